"""NMEA 0183: values as pynmea2 has them, joined by time, over midnight, from several talkers."""

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pynmea2
import pytest

from tests.flight.readers.tracks import check, near, survives
from wildlab.errors import WildlabError
from wildlab.flight.readers.tracks import nmea

KNOT = 1852 / 3600


def said(body: str) -> str:
    total = 0
    for one in body.encode():
        total ^= one
    return f"${body}*{total:02X}\r\n"


def angle(degrees: float, width: int) -> str:
    whole = int(abs(degrees))
    return f"{whole:0{width}d}{60 * (abs(degrees) - whole):010.7f}"


def burst(at: datetime, latitude: float, longitude: float, talker: str = "GN", **other: object) -> str:
    """GGA, RMC as a receiver says them; `other`: kinds left out, quality, speed, course."""
    clock = at.strftime("%H%M%S.") + f"{at.microsecond // 1000:03d}"
    place = f"{angle(latitude, 2)},{'NS'[latitude < 0]},{angle(longitude, 3)},{'EW'[longitude < 0]}"
    status = "V" if other.get("quality") == 0 else "A"
    speed, course = other.get("speed", 2.0), other.get("course", 90.0)
    quality = other.get("quality", 4)
    lines = {
        "GGA": f"{talker}GGA,{clock},{place},{quality},12,{other.get('hdop', 0.7)},12.5,M,40.1,M,,",
        "RMC": f"{talker}RMC,{clock},{status},{place},{speed},{course},{at:%d%m%y},,,A",
        "GST": f"{talker}GST,{clock},,,,,0.3,0.4,0.9",
    }
    return "".join(said(line) for kind, line in lines.items() if kind not in other.get("without", ()))


def track(start: datetime, count: int, **other: object) -> bytes:
    rows = [
        burst(start + timedelta(seconds=0.2 * k), 63.4 + 1e-6 * k, 10.4 - 2e-6 * k, **other)
        for k in range(count)
    ]
    return "".join(rows).encode()


def test_equals_pynmea2(shared_data):
    path = shared_data("logs", "target_boat_nmea", "bundg_zeus_9.log")
    data = path.read_bytes()
    assert nmea.recognise(data[:8192], path.name)
    log = nmea.read(path, data)
    check(log)
    stream = log.parts["gnss"]
    by_time: dict[float, dict[str, object]] = {}
    for line in data.decode("utf-8", "replace").splitlines():
        try:
            one = pynmea2.parse(line, check=True)
        except pynmea2.ParseError:
            continue
        if one.sentence_type in ("GGA", "RMC", "GLL"):
            at = datetime.combine(datetime(2018, 8, 20).date(), one.timestamp.replace(tzinfo=UTC))
            by_time.setdefault(at.timestamp(), {}).setdefault(one.sentence_type, one)
    columns = stream.columns
    first = {at: k for k, at in reversed(list(enumerate(columns["time_s"])))}
    assert set(first) == set(by_time)
    for at, k in first.items():
        seen = by_time[at]
        best = seen.get("GGA") or seen.get("RMC") or seen["GLL"]
        assert columns["latitude_deg"][k] == pytest.approx(best.latitude, abs=1e-12)
        assert columns["longitude_deg"][k] == pytest.approx(best.longitude, abs=1e-12)
        if "GGA" in seen:
            assert columns["height_sea_m"][k] == float(seen["GGA"].altitude)
            assert columns["undulation_m"][k] == float(seen["GGA"].geo_sep)
            assert columns["hdop"][k] == float(seen["GGA"].horizontal_dil)
        if "RMC" in seen:
            speed = math.hypot(columns["v_north_m_s"][k], columns["v_east_m_s"][k])
            assert speed == pytest.approx(seen["RMC"].spd_over_grnd * KNOT, abs=1e-12)


@pytest.mark.parametrize("without", [(), ("GST",)])
def test_over_midnight_from_any_sentence(without):
    start = datetime(2025, 12, 31, 23, 59, 58, tzinfo=UTC)
    data = track(start, 20, without=without)
    # The date stands in one sentence only, and comes late.
    lines = data.decode().splitlines(keepends=True)
    kept = [line for k, line in enumerate(lines) if "RMC" not in line or k > 50 - 20 * len(without)]
    for text in ("".join(lines), "".join(kept)):
        log = nmea.read(Path("x"), text.encode())
        check(log)
        expected = start.timestamp() + 0.2 * np.arange(20)
        near(log.parts["gnss"].columns, 1e-06, time_s=expected)
        assert log.parts["gnss"].used.all()


def test_values():
    log = nmea.read(Path("x"), track(datetime(2014, 5, 1, tzinfo=UTC), 3, speed=10.0, course=30.0))
    columns = log.parts["gnss"].columns
    near(columns, 1e-09, latitude_deg=63.4 + 1e-06 * np.arange(3), longitude_deg=10.4 - 2e-06 * np.arange(3))
    near(
        columns,
        v_north_m_s=10 * KNOT * math.cos(math.pi / 6),
        v_east_m_s=10 * KNOT * 0.5,
        height_sea_m=12.5,
        undulation_m=40.1,
        sd_horizontal_m=math.sqrt((0.3**2 + 0.4**2) / 2),
        sd_vertical_m=0.9,
    )
    assert columns["fix"].tolist() == [6.0] * 3
    assert columns["satellites"].tolist() == [12.0] * 3


