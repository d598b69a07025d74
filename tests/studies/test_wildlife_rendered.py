"""What tracks from rendered frames are counted as."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.analysis.animals.images import NONE, Framed, Images
from wildlab.analysis.animals.tracking import FollowedAnimals, Found, Known
from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.simulation.parameters import load_twin
from wildlab.studies.wildlife_tracking.rendered import (
    CLOUDS,
    DAWN,
    SIMULATED,
    Rendered,
    Renderings,
    count_all,
    counted,
    run_rendered,
    seen_again,
    telling_image,
    weathers,
)
from wildlab.studies.wildlife_tracking.trial import UAV, World, draw_world, out_of_sight

CAMERA = Camera(64, 48, 100.0, 100.0, 31.5, 23.5)
POSES = CameraPoses.at_lens(CAMERA, np.zeros((4, 3)), np.broadcast_to(np.eye(3), (4, 3, 3)), np.eye(3))


def images_of(image: list[int], animal: list[int], in_view: list[list[int]]) -> Images:
    n = len(image)
    return Images(
        np.arange(4) * 20.0, POSES, np.zeros((n, 2)), np.zeros((n, 2, 2)), np.array(image, np.intp),
        np.array(animal, np.intp), np.zeros((4, 2, 2)), np.array(in_view, bool),
    )  # fmt: skip


def found(image: int, animal: int, track: int, started: bool) -> Found:
    return Found(image, animal, track, started, 1.0, 1.0, 1.0, 1.0, 0, np.inf)


IN_VIEW = [[1, 1], [1, 0], [0, 1], [0, 0]]
#: Of animal 0 twice in one image, once of animal 1 while it is not in view, and three of none.
IMAGES = images_of([0, 0, 0, 1, 1, 3], [0, 0, NONE, NONE, NONE, 1], IN_VIEW)
FOLLOWED = FollowedAnimals(
    [],
    [found(0, 0, 1, True), found(0, 0, 1, False), found(0, NONE, 2, True), found(1, NONE, 2, False),
     found(1, NONE, 3, True), found(3, 1, 4, True)],
    4, 4,
)  # fmt: skip


def test_what_frames_gave_is_counted_by_hand():
    got = counted(IMAGES, FOLLOWED)
    assert got.shown == 4 and got.found == 1  # animal 0 in the first image alone
    assert (got.with_false, got.tracks, got.by_false) == (2, 4, 2)


def test_a_false_detection_is_no_sighting_and_mixes_a_track():
    truth, times = np.zeros((4, 2, 2)), np.arange(4) * 20.0
    one = Known(3, np.array([1, 2]), np.array([[3.0, 4.0], [9.0, 9.0]]), np.tile(np.eye(2), (2, 1, 1)))
    seen = [found(0, 1, 1, True), found(2, NONE, 2, True)]
    away = out_of_sight([one], seen, times, truth)
    # The last animal, seen 60 s ago, keeps its own track, though nobody's was detected 20 s ago.
    np.testing.assert_array_equal(away.off, [[3.0, 4.0]])
    assert away.own.tolist() == [True]
    mixed = out_of_sight([one], [*seen[:1], found(1, NONE, 1, False)], times, truth)
    assert mixed.own.tolist() == [False]


def renderings(**images: Images) -> Renderings:
    world = World(*[None] * len(World._fields))._replace(images=images_of([], [], IN_VIEW))  # type: ignore[arg-type]
    empty = FollowedAnimals([], [], 0, 0)
    by = {
        name: Rendered(Framed(one, None), empty, None, None, None)  # type: ignore[arg-type]
        for name, one in images.items()
    }
    return Renderings(world, empty, by)


def test_the_frame_shown_has_a_false_detection_where_any_has():
    clean = images_of([0], [0], IN_VIEW)
    assert telling_image(renderings(dawn=clean)) == 0
    assert telling_image(renderings(dawn=clean, clouds=images_of([2, 3], [NONE, NONE], IN_VIEW))) == 2


def test_the_hour_is_the_suns_at_the_place():
    by_name = weathers(load_twin("uav-tracking"))
    # 04:00 UTC at 16.43 degrees east: 66 minutes later by the sun.
    assert by_name[DAWN].hour == pytest.approx(4 + 65.7 / 60, abs=0.01) and by_name[DAWN].clouds == 0
    assert by_name[CLOUDS].clouds == 1


def test_no_frame_at_all_is_refused():
    with pytest.raises(WildlabError, match="0 frames"):
        run_rendered(None, 1, 0)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def beginning() -> Renderings:
    return run_rendered(draw_world(UAV, "uav-tracking", 1), 1, 14)


@pytest.mark.slow
def test_frames_of_a_world_show_its_animals_where_it_has_them(beginning):
    counts = count_all(beginning)
    assert set(counts) == {SIMULATED, DAWN, CLOUDS}
    one = counts[DAWN]
    assert one.shown == counts[SIMULATED].shown > 0 and one.found > 0


@pytest.mark.slow
def test_a_frame_is_the_same_when_it_is_seen_again(beginning):
    run = beginning.by_weather[CLOUDS]
    images = run.framed.images
    k = int(images.image[0])
    grey, again, judged = seen_again(beginning.world, run, k)
    rows = images.image == k
    np.testing.assert_array_equal(again.uv, run.framed.uv[rows])
    np.testing.assert_array_equal(judged, images.animal[rows])
    assert grey.dtype == np.uint8
