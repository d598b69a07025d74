"""All targets at once: one alone is the single filter, long hulls are one, clutter is nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from wildlab.tracking.multitarget import follow_many, run_many, step
from wildlab.tracking.multitarget_tracks import begin, moves
from wildlab.tracking.target_model import POINT, Hull, ManySensorModel, ManyTargetModel, Scan

EYE = ManySensorModel("eye", 0.9, 1e-4, 0.0, 1e6, 3.0, (0.0,), (0.0,), (0.0,))
POINTS = ManyTargetModel(
    (POINT,), density=0.1, start_speed_m_s=3.0, lifetime_s=500.0, birth=0.1, visible_s=100.0, hidden_s=5.0,
    gate=4.5, confirmed=0.9, hits=3, shown=0.5, forgotten=0.01, lost_m=50.0, fastest_m_s=30.0, moves_m=0.0,
    over_s=15.0, apart_m=1.0,
)  # fmt: skip
R, PLATFORM = np.eye(2), np.array([0.0, -500.0])


def look(time: float, *places: Any, **more: Any) -> Scan:
    """A scan of these places (2,), each known to a metre."""
    z = np.reshape(places, (-1, 2)).astype(float)
    usual = {"sensor": 0, "platform": PLATFORM, "z": z, "R": np.tile(R, (len(z), 1, 1))}
    return Scan(float(time), **usual | more)


def never(at: np.ndarray) -> np.ndarray:
    """That no place is in view."""
    return np.zeros(len(at), bool)


def looks(places: np.ndarray, rng: np.random.Generator, clutter: int = 0, seen: float = 1.0) -> list[Scan]:
    """Scans of (N, T, 2) places, a second apart, in no order."""
    found = []
    for t, now in enumerate(places):
        own = now[rng.random(len(now)) < seen]
        z = np.concatenate([own + rng.normal(size=own.shape), rng.uniform(-100, 100, (clutter, 2))])
        found.append(look(t, *rng.permutation(z)))
    return found


def lines(starts: np.ndarray, velocities: np.ndarray, steps: int) -> np.ndarray:
    return starts + velocities * np.arange(steps)[:, None, None]


def test_clutter_alone_is_no_target(rng):
    scans = looks(np.zeros((100, 0, 2)), rng, clutter=4)
    assert sum(len(one.identity) for one in run_many(scans, [EYE], POINTS)) <= 4


def test_what_hides_for_a_while_keeps_its_name(rng):
    scans = looks(lines(np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]]), 60), rng)
    scans = [s if not 30 <= s.time < 38 else look(s.time) for s in scans]
    shown = run_many(scans, [EYE], POINTS)
    assert [len(one.identity) for one in shown[34:38]] == [0] * 4, "not shown while nobody sees it"
    assert shown[29].identity.tolist() == shown[45].identity.tolist() != []


def test_what_is_not_in_view_is_not_missed():
    """The camera turns away for ten looks: a target that was sure stays as sure."""
    scans = looks(lines(np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]]), 30), np.random.default_rng(7))
    away, blind = (
        [one if one.time < 15 else look(one.time, sees=sees) for one in scans] for sees in (never, None)
    )
    existence = [
        [tracks.existence.max() for tracks, _ in follow_many(these, [EYE], POINTS)] for these in (away, blind)
    ]
    assert existence[0][-1] == pytest.approx(existence[0][14]) and existence[1][-1] < 0.9


def test_a_target_gets_older_by_the_time_that_it_is_looked_at():
    """Two sensors that look in turn make it no older than one; the time that nobody looked does not count."""
    targets = POINTS._replace(lifetime_s=20.0, hidden_s=1e-9)
    places = lines(np.array([[0.0, 0.0]]), np.array([[0.5, 0.0]]), 12)
    seen = looks(places, np.random.default_rng(3))

    def after(times: Sequence[float], eyes: int, hidden: tuple[float, float] = (0.0, 0.0)) -> float:
        blind = [
            look(t, sensor=1 + n % eyes, sees=never if hidden[0] < t < hidden[1] else None)
            for n, t in enumerate(times)
        ]
        # A sensor that hardly ever detects: what is left of existence is its age.
        both = [EYE, *[EYE._replace(detection=1e-9)] * eyes]
        *_, (tracks, _) = follow_many([*seen, *blind], both, targets)
        return float(tracks.existence.max())

    start = after([12.0], 1)
    alone = after(range(12, 22), 1)
    assert alone == pytest.approx(start * np.exp(-9 / 20), rel=1e-6)
    assert after(range(12, 22), 2) == pytest.approx(alone, rel=1e-6)
    # Nobody looks at it from 13 s to 20 s: one look in sight before, one after, 1 s each.
    away = after(range(12, 22), 1, (12.5, 20.5))
    assert away == pytest.approx(start * np.exp(-1 / 20), rel=1e-6)


def test_bearings_neither_confirm_nor_end_a_track():
    """Two sightings of three that are asked for: bearings add none, and without them none is missed."""
    seen = looks(lines(np.array([[0.0, 0.0]]), np.array([[0.5, 0.0]]), 2), np.random.default_rng(3))
    eyes = [EYE, EYE._replace(bearings=True, clutter=1e-3)]
    one, none = (np.array([[np.pi / 2]]), np.full((1, 1, 1), 1e-4)), (np.zeros((0, 1)), np.zeros((0, 1, 1)))
    times, across = np.arange(1.1, 3.0, 0.1), []
    for z, R in (one, none):
        scans = [*seen, *(look(t, sensor=1, z=z, R=R) for t in times)]
        steps = list(follow_many(scans, eyes, POINTS))
        before = steps[1][0].existence[0]
        aged = before * np.exp(-(times[-1] - 1.0) / POINTS.lifetime_s)
        assert steps[-1][0].existence[0] == pytest.approx(aged, rel=1e-3)
        assert steps[-1][0].hits[0] == 2 and not len(steps[-1][1].identity)
        across.append(steps[-1][0].P[0, 0, 0, 0])
    assert across[0] < across[1] / 2, "bearings tell where it is across the line of sight"


@pytest.mark.parametrize(
    ("gone", "lasted", "before", "right"),
    [(9.0, 12.0, False, False), (11.0, 12.0, False, True), (7.0, 12.0, True, True), (5.0, 12.0, True, False),
     (5.0, 6.0, True, True), (11.0, 30.0, False, False), (5.0, 12.0, False, False)],
)  # fmt: skip
def test_what_moves(gone, lasted, before, right):
    """10 m within 14 s; slower than half a metre a second it stays; in between it does as before."""
    trail = np.array([[0.0, 0.0, 0.0], [lasted, 0.0, gone]])
    assert moves(trail, before, 10.0, 14.0) is right
    assert moves(trail[:1], before, 10.0, 14.0) is before


def test_a_track_is_shown_as_long_as_the_sensor_that_saw_it_has_patience():
    """A slow sensor saw it; a fast one with little patience, which cannot, does not make it flicker."""
    slow = looks(lines(np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]]), 12), np.random.default_rng(7))
    fast = [look(t, sensor=1) for t in np.arange(0.25, 12, 0.25)]
    eyes = [EYE._replace(patience_s=3.0), EYE._replace(patience_s=0.1, far_m=10.0)]
    shown = [one for one in run_many([*slow, *fast], eyes, POINTS) if one.time > 6]
    assert {len(one.identity) for one in shown} == {1}


def test_order_of_scans_does_not_matter(rng):
    scans = looks(lines(np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]]), 20), rng, clutter=2)
    shuffled = [scans[i] for i in rng.permutation(len(scans))]
    for one, other in zip(run_many(scans, [EYE], POINTS), run_many(shuffled, [EYE], POINTS), strict=True):
        assert one.time == other.time and np.array_equal(one.x, other.x)


def test_many_at_once_and_none(rng):
    """A scan of hundreds, twice, an empty one, and places that are no numbers."""
    crowd = rng.uniform(-1000, 1000, (300, 2))
    crowd[7] = np.nan
    scans = [look(0.0), look(1.0, *crowd), look(2.0, *crowd + 0.3), look(3.0)]
    *_, (tracks, shown) = follow_many(scans, [EYE], POINTS)
    assert not len(shown.identity) and np.isfinite(tracks.x).all()
    assert run_many([], [EYE], POINTS) == []


SHIP = Hull("ship", 30.0, 8.0, 0.4)
BOTH = POINTS._replace(hulls=(POINT._replace(share=0.6), SHIP), apart_m=4.0)
LONG = ManySensorModel("long", 0.9, 1e-5, 0.0, 1e6, 3.0, (0.0, 1.0), (0.0, 6.0), (0.0, 3.0), several=True)


def ship(seed: int, steps: int = 40) -> tuple[np.ndarray, list[Scan]]:
    """A ship of 30 m that gives two or three measurements from its near side in every scan."""
    rng = np.random.default_rng(seed)
    middle = lines(np.array([[-60.0, 30.0]]), np.array([[3.0, 0.0]]), steps)[:, 0]
    scans = []
    for t, place in enumerate(middle):
        along = rng.uniform(-13, 13, rng.integers(2, 4))
        z = np.stack([place[0] + along, np.full(len(along), place[1] - 3.0)], axis=1)
        z += 0.3 * rng.normal(size=z.shape)
        scans.append(look(t, *z, platform=np.array([0.0, -100.0]), R=np.tile(0.1 * R, (len(z), 1, 1))))
    return middle, scans


def test_a_long_hull_is_one_target_and_its_middle_is_found():
    as_one, off = [], []
    for seed in range(4):
        middle, scans = ship(seed)
        shown = run_many(scans, [LONG], BOTH)[15:]
        as_one += [len(one.identity) == 1 and one.kinds[0, 1] > 0.5 for one in shown]
        off += [
            np.linalg.norm(one.x[0, :2] - place)
            for one, place in zip(shown, middle[15:], strict=True)
            if len(one.x)
        ]
    assert np.mean(as_one) > 0.9 and np.mean(off) < 5.0


def test_a_measurement_is_compared_however_far_apart_two_kinds_have_a_target():
    """The measurement is where one kind has it, which is far from the middle of both."""
    targets = POINTS._replace(hulls=(POINT, POINT._replace(name="other")))
    eye, platform = EYE._replace(rough_m=(0.0,) * 2, along_m=(0.0,) * 2, near_side_m=(0.0,) * 2), np.zeros(2)
    tracks = begin(
        np.array([[50.0, 0.0]]), R[None], 0.0, platform, (eye,), 0, targets, 0, np.zeros((1, 2, 0))
    )
    tracks.x[0, 1, 0] = 150.0
    scan = look(0.0, [150.0, 0.0], platform=platform)
    after, free = step(tracks._replace(existence=np.ones(1)), scan, 0.0, 0.0, (eye,), targets, 1)
    assert after.hits.tolist() == [2] and free == 1, "it is the track's, and begins none"
    assert after.kinds[0, 1] > 0.9


def test_bow_and_stern_of_a_known_ship_begin_no_target():
    """15 m off its middle, in no gate, and at a speed at which no track that begins there is a double."""
    targets = POINTS._replace(hulls=(SHIP,))
    tracks = begin(np.zeros((1, 2)), R[None], 0.0, PLATFORM, (EYE,), 0, targets, 0, np.zeros((1, 2, 0)))
    tracks.x[0, 0, 2] = 5.0
    known = tracks._replace(existence=np.ones(1), confirmed=np.ones(1, bool))
    for confirmed, off, began in ((known, 15.0, 0), (known, 30.0, 2), (tracks, 15.0, 2)):
        ends = look(0.0, [off, 0.0], [-off, 0.0])
        _, free = step(confirmed, ends, 0.0, 0.0, (EYE,), targets, 1)
        assert free == 1 + began, off
