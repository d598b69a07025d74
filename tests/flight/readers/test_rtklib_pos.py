"""RTKLIB positions: each way of writing the same made-up track gives the same track."""

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.flight.readers.tracks import Reader, check, near
from wildlab.errors import WildlabError

rtklib_pos = Reader("rtklib-pos")

START = datetime(2025, 3, 1, 23, 59, 50, tzinfo=UTC)
COUNT = 40
K = np.arange(COUNT)
UTC_S = START.timestamp() + 0.2 * K
LATITUDE, LONGITUDE, HEIGHT = -33.5 - 1e-6 * K, -70.25 + 2e-6 * K, 500.0 + 0.01 * K
LLH = "latitude(deg) longitude(deg)  height(m)"
REST = "Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio"
WGS84 = "% (lat/lon/height=WGS84/{},Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)\n"


def calendar(utc_s: float, ahead: float, sep: str = " ") -> str:
    at = datetime.fromtimestamp(0, UTC) + timedelta(seconds=round(utc_s + ahead, 3))
    return f"{at:%Y/%m/%d}{sep}{at:%H:%M:%S}.{at.microsecond // 1000:03d}"


def week(utc_s: float, sep: str = " ") -> str:
    gps = utc_s - 315964800 + 18
    return f"{int(gps // 604800)}{sep}{gps % 604800:.3f}"


def document(scale: str, stamps: list[str], places: list[str], **other: object) -> str:
    names, rest, sep = other.get("names", LLH), other.get("rest", REST), str(other.get("sep", " "))
    quality = other.get("quality", [1] * len(stamps))
    head = "% program   : RTKPOST ver.demo5 b34f\n% ref pos   : 1.0 2.0 3.0\n"
    head += WGS84.format(other.get("vertical", "ellipsoidal"))
    head += f"%  {scale}                  {names}   {rest}\n"
    tail = other.get("tail", "0.3 0.4 0.9 0.1 0.1 0.1 0.00 9.9")
    lines = [f"{t} {p} {q} 12 {tail}" for t, p, q in zip(stamps, places, quality, strict=True)]
    if sep != " ":
        lines = [sep.join(line.split()) for line in lines]
        lines = [line.replace(sep, " ", 1) if "/" in line else line for line in lines]
    return head + "\n".join(lines) + "\n"


def llh() -> list[str]:
    return [f"{a:.9f} {b:.9f} {c:.4f}" for a, b, c in zip(LATITUDE, LONGITUDE, HEIGHT, strict=True)]


GPST = [calendar(at, 18.0) for at in UTC_S]
WAYS = {
    "calendar GPST": document("GPST", GPST, llh()),
    "week and time": document("GPST", [week(at) for at in UTC_S], llh()),
    "UTC": document("UTC", [calendar(at, 0.0) for at in UTC_S], llh()),
    "commas": document("GPST", GPST, llh(), sep=","),
    "semicolons, week": document("GPST", [week(at) for at in UTC_S], llh(), sep=";"),
    "CRLF": document("GPST", GPST, llh()).replace("\n", "\r\n"),
    "backwards": document("GPST", GPST[::-1], llh()[::-1]),
}


@pytest.mark.parametrize("way", WAYS)
def test_every_way_gives_the_same_track(way):
    data = WAYS[way].encode()
    assert rtklib_pos.sniff(data[:8192])
    log = rtklib_pos.read(Path("x.pos"), data)
    check(log)
    stream = log.parts["gnss"]
    assert stream.used.all()
    near(stream.columns, 1e-3, time_s=UTC_S)
    near(stream.columns, 2e-9, latitude_deg=LATITUDE, longitude_deg=LONGITUDE)
    near(stream.columns, 1e-4, height_ellipsoid_m=HEIGHT, fix=6)
    near(stream.columns, sd_horizontal_m=math.sqrt((0.3**2 + 0.4**2) / 2), sd_vertical_m=0.9)
    assert bool(log.notes) == (way == "backwards")
    assert stream.rows[0] == (4 + COUNT if way == "backwards" else 5)


def test_equals_pandas(shared_data):
    path = shared_data("logs", "target_car_rtk_pos", "demo5_b34f_f.pos")
    log = rtklib_pos.read(path, path.read_bytes())
    check(log)
    table = pd.read_csv(path, sep=r"\s+", comment="%", header=None)
    columns = log.parts["gnss"].columns
    assert not log.lost
    near(columns, 0, latitude_deg=table[2], longitude_deg=table[3], height_ellipsoid_m=table[4])
    stamps = pd.to_datetime(table[0] + " " + table[1], utc=True)
    seconds = (stamps - pd.Timestamp(0, tz="UTC")).dt.total_seconds().to_numpy() - 18.0
    near(columns, 1e-6, time_s=seconds, satellites=table[6])
    assert (columns["fix"] == 6.0).sum() == (table[5] == 1).sum()


@pytest.mark.parametrize(
    ("scale", "names"),
    [("GPST", "x-ecef(m) y-ecef(m) z-ecef(m)"), ("JST", LLH), ("GPST", LLH.replace("deg", "d'\"")),
     ("GPST", "e-baseline(m) n-baseline(m) u-baseline(m)")],
)  # fmt: skip
def test_other_solutions_are_refused_with_what_to_set(scale, names):
    with pytest.raises(WildlabError, match="out-solformat = llh"):
        rtklib_pos.read(Path("x.pos"), document(scale, GPST, llh(), names=names).encode())
