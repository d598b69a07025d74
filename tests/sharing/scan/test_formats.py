"""Planted leaks are found in each format, as text and as numbers; without them nothing is."""

from __future__ import annotations

import base64
import io
import json
import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as arrow
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as some
from PIL import Image
from rasterio.transform import from_origin

from tests.sharing.scan.packed import PACKED, parquet, picture, recording, saved, sqlite
from tests.sharing.scan.spelt import LATITUDE, LEAKS, LONGITUDE, WHEN, ecef, secrets, sexagesimal, utm
from wildlab.sharing.scan import scan
from wildlab.sharing.scan.look import SoughtPlaces


@pytest.mark.parametrize("kind", PACKED)
def test_planted_leaks_are_found(tmp_path, kind):
    file = tmp_path / "sent.bin"
    file.write_bytes(PACKED[kind]("; ".join(text for _, text in LEAKS.values())))
    found = scan([file], secrets())
    assert {wanted for wanted, _ in LEAKS.values()} <= {finding.kind for finding in found}, found
    written = " ".join(finding.written for finding in found)
    assert all(one in written for one in ("decimal degrees", "minutes and seconds", "UTM zone")), written


@pytest.mark.parametrize("kind", PACKED)
def test_the_same_without_a_leak_is_clean(tmp_path, kind):
    file = tmp_path / "sent.bin"
    file.write_bytes(PACKED[kind]("the error is 6.41 m, 5.9 to 7.0 over 200 flights"))
    assert [str(finding) for finding in scan([file], secrets())] == []


_ZONE, EAST, NORTH = utm(LATITUDE, LONGITUDE)
BEFORE = bytes([1, 250, 3, 7, 99])


def _gps() -> Image.Exif:
    exif = Image.Exif()
    exif.get_ifd(0x8825).update(
        {
            1: "N", 3: "E",
            2: tuple(float(one) for one in sexagesimal(LATITUDE, 2)),
            4: tuple(float(one) for one in sexagesimal(LONGITUDE, 2)),
        }
    )  # fmt: skip
    return exif


def _table(**columns: Any) -> bytes:
    return parquet(arrow.table(columns))


def _map(crs: str, west: float, north: float, step: float) -> bytes:
    out = io.BytesIO()
    profile = {"driver": "GTiff", "width": 8, "height": 8, "count": 1, "dtype": "float32", "crs": crs}
    with rasterio.MemoryFile() as file:
        with file.open(**profile, transform=from_origin(west, north, step, step)) as made:
            made.write(np.zeros((1, 8, 8), np.float32))
        out.write(file.read())
    return out.getvalue()


def _recorded_points() -> bytes:
    import rerun

    places = [[LATITUDE, LONGITUDE]] * 3
    return recording(lambda stream: stream.log("path", rerun.GeoPoints(lat_lon=places), static=True))


def _recorded_metres() -> bytes:
    import rerun

    return recording(lambda stream: stream.log("path", rerun.Points3D([[EAST, NORTH, 3.0]] * 3), static=True))


def _recorded_scalar() -> bytes:
    import rerun

    return recording(lambda stream: stream.log("origin/latitude", rerun.Scalars([LATITUDE]), static=True))


def _numpy(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)
    return out.getvalue()


