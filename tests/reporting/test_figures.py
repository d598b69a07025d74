"""Figures: ellipses, the same bytes, and letters that can be read and lie on no others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure

from tests.figure_text import overlapping
from tests.reporting.test_html import contrast
from wildlab.reporting import figures
from wildlab.reporting.charts import drawing, flights, tracks
from wildlab.reporting.figures import PHONE_WIDTH, least_size


def test_ellipse_holds_its_share_of_samples():
    rng = np.random.default_rng(0)
    covariance = np.array([[9.0, 4.0], [4.0, 3.0]])
    points = rng.multivariate_normal([10.0, -5.0], covariance, 40_000)
    _, ax = figures.new_figure()
    shape = figures.ellipse(ax, [10.0, -5.0], covariance, probability=0.9)
    assert shape is not None
    # In the ellipse's own frame, independent of how the half axes were found.
    turned = np.exp(-1j * np.radians(shape.angle)) * ((points - [10.0, -5.0]) @ [1, 1j])
    inside = (turned.real / (shape.width / 2)) ** 2 + (turned.imag / (shape.height / 2)) ** 2 <= 1
    assert inside.mean() == pytest.approx(0.9, abs=0.005)
    # The view was widened to show it.
    assert ax.get_xlim()[0] < 10 - shape.width / 4


def test_same_figure_same_bytes_and_no_trace_of_when(tmp_path, monkeypatch):
    monkeypatch.delenv(figures.QUICK, raising=False)
    saved = []
    for name in ("1", "2", "3"):
        fig, ax = figures.new_figure(4, 3)
        ax.plot([1, 2, 3], label="ü")
        engine = fig.get_layout_engine()
        png = figures.save_figure(fig, tmp_path / name, "a")
        assert png == (tmp_path / name / "a.png").read_bytes()
        saved.append((png, (tmp_path / name / "a.pdf").read_bytes()))
        assert fig.get_layout_engine() is engine, "it can be added to, and saved once more"
    assert saved[0] == saved[1] == saved[2]
    assert b"Date" not in saved[0][1] and b"matplotlib" not in saved[0][0].lower()


LONG = "A title that says what is to be seen here, and says it at length: 12.3 m of 45.6 m"
TIMES = np.linspace(0.0, 90.0, 181)
SEEN = (TIMES < 30.0) | (TIMES > 60.0)
NAMES = {"ekf": "extended filter", "schmidt": "Schmidt filter", "coloured": "differenced"}
Draw = Callable[[np.random.Generator], Figure]


def walk(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.normal(0, rng.uniform(0.1, 30), shape).cumsum(axis=0)


def strips_of(rng: np.random.Generator) -> Figure:
    sources = ("mekf", "truth", "autopilot", "observer")
    angles = {label: dict.fromkeys(sources, (TIMES, walk(rng, 181))) for label in ("roll (°)", "pitch (°)")}
    return flights.strips(angles)


def scored(rng: np.random.Generator) -> pd.DataFrame:
    return pd.DataFrame(
        {"frame_id": [f"f{i}" for i in range(40)], "time_s": np.arange(40.0), "error_m": rng.gamma(2, 3, 40)}
    )


CHARTS: dict[str, Draw] = {
    "scatter": lambda rng: tracks.error_scatter(rng.normal(0, rng.uniform(0.1, 50), (80, 2))),
    "shares": lambda rng: tracks.error_shares(
        {name: (rng.normal(0, 3, (50, 2)), figures.BLUE) for name in ("as logged", "corrected")}
    ),
    "by image": lambda rng: tracks.errors_by_image(scored(rng)),
    "positions": lambda rng: tracks.positions_map(walk(rng, 90, 2), walk(rng, 90, 2), "black"),
    "aircraft": lambda rng: tracks.aircraft_map(*(walk(rng, 90, 2) for _ in range(3))),
    "lags": lambda rng: drawing.correlations_chart(
        {"autocorrelation": {name: (rng.uniform(-1, 1, 20), "black") for name in ("north", "east")}}, [0.2]
    ),
    "track map": lambda rng: tracks.track_map(
        walk(rng, 181, 2), {name: walk(rng, 181, 2) for name in NAMES}, NAMES,
        aircraft=walk(rng, 90, 2), measured=walk(rng, 90, 2),
    ),
    "errors": lambda rng: tracks.error_over_time(
        TIMES, SEEN, {name: walk(rng, 181, 2) for name in NAMES}, NAMES, measured=walk(rng, 181, 2)
    ),
    "course": lambda rng: tracks.speed_and_course(
        TIMES, SEEN, walk(rng, 181, 4), {name: walk(rng, 181, 4) for name in NAMES}, NAMES
    ),
    "squares": lambda rng: tracks.squares_over_time(
        TIMES, SEEN, {what: {name: rng.chisquare(2, 181) for name in NAMES} for what in ("NEES", "NIS")},
        NAMES,
    ),
    "strips": strips_of,
    "bands": lambda rng: flights.error_bands(
        TIMES, {name: walk(rng, 181, 3) for name in ("mekf", "observer")},
        {"mekf": rng.gamma(2, 1, (181, 3))}, ["roll (°)", "pitch (°)", "yaw (°)"],
    ),
    "biases": lambda rng: flights.bias_chart(TIMES, walk(rng, 181, 6), rng.gamma(2, 1, (181, 6))),
    "nis": lambda rng: drawing.squares_chart(
        {name: [drawing.Curve(TIMES, rng.chisquare(3, 181), "black")] for name in ("position", "velocity")}, 3
    ),
    "flights": lambda rng: drawing.rows_chart(
        ["a", "a flight with quite a…", "c"], {"": drawing.Values(rng.gamma(2, 1, 3))},
        "m", size=(4.6, 2.4),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CHARTS)
def test_no_letters_lie_on_others_and_all_can_be_read_on_a_phone(name):
    figure = CHARTS[name](np.random.default_rng(0))
    figure.suptitle(LONG, x=0.01, ha="left", fontsize=rcParams["axes.titlesize"])
    figures.png_bytes(figure)
    assert overlapping(figure) == []
    # As wide as a phone, the smallest letters still have their pixels: nobody has to push it sideways.
    assert figure.get_size_inches()[0] * least_size(figure) <= PHONE_WIDTH


def test_the_look_out_finds_what_is_wrong():
    figure, ax = figures.new_figure()
    ax.text(0.5, 0.5, "one")
    ax.text(0.5, 0.5, "other")
    figure.text(0.9, 0.5, "far to the right of all")
    found = overlapping(figure)
    assert any("'one' lies on 'other'" in one for one in found)
    assert any("'far to the right of all' leaves the figure" in one for one in found)
    assert len(found) == 2


def test_a_legend_and_names_at_ends_are_moved_until_they_fit():
    figure, ax = figures.new_figure()
    for i in range(5):
        ax.plot([0, 1], [0, 1e-9 * i], label=f"the line number {i}")
        figures.end_label(ax, 1, 1e-9 * i, f"name {i}", "black")
    ax.set_ylim(-1, 1)
    figure.legend(loc="outside lower center", ncols=5)
    assert len(overlapping(figure)) > 1
    figures.png_bytes(figure)
    assert overlapping(figure) == []
    heights = [text.get_window_extent().y0 for text in ax.texts]
    assert heights == sorted(heights)  # in the order of the lines


def test_every_line_stands_out_from_white():
    cycle = [str(one["color"]) for one in figures.house_rc()["axes.prop_cycle"]]
    for colour in {*figures.COLOURS.values(), *cycle}:
        assert contrast(colour, "#ffffff") >= 3.0, colour


def test_signs_of_a_legend_keep_their_size_in_fewer_columns():
    fig, (ax,) = drawing.new_strips(1, 3.0)
    for k in range(4):
        ax.plot([0, 1], [k, k], "o", ms=6, label=f"a filter with quite a long name {k}")
    drawing.finish(fig)
    before = {one.get_markersize() for one in fig.legends[0].legend_handles}
    figures.fit_text(fig)
    assert fig.legends[0]._ncols < 4
    assert {one.get_markersize() for one in fig.legends[0].legend_handles} == before == {9.0}


def test_signs_of_a_legend_that_lie_on_one_another_or_on_words_are_found():
    def drawn(size: float) -> list[str]:
        fig, ax = figures.new_figure()
        for name in "ab":
            ax.plot([0, 1], [0, 1], "o-", ms=size, label=name)
        fig.legend(loc="outside lower center")
        figures.fit_text(fig)
        return overlapping(fig)

    assert drawn(12.0) == []
    assert {"the sign of 'a'" in one and "the sign of 'b'" in one for one in drawn(22.0)} == {True}
    assert any(one.startswith("'a' lies on \"the sign of 'a'") for one in drawn(44.0))


def test_names_on_a_map_are_apart_and_those_that_lie_beside_others_stay():
    fig, ax = figures.new_figure(5.6, 5.2)
    ax.plot([0, 100], [0, 100])
    for k in range(6):
        figures.end_label(ax, 50 + 0.2 * k, 50 + 0.1 * k, str(k), "black")
    figures.end_label(ax, 10, 50, "aside", "black")
    figures.fit_text(fig)
    boxes = [name.get_window_extent() for name in ax.texts]
    for i, one in enumerate(boxes):
        for other in boxes[:i]:
            assert min(one.x1, other.x1) <= max(one.x0, other.x0) or (
                min(one.y1, other.y1) <= max(one.y0, other.y0) + 1
            )
    assert ax.texts[-1].xyann == (5, 0)