def test_south_and_west():
    data = burst(datetime(2014, 5, 1, tzinfo=UTC), -33.9, -70.25).encode()
    columns = nmea.read(Path("x"), data).parts["gnss"].columns
    assert columns["latitude_deg"][0] == pytest.approx(-33.9, abs=1e-9)
    assert columns["longitude_deg"][0] == pytest.approx(-70.25, abs=1e-9)


def test_no_fix_no_dilution_and_repeated():
    start = datetime(2020, 1, 1, tzinfo=UTC)
    at = [start + timedelta(seconds=k) for k in range(6)]
    texts = [
        burst(at[0], 63.4, 10.4),
        burst(at[1], 63.4, 10.4, quality=0),
        burst(at[2], 63.4, 10.4, hdop=99.99),
        burst(at[3], 0.0, 0.0),
        burst(at[4], 63.4, 10.4),
        burst(at[4], 63.4, 10.4),
        burst(at[5], 63.4, 10.4, quality=6),
    ]
    log = nmea.read(Path("x"), "".join(texts).encode())
    check(log)
    assert log.parts["gnss"].columns["why"].tolist() == [
        *("", "no fix", "no dilution of precision", "position is a placeholder"),
        *("", "repeated stamp", "estimated, not measured"),
    ]


def test_gns_gll_vtg_and_old_vtg():
    def read(*bodies: str) -> dict[str, np.ndarray]:
        return nmea.read(Path("x"), "".join(map(said, bodies)).encode()).parts["gnss"].columns

    zda = "GNZDA,101010.00,05,06,2022,00,00"
    gns = "GNGNS,101010.00,6300.0,N,01030.0,E,NRA,17,0.5,55.2,39.1,,"
    one = read(zda, gns, "GNVTG,90.0,T,,M,10.0,N,18.52,K,A")
    assert one["fix"][0] == 6.0
    assert one["time_s"][0] == datetime(2022, 6, 5, 10, 10, 10, tzinfo=UTC).timestamp()
    assert (one["height_sea_m"][0], one["undulation_m"][0]) == (55.2, 39.1)
    assert one["v_east_m_s"][0] == pytest.approx(10 * KNOT)
    old = read(zda, gns, "GPVTG,90.0,,10.0,18.52")
    assert old["v_east_m_s"][0] == pytest.approx(10 * KNOT)
    other = read(zda, gns, "GPVTG,180.0,,,,,,18.0,K")
    assert other["v_north_m_s"][0] == pytest.approx(-5.0)
    gll = read(zda, "GPGLL,6300.0,N,01030.0,E,101011.00,V,N", "GPGLL,6300.0,N,01030.0,E,101012.00,A,D")
    assert gll["why"].tolist() == ["no fix", ""]
    assert gll["fix"].tolist() == [0.0, 4.0]
    assert "height_sea_m" not in gll


def test_talkers():
    start = datetime(2020, 1, 1, tzinfo=UTC)
    both = "".join(
        burst(start + timedelta(seconds=k), 63.4, 10.4, talker="GN" if k % 3 else "GP")
        + burst(start + timedelta(seconds=k), 63.5, 10.4, talker="II", without=("GGA", "GST"))
        for k in range(9)
    )
    log = nmea.read(Path("x"), both.encode())
    assert log.parts["gnss"].used.all()
    near(log.parts["gnss"].columns, latitude_deg=63.4)
    plotter = burst(start, 63.5, 10.4, talker="II") + burst(start, 63.4, 10.4, talker="SD", without=("RMC",))
    log = nmea.read(Path("x"), plotter.encode())
    near(log.parts["gnss"].columns, latitude_deg=63.5)


def test_no_date():
    start = datetime(2020, 1, 1, 23, 59, 59, tzinfo=UTC)
    log = nmea.read(Path("x"), track(start, 10, without=("RMC",)))
    stream = log.parts["gnss"]
    assert np.isnan(stream.columns["time_s"]).all()
    near(stream.columns, 1e-06, time_log_s=86399 + 0.2 * np.arange(10))
    assert log.clock is None


def test_prefixes_comments_unknown_and_checksums():
    lines = track(datetime(2020, 1, 1, tzinfo=UTC), 5).decode().splitlines(keepends=True)
    lines = [f"12:00:0{k % 10} > {line}" for k, line in enumerate(lines)]
    text = "# a file, $2\r\n# " + said("GPGLL,1000.0,N,01030.0,E,115959.00,A,D")
    text += said("GPXYZ,1,2") + said("GPHDT,12.0,T") + "".join(lines)
    log = nmea.read(Path("x"), text.encode())
    assert log.parts["gnss"].used.sum() == 5
    assert log.parts["gnss"].rows[0] == 5
    spoilt = text.replace("63", "64", 1)
    log = nmea.read(Path("x"), spoilt.encode("latin-1"))
    assert log.lost[0].startswith("1 ")
    bare = "".join(line.partition("*")[0] + "\n" for line in lines)
    assert nmea.read(Path("x"), bare.encode()).parts["gnss"].used.sum() == 5


def test_nothing_in_it():
    with pytest.raises(WildlabError, match="1 sentence"):
        nmea.read(Path("x"), said("GPHDT,12.0,T").encode())
    assert not nmea.recognise(b"$GP is a currency, $100,000", "x.txt")
    assert not nmea.recognise(b"", "x.nmea")


def test_damage(shared_data):
    assert survives(nmea.read, track(datetime(2020, 1, 1, tzinfo=UTC), 40)) > 0.89
    data = shared_data("logs", "target_boat_nmea", "bundg_zeus_9.log").read_bytes()
    assert survives(nmea.read, data, 4, 6) > 0.62
