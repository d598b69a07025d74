"""A camera from found boards: odd views, coverage, what its file holds, how well focal lengths are known."""

from dataclasses import replace

import numpy as np
import pytest

from wildlab.analysis.camera import (
    BoardImage,
    camera_file,
    solve_boards,
)
from wildlab.detection.boards import Board
from wildlab.geometry.camera import Camera
from wildlab.geometry.intrinsics import Views, project_board
from wildlab.simulation.boards import board_views

CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0, 0.0, (-0.2, 0.0, 0.0, 0.0, 0.0))
BOARD = Board("chessboard", 9, 6, 0.025)


def images(n=20, noise=0.1, tilt=40.0, seed=1):
    rng = np.random.default_rng(seed)
    views: Views = board_views(rng, CAMERA, BOARD.points, n, np.radians(tilt))
    uv = project_board(CAMERA, views, BOARD.points)
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


def test_the_file_has_all_that_was_found(good):
    content = camera_file(good, "Tau2")
    assert content.camera.fx_px == good.found.camera.fx and content.camera.k1 == good.found.value("k1")
    assert [one.name for one in content.parameter] == ["fx", "fy", "cx", "cy", "k1"]
    assert np.allclose(content.covariance, good.found.covariance)
    assert content.evidence.points == 20 * 54 and len(content.view) == 20
