"""UBX: values as pyubx2 has them, receivers of several generations written by it, and any damage."""

import io
from datetime import UTC, datetime

import numpy as np
from pyubx2 import GET, UBXMessage, UBXReader

from tests.flight.readers.tracks import Reader, check, columns_of, near
from wildlab.flight.readers.tracks import frames

ubx = Reader("ubx")

#: 2025-03-01 12:00:00 UTC is so many s into GPS week 2355.
TOW = 6 * 86400 + 43200 + 18
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


def test_equals_pyubx2(shared_data):
    path = shared_data("logs", "target_ubx_m8l", "ublox-neo-m8l.log")
    data = path.read_bytes()
    assert ubx.sniff(data[:8192])
    log = ubx.read(path, data)
    check(log)
    seen: dict[str, list[object]] = {}
    for _, one in UBXReader(io.BytesIO(data), protfilter=2, quitonerror=0):
        seen.setdefault(one.identity, []).append(one)

    def same(part: str, name: str, scale: float, **fields: str) -> None:
        for ours, theirs in fields.items():
            near(log.parts[part].columns, **{ours: [getattr(one, theirs) * scale for one in seen[name]]})

    for part, name in (("gnss", "NAV-PVT"), ("poses", "HNR-PVT")):
        assert log.parts[part].used.all()
        same(part, name, 1, latitude_deg="lat", longitude_deg="lon")
        same(part, name, 1e-3, height_ellipsoid_m="height", height_sea_m="hMSL", sd_horizontal_m="hAcc")
        stamps = [
            datetime(one.year, one.month, one.day, one.hour, one.min, one.second, tzinfo=UTC).timestamp()
            + one.nano * 1e-9
            for one in seen[name]
        ]
        near(log.parts[part].columns, 1e-6, time_s=stamps)
    # Nanoseconds are negative in this log: the second before is meant.
    assert seen["NAV-PVT"][0].nano < 0
    same("gnss", "NAV-PVT", 1e-3, v_north_m_s="velN", v_east_m_s="velE", v_down_m_s="velD")
    same("poses", "HNR-ATT", 1, roll_deg="roll", pitch_deg="pitch", yaw_deg="heading")


#: Fields of NAV-PVT, what kind of fix that is, and why it is not used.
CASES = [
    ({}, 3, ""),
    ({"fixType": 0}, 0, "no fix"),
    ({"fixType": 1}, 1, "estimated, not measured"),
    ({"fixType": 2}, 2, ""),
    ({"fixType": 4, "diffSoln": 1}, 4, ""),
    ({"carrSoln": 1}, 5, ""),
    ({"carrSoln": 2}, 6, ""),
    ({"fixType": 5}, 0, "no fix"),
    ({"gnssFixOk": 0}, 3, "no fix"),
    ({"validTime": 0}, 3, "time is not known to the receiver"),
    ({"invalidLlh": 1}, 3, "no position"),
    ({"lat": 0, "lon": 0}, 3, "position is a placeholder"),
    ({"velN": 800000}, 3, "impossible speed"),
    ({"month": 13}, 3, "no time"),
    ({"second": 12}, 3, ""),
]


def test_kinds_of_fixes_and_why_some_are_not_used():
    columns = columns_of(ubx, b"".join(pvt(k, **case) for k, (case, _, _) in enumerate(CASES)))
    assert list(zip(columns["fix"], columns["why"], strict=True)) == [case[1:] for case in CASES]


def test_attitude_of_nav_att():
    angles = {"roll": 1.0, "pitch": -2.0, "heading": 300.0, "accRoll": 0.5, "accPitch": 0.5}
    data = b"".join(
        pvt(k) + message("NAV-ATT", iTOW=1000 * (TOW + k), accHeading=2.0 * (k != 2), **angles)
        for k in range(4)
    )
    columns = columns_of(ubx, data, "poses")
    near(columns, 2e-5, roll_deg=1.0, pitch_deg=-2.0)
    assert columns["why"].tolist() == ["", "", "no attitude", ""]


def test_the_week_ends():
    stamps = [1000 * (604797 + k) % 604800000 for k in range(6)]
    data = b"".join(
        pvt(k, iTOW=at, second=k) + message("NAV-DOP", iTOW=at, hDOP=1 + k) for k, at in enumerate(stamps)
    )
    columns = columns_of(ubx, data)
    assert columns["time_log_s"].tolist() == [604797.0 + k for k in range(6)]
    assert columns["hdop"].tolist() == [1.0 + k for k in range(6)]


def test_frames_agree_with_pyubx2_on_any_length():
    rng = np.random.default_rng(3)
    data, lengths = b"", [0, 1, 2, 255, 256, 300, 3000]
    for length in lengths:
        body = bytes([0x02, 0x15, length & 255, length >> 8]) + rng.bytes(length)
        first = second = 0
        for one in body:
            first = (first + one) % 256
            second = (second + first) % 256
        data += b"\xb5\x62" + body + bytes([first, second]) + b"x"
    found = frames(data)
    assert (found.stop - found.start - 8).tolist() == lengths
    assert len(found.rows((0x01, 0x07))) == 0
