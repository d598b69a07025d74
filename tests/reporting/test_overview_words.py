"""The length of a path in an overview is that of its course."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.pipeline.overviews.overview import Path
from wildlab.reporting.overview_words import way_of


def circling(since: float, shaking: float = 0.0) -> Any:
    """A round of 100 m radius in 60 s at 20 Hz, which shakes from sample to sample."""
    times = np.arange(0, 60.0001, 0.05)
    turn = 2 * np.pi * times / 60
    place = 100 * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    place[1::2] += shaking
    return SimpleNamespace(path=Path("poses", since + times, place, timed=True))


def test_the_length_of_a_path_is_that_of_its_course_however_it_shakes() -> None:
    assert way_of(circling(0.0)) == pytest.approx(2 * np.pi * 100, rel=1e-3)
    assert way_of(circling(0.0, shaking=0.5)) == pytest.approx(2 * np.pi * 100, rel=0.01)


@given(st.floats(-1e5, 2e9))
def test_no_clock_has_a_say_in_the_length_of_a_path(since: float) -> None:
    assert way_of(circling(since, 0.5)) == pytest.approx(way_of(circling(0.0, 0.5)), rel=1e-9)
