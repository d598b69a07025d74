"""Tracks with identities against targets: closed cases, what permutations leave alone, brute force."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.evaluation.identities import Moment, compare_identities, gospa

CUTOFF = 20.0


def scan(time, tracks, targets, hidden=(), ignored=(), P=4.0):
    """Tracks and targets by name, each at (x, y)."""
    return Moment(
        time,
        np.array(list(tracks.values()), float).reshape(-1, 2),
        np.broadcast_to(P * np.eye(2), (len(tracks), 2, 2)),
        list(tracks),
        np.array(list(targets.values()), float).reshape(-1, 2),
        list(targets),
        [name not in hidden for name in targets],
        [name in ignored for name in targets],
    )


def test_a_swap_counts_for_each_track_when_the_targets_are_apart_again():
    """Targets cross at t = 10; tracks turn back there, and hold on to theirs up to half the cut-off."""
    found = compare_identities(
        [
            scan(t, {1: (10 - abs(10 - t), 0), 2: (10 + abs(10 - t), 0)}, {"A": (t, 0), "B": (20 - t, 0)})
            for t in range(31)
        ],
        CUTOFF,
    )
    assert (found.swaps, found.breaks) == (2, 0)
    # 2 (t - 10) passes half of the cut-off at t = 15.
    assert found.followed[14] == {"A": 1, "B": 2}
    assert found.followed[16] == {"A": 2, "B": 1}
    assert [found.targets[name].swaps for name in "AB"] == [1, 1]
    # GOSPA has no memory and sees nothing wrong.
    assert all(one.distance == 0 for one in found.gospa)


def test_tracks_hold_on_up_to_half_the_cutoff():
    """Each is on the other's target from the second scan on."""
    for apart, swaps in ((9.9, 0), (10.1, 2)):
        targets = {"A": (0, 0), "B": (apart, 0)}
        right = scan(0, {1: (0, 0), 2: (apart, 0)}, targets)
        wrong = scan(1, {1: (apart, 0), 2: (0, 0)}, targets)
        assert compare_identities([right, wrong], CUTOFF).swaps == swaps


def test_a_track_that_went_over_leaves_its_target_to_the_new_track_there():
    """Its own target is still within the cut-off of it, and a new track beside that target is on no other."""
    before = scan(0, {1: (0, 0), 2: (12, 0)}, {"A": (0, 0), "B": (12, 0)})
    after = scan(1, {1: (12, 0.5), 3: (0, 2)}, {"A": (0, 0), "B": (12, 0)})
    found = compare_identities([before, after], CUTOFF)
    assert found.followed[1] == {"A": 3, "B": 1} and (found.swaps, found.breaks) == (1, 1)
    assert found.tracks[3].anees == pytest.approx(4 / 4)


def test_where_not_all_targets_are_known_no_track_is_false():
    """At t = 1 a target is there that nobody tells of: neither the track on it nor that minute counts."""
    tracks = {1: (0, 0), 2: (90, 0)}
    scans = [scan(t, tracks if t == 60 else {1: (0, 0)}, {"A": (0, 0)}) for t in (0, 60, 120, 180)]
    whole = compare_identities(scans, CUTOFF)
    assert whole.tracks[2].false and whole.false_tracks_per_minute == pytest.approx(1 / 3)
    scans[1] = scans[1]._replace(complete=False)
    found = compare_identities(scans, CUTOFF)
    assert found.tracks[2][:4] == (0, 0, pytest.approx(np.nan, nan_ok=True), False)
    assert found.tracks[1].scans == 3 == found.tracks[1].on_target
    assert found.gospa[1].distance == 0 < whole.gospa[1].distance
    # Where a track is false, it is so over the minutes that are judged: of four, one is about t = 60.
    late = scan(240, tracks, {"A": (0, 0)})
    assert compare_identities([*scans, late], CUTOFF).false_tracks_per_minute == pytest.approx(1 / 3)


def test_a_break_is_a_new_identity_on_the_same_target():
    tracks = [{1: (0, 0)}, {}, {2: (0, 0)}, {2: (0, 0)}, {1: (0, 0)}]
    found = compare_identities([scan(t, one, {"A": (0, 0)}) for t, one in enumerate(tracks)], CUTOFF)
    assert (found.swaps, found.breaks) == (0, 2)
    assert found.targets["A"] == (5, 0.8, 0.0, 0, 2)
    assert not any(track.false for track in found.tracks.values())


