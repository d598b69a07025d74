"""The crossing from rendered frames: whose a detection is, where it is put, and what is counted of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wildlab.analysis.rendered import ImageScore, Photographer, Shot, exposures_of
from wildlab.detection.detections import Detections, no_detections
from wildlab.errors import WildlabError
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.scene.render import SeenBody
from wildlab.simulation.twins import simulate_twin
from wildlab.studies import crossing_vessels
from wildlab.studies.crossing_vessels import detected_table, rendered_table
from wildlab.studies.crossing_vessels import rendered as study
from wildlab.studies.crossing_vessels.rendered import (
    WHOLE,
    Placed,
    Rendering,
    Spotted,
    associate,
    count,
    drawn_at_sea,
    follow,
    frames_in,
    on_the_sea,
    part_of,
    render_crossing,
    render_flights,
    spot,
)
from wildlab.studies.crossing_vessels.trial import (
    BOATS,
    DISTANCE,
    FEATURES,
    JOINT,
    NONE,
    WINDOW_S,
    Crossing,
    apart_times,
    follow_by,
    gather,
    identities_of,
    wrong_of,
)
from wildlab.tracking.association import Appearance
from wildlab.tracking.many.bank import Bank, Looks

TWIN, SEED = "crossing-vessels", 7
SHAPE = (100, 200)
INTERVAL = 0.5


@pytest.fixture(scope="module")
def flight():
    return simulate_twin(TWIN, SEED, ("imu", "gnss"))


@pytest.fixture(scope="module")
def rendering(flight) -> Rendering:
    """One in so many frames of the crossing."""
    return render_crossing(TWIN, SEED, 2, lambda done, total: None, flight=flight, every=25)


def things(uv: list[list[float]], box: list[list[float]] | None = None) -> Detections:
    """Detections at pixels, in the middle of boxes of 10 px where none are given."""
    n, at = len(uv), np.array(uv, float).reshape(-1, 2)
    boxes = np.column_stack([at - 5, np.full((n, 2), 10.0)]) if box is None else np.array(box, float)
    one = np.ones(n)
    return Detections(
        at, np.tile(np.eye(2), (n, 1, 1)), 100 * one, 7 * one, boxes, np.ones((n, 2)), one,
        np.tile(np.arange(1.0, 8), (n, 1)), one,
    )  # fmt: skip


def in_view(number: int, share: float = 1.0) -> SeenBody:
    nothing = np.zeros(2)
    return SeenBody(
        number, "vessel", nothing, nothing, nothing, np.zeros((3, 2)), share * 100, share, share * 100
    )


def shot(exposure: int, found: Detections, judged: ImageScore, *seen: SeenBody) -> Shot:
    return Shot(exposure, seen, found, judged)


SHOTS = [
    # Each alone, the second first; and one of nothing.
    shot(
        3,
        things([[50, 50], [90, 50], [20, 20]]),
        ImageScore({2: [0], 1: [1]}, set(), 1),
        in_view(1),
        in_view(2),
    ),
    # Both as one, and a second piece of boat 1.
    shot(5, things([[50, 50], [80, 50]]), ImageScore({1: [0, 1], 2: []}, {2}, 0), in_view(1), in_view(2)),
    shot(6, no_detections(), ImageScore({1: []}, set(), 0), in_view(1)),
    # Cut by the left border.
    shot(8, things([[4, 50]]), ImageScore({2: [0]}, set(), 0), in_view(2, 0.7)),
    shot(9, no_detections(), ImageScore({}, set(), 0)),
]  # fmt: skip


def test_each_detection_has_the_vessel_that_it_was_judged_to_be():
    spotted = spot(SHOTS, SHAPE)
    assert spotted.boat.tolist() == [1, 0, NONE, 0, 0, 1]
    assert spotted.exposure.tolist() == [3, 3, 3, 5, 5, 8]
    assert spotted.both.tolist() == [False, False, False, True, False, False]
    assert spotted.cut.tolist() == [False] * 5 + [True]
    assert spotted.share.tolist() == [[1, 1], [1, 1], [1, 0], [0, 0.7], [0, 0]]
    assert spotted.hu.tolist() == [1.0] * 6, "the first of seven"
    np.testing.assert_array_equal(spotted.frames, [3, 5, 6, 8, 9])


def test_counts_are_those_by_hand():
    counted = count(spot(SHOTS, SHAPE))
    assert (counted.frames, counted.false) == (5, 1)
    assert (counted.whole, counted.found, counted.joined, counted.missed) == (5, 3, 1, 1)


def test_no_image_is_no_detection():
    spotted = spot([], SHAPE)
    assert len(spotted.boat) == len(spotted.uv) == len(spotted.frames) == 0
    assert set(count(spotted)) == {0}


def test_some_detections_leave_what_was_to_see_as_it_was():
    spotted = spot(SHOTS, SHAPE)
    some = spotted.of(~spotted.cut)
    assert some.boat.tolist() == spotted.boat.tolist()[:5] and len(some.uv) == len(some.area) == 5
    assert some.share is spotted.share


def drawn_as_spotted(flight) -> Spotted:
    """What a detector that finds exactly the drawn detections gives."""
    table = flight.table("detections").sample(frac=1, random_state=3)  # in whatever order
    exposure, n = exposures_of(table).astype(np.int64), len(table)
    frames = np.unique(exposure)
    none = np.zeros((len(frames), 2), bool)
    return Spotted(
        frames, exposure, table[["u_px", "v_px"]].to_numpy(float), np.full(n, 100.0), np.full(n, 7.0),
        np.full(n, 0.2), np.array([BOATS.index(name) for name in table["target_id"]]),
        np.zeros(n, bool), np.zeros(n, bool), np.zeros((len(frames), 2)), none, none,
    )  # fmt: skip


def test_a_detector_that_finds_the_drawn_detections_gives_their_result(flight):
    placed, crossing = on_the_sea(flight, drawn_as_spotted(flight)), drawn_at_sea(flight)
    np.testing.assert_array_equal(placed.crossing.looks.image, crossing.looks.image)
    np.testing.assert_array_equal(placed.crossing.boat, crossing.boat)
    np.testing.assert_array_equal(placed.crossing.looks.positions, crossing.looks.positions)
    np.testing.assert_array_equal(placed.crossing.truth, crossing.truth)
    assert placed.crossing.looks.interval == crossing.looks.interval
    one, other = (follow_by(each, DISTANCE) for each in (placed.crossing, crossing))
    np.testing.assert_array_equal(one.track, other.track)
    assert associate(placed, one).wrong == wrong_of(crossing, other).sum()


def test_on_the_level_of_the_sea_places_are_those_of_the_study_but_for_the_receivers_heights(flight):
    """At the same heights they are the same to the last bit; heights are off by metres, and so are places."""
    here, there = drawn_at_sea(flight), gather(flight)
    np.testing.assert_array_equal(here.boat, there.boat)
    moved = np.linalg.norm(here.looks.positions - there.looks.positions, axis=1)
    assert 0 < np.median(moved) < 3
    level = flight.table("truth").assign(down_m=0.0)
    flat = gather(replace(flight, tables=flight.tables | {"truth": level}))
    np.testing.assert_array_equal(flat.looks.positions, here.looks.positions)


def test_whose_a_detection_is_has_no_part_in_where_it_is_put(flight):
    spotted = drawn_as_spotted(flight)
    nobody = on_the_sea(flight, spotted._replace(boat=np.full(len(spotted.boat), NONE))).crossing
    crossing = drawn_at_sea(flight)
    order = np.lexsort((nobody.looks.positions[:, 0], nobody.looks.image))
    other = np.lexsort((crossing.looks.positions[:, 0], crossing.looks.image))
    np.testing.assert_array_equal(nobody.looks.positions[order], crossing.looks.positions[other])


@pytest.mark.slow
def test_frames_are_those_with_a_vessel_near_and_one_in_ten_others(rendering, flight):
    scenes = Photographer(TWIN, SEED).flight
    until, since = apart_times(drawn_at_sea(flight))
    assert rendering.span == (until - WINDOW_S, since + WINDOW_S)
    near, sea = frames_in(scenes, rendering.span)
    shown = scenes.near().any(axis=1)
    assert shown[near].all() and not shown[sea].any()
    for rows in (near, sea):
        assert scenes.times[rows].min() >= rendering.span[0] and scenes.times[rows].max() <= rendering.span[1]
    assert len(near) + 10 * len(sea) == pytest.approx(rendering.exposures, abs=9)
    np.testing.assert_array_equal(rendering.spotted.frames, near[::25])
    assert rendering.sea.frames == len(sea[::25])


@pytest.mark.slow
def test_a_detection_is_of_the_vessel_that_is_nearest_in_the_image(rendering):
    scenes, spotted = Photographer(TWIN, SEED).flight, rendering.spotted
    rows = np.flatnonzero((spotted.boat != NONE) & ~spotted.both)
    assert len(rows) > 30
    for row in rows:
        exposure = int(spotted.exposure[row])
        pose = scenes.poses.take(np.array([exposure]))
        middles = np.array([body.centre(0.0) for body in scenes.bodies(exposure)])
        uv = ground_to_pixel(pose.camera, middles, np.tile(pose.p_nc, (2, 1)), np.tile(pose.R_nc, (2, 1, 1)))
        away = np.linalg.norm(uv - spotted.uv[row], axis=1)
        assert away.argmin() == spotted.boat[row] and away.min() < 40


@pytest.mark.slow
def test_places_are_as_far_off_as_the_told_pose_makes_drawn_ones(rendering):
    """In one frame both have the same error of pose; nothing else is metres off."""
    places = {}
    for name, one in (("frames", rendering.frames.crossing), ("drawn", rendering.drawn.crossing)):
        places[name] = {
            (int(image), int(boat)): place
            for image, boat, place in zip(one.looks.image, one.boat, one.looks.positions, strict=True)
        }
    same = [np.linalg.norm(places["frames"][key] - places["drawn"][key])
            for key in places["frames"].keys() & places["drawn"].keys()]  # fmt: skip
    assert len(same) > 15
    assert np.median(same) < 3 < np.nanmedian(rendering.frames.off)


@pytest.mark.slow
def test_looks_are_the_detections_own(rendering, flight):
    spotted = rendering.spotted
    placed = on_the_sea(flight, spotted)
    row_of = {int(frame): k for k, frame in enumerate(spotted.frames)}
    at = [row_of[int(image)] for image in placed.crossing.looks.image]
    whole = (spotted.share[at, placed.crossing.boat] >= WHOLE) & ~placed.both
    for boat, length in enumerate((11.0, 7.0)):
        size = np.exp(placed.appearance.features[whole & (placed.crossing.boat == boat), 0])
        assert len(size) > 10
        assert np.median(size) == pytest.approx(length**2 / 3, rel=0.5)
    assert len(np.unique(placed.appearance.features[:, 0])) == len(placed.appearance.features), "not drawn"


@pytest.mark.slow
def test_all_ways_are_followed_by_every_rule(rendering):
    assert rendering.near == count(rendering.spotted)
    for one in (rendering.frames, rendering.inside, rendering.drawn):
        assert set(one.by_rule) == {*study.SUBJECTS, JOINT}
        assert len(one.off) == len(one.crossing.boat)
    cut = int(rendering.spotted.cut.sum())
    assert cut > 0 and len(rendering.inside.crossing.boat) == len(rendering.frames.crossing.boat) - cut
    assert rendering.drawn.by_rule[DISTANCE].own == len(rendering.drawn.crossing.boat)


def test_a_part_in_time_has_its_ends():
    crossing = passing(images=10)
    part = part_of(crossing, (1.0, 2.0))
    np.testing.assert_array_equal(part.times, [1.0, 1.5, 2.0])
    assert part.looks.image.tolist() == [2, 2, 3, 3, 4, 4]
    assert part.truth.shape == (2, 3, 2) and part.boat.tolist() == [0, 1] * 3
    whole = part_of(crossing, (0.0, 99.0))
    np.testing.assert_array_equal(whole.looks.positions, crossing.looks.positions)


def passing(images: int = 40) -> Crossing:
    """Two 400 m from each other, seen in every image where they are."""
    when = np.arange(images)
    truth = np.array([np.column_stack([np.full(images, north), when * 1.0]) for north in (0.0, 400.0)])
    looks = Looks(np.repeat(when, 2), truth.transpose(1, 0, 2).reshape(-1, 2).copy(), INTERVAL)
    return Crossing(looks, np.tile([0, 1], images), when * INTERVAL, truth)


def placed_of(crossing: Crossing, **marks: np.ndarray) -> Placed:
    none = np.zeros(len(crossing.boat), bool)
    looks = Appearance(crossing.boat[:, None].astype(float), np.ones(1), np.ones(1))
    return Placed(crossing, looks, none)._replace(**marks)


def bank_of(crossing: Crossing, track: np.ndarray, started: list[int]) -> Bank:
    images = np.unique(crossing.looks.image)
    x = np.full((len(images), len(started), 4), np.nan)
    P, n = np.full((*x.shape, 4), np.nan), len(started)
    never, sure = np.full(n, -1), np.ones(n, bool)
    return Bank(track, np.array(started, int), images, x, P, np.arange(n), never, sure)


def test_two_far_apart_are_two_tracks_and_nothing_is_wrong():
    done = follow(placed_of(passing()))
    one = done.by_rule[FEATURES]
    assert (one.own, one.wrong, one.tracks) == (80, 0, 2)
    assert not one.swapped and one.swaps == 0
    np.testing.assert_allclose(done.off, 0)
    joint = done.by_rule[JOINT]
    assert joint.wrong is joint.tracks is None and not joint.swapped


def test_what_a_rule_did_is_counted_by_hand():
    crossing = passing(images=5)
    boat = crossing.boat.copy()
    boat[[4, 9]] = NONE
    crossing = crossing._replace(boat=boat)
    #  boat:          0  1  0  1 NONE 1  0  1  0 NONE
    track = np.array([0, 1, 1, 1, 2, 2, 0, -1, 1, 0])
    bank = bank_of(crossing, track, [0, 1, 4])
    one = associate(placed_of(crossing), bank)
    assert (one.own, one.wrong, one.unassigned, one.tracks) == (8, 2, 1, 3)
    both = np.zeros(10, bool)
    both[2] = True
    right = associate(placed_of(crossing, both=both), bank)
    assert (right.own, right.wrong) == (7, 1), "of both is right on either's"


def test_without_any_track_nothing_is_wrong():
    crossing = passing(images=3)
    bank = bank_of(crossing, np.full(6, -1), [])
    assert not wrong_of(crossing, bank).any()
    assert associate(placed_of(crossing), bank).unassigned == 6


def test_a_detection_of_nothing_shows_no_vessel():
    crossing = passing(images=20)
    seen = crossing._replace(boat=np.tile([NONE, NONE], 20))
    bank = bank_of(seen, np.full(40, -1), [])
    assert all(life.visible == 0 for life in identities_of(seen, bank).targets.values())
    assert any(life.visible > 0 for life in identities_of(crossing, bank).targets.values())


def test_nothing_detected_is_refused(flight):
    with pytest.raises(WildlabError, match="nothing is detected") as found:
        on_the_sea(flight, spot(SHOTS, SHAPE).of(np.zeros(6, bool)))
    assert found.value.field == "detections"


def test_frames_of_another_flight_are_refused(flight):
    first = flight.table("frames").iloc[:1]
    with pytest.raises(WildlabError, match="exposure 3"):
        on_the_sea(replace(flight, tables=flight.tables | {"frames": first}), spot(SHOTS, SHAPE))


def test_fewer_flights_than_none_are_refused():
    with pytest.raises(WildlabError, match="-1 flights"):
        render_flights(TWIN, 6, -1, 8)
    assert render_flights(TWIN, 6, 0, 8) == []


def test_flights_are_those_after_the_chosen_one(monkeypatch):
    monkeypatch.setattr(study, "render_crossing", lambda twin, seed, images, tell: seed)
    assert render_flights(TWIN, 6, 2, 8) == [7, 8]


@pytest.mark.slow
def test_a_frame_is_the_same_when_it_is_seen_again(rendering):
    exposure = crossing_vessels.telling_exposures(rendering)[0]
    picture = crossing_vessels.picture_of(TWIN, rendering, exposure)
    np.testing.assert_array_equal(
        picture.spotted.uv, rendering.spotted.uv[rendering.spotted.exposure == exposure]
    )
    assert picture.apart == pytest.approx(
        rendering.frames.crossing.apart[rendering.frames.crossing.times == frame_time(rendering, exposure)][0]
    )


def frame_time(rendering: Rendering, exposure: int) -> float:
    crossing = rendering.frames.crossing
    return float(crossing.times[list(np.unique(crossing.looks.image)).index(exposure)])


@pytest.mark.slow
def test_tables_and_figure_are_of_what_was_rendered(rendering):
    (detected,) = detected_table([rendering]).to_dict("records")
    assert (detected["flight"], detected["whole"]) == (str(SEED), rendering.near.whole)
    assert detected["missed"] == rendering.near.whole - detected["found"] - detected["joined"]
    names = {rule: rule for rule in (*study.SUBJECTS, JOINT)}
    table = rendered_table([rendering, rendering], names).set_index("rule")
    one = rendering.frames.by_rule[DISTANCE]
    assert table.loc[DISTANCE, "frames_wrong"] == pytest.approx(100 * one.wrong / one.own)
    assert table.loc[DISTANCE, "frames_swapped"] == 2 * one.swapped
    assert np.isnan(table.loc[JOINT, "drawn_wrong"]), "no detection is one track's"
    assert crossing_vessels.plot_frames(TWIN, [rendering]) is not None
