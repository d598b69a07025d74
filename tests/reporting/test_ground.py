"""Which ground is nearer to the truth follows from the interval of the difference."""

import numpy as np
import pytest

from wildlab.reporting.ground import level_sentence


@pytest.mark.parametrize(
    ("terrain", "level", "interval", "words"),
    [
        (2.0, 5.0, (1.0, 4.0), "the terrain is nearer"),
        (5.0, 2.0, (-4.0, -1.0), "level ground is nearer"),
        (5.0, 4.0, (-2.0, 1.0), "not decide"),
        (5.0, 4.0, (np.nan, np.nan), "too few"),
    ],
)
def test_which_is_nearer_follows_the_interval(terrain, level, interval, words):
    said = level_sentence(terrain, level, 30, interval)
    assert words in said and (f"{level - terrain:+.2f} m" in said) == (words != "too few")
