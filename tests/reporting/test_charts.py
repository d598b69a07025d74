"""Charts draw the numbers they are given: bounds and bands, gains, courses, and looks of their own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import EllipseCollection

from wildlab.analysis.overview import Path
from wildlab.analysis.tracks.single_target import SensorTrack
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import Curve, squares_chart
from wildlab.reporting.charts.flights import (
    Clock,
    error_bands,
    strips,
)
from wildlab.reporting.charts.tracks import error_map, map_shown, speed_and_course
from wildlab.reporting.georeferencing import worst_images
from wildlab.reporting.overview import way_of

N = 200


def track(name: str, off: Array, seen: Array | None = None, start: int = 0) -> SensorTrack:
    """A track that is off by so many metres to the north-east, of looks a second apart."""
    n = len(off)
    error = np.zeros((n, 4))
    error[:, :2] = off[:, None] * np.array([0.6, -0.8])
    near = np.ones(n, bool) if seen is None else np.asarray(seen, bool)
    covariance = np.broadcast_to(np.eye(4), (n, 4, 4))
    times, nan = start + np.arange(n, dtype=float), np.full(n, np.nan)
    return SensorTrack(
        "radar", "boat", name, times, np.zeros((n, 4)), error, nan, np.full((n, 2), np.nan), nan,
        np.ones(n, bool), near, covariance,
    )  # fmt: skip


PLAIN = np.full(N, 10.0)


@pytest.mark.parametrize("at_rest", [False, True])
def test_the_map_of_a_target_at_rest_is_of_its_track(at_rest):
    """Its covariance has no velocity; of one that moves the map has the platform's way of 900 m too."""
    one = track("ekf", PLAIN)
    states = np.diag([1.0, 1.0, *([0.0, 0.0] if at_rest else [1.0, 1.0])])
    one = one._replace(covariance=np.tile(states, (N, 1, 1)), estimate=np.zeros((N, 4)))
    way = np.linspace([-400.0, 0.0], [500.0, 0.0], 50)
    known: Any = SimpleNamespace(tracks=[one])
    figure = map_shown(known, "boat", "ekf", np.array([[2.0, 1.0]]), {"aircraft": way})[0]
    north = np.ptp(figure.axes[0].get_ylim())
    assert north < 20.0 if at_rest else north > 900.0


TIMES = np.linspace(0.0, 60.0, 301)


def test_errors_and_twice_their_deviations_are_drawn():
    rng, sds = np.random.default_rng(0), [1.0, 2.0, 3.0]
    error, sd = rng.normal(0, sds, (301, 3)), np.tile(sds, (301, 1))
    fig = error_bands(TIMES, {"mekf": error}, {"mekf": sd}, ["a (m)", "b (m)", "c (m)"])
    for i, ax in enumerate(fig.axes[:3]):
        (band,) = ax.collections
        assert band.get_paths()[0].get_extents().y1 == pytest.approx(2 * sds[i])
        assert any(np.array_equal(line.get_ydata(), error[:, i]) for line in ax.lines)
        assert ax.get_ylim()[1] >= np.abs(error[:, i]).max()


def test_squares_have_the_band_of_chi_square():
    values = np.random.default_rng(1).chisquare(3, 301)
    fig = squares_chart({"NIS": [Curve(TIMES, values, "black", dots=True)]}, 3)
    edges = [line.get_ydata()[0] for line in fig.axes[0].lines if len(line.get_ydata()) == 2]
    assert sorted(edges) == pytest.approx(chi_square_interval(3))


SECONDS = np.arange(0.0, 20.0, 0.1)
SEEN = (SECONDS < 5.0) | (SECONDS > 15.0)
NAMES = {"ekf": "Extended", "schmidt": "Schmidt"}
#: At 1 m/s to the north, a little east and west of it.
TRUTH = np.column_stack([SECONDS, 0 * SECONDS, 0 * SECONDS + 1.0, 0.05 * np.sin(SECONDS)])


def courses(figure):
    return {line.get_label(): np.asarray(line.get_ydata(), float) for line in figure.axes[1].lines}


