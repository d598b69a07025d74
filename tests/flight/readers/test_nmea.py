"""NMEA 0183: values as pynmea2 has them, joined by time, over midnight, from several talkers."""

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pynmea2
import pytest

from tests.flight.readers.tracks import Columns, Reader, columns_of, near

nmea = Reader("nmea")

KNOT = 1852 / 3600


def read(*lines: str) -> Columns:
    return columns_of(nmea, "".join(lines))


def bodies(*found: str) -> Columns:
    return read(*map(said, found))


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
    assert nmea.sniff(data[:8192])
    columns = columns_of(nmea, data)
    by_time: dict[float, dict[str, Any]] = {}
    for line in data.decode("utf-8", "replace").splitlines():
        try:
            one = pynmea2.parse(line, check=True)
        except pynmea2.ParseError:
            continue
        if one.sentence_type in ("GGA", "RMC", "GLL"):
            at = datetime.combine(datetime(2018, 8, 20).date(), one.timestamp.replace(tzinfo=UTC))
            by_time.setdefault(at.timestamp(), {}).setdefault(one.sentence_type, one)
    first = {at: k for k, at in reversed(list(enumerate(columns["time_s"])))}
    assert set(first) == set(by_time)
    for at, k in first.items():
        gga, rmc, gll = map(by_time[at].get, ("GGA", "RMC", "GLL"))
        row, best = {name: values[k] for name, values in columns.items()}, gga or rmc or gll
        near(row, 1e-12, latitude_deg=best.latitude, longitude_deg=best.longitude)
        if gga:
            near(row, 0, height_sea_m=float(gga.altitude), undulation_m=float(gga.geo_sep))
            near(row, 0, hdop=float(gga.horizontal_dil))
        if rmc:
            speed = math.hypot(row["v_north_m_s"], row["v_east_m_s"])
            assert speed == pytest.approx(rmc.spd_over_grnd * KNOT, abs=1e-12)


@pytest.mark.parametrize("without", [(), ("GST",)])
def test_over_midnight_from_any_sentence(without):
    start = datetime(2025, 12, 31, 23, 59, 58, tzinfo=UTC)
    lines = track(start, 20, without=without).decode().splitlines(keepends=True)
    # The date stands in one sentence only, and comes late.
    kept = [line for k, line in enumerate(lines) if "RMC" not in line or k > 50 - 20 * len(without)]
    for text in (lines, kept):
        columns = read(*text)
        near(columns, 1e-6, time_s=start.timestamp() + 0.2 * np.arange(20))
        assert columns["use"].all()


def test_no_fix_no_dilution_and_repeated():
    cases = [
        (0, {}, ""),
        (1, {"quality": 0}, "no fix"),
        (2, {"hdop": 99.99}, "no dilution of precision"),
        (3, {"at": (0.0, 0.0)}, "position is a placeholder"),
        (4, {}, ""),
        (4, {}, "repeated stamp"),
        (5, {"quality": 6}, "estimated, not measured"),
    ]
    start = datetime(2020, 1, 1, tzinfo=UTC)
    columns = read(
        *(burst(start + timedelta(seconds=k), *more.pop("at", (63.4, 10.4)), **more) for k, more, _ in cases)
    )
    assert columns["why"].tolist() == [why for _, _, why in cases]


def test_gns_gll_and_vtg():
    zda = "GNZDA,101010.00,05,06,2022,00,00"
    gns = "GNGNS,101010.00,6300.0,N,01030.0,E,NRA,17,0.5,55.2,39.1,,"
    one = bodies(zda, gns, "GNVTG,90.0,T,,M,10.0,N,18.52,K,A")
    near(one, time_s=datetime(2022, 6, 5, 10, 10, 10, tzinfo=UTC).timestamp(), fix=6)
    near(one, height_sea_m=55.2, undulation_m=39.1, v_east_m_s=10 * KNOT)
    gll = bodies(zda, *(f"GPGLL,6300.0,N,01030.0,E,1010{rest}" for rest in ("11.00,V,N", "12.00,A,D")))
    assert gll["why"].tolist() == ["no fix", ""]
    assert gll["fix"].tolist() == [0.0, 4.0]
    assert "height_sea_m" not in gll


def test_talkers():
    start = datetime(2020, 1, 1, tzinfo=UTC)
    at = [start + timedelta(seconds=k) for k in range(9)]
    both = read(
        *(
            burst(one, 63.4, 10.4, talker="GN" if k % 3 else "GP")
            + burst(one, 63.5, 10.4, talker="II", without=("GGA", "GST"))
            for k, one in enumerate(at)
        )
    )
    assert both["use"].all()
    near(both, latitude_deg=63.4)
    plotter = burst(start, 63.5, 10.4, talker="II") + burst(start, 63.4, 10.4, talker="SD", without=("RMC",))
    near(read(plotter), latitude_deg=63.5)


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
