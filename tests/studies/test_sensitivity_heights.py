"""What a wrong height of the ground costs, beside closed forms."""

import numpy as np
import pytest

from wildlab.geometry.terrain import Terrain
from wildlab.studies import sensitivity
from wildlab.studies.sensitivity import PITCHES_DEG, coarser, shifts


@pytest.fixture(scope="module")
def found():
    return shifts(lands=3, rays=80)


def test_on_level_land_a_metre_costs_the_cotangent(monkeypatch):
    flat = Terrain(np.full((251, 501), 20.0, np.float32), -250.0, -500.0, 2.0)
    monkeypatch.setattr(sensitivity, "synthetic_landscape", lambda seed: flat)
    for one in shifts(lands=2, rays=40):
        assert np.allclose(one.off["level"], 1 / np.tan(np.radians(one.pitch)), atol=1e-6)
        assert np.allclose([one.off["plane"], one.off["coarse"]], 0.0, atol=1e-6)


def test_flat_rays_suffer_most_and_none_straight_down(found):
    for name in ("plane", "coarse", "level"):
        medians = [np.mean(one.off[name]) for one in found]
        assert medians[-1] < 1e-6, name
        assert (np.diff(medians[2:]) < 0).all() and medians[0] > 2 * medians[3], name
    assert [one.pitch for one in found] == list(PITCHES_DEG)
    assert all(np.mean(one.off["coarse"]) <= np.mean(one.off["plane"]) for one in found)


def test_a_coarse_map_keeps_a_slope():
    north = 2.0 * np.arange(61, dtype=np.float32)[:, None]
    slope = Terrain(np.repeat(0.1 * north, 61, axis=1), 0.0, 0.0, 2.0)
    rough = coarser(slope, 30.0)
    assert rough.step == 30 and rough.height.shape == (5, 5)
    assert rough.heights_at([[45.0, 50.0]]) == pytest.approx(slope.heights_at([[45.0, 50.0]]), abs=0.15)
