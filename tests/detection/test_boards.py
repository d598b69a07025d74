"""Boards are found where they are, warm on cold or cold on warm."""

import cv2
import numpy as np
import pytest

from wildlab.detection import boards
from wildlab.detection.boards import Board, find_board, grey8
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.intrinsics import Views, project_board
from wildlab.simulation.boards import board_image

CAMERA = Camera(320, 256, 420.0, 424.0, 156.0, 131.0, 0.0, (-0.15, 0.1, 0.0, 0.0, 0.0))
BOARDS = (
    Board("chessboard", 7, 5, 0.03),
    Board("circles", 6, 5, 0.03),
    Board("staggered circles", 4, 7, 0.02),
)


def pose(board, tilt=(15.0, -20.0, 12.0), distance=0.5):
    R = euler_to_matrix(*np.radians(tilt))
    return R, np.array([0.01, -0.01, distance]) - R @ board.points.mean(axis=0)


def image(board, rng, warm, cold):
    R, t = pose(board)
    wide = board.spacing * (2 if board.pattern == "staggered circles" else 1)
    clean = board_image(
        CAMERA, R, t, board.points, wide, circles=board.pattern != "chessboard", warm=warm, cold=cold
    )
    return cv2.GaussianBlur(clean, (0, 0), 0.6) + rng.normal(0, 2, clean.shape)


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.pattern)
@pytest.mark.parametrize(("warm", "cold"), [(200.0, 50.0), (50.0, 200.0)])
def test_points_lie_where_they_are_whichever_side_is_warm(board, warm, cold):
    seen = find_board(grey8(image(board, np.random.default_rng(1), warm, cold)), board)
    R, t = pose(board)
    true = project_board(CAMERA, Views(R[None], t[None]), board.points)[0]
    # Which corner is the first is not to be told on a symmetric board.
    error = min(np.abs(seen.uv - order).max() for order in (true, true[::-1]))
    assert error < 0.35
    if board.pattern != "chessboard":
        assert seen.inverted == (cold > warm)


def test_counts_and_kelvin_are_as_good_as_grey():
    board = BOARDS[0]
    grey = image(board, np.random.default_rng(2), 200.0, 50.0)
    reference = find_board(grey8(grey), board).uv
    for other in (
        (7000 + 4 * grey).astype(np.uint16),
        (280 + grey / 20).astype(np.float32),
        np.dstack([grey] * 3),
    ):
        np.testing.assert_allclose(find_board(grey8(other), board).uv, reference, atol=0.1)


def test_a_few_hot_pixels_and_lost_ones_do_not_make_the_rest_dark():
    scene = np.tile(np.linspace(280.0, 290.0, 100), (100, 1))
    plain = grey8(scene)
    scene[0, :5] = 2000.0
    scene[1, :5] = np.nan
    assert abs(int(grey8(scene)[50, 50]) - int(plain[50, 50])) <= 3
    assert not grey8(np.full((4, 4), 7)).any() and not grey8(np.full((4, 4), np.nan)).any()


def test_what_is_not_there_is_not_found():
    noise = np.random.default_rng(3).normal(100, 30, (128, 160))
    assert all(find_board(grey8(noise), board) is None for board in BOARDS)
    assert (
        find_board(grey8(image(BOARDS[0], np.random.default_rng(1), 200, 50)), Board("chessboard", 9, 8))
        is None
    )


def test_corners_are_where_edges_cross():
    """Nearer than the finder says, over views; and what is too far off to be a corner stays where it was."""
    board, errors = BOARDS[0], {"found": [], "refined": []}
    for seed, tilt in enumerate([(15.0, -20.0, 12.0), (-25.0, 10.0, 40.0), (5.0, 30.0, -60.0)]):
        R, t = pose(board, tilt)
        rng = np.random.default_rng(seed)
        clean = board_image(CAMERA, R, t, board.points, board.spacing, warm=200.0, cold=50.0)
        grey = grey8(cv2.GaussianBlur(clean, (0, 0), 0.6) + rng.normal(0, 2, clean.shape))
        true = project_board(CAMERA, Views(R[None], t[None]), board.points)[0]
        found = true + rng.normal(0, 0.4, true.shape)
        refined = boards._refined(found, grey, board)
        errors["found"].append(found - true)
        errors["refined"].append(refined - true)
        far = true.copy()
        # The edges cross within the window, and yet farther off than a corner may move.
        far[0] = true[0] - 0.22 * (true[1] - true[0])
        assert np.allclose(boards._refined(far, grey, board)[0], far[0])
    found, refined = (np.sqrt(np.mean(np.square(errors[key]))) for key in ("found", "refined"))
    assert refined < 0.3 * found
