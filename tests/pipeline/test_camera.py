"""A camera from found boards: odd views, coverage, and sentences that turn with their numbers."""

from dataclasses import replace

import numpy as np
import pytest

from wildlab.detection.boards import Board
from wildlab.geometry.board_views import Views, parameters_of, project_board
from wildlab.geometry.camera import Camera
from wildlab.geometry.lens_choice import LensChoice
from wildlab.pipeline import camera_text as text
from wildlab.pipeline.camera import BoardImage, camera_file, coverage, odd_views, solve_boards
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


@pytest.fixture(scope="module")
def odd():
    some = list(images())
    some[4] = replace(some[4], uv=some[4].uv * [1.0, 0.8])
    return solve_boards(tuple(some), BOARD, 640, 512, "k1")


def test_a_view_that_disagrees_is_named_with_figures_without_it(good, odd):
    assert good.odd == () and good.without_odd is None and text.odd_sentences(good) == []
    assert odd.odd == ("4.png",)
    assert odd.without_odd.rms < 0.2 < odd.found.rms
    said = text.odd_sentences(odd)[0]
    assert said.startswith("4.png (") and "disagrees" in said and "(--without 4.png)" in said
    assert f"{odd.without_odd.rms:.3f} px" in said


def test_two_views_that_disagree_are_both_named_and_no_other():
    some = list(images())
    some[4] = replace(some[4], uv=some[4].uv * [1.0, 0.8])
    some[9] = replace(some[9], uv=some[9].uv * [0.9, 1.0])
    both = solve_boards(tuple(some), BOARD, 640, 512, "k1")
    assert set(both.odd) == {"4.png", "9.png"}
    assert both.without_odd.rms < 0.2 and both.without_odd.views.rotation.shape[0] == len(some) - 2


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


def test_how_many_boards_and_which_way_round(good):
    assert text.boards_sentence(good) == "The board is in 20 of 20 images."
    some = (
        *good.images[:-1],
        BoardImage("x.png", "", good.images[-1].uv, True),
        BoardImage("y.png", "is empty"),
    )
    assert "20 of 21 images, in 1 of them light on dark" in text.boards_sentence(replace(good, images=some))
    every = tuple(replace(one, inverted=True) for one in good.images)
    assert "in all of them light on dark" in text.boards_sentence(replace(good, images=every))


def test_which_lens_and_why(good):
    assert text.fit_sentence(good).endswith('with the lens model "k1".')
    tried = replace(good, choice=LensChoice("k1", {"none": 0.9, "k1": 0.2, "full": 0.19}))
    assert 'the best, "full", by 0.190 px, which is no certain gain' in text.fit_sentence(tried)
    best = replace(good, choice=LensChoice("none", {"none": 0.2, "k1": 0.3}))
    assert "a lens that does not bend: on views held out it is off by 0.200 px." in text.fit_sentence(best)


def test_where_the_image_is_not_covered(good):
    assert text.coverage_sentence(good).endswith("% of the image.")
    left = tuple(one for one in images(60) if one.uv[:, 0].max() < 400 and one.uv[:, 1].max() < 330)
    few = solve_boards(left, BOARD, 640, 512, "k1")
    said = text.coverage_sentence(few)
    assert "least at its lower right (" in said and "hold the board there, too" in said
    assert " at the lower right corner" in text.corner_sentence(few)
    assert text.number_sentence(few) and not text.number_sentence(good)


def test_focal_lengths_that_are_known_well_are_not_complained_of(good):
    assert text.rim_px(good.found) < text.MATTERS_PX
    flat = solve_boards(images(8, 0.1, 1.0), BOARD, 640, 512, "none").found
    sd = dict(zip(flat.names, np.sqrt(np.diag(flat.covariance)), strict=True))
    by_hand = max(sd["fx"] / flat.camera.fx, sd["fy"] / flat.camera.fy) * np.hypot(320, 256)
    assert text.rim_px(flat) == pytest.approx(by_hand) and by_hand > text.MATTERS_PX


def test_what_cannot_be_told_apart(good):
    assert text.confusion_sentences(good) == []
    flat = solve_boards(images(8, 0.1, 1.0), BOARD, 640, 512, "none")
    said = text.confusion_sentences(flat)
    assert any(
        "cannot tell" in one and "focal length" in one and "tilt the board more" in one for one in said
    )
    assert any("hardly tells focal length from distance" in one for one in said)
    full = solve_boards(images(), BOARD, 640, 512, "full")
    said = text.confusion_sentences(full)
    assert len(said) == 1 and "k2" in said[0] and "k3" in said[0] and "--lens k1" in said[0]


def test_a_lens_that_folds_before_the_corner_is_said(good):
    folding = replace(good.found, camera=replace(CAMERA, distortion=(-4.0, 0.0, 0.0, 0.0, 0.0)))
    assert "does not reach the upper left corner and" in text.corner_sentence(replace(good, found=folding))


def test_all_sentences_end(good, odd):
    for one in (good, odd):
        assert all(said.endswith((".", ")")) for said in text.sentences(one))