#: A point as GeoPackage and WKB have it.
WKB = struct.pack("<BIdd", 1, 1, LONGITUDE, LATITUDE)
PLANTED: dict[str, Callable[[], bytes]] = {
    "two floats of 64 bits": lambda: BEFORE + struct.pack("<dd", LATITUDE, LONGITUDE) + BEFORE,
    "the other order of bytes": lambda: BEFORE + struct.pack(">dd", LONGITUDE, LATITUDE) + BEFORE,
    "radians": lambda: BEFORE + struct.pack("<dd", math.radians(LATITUDE), math.radians(LONGITUDE)),
    "one float of 64 bits": lambda: BEFORE + struct.pack("<d", LATITUDE) + BEFORE,
    "floats of 32 bits": lambda: BEFORE + struct.pack("<ff", LATITUDE, LONGITUDE) + BEFORE,
    "floats of 32 bits, radians": lambda: BEFORE + struct.pack(">ff", *np.radians([LATITUDE, LONGITUDE])),
    "E7": lambda: BEFORE + struct.pack("<ii", round(LATITUDE * 1e7), round(LONGITUDE * 1e7)) + BEFORE,
    "E7, the other order of bytes": lambda: struct.pack(">ii", round(LATITUDE * 1e7), round(LONGITUDE * 1e7)),
    "UTM": lambda: BEFORE + struct.pack("<dd", EAST, NORTH),
    "ECEF": lambda: BEFORE + struct.pack("<ddd", *ecef(LATITUDE, LONGITUDE)),
    "ECEF in cm": lambda: BEFORE + struct.pack("<iii", *(round(v * 100) for v in ecef(LATITUDE, LONGITUDE))),
    "a time in us": lambda: BEFORE + struct.pack("<q", int(WHEN.timestamp() * 1e6)) + BEFORE,
    "a time as a float": lambda: BEFORE + struct.pack("<d", WHEN.timestamp()) + BEFORE,
    "base64, as plots have it": lambda: json.dumps(
        {"bdata": base64.b64encode(struct.pack("<dd", LATITUDE, LONGITUDE)).decode()}
    ).encode(),
    "NumPy archive": lambda: _numpy(a=np.array([[LATITUDE, LONGITUDE]])),
    "Parquet, degrees": lambda: _table(a=[LATITUDE] * 3, b=[LONGITUDE] * 3),
    "Parquet, radians": lambda: _table(a=np.radians([LATITUDE] * 3), b=np.radians([LONGITUDE] * 3)),
    "Parquet, UTM": lambda: _table(x=[1.0, EAST], y=[2.0, NORTH]),
    "Parquet, E7": lambda: _table(x=[round(LATITUDE * 1e7)], y=[round(LONGITUDE * 1e7)]),
    "Parquet, 32 bits": lambda: _table(x=np.float32([LATITUDE, 0]), y=np.float32([LONGITUDE, 0])),
    "Parquet, one column": lambda: _table(x=LATITUDE + np.linspace(0, 1e-3, 50)),
    "Parquet, lists": lambda: _table(x=[[LATITUDE, LONGITUDE]] * 3),
    "Parquet, structures": lambda: _table(x=[{"a": LATITUDE, "b": {"c": LONGITUDE}}]),
    "Parquet, WKB": lambda: _table(geometry=[WKB] * 3),
    "Parquet, times": lambda: _table(t=arrow.array([WHEN], arrow.timestamp("ns", tz="UTC"))),
    "Parquet, day": lambda: _table(t=arrow.array([WHEN.date()])),
    "Parquet, height": lambda: _table(a=[0.0, 40.8217]),
    "SQLite": lambda: sqlite("a REAL, b REAL", [(LATITUDE, LONGITUDE)]),
    "SQLite, deleted": lambda: sqlite("a REAL, b REAL", [(LATITUDE, LONGITUDE)], deleted=True),
    "GeoPackage's points": lambda: sqlite("geom BLOB", [(b"GP\x00\x01\xe6\x10\x00\x00" + WKB,)]),
    "JPEG, GPS": lambda: saved(picture(), "JPEG", exif=_gps()),
    "PNG, GPS": lambda: saved(picture(), "PNG", exif=_gps().tobytes()),
    "WebP, GPS": lambda: saved(picture(), "WEBP", exif=_gps()),
    "GeoTIFF, degrees": lambda: _map("EPSG:4326", LONGITUDE - 0.3, LATITUDE + 0.4, 0.1),
    "GeoTIFF, UTM": lambda: _map("EPSG:32632", EAST - 5000, NORTH + 5000, 2000.0),
    "GeoTIFF, Web Mercator": lambda: _map("EPSG:3857", 1_100_000.0, 9_300_000.0, 100_000.0),
    "rerun, a map": _recorded_points,
    "rerun, metres": _recorded_metres,
    "rerun, a curve": _recorded_scalar,
}  # fmt: skip


@pytest.mark.parametrize("kind", PLANTED)
def test_planted_numbers_are_found(tmp_path, kind):
    (tmp_path / "sent.bin").write_bytes(PLANTED[kind]())
    known = secrets()
    found = [str(finding) for finding in scan([tmp_path / "sent.bin"], known)]
    assert [one for one in found if "unreadable" not in one], found
    assert not [one for one in found if "unreadable" in one]


@given(
    latitude=some.floats(2, 80).flatmap(lambda a: some.sampled_from([a, -a])),
    longitude=some.floats(2, 178).flatmap(lambda a: some.sampled_from([a, -a])),
    before=some.binary(max_size=40),
    order=some.sampled_from("<>"),
    kind=some.sampled_from("dfi"),
)
@settings(max_examples=40)
def test_any_place_is_found_at_any_byte(latitude, longitude, before, order, kind):
    unit = 1e7 if kind == "i" else 1
    pair = [round(v * unit) if kind == "i" else v for v in (latitude, longitude)]
    data = before + struct.pack(order + 2 * kind, *pair) + bytes(9)
    found = SoughtPlaces(secrets(latitude, longitude)).binary.found_in(data)
    assert any(hit.kind == "place" and hit.start == len(before) for hit in found)


def test_chance_bytes_are_no_place():
    """Pairs of four bytes agree less than once in so many."""
    data = np.random.default_rng(20).bytes(4_000_000)
    assert SoughtPlaces(secrets()).binary.found_in(data) == []


def test_a_map_elsewhere_and_local_metres_are_none(tmp_path):
    for name, data in {
        "elsewhere": _map("EPSG:32635", EAST + 50_000.5, NORTH + 20_000.5, 100.0),
        "local": _map("", -500.0, 500.0, 125.0),
        "columns": _table(north_m=np.linspace(-500, 500, 999), east_m=np.linspace(300, -300, 999)),
    }.items():
        (tmp_path / name).write_bytes(data)
        assert scan([tmp_path / name], secrets()) == []
