"""That ground made from a terrain has its heights everywhere, and says so where it cannot."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.geometry.terrain import Terrain
from wildlab.simulation.landscape import synthetic_landscape
from wildlab.simulation.scene.ground import Weather, rolling_land
from wildlab.simulation.scene.land import height_at
from wildlab.simulation.scene.on_terrain import MOST_CELLS, land_on

COVERS = rolling_land(Weather(hour=13.0), 3)
TERRAIN = synthetic_landscape(2, north=120.0, east=260.0, step=2.0)
LAND = land_on(TERRAIN, COVERS)


@settings(max_examples=80, deadline=None)
@given(st.floats(-60.0, 60.0), st.floats(-130.0, 130.0))
def test_heights_are_those_of_the_terrain(north: float, east: float) -> None:
    want = TERRAIN.heights_at([[north, east]])[0]
    assert height_at(LAND, [north, east]) == pytest.approx(want, abs=1e-4)


@pytest.mark.parametrize("north, east", [(500.0, -300.0), (-1036.0, 412.0), (8.0, -12.0)])
def test_a_terrain_far_from_the_origin_keeps_its_place(north: float, east: float) -> None:
    rng = np.random.default_rng(1)
    far = Terrain(rng.uniform(0, 9, (20, 31)).astype(np.float32), north=north, east=east, step=4.0)
    land = land_on(far, COVERS)
    for place in rng.uniform([north, east], [north + 76.0, east + 120.0], (20, 2)):
        assert height_at(land, place) == pytest.approx(far.heights_at([place])[0], abs=1e-4)


def test_beyond_the_terrain_it_is_as_high_as_its_border() -> None:
    for beyond, border in (((75.0, 10.0), (60.0, 10.0)), ((-20.0, -160.0), (-20.0, -130.0))):
        assert height_at(LAND, beyond) == pytest.approx(TERRAIN.heights_at([border])[0], abs=1e-4)


def test_covers_keep_their_shares_and_their_places() -> None:
    assert LAND.weather == COVERS.weather
    for one in range(3):
        assert (LAND.cover == one).mean() == pytest.approx((COVERS.cover == one).mean(), abs=0.02)
    fine, cell = COVERS.side / len(COVERS.cover), LAND.side / len(LAND.cover)
    for i, j in np.random.default_rng(4).integers(0, len(LAND.cover), (40, 2)):
        at = (np.array([i, j]) + 0.5) * cell % COVERS.side / fine
        assert LAND.cover[i, j] == COVERS.cover[int(at[0]), int(at[1])]


def test_a_terrain_with_a_hole_beside_its_grid_or_too_large_is_refused() -> None:
    holed = np.zeros((4, 4), np.float32)
    holed[1, 2] = np.nan
    for terrain, about in (
        (Terrain(holed, 0.0, 0.0, 2.0), "missing"),
        (Terrain(np.zeros((4, 4), np.float32), 8.0, 6.0, 4.0), "multiples of 4 m"),
        (Terrain(np.zeros((2, MOST_CELLS), np.float32), 0.0, 0.0, 2.0), f"{MOST_CELLS} nodes"),
    ):
        with pytest.raises(WildlabError, match=about):
            land_on(terrain, COVERS)
