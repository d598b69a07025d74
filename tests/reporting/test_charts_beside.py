"""Filters beside the plain one: gains follow from their errors, and no strip hides another."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from tests.figure_text import overlapping
from wildlab.pipeline.following.sensor_tracks import Array, SensorTrack
from wildlab.reporting.charts.beside import beside_plain, beside_plain_shown
from wildlab.reporting.charts.following import errors_shown
from wildlab.reporting.figures import png_bytes

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


def assert_readable(figure: Figure) -> None:
    """No letters lie on others once it is saved."""
    png_bytes(figure)
    assert overlapping(figure) == []


PLAIN = np.full(N, 10.0)


def test_gains_are_differences_of_distances_where_both_see_the_target() -> None:
    seen = np.arange(N) % 2 == 0
    plain, (one,) = beside_plain([track("ekf", PLAIN), track("schmidt", np.full(N, 4.0), seen)])
    assert plain == "ekf" and one.filter == "schmidt"
    assert one.times.tolist() == np.arange(0, N, 2).tolist()
    assert one.gain == pytest.approx(np.full(N // 2, 6.0))
    assert (one.nearer, one.farther, one.middle) == (1.0, 0.0, pytest.approx(6.0))


def test_shares_count_looks_and_leave_out_what_is_alike() -> None:
    off = np.repeat([10.05, 9.95, 12.0, 3.0], [40, 40, 30, 90])
    _, (one,) = beside_plain([track("ekf", PLAIN), track("coloured", off)])
    assert (one.nearer, one.farther) == (0.45, 0.15)


def test_tracks_of_other_looks_are_held_together_by_time() -> None:
    _, (one,) = beside_plain([track("kf", np.arange(N) + 1.0), track("imm", np.ones(50), start=100)])
    assert one.times.tolist() == list(range(100, 150))
    assert one.gain == pytest.approx(np.arange(100.0, 150.0))
    lost = track("imm", np.full(N, np.nan))
    assert beside_plain([track("kf", PLAIN), lost]) == ("kf", [])


@pytest.mark.parametrize(
    "tracks", [[], [track("ekf", PLAIN)], [track("schmidt", PLAIN), track("coloured", PLAIN)]]
)
def test_without_a_plain_filter_and_another_there_is_no_figure(tracks: list[SensorTrack]) -> None:
    assert beside_plain(tracks)[1] == []
    assert not tracks or beside_plain_shown(tracks) is None


def test_each_filter_has_a_strip_and_all_have_one_axis() -> None:
    names = ("schmidt", "coloured", "ukf", "imm", "thinned")
    tracks = [track("ekf", PLAIN), *(track(name, PLAIN - i - 1) for i, name in enumerate(names))]
    shown = beside_plain_shown(tracks)
    assert shown is not None
    figure, _, alt, caption = shown
    assert len(figure.axes) == 4 and "4 of 5" in caption and "thinned" in alt
    assert len({ax.get_ylim() for ax in figure.axes}) == 1
    for i, ax in enumerate(figure.axes):
        assert np.asarray(ax.lines[0].get_ydata(), float) == pytest.approx(np.full(N, i + 1.0))
    assert_readable(figure)


@pytest.mark.parametrize("largest", [300.0, 1e8])
def test_a_filter_that_is_lost_does_not_press_the_rest_flat(largest: float) -> None:
    plain = PLAIN.copy()
    plain[-5:] = largest
    shown = beside_plain_shown(
        [track("ekf", plain), track("schmidt", PLAIN - 1.3), track("ukf", PLAIN + 0.7)]
    )
    assert shown is not None
    figure = shown[0]
    ax = figure.axes[0]
    assert ax.get_yscale() == "symlog"
    bottom, top = (ax.transData.transform((0, y))[1] for y in (0.0, 1.3))
    assert top - bottom > 8  # pixels
    assert_readable(figure)


@pytest.mark.parametrize(("worst", "scale"), [(12.0, "linear"), (5e6, "log")])
def test_errors_of_one_that_is_lost_are_drawn_over_powers_of_ten(worst: float, scale: str) -> None:
    plain = PLAIN.copy()
    plain[-5:] = worst
    rows = pd.DataFrame(
        {"sensor": "radar", "target": "boat", "filter": ["ekf", "schmidt"], "rmse": [worst, 9.0]}
    )
    figure, *_ = errors_shown([track("ekf", plain), track("schmidt", PLAIN - 1)], rows)
    assert figure.axes[0].get_yscale() == scale
    assert_readable(figure)
