"""A recipe that names an elevation map, and `wildlab import --terrain`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from wildlab import cli
from wildlab.errors import WildlabError
from wildlab.flight.checksums import accept_changes
from wildlab.flight.store import load_flight


def write_map(path: Path, height: float) -> Path:
    """Level ground about the flight of `raw`, heights above the geoid."""
    path.parent.mkdir(exist_ok=True)
    transform = Affine(1e-4, 0, 10.39, 0, -5e-5, 63.445)
    given = {"width": 200, "height": 200, "count": 1, "dtype": "float32", "crs": 4326, "transform": transform}
    with rasterio.open(path, "w", driver="GTiff", **given) as data:
        data.write(np.full((200, 200), height, np.float32), 1)
    return path


def call(capsys: Any, *arguments: Any) -> tuple[Any, str, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main([str(one) for one in arguments])
    out, err = capsys.readouterr()
    return ended.value.code, out, err


def test_a_recipe_may_name_a_map(raw):
    write_map(raw.folder / "raw" / "dem.tif", 1.5)
    raw.set("terrain", {"file": "dem.tif", "heights": 39.5, "sd_m": 0.4})
    raw.run()
    flight = load_flight(raw.into)
    assert flight.terrain is not None and flight.manifest.terrain is not None
    # 41 m above the ellipsoid, where the origin is the first pose, 140 m up.
    assert flight.terrain.heights_at([[0.0, 0.0]])[0] == pytest.approx(41.0 - 140.0, abs=1e-3)
    record = flight.manifest.terrain
    assert (record.source, record.heights, record.added_m, record.sd_m) == ("dem.tif", "geoid", 39.5, 0.4)
    assert record.crs == "EPSG:4326" and flight.terrain.sd == pytest.approx(0.4, abs=1e-3)
    # A byte that changes by itself is found, one that was changed on purpose is accepted.
    path = raw.into / "terrain.tif"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    with pytest.raises(WildlabError, match="SHA-256"):
        load_flight(raw.into)
    assert accept_changes(raw.into) == ["terrain.tif"]


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ({"file": "../dem.tif", "heights": 0.0}, "leaves the folder"),
        ({"file": "dem.tif"}, "heights count from"),
        ({"file": "dem.tif", "heights": "geoid"}, r"terrain\.heights"),
    ],
)
def test_what_is_wrong_with_it_is_said(raw, part, words):
    write_map(raw.folder / "raw" / "dem.tif", 1.5)
    raw.set("terrain", part)
    with pytest.raises(WildlabError, match=words):
        raw.run()
    assert not raw.into.exists()


def test_the_option_takes_the_place_of_the_recipe(raw, capsys):
    write_map(raw.folder / "raw" / "dem.tif", 1.5)
    raw.set("terrain", {"file": "dem.tif", "heights": 39.5})
    other = write_map(raw.folder / "other.tif", 3.0)
    command = ("import", raw.write(), "--source", raw.folder / "raw", "--into", raw.into)
    code, _, err = call(capsys, *command, "--terrain-heights", "0")
    assert code == 2 and "--terrain-heights" in err
    code, _, err = call(capsys, *command, "--terrain", other, "--terrain-heights", "ellipsoid")
    assert code == 0, err
    flight = load_flight(raw.into)
    assert flight.manifest.terrain.source == "other.tif"
    assert flight.terrain.heights_at([[0.0, 0.0]])[0] == pytest.approx(3.0 - 140.0, abs=1e-3)
    # The file in the folder names no place: its coordinates are metres from the origin.
    with rasterio.open(raw.into / "terrain.tif") as data:
        assert data.crs is None and np.abs(data.bounds).max() < 5000
