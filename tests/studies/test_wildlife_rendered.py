"""What tracks from rendered frames are counted as, and that the words turn with these numbers."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.pipeline.animals.follow import Followed, Found, Known
from wildlab.pipeline.animals.frames import NONE, Framed
from wildlab.pipeline.animals.images import Images
from wildlab.simulation.parameters import load_twin
from wildlab.studies.wildlife_tracking import charts
from wildlab.studies.wildlife_tracking import rendered_text as text
from wildlab.studies.wildlife_tracking.rendered import (
    CLOUDS,
    DAWN,
    Counted,
    Rendered,
    Renderings,
    counted,
    run_rendered,
    seen_again,
    telling_image,
    weathers,
)
from wildlab.studies.wildlife_tracking.trial import UAV, World, draw_world, out_of_sight

CAMERA = Camera(64, 48, 100.0, 100.0, 31.5, 23.5)
POSES = CameraPoses.at_lens(CAMERA, np.zeros((4, 3)), np.broadcast_to(np.eye(3), (4, 3, 3)), np.eye(3))
SIGHT = {"rmse": 6.0, "sd": 5.0}
GOOD = Counted(
    shown=40, found=38, further=0, animals=4, detections=40, false=0, standing=0, with_false=0,
    off_px=1.2, tracks=5, by_false=0, sight=SIGHT,
)  # fmt: skip


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
FOLLOWED = Followed(
    [],
    [found(0, 0, 1, True), found(0, 0, 1, False), found(0, NONE, 2, True), found(1, NONE, 2, False),
     found(1, NONE, 3, True), found(3, 1, 4, True)],
    4, 4,
)  # fmt: skip


def test_what_frames_gave_is_counted_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wildlab.studies.wildlife_tracking.rendered.off_px", lambda world, framed: 1.5)
    standing = np.array([True, True, False, True, False, True])
    world: World = None  # type: ignore[assignment]
    got = counted(world, IMAGES, FOLLOWED, Framed(IMAGES, np.zeros((6, 2)), standing))
    assert got.shown == 4 and got.found == 1  # animal 0 in the first image alone
    assert got.further == 1 and got.animals == 2
    assert (got.detections, got.false, got.standing, got.with_false) == (6, 3, 1, 2)
    assert (got.tracks, got.by_false, got.off_px) == (4, 2, 1.5)
    drawn = counted(world, IMAGES, FOLLOWED)
    assert drawn.standing == 0 and np.isnan(drawn.off_px)


def test_a_false_detection_is_no_sighting_and_mixes_a_track() -> None:
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
    empty = Followed([], [], 0, 0)
    by = {
        name: Rendered(None, Framed(one, None, None), empty, None, None, None)  # type: ignore[arg-type]
        for name, one in images.items()
    }
    return Renderings(world, empty, by)


def test_the_frame_shown_has_a_false_detection_where_any_has() -> None:
    clean = images_of([0], [0], IN_VIEW)
    assert telling_image(renderings(dawn=clean)) == 0
    assert telling_image(renderings(dawn=clean, clouds=images_of([2, 3], [NONE, NONE], IN_VIEW))) == 2


def test_the_hour_is_the_suns_at_the_place() -> None:
    by_name = weathers(load_twin("uav-tracking"))
    # 04:00 UTC at 16.43 degrees east: 66 minutes later by the sun.
    assert by_name[DAWN].hour == pytest.approx(4 + 65.7 / 60, abs=0.01) and by_name[DAWN].clouds == 0
    assert by_name[CLOUDS].clouds == 1


def said(drawn: Counted = GOOD, frames: int = 100, **changed: object) -> str:
    return text.weather_words("At dawn", GOOD._replace(**changed), drawn, frames, believed=0.9)


def test_words_on_detections_turn_with_them() -> None:
    assert "38 of 40 (83 to 99 %) are detected, 1.2 px from their middles" in said()
    assert "not different for certain from the 90 %" in said()
    assert "fewer than the 90 %" in said(found=20)
    assert "more than the 90 %" in said(shown=400, found=399)
    assert "no animal is in view" in said(shown=0, found=0, off_px=np.nan)
    assert "not count as in view" not in said()
    assert "detected once that do not count as in view" in said(further=1)
    assert "detected 3 times that do not count as in view" in said(further=3)


def test_words_on_false_detections_turn_with_them() -> None:
    assert "No detection is false: 0 of 100 (0 to 4 %) frames have one." in said()
    many = said(detections=290, false=250, with_false=80, standing=50, tracks=60, by_false=55)
    assert "250 detections are false, 2.5 a frame, in 80 of 100 (71 to 87 %) frames" in many
    assert "50 of 250 (16 to 25 %) of them lie on a stone" in many
    assert "60 tracks begin, 55 of 60 (82 to 96 %) of them by a false detection, where 4 animals" in many
    assert "F's filter starts one on each detection" in many
    assert "5 tracks begin, none by a false detection, where 4 animals are detected." in said()
    few = said(detections=42, false=2, with_false=2, tracks=6, by_false=1)
    assert "6 tracks begin, 1 of 6" in few and "F's filter" not in few
    assert "No track begins." in said(tracks=0)
    assert "1 detection is false, 0.0 a frame" in said(false=1, with_false=1, standing=1)
    assert "1 track begins, none by" in said(tracks=1)


def test_words_on_distance_turn_with_it() -> None:
    better = GOOD._replace(sight={"rmse": 3.0, "sd": 5.0})
    assert "known to 6.0 m (RMS), by drawn detections of the same images to 3.0 m" in said(better)
    assert "Out of sight" not in said(sight={"rmse": np.nan, "sd": np.nan})


def test_the_table_has_a_row_for_each_way() -> None:
    bad = GOOD._replace(false=7, with_false=5, by_false=4, tracks=9, sight={"rmse": np.nan, "sd": np.nan})
    table = text.frames_table(GOOD, {DAWN: GOOD, CLOUDS: bad}, 50)
    assert table["from"].tolist() == ["drawn detections", "frames at dawn", "frames under clouds at noon"]
    assert set(table.columns) == set(text.COLUMNS)
    assert table["false"].tolist() == ["0", "0", "7"] and table["rmse"].tolist() == ["6.0", "6.0", "–"]
    assert table["by_false"][2].startswith("4 of 9") and table["with_false"][2].startswith("5 of 50")


def test_a_paragraph_for_each_weather() -> None:
    both = text.frames_words(GOOD, {DAWN: GOOD, CLOUDS: GOOD}, 100, 0.9)
    assert [one.partition(",")[0] for one in both.split("\n\n")] == ["At dawn", "Under clouds at noon"]
    assert "first 100 images of the multicopter, 2 min" in text.opening_words(100, 99.0)
    assert "first 20 images of the multicopter, 20 s, are" in text.opening_words(20, 20.0)
    assert text.opening_words(1, 0.0).startswith("One image of the multicopter, 0 s, is rendered")


def test_no_frame_at_all_is_refused() -> None:
    with pytest.raises(WildlabError, match="0 frames to be rendered"):
        run_rendered(None, 1, 0)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def beginning() -> Renderings:
    return run_rendered(draw_world(UAV, "uav-tracking", 1), 1, 14)


def test_frames_of_a_world_show_its_animals_where_it_has_them(beginning: Renderings) -> None:
    drawn, by_weather = text.counts_of(beginning)
    assert set(by_weather) == {DAWN, CLOUDS}
    one = by_weather[DAWN]
    assert one.shown == drawn.shown > 0 and one.found > 0
    # The frames are rendered from the true pose; a told one would be tens of pixels off.
    assert one.off_px < 4
    assert one.detections == len(beginning.by_weather[DAWN].framed.uv)


def test_a_frame_is_the_same_when_it_is_seen_again(beginning: Renderings) -> None:
    run = beginning.by_weather[CLOUDS]
    images = run.framed.images
    k = int(images.image[0])
    grey, again, judged = seen_again(beginning.world, run, k)
    rows = images.image == k
    np.testing.assert_array_equal(again.uv, run.framed.uv[rows])
    np.testing.assert_array_equal(judged.animal, images.animal[rows])
    assert grey.dtype == np.uint8


def test_the_figure_says_what_it_draws(beginning: Renderings) -> None:
    fig, name, alt, caption = charts.frames_shown(beginning)
    k = telling_image(beginning)
    in_view = int(beginning.world.images.in_view[k].sum())
    for ax, (weather, one) in zip(fig.axes, beginning.by_weather.items(), strict=True):
        rows = one.framed.images.image == k
        animal = one.framed.images.animal[rows]
        false = int((animal == NONE).sum())
        shown = beginning.world.images.in_view[k]
        words = f"{sum(shown[one] for one in set(animal) - {NONE})} of {in_view} found, {false} false"
        assert ax.get_title(loc="left") == f"{text.WHEN[weather]}: {words}"
        assert words in alt and words in caption
        assert len(ax.patches) == rows.sum()
        beyond = {one for one in set(animal) - {NONE} if not shown[one]}
        assert ("Boxed too" in caption) >= bool(beyond)
    assert name == "frames"


def test_the_summary_counts_tracks_that_false_detections_begin() -> None:
    bad = GOOD._replace(tracks=20, by_false=19, false=80)
    said = text.summary_words({DAWN: GOOD, CLOUDS: bad})
    assert "at dawn 0 of 5 (0 to 43 %)" in said and "under clouds at noon 19 of 20 (76 to 99 %)" in said
    assert "none of 0" in text.summary_words({DAWN: GOOD._replace(tracks=0)})