def test_false_tracks_by_the_minute():
    """Two of three tracks are false: one always, one at two of its three scans; the time is half a minute."""
    target = {"A": (0, 0)}
    found = compare_identities(
        [
            scan(0, {1: (0, 0), 2: (50, 0), 3: (50, 50)}, target),
            scan(15, {1: (0, 0), 3: (50, 50)}, target),
            scan(30, {3: (0, 0)}, target),
        ],
        CUTOFF,
    )
    assert [found.tracks[one].false for one in (1, 2, 3)] == [False, True, True]
    assert found.false_tracks_per_minute == pytest.approx(4)
    assert np.isnan(compare_identities([scan(0, {}, target)], CUTOFF).false_tracks_per_minute)


def test_time_to_confirm_counts_from_when_it_is_visible():
    near, far = {"A": (0, 0)}, {"A": (500, 0)}
    found = compare_identities(
        [
            scan(0, {1: (500, 0)}, far, hidden="A"),
            scan(3, {}, near),
            scan(4, {}, near),
            scan(8, {1: (0, 0)}, near, hidden="A"),
            scan(9, {1: (0, 0)}, near),
        ],
        CUTOFF,
    )
    assert found.targets["A"].time_to_confirm == 5
    assert found.targets["A"].tracked == pytest.approx(1 / 3)
    never = compare_identities([scan(0, {}, near)], CUTOFF).targets["A"]
    assert np.isnan(never.time_to_confirm)
    assert never.tracked == 0


def gospa_of(one, cutoff):
    return compare_identities([one], cutoff).gospa[0]


@pytest.mark.parametrize("how", ["hidden", "ignored"])
def test_a_track_on_a_target_that_nobody_asks_for_costs_nothing(how):
    targets = {"A": (0, 0), "B": (100, 0)}
    alone = gospa_of(scan(0, {1: (3, 0)}, targets, **{how: "B"}), CUTOFF)
    both = gospa_of(scan(0, {1: (3, 0), 2: (110, 0)}, targets, **{how: "B"}), CUTOFF)
    assert alone == both
    assert (alone.distance, alone.n_missed, alone.n_false) == (pytest.approx(3), 0, 0)
    # As far off as the cut-off it is on nothing.
    assert gospa_of(scan(0, {1: (3, 0), 2: (120, 0)}, targets, **{how: "B"}), CUTOFF).n_false == 1
    # One target takes one track.
    doubled = scan(0, {1: (3, 0), 2: (99, 0), 3: (101, 0)}, targets, **{how: "B"})
    assert gospa_of(doubled, CUTOFF).n_false == 1


def test_dont_care_takes_no_part_in_swaps_breaks_and_anees_and_hidden_does():
    def run(how):
        target = {"A": (0, 0)}
        return compare_identities(
            [
                scan(0, {1: (0, 0)}, target),
                scan(1, {2: (10, 0)}, target, **{how: "A"}),
                scan(2, {1: (0, 2)}, target),
            ],
            CUTOFF,
        )

    assert run("ignored").breaks == 0
    assert run("hidden").breaks == 2
    assert np.isnan(run("ignored").tracks[2].anees)
    assert run("hidden").tracks[2].anees == pytest.approx(25)
    assert run("ignored").tracks[1].anees == pytest.approx(0.5)


def test_anees_is_that_of_the_errors_and_leaves_out_unknown_covariances():
    rng = np.random.default_rng(3)
    errors = rng.multivariate_normal([0, 0], [[4, 1], [1, 2]], 1000)
    P = np.array([[4.0, 1], [1, 2]])
    scans = [scan(t, {1: tuple(e)}, {"A": (0, 0)}) for t, e in enumerate(errors)]
    found = compare_identities([one._replace(covariances=P[None]) for one in scans], 100.0)
    assert found.tracks[1].anees == pytest.approx(
        np.mean(np.einsum("ni,ij,nj->n", errors, np.linalg.inv(P), errors))
    )
    assert found.tracks[1].anees == pytest.approx(2, abs=0.15)
    unknown = scans[0]._replace(covariances=np.full((1, 2, 2), np.nan))
    mixed = compare_identities([unknown, scans[1]._replace(covariances=P[None])], 100.0)
    assert mixed.tracks[1].anees == pytest.approx(errors[1] @ np.linalg.inv(P) @ errors[1])
    assert np.isnan(compare_identities([unknown], 100.0).tracks[1].anees)