def test_a_steady_course_is_drawn_about_itself_also_over_north():
    rest = TRUTH.copy()
    rest[:, 2:] *= 0.1
    figure = speed_and_course(SECONDS, SEEN, TRUTH, {"ekf": rest}, NAMES)
    assert np.isnan(courses(figure)["Extended"]).all()  # of what hardly moves
    about = courses(figure)["truth"]
    assert np.ptp(about) == pytest.approx(2 * np.degrees(np.arctan(0.05)), rel=0.01)
    low, high = figure.axes[1].get_ylim()
    assert (
        low < about.min() and about.max() < high and high - low == pytest.approx(20 + np.ptp(about), rel=0.01)
    )
    assert figure.axes[1].yaxis.get_major_formatter()(-5.0, 0) == "355"
    assert figure.axes[0].get_ylim()[1] == pytest.approx(1.2, rel=0.01)


def test_courses_all_round_break_over_north():
    turning = TRUTH.copy()
    turning[:, 2], turning[:, 3] = np.cos(0.7 * SECONDS), np.sin(0.7 * SECONDS)
    figure = speed_and_course(SECONDS, SEEN, turning, {"ekf": turning}, NAMES)
    angle = courses(figure)["truth"]
    seen = angle[np.isfinite(angle)]
    assert len(seen) < len(angle)
    assert np.nanmax(np.abs(np.diff(angle))) < 180
    low, high = figure.axes[1].get_ylim()
    assert high - low > 360


SOURCES = ("autopilot", "truth", "mine", "truth-payload", "mekf")


def test_every_source_and_the_ground_have_a_look_of_their_own():
    times = np.arange(3.0)
    series = {name: (times, times + index) for index, name in enumerate(("ground", *SOURCES))}
    figure = strips({"height (m)": series}, Clock(0.0, 10.0))
    looks = {line.get_label(): (line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines}
    looks["mekf"] = looks.pop("filter (MEKF)")
    assert set(looks) == {"ground", *SOURCES} and len(set(looks.values())) == len(looks)
    black = {name for name, (color, _) in looks.items() if color == "#000000"}
    assert black == {"truth", "truth-payload"}


def circling(since: float, shaking: float = 0.0) -> Any:
    """A round of 100 m radius in 60 s at 20 Hz, which shakes from sample to sample."""
    times = np.arange(0, 60.0001, 0.05)
    turn = 2 * np.pi * times / 60
    place = 100 * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    place[1::2] += shaking
    return SimpleNamespace(path=Path("poses", since + times, place, timed=True))


def test_the_length_of_a_path_is_that_of_its_course_however_it_shakes():
    assert way_of(circling(0.0)) == pytest.approx(2 * np.pi * 100, rel=1e-3)
    assert way_of(circling(0.0, shaking=0.5)) == pytest.approx(2 * np.pi * 100, rel=0.01)


@given(st.floats(-1e5, 2e9))
def test_no_clock_has_a_say_in_the_length_of_a_path(since):
    assert way_of(circling(since, 0.5)) == pytest.approx(way_of(circling(0.0, 0.5)), rel=1e-9)


def test_a_map_of_errors_has_every_ellipse_and_the_worst_images_by_number():
    n = 40
    scored = pd.DataFrame(
        {
            "frame_id": [f"f{k // 2}" for k in range(n)],
            "north_m": np.arange(n) * 10.0,
            "east_m": 0.0,
            "error_north_m": 0.0,
            "error_east_m": np.arange(n) * 1.0,
            "error_m": np.arange(n) * 1.0,
            "cov_nn": 4.0,
            "cov_ne": 0.0,
            "cov_ee": 1.0,
        }
    )
    scored.loc[3, ["north_m", "east_m", "error_m"]] = np.nan
    worst = worst_images(scored)
    assert list(worst["image"][:2]) == ["f19", "f18"] and list(worst["number"]) == list(range(1, 11))
    assert worst["mean"].iloc[0] == 38.5 and worst["max"].iloc[0] == 39.0
    ax = error_map(scored, list(worst["image"])).axes[0]
    (ellipses,) = (one for one in ax.collections if isinstance(one, EllipseCollection))
    # The long axis, north, is the width that is turned upright.
    assert len(ellipses.get_offsets()) == n - 1
    assert ellipses._angles == pytest.approx(np.pi / 2) and ellipses._widths[0] == pytest.approx(
        4.292, abs=1e-3
    )
    assert {one.get_text(): one.xy for one in ax.texts if one.get_text().isdigit()}["1"] == (0.0, 390.0)
