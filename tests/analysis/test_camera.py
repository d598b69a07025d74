"""A camera from found boards: odd views, coverage, what its file holds, how well focal lengths are known."""

from dataclasses import replace

import numpy as np
import pytest

from wildlab.analysis.camera import (
    MATTERS_PX,
    BoardImage,
    camera_file,
    coverage,
    odd_views,
    rim_px,
    solve_boards,
)
from wildlab.detection.boards import Board
from wildlab.geometry.board_views import Views, parameters_of, project_board
from wildlab.geometry.camera import Camera
from wildlab.simulation.boards import board_views

CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0, 0.0, (-0.2, 0.0, 0.0, 0.0, 0.0))
BOARD = Board("chessboard", 9, 6, 0.025)


def images(n=20, noise=0.1, tilt=40.0, seed=1):
    rng = np.random.default_rng(seed)
    views: Views = board_views(rng, CAMERA, BOARD.points, n, np.radians(tilt))
    uv = project_board(parameters_of(CAMERA), views, BOARD.points).uv
    uv = uv + rng.normal(0, noise, uv.shape)
    return tuple(BoardImage(f"{i}.png", "", one) for i, one in enumerate(uv))


@pytest.fixture(scope="module")
def good():
    return solve_boards(images(), BOARD, 640, 512, "k1")


@pytest.mark.parametrize("wrong", [{4: [1.0, 0.8]}, {4: [1.0, 0.8], 9: [0.9, 1.0]}])
def test_views_that_disagree_are_named_with_figures_without_them(good, wrong):
    assert good.odd == () and good.without_odd is None
    views = [replace(one, uv=one.uv * wrong.get(k, [1.0, 1.0])) for k, one in enumerate(images())]
    found = solve_boards(tuple(views), BOARD, 640, 512, "k1")
    assert set(found.odd) == {f"{k}.png" for k in wrong}
    assert found.without_odd.rms < 0.2 < found.found.rms
    assert len(found.without_odd.views.rotation) == len(views) - len(wrong)


def test_no_more_than_a_quarter_are_odd():
    errors = np.r_[np.full(12, 0.2) + 0.01 * np.arange(12), 5, 6, 7, 8]
    assert odd_views(errors).sum() == 4
    assert odd_views(np.r_[errors, 9]).sum() == 4
    assert not odd_views(np.full(8, 0.2)).any()
    assert not odd_views(np.array([0.1, 0.1, 0.1, 9.0])).any()  # four are needed without it


def test_coverage_counts_cells():
    assert coverage(np.array([[0.0, 0.0], [639.0, 511.0], [640.0, 512.0]]), 640, 512).sum() == 2
    assert coverage(np.array([[[639.0, 1.0]]]), 640, 512)[0, 7]


def test_the_file_has_all_that_was_found(good):
    content = camera_file(good, "Tau2")
    assert content.camera.fx_px == good.found.camera.fx and content.camera.k1 == good.found.value("k1")
    assert [one.name for one in content.parameter] == ["fx", "fy", "cx", "cy", "k1"]
    assert np.allclose(content.covariance, good.found.covariance)
    assert content.evidence.points == 20 * 54 and len(content.view) == 20


def test_focal_lengths_that_are_known_well_are_not_complained_of(good):
    assert rim_px(good.found) < MATTERS_PX
    flat = solve_boards(images(8, 0.1, 1.0), BOARD, 640, 512, "none").found
    sd = dict(zip(flat.names, np.sqrt(np.diag(flat.covariance)), strict=True))
    by_hand = max(sd["fx"] / flat.camera.fx, sd["fy"] / flat.camera.fy) * np.hypot(320, 256)
    assert rim_px(flat) == pytest.approx(by_hand) and by_hand > MATTERS_PX
