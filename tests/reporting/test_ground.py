"""Words on the ground follow from their numbers."""

import numpy as np
import pandas as pd
import pytest

from wildlab.geometry.terrain import Terrain
from wildlab.reporting.georeferencing import limits_of, method_words
from wildlab.reporting.ground import ground_height_words, level_sentence


@pytest.mark.parametrize(
    ("terrain", "level", "interval", "words"),
    [
        (2.0, 5.0, (1.0, 4.0), "the terrain is nearer to it (+3.00 m, 95 % interval +1.00 to +4.00 m)"),
        (5.0, 2.0, (-4.0, -1.0), "level ground is nearer to it (-3.00 m"),
        (5.0, 4.0, (-2.0, 1.0), "these images do not decide"),
        (5.0, 4.0, (np.nan, np.nan), "too few images to tell"),
    ],
)
def test_which_is_nearer_follows_the_interval(terrain, level, interval, words):
    assert words in level_sentence(terrain, level, 30, interval)


def test_the_height_is_as_good_as_it_is_stated():
    flat = np.zeros((2, 2), np.float32)
    assert ground_height_words(None, {}) == ""
    assert "assumed to be good to 1.5 m" in ground_height_words(
        Terrain(flat, 0, 0, 1.0), {"plane_height_m": 1.5}
    )
    assert "is good to 0.25 m" in ground_height_words(Terrain(flat, 0, 0, 1.0, 0.25), {"plane_height_m": 1.5})


def test_method_and_limits_name_the_ground_that_was_used():
    assert "horizontal plane" in method_words(terrain=False) and "GROUND" not in method_words(terrain=False)
    assert "from cell to cell" in method_words(terrain=True)
    assert "horizontal plane" not in method_words(terrain=True)
    points = pd.DataFrame({"north_m": [np.nan, 1.0]})
    said = " ".join(limits_of(points, [30.0], [80.0], labelled=True, timed=True, enough=True, terrain=True))
    assert "taken from an elevation map" in said and "a ray that meets no ground" in said
