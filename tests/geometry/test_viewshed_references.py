"""Lines of sight; viewsheds of real terrain beside those of GRASS and GDAL, where the data are at hand."""

import json

import numpy as np
import pytest

from wildlab.geometry.georeference import Terrain
from wildlab.geometry.viewsheds import cast_rays, compare_angles, lines_clear

rasterio = pytest.importorskip("rasterio")


@pytest.fixture(scope="module")
def references(shared_data):
    """Name -> (terrain, nodes, camera, target's height, seen by GRASS, seen by GDAL); rows run north."""
    folder = shared_data("dem", "viewshed_refs")

    def read(path):
        with rasterio.open(path) as source:
            return source.read(1)[::-1], source.nodata

    given = json.loads((folder / "viewsheds.json").read_text())
    found = {}
    for name, one in given.items():
        (path,) = folder.parent.glob(f"{one['dem']}*/*.tif")
        height, missing = read(path)
        terrain = Terrain(np.where(height == missing, np.nan, height).astype(np.float32), 0.0, 0.0, 1.0)
        row, column = len(height) - 1 - one["row"], one["col"]
        camera = np.array([row, column, -float(terrain.height[row, column]) - one["observer_height"]])
        nodes = np.argwhere(np.isfinite(terrain.height))
        assert len(nodes) == one["n"]
        seen = [
            (read(folder / f"{name}_{by}.tif")[0] == value)[tuple(nodes.T)]
            for by, value in (("grass", 1), ("gdal", 255))
        ]
        found[name] = (terrain, nodes, camera, one["target_height"], *seen)
    return found


def test_no_line_leads_to_what_is_not_known():
    terrain = Terrain(np.random.default_rng(1).uniform(0, 6, (24, 24)).astype(np.float32), -23.0, -31.0, 2.0)
    points = np.array([[0.0, 0.0, -50.0], [np.nan, 0.0, -50.0], [0.0, 0.0, -50.0]])
    lenses = [[0.0, 5.0, -60.0], [0.0, 5.0, -60.0], [np.nan, 0.0, 0.0]]
    assert lines_clear(terrain, points, lenses).tolist() == [True, False, False]


def test_the_exact_line_of_sight_is_that_of_grass(references):
    for name, (terrain, nodes, camera, above, grass, gdal) in references.items():
        points = np.column_stack([nodes, -terrain.height[tuple(nodes.T)].astype(float) - above])
        clear = lines_clear(terrain, points, camera)
        assert (clear == grass).mean() >= 0.99, name
        assert (clear == grass)[grass == gdal].mean() >= 0.995, name


@pytest.mark.slow
def test_the_thesis_is_further_from_grass_than_the_exact_one(references):
    """Its Bresenham takes the nearest grid points, and its rays have steps: neither is hidden here."""
    for name, (terrain, nodes, camera, above, grass, _) in references.items():
        if above:
            continue  # F's points lie on the ground
        points = np.column_stack([nodes, -terrain.height[tuple(nodes.T)].astype(float)])
        wrong = (lines_clear(terrain, points, camera) != grass).mean()
        assert (compare_angles(terrain, nodes, camera).clear != grass).mean() > 4 * wrong, name
        assert (cast_rays(terrain, nodes, camera, 0.5, 1.0).clear != grass).mean() > wrong, name
        assert not compare_angles(terrain, nodes, camera, itself=True).clear.any()
