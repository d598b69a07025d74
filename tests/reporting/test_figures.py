"""Figures: the ellipse is the right one, the same figure gives the same bytes, a map can be measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wildlab.reporting import figures


def test_ellipse_holds_its_share_of_samples() -> None:
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


def test_nothing_is_drawn_where_nothing_is_known() -> None:
    _, ax = figures.new_figure()
    assert figures.ellipse(ax, [np.nan, 0.0], np.eye(2)) is None
    assert figures.ellipse(ax, [0.0, 0.0], np.full((2, 2), np.nan)) is None
    assert not ax.patches


@pytest.mark.parametrize(("about", "length"), [(7.3, 5), (10, 10), (0.024, 0.02), (1999, 1000)])
def test_nice_length(about: float, length: float) -> None:
    assert figures.nice_length(about) == pytest.approx(length)


def test_same_figure_same_bytes_and_no_trace_of_when(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_subjects_that_share_a_figure_have_different_colours() -> None:
    for family in (("autopilot", "observer", "mekf"), ("kf", "ekf", "schmidt", "coloured", "ukf", "imm")):
        assert len({figures.colour(name) for name in (*family, "truth")}) == len(family) + 1
    assert figures.colour("logged-pose") != figures.colour("calibrated-pose") != figures.colour("recorded")
