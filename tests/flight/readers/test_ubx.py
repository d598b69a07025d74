"""UBX: values as pyubx2 has them, receivers of several generations written by it, and any damage."""

import io
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from pyubx2 import GET, UBXMessage, UBXReader

from tests.flight.readers.tracks import check, survives
from wildlab.errors import WildlabError
from wildlab.flight.readers.tracks import ubx
from wildlab.flight.readers.tracks.ubx_frames import LAYOUTS, frames, rows

#: 2025-03-01 12:00:00 UTC is so many s into GPS week 2355.
WEEK, TOW = 2355, 6 * 86400 + 43200 + 18
UTC_S = datetime(2025, 3, 1, 12, tzinfo=UTC).timestamp()


def message(name: str, **fields: object) -> bytes:
    return UBXMessage(name.split("-")[0], name, GET, **fields).serialize()


def pvt(k: int, **other: object) -> bytes:
    fields = {
        **{"iTOW": 1000 * (TOW + k), "year": 2025, "month": 3, "day": 1, "hour": 12, "min": k // 60},
        **{"second": k % 60, "validDate": 1, "validTime": 1, "fullyResolved": 1, "nano": 0, "fixType": 3},
        **{"gnssFixOk": 1, "numSV": 11, "lon": 10.4 + 1e-6 * k, "lat": -63.4, "height": 140100},
        **{"hMSL": 100000, "hAcc": 900, "vAcc": 1500, "velN": 1000, "velE": -2000, "velD": 30, "sAcc": 50},
    }
    return message("NAV-PVT", **{**fields, **other})


def old(k: int, *left_out: str, **other: object) -> bytes:
    stamp = {"iTOW": 1000 * (TOW + k)}
    said = {
        "NAV-POSLLH": {"lon": 10.4, "lat": -63.4 + 1e-5 * k, "height": 1000, "hMSL": 500, "hAcc": 4000},
        "NAV-VELNED": {"velN": 100, "velE": -200, "velD": 3, "sAcc": 40},
        "NAV-SOL": {
            **{"fTOW": 0, "week": WEEK, "gpsFix": 3, "gpsfixOK": 1, "wknSet": 1, "towSet": 1, "numSV": 7},
            **other,
        },
        "NAV-TIMEGPS": {"fTOW": -250, "week": WEEK, "leapS": 18, "towValid": 1, "weekValid": 1},
        "NAV-DOP": {"hDOP": 1.25},
    }
    return b"".join(message(name, **stamp, **one) for name, one in said.items() if name not in left_out)


def log_of(data: bytes) -> dict[str, np.ndarray]:
    log = ubx.read(Path("x.ubx"), data)
    check(log)
    return log.parts["gnss"].columns


def test_equals_pyubx2(shared_data):
    path = shared_data("logs", "target_ubx_m8l", "ublox-neo-m8l.log")
    data = path.read_bytes()
    assert ubx.recognise(data[:8192], path.name)
    log = ubx.read(path, data)
    check(log)
    seen: dict[str, list[object]] = {}
    for _, one in UBXReader(io.BytesIO(data), protfilter=2, quitonerror=0):
        seen.setdefault(one.identity, []).append(one)
    gnss, poses = log.parts["gnss"], log.parts["poses"]
    for stream, name in ((gnss, "NAV-PVT"), (poses, "HNR-PVT")):
        said = seen[name]
        assert len(stream) == len(said)
        assert stream.used.all()
        for ours, theirs, scale in (
            ("latitude_deg", "lat", 1),
            ("longitude_deg", "lon", 1),
            ("height_ellipsoid_m", "height", 1e-3),
            ("height_sea_m", "hMSL", 1e-3),
            ("sd_horizontal_m", "hAcc", 1e-3),
        ):
            expected = [getattr(one, theirs) * scale for one in said]
            np.testing.assert_allclose(stream.columns[ours], expected, rtol=0, atol=1e-9)
        stamps = [
            datetime(one.year, one.month, one.day, one.hour, one.min, one.second, tzinfo=UTC).timestamp()
            + one.nano * 1e-9
            for one in said
        ]
        np.testing.assert_allclose(stream.columns["time_s"], stamps, rtol=0, atol=1e-6)
    # Nanoseconds are negative in this log: the second before is meant.
    assert seen["NAV-PVT"][0].nano < 0
    assert gnss.columns["time_s"][0] < datetime(2024, 1, 30, 15, 31, 52, tzinfo=UTC).timestamp()
    for ours, theirs in (("v_north_m_s", "velN"), ("v_east_m_s", "velE"), ("v_down_m_s", "velD")):
        np.testing.assert_allclose(gnss.columns[ours], [getattr(m, theirs) * 1e-3 for m in seen["NAV-PVT"]])
    for ours, theirs in (("roll_deg", "roll"), ("pitch_deg", "pitch"), ("yaw_deg", "heading")):
        expected = [getattr(m, theirs) for m in seen["HNR-ATT"]]
        np.testing.assert_allclose(poses.columns[ours], expected, rtol=0, atol=1e-9)


def test_layouts_are_as_long_as_they_are_said_to_be():
    """Each layout ends where pyubx2's does, or before."""
    for kind, layout in LAYOUTS.items():
        one = UBXMessage(bytes([kind[0]]), bytes([kind[1]]), GET, iTOW=1)
        assert np.dtype(layout).itemsize <= one.length


def test_kinds_of_fix_and_what_is_no_fix():
    cases = [
        {},
        {"fixType": 0},
        {"fixType": 1},
        {"fixType": 2},
        {"fixType": 4, "diffSoln": 1},
        {"carrSoln": 1},
        {"carrSoln": 2},
        {"fixType": 5},
        {"gnssFixOk": 0},
        {"validTime": 0},
        {"invalidLlh": 1},
        {"lat": 0, "lon": 0},
        {"velN": 800000},
        {"month": 13},
        {"second": 12},
    ]
    columns = log_of(b"".join(pvt(k, **case) for k, case in enumerate(cases)))
    assert columns["fix"][:8].tolist() == [3.0, 0.0, 1.0, 2.0, 4.0, 5.0, 6.0, 0.0]
    assert columns["why"].tolist() == [
        *("", "no fix", "estimated, not measured", "", "", "", "", "no fix", "no fix"),
        *("time is not known to the receiver", "no position", "position is a placeholder"),
        *("impossible speed", "no time", ""),
    ]


def test_values_and_time_between_text_nmea_and_noise():
    noise = [b"# a log\r\n", b"$GPGGA,1*00\r\n", b"\xb5\x62", b"\xb5\x62\x01\x07\xff\xff", b"\xd3\x00\x13"]
    data = b"".join(noise[k % 5] + pvt(k, nano=-5000) for k in range(10))
    log = ubx.read(Path("x"), data)
    columns = log.parts["gnss"].columns
    np.testing.assert_allclose(columns["time_s"], UTC_S + np.arange(10) - 5e-6, rtol=0, atol=5e-7)
    np.testing.assert_allclose(columns["longitude_deg"], 10.4 + 1e-6 * np.arange(10), rtol=0, atol=1e-9)
    np.testing.assert_allclose(columns["undulation_m"], 40.1)
    assert log.parts["gnss"].rows.tolist() == list(range(1, 11))
    assert log.lost[0] == "2 messages with a wrong checksum or cut off"
    assert log.clock.rate == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize("left_out", [(), ("NAV-SOL",), ("NAV-TIMEGPS",), ("NAV-VELNED", "NAV-DOP")])
def test_old_receivers(left_out):
    columns = log_of(b"".join(old(k, *left_out) for k in range(8)))
    np.testing.assert_allclose(columns["time_s"], UTC_S + np.arange(8), rtol=0, atol=1e-6)
    np.testing.assert_allclose(columns["latitude_deg"], -63.4 + 1e-5 * np.arange(8), rtol=0, atol=1e-9)
    np.testing.assert_allclose(columns["height_ellipsoid_m"], 1.0)
    np.testing.assert_allclose(columns["height_sea_m"], 0.5)
    assert ("v_north_m_s" in columns) == ("NAV-VELNED" not in left_out)
    if "v_north_m_s" in columns:
        np.testing.assert_allclose(columns["v_east_m_s"], -2.0)
    assert ("fix" in columns) == ("NAV-SOL" not in left_out)
    assert columns["use"].all()


def test_old_receivers_without_a_week_or_a_fix():
    columns = log_of(b"".join(old(k, "NAV-SOL", "NAV-TIMEGPS") for k in range(8)))
    assert np.isnan(columns["time_s"]).all()
    columns = log_of(b"".join(old(k, gpsFix=3 * (k > 2), gpsfixOK=int(k > 3)) for k in range(8)))
    assert columns["why"].tolist() == [*["no fix"] * 4, *[""] * 4]


def test_more_digits():
    fine = {"lon": 10.4, "lat": -63.4, "height": 140100, "hMSL": 100000, "hAcc": 14.1, "vAcc": 20}
    data = b"".join(
        pvt(k) + message("NAV-HPPOSLLH", iTOW=1000 * (TOW + k), _HPlat=37e-9, _HPheight=0.4, **fine)
        for k in range(4)
    )
    columns = log_of(data)
    np.testing.assert_allclose(columns["latitude_deg"], -63.4 + 37e-9, rtol=0, atol=1e-10)
    np.testing.assert_allclose(columns["height_ellipsoid_m"], 140.1004, rtol=0, atol=1e-6)
    np.testing.assert_allclose(columns["sd_horizontal_m"], 0.0141, rtol=0, atol=1e-6)


def test_attitude_of_nav_att():
    data = b"".join(
        pvt(k)
        + message(
            *("NAV-ATT",),
            **{"iTOW": 1000 * (TOW + k), "roll": 1.0, "pitch": -2.0, "heading": 300.0},
            **{"accRoll": 0.5, "accPitch": 0.5, "accHeading": 2.0 * (k != 2)},
        )
        for k in range(4)
    )
    poses = ubx.read(Path("x"), data).parts["poses"]
    np.testing.assert_allclose(poses.columns["roll_deg"], 1.0, atol=2e-5)
    np.testing.assert_allclose(poses.columns["pitch_deg"], -2.0, atol=2e-5)
    assert poses.columns["why"].tolist() == ["", "", "no attitude", ""]


def test_the_week_ends():
    data = b"".join(
        pvt(k, iTOW=(1000 * (604797 + k)) % 604800000, day=1, second=k)
        + message("NAV-DOP", iTOW=(1000 * (604797 + k)) % 604800000, hDOP=1 + k)
        for k in range(6)
    )
    columns = log_of(data)
    assert columns["time_log_s"].tolist() == [604797.0 + k for k in range(6)]
    assert columns["hdop"].tolist() == [1.0 + k for k in range(6)]


def test_nothing_in_it():
    with pytest.raises(WildlabError, match="1 message"):
        ubx.read(Path("x"), message("NAV-DOP", iTOW=5))
    with pytest.raises(WildlabError, match="0 messages of u-blox"):
        ubx.read(Path("x"), b"")
    assert not ubx.recognise(b"\xb5\x62" * 100, "x.ubx")


def test_lengths_that_lie_cost_no_time():
    begun = time.perf_counter()
    data = b"\xb5\x62\x01\x07\xf0\xff" * 200000
    assert len(frames(data).start) == 0
    assert time.perf_counter() - begun < 10


def test_frames_agree_with_pyubx2_on_any_length():
    rng = np.random.default_rng(3)
    data = b""
    for length in [0, 1, 2, 255, 256, 300, 3000]:
        body = bytes([0x02, 0x15, length & 255, length >> 8]) + rng.bytes(length)
        first = second = 0
        for one in body:
            first = (first + one) % 256
            second = (second + first) % 256
        data += b"\xb5\x62" + body + bytes([first, second]) + b"x"
    found = frames(data)
    assert (found.stop - found.start - 8).tolist() == [0, 1, 2, 255, 256, 300, 3000]
    assert len(rows(data, found, (0x01, 0x07))[0]) == 0


def test_damage(shared_data):
    assert survives(ubx.read, b"".join(map(pvt, range(30)))) > 0.89
    assert survives(ubx.read, b"".join(map(old, range(10)))) > 0.83
    data = shared_data("logs", "target_ubx_m8l", "ublox-neo-m8l.log").read_bytes()
    assert survives(ubx.read, data, 4, 6) > 0.85