coordinates = st.tuples(st.integers(-30, 30), st.integers(-30, 30))
places = st.lists(coordinates, max_size=4)
runs = st.lists(
    st.tuples(places, places, st.lists(st.sampled_from("vhi"), min_size=4, max_size=4)),
    min_size=1,
    max_size=5,
)


def scans_of(run, names="ABCD", tracks=(0, 1, 2, 3)):
    return [
        scan(
            t,
            dict(zip(tracks, x, strict=False)),
            dict(zip(names, y, strict=False)),
            hidden=[name for name, kind in zip(names, kinds, strict=True) if kind == "h"],
            ignored=[name for name, kind in zip(names, kinds, strict=True) if kind == "i"],
        )
        for t, (x, y, kinds) in enumerate(run)
    ]


@given(runs, st.permutations(range(4)))
def test_permuted_identities_change_nothing_but_names(run, order):
    """Other identities for all time, whatever their order in a scan was, are other names alone."""
    one = compare_identities(scans_of(run), CUTOFF)
    other = compare_identities(scans_of(run, tracks=order), CUTOFF)
    assert other.gospa == one.gospa
    assert other.followed == [{name: order[track] for name, track in at.items()} for at in one.followed]
    assert (other.swaps, other.breaks, other.targets) == (one.swaps, one.breaks, one.targets)
    assert repr({order[track]: life for track, life in one.tracks.items()}) == repr(other.tracks)
    assert other.false_tracks_per_minute == pytest.approx(one.false_tracks_per_minute, nan_ok=True)


@given(places, places)
def test_gospa_of_a_scan_is_gospa_and_symmetric_where_all_are_visible(x, y):
    there = gospa_of(scan(0, dict(enumerate(x)), dict(enumerate(y))), CUTOFF)
    back = gospa_of(scan(0, dict(enumerate(y)), dict(enumerate(x))), CUTOFF)
    assert there == gospa(y, x, CUTOFF)
    assert (there.distance, there.n_missed) == (pytest.approx(back.distance), back.n_false)


def every_pairing(x, y):
    """All sets of pairs of rows of ``x`` and of ``y``."""
    for size in range(min(len(x), len(y)) + 1):
        for rows in itertools.combinations(range(len(x)), size):
            for columns in itertools.permutations(range(len(y)), size):
                yield list(zip(rows, columns, strict=True))


@given(places, places, st.lists(st.booleans(), min_size=4, max_size=4))
def test_dont_care_against_every_pairing(x, y, flags):
    """What the best pairing with all targets leaves, when what lies on don't-care leaves with it."""
    ignored = flags[: len(y)]

    def cost(pairs):
        return sum(np.hypot(*np.subtract(x[i], y[j])) ** 2 for i, j in pairs) + CUTOFF**2 / 2 * (
            len(x) + len(y) - 2 * len(pairs)
        )

    def rest(pairs):
        kept = [pair for pair in pairs if not ignored[pair[1]]]
        lost = len(y) - sum(ignored) - len(kept)
        return sum(np.hypot(*np.subtract(x[i], y[j])) ** 2 for i, j in kept) + CUTOFF**2 / 2 * (
            lost + len(x) - len(pairs)
        )

    ways = list(every_pairing(x, y))
    least = min(map(cost, ways))
    possible = [rest(way) for way in ways if cost(way) <= least + 1e-6]
    hidden = [name for name, flag in zip(range(4), flags, strict=True) if flag]
    found = gospa_of(scan(0, dict(enumerate(x)), dict(enumerate(y)), ignored=hidden), CUTOFF)
    assert np.isclose(found.distance**2, possible, atol=1e-6).any()


def test_the_truth_own_error_is_beside_the_tracks():
    """3 m off with 1 m of its own and a truth known to 2 m: 9 over 5 in one axis."""
    place, truth = np.array([[3.0, 0.0]]), np.zeros((1, 2))
    one = Moment(0.0, place, np.eye(2)[None], ["t"], truth, ["a"], [True], [False], truth_sd=[2.0])
    found = compare_identities([one], 5.0).tracks["t"]
    assert (found.anees, found.anees_alone, found.compared) == (pytest.approx(9 / 5), pytest.approx(9), 1)
