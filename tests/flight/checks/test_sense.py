"""The parts of the sense checks by themselves: rule, pairs, bounds, each with a right and a wrong one."""

import numpy as np
import pytest

from tests.analysis.survey_twin import Survey, simulate
from wildlab.flight.checks import check, findings, motion
from wildlab.flight.checks.attitude import Felt, FieldStep, felt_mistakes, field_mistakes
from wildlab.flight.checks.findings import attitude_mistakes, axes_words, other_axes, place_mistakes
from wildlab.flight.checks.known_points import sightings
from wildlab.geometry.frames import euler_to_matrix
from wildlab.simulation.twins import simulate_twin

ORIGIN = (np.radians(63.4), np.radians(10.4), 40.0)


def _mistake(cause: str, factor: float) -> findings.Mistake[float]:
    return findings.Mistake(cause, cause, cause, lambda x: x * factor, cause == "fitted")


@pytest.mark.parametrize(
    ("factors", "named"),
    [
        # Only what is far better; of two that explain alike both, and the fitted one last.
        ({"little": 0.7, "much": 0.2, "worse": 3.0}, ["much"]),
        ({"little": 0.7}, []),
        ({"fitted": 0.2, "plain": 0.22, "third": 0.4}, ["plain", "fitted"]),
    ],
)
def test_which_mistakes_are_named(factors, named):
    ways = [_mistake(cause, factor) for cause, factor in factors.items()]
    found = findings.explain(lambda x: np.full((2, 3), x), 4.0, ways)
    assert [one.cause for one in found] == named


@pytest.mark.parametrize(
    ("before", "after", "better"),
    [
        (9.0, [1.0, 1.0, 1.0], True),
        # A half that gets worse is no cause, and what is left has to be like noise.
        (9.0, [1.0, 1.0, 8.0], False),
        (20.0, [5.0, 5.0, 5.0], False),
        (20.0, [2.0, 2.0, 2.0], True),
    ],
)
def test_what_is_far_better(before, after, better):
    assert findings.far_better(np.full((2, 3), before), np.array([after] * 2)) == better


def test_every_attitude_mistake_gives_rotations():
    R = euler_to_matrix(*np.random.default_rng(1).uniform(-0.9, 0.9, (3, 20)))
    for mistake in attitude_mistakes("poses.x"):
        undone = mistake.undo(R)
        if undone is not None:
            assert np.allclose(undone @ np.swapaxes(undone, 1, 2), np.eye(3), atol=1e-9), mistake.cause
            assert np.allclose(np.linalg.det(undone), 1)


@pytest.mark.parametrize(
    ("cause", "read"),
    [
        ("latitude and longitude exchanged", lambda lat, lon, h: (lon, lat, h)),
        ("height in ft, read as m", lambda lat, lon, h: (lat, lon, h / 0.3048)),
        ("longitude negated", lambda lat, lon, h: (lat, -lon, h)),
    ],
)
def test_a_place_mistake_is_undone_exactly(cause, read):
    from wildlab.geometry.frames import geodetic_to_ned, ned_to_geodetic

    right = np.random.default_rng(2).normal(0, 300, (10, 3))
    wrong = geodetic_to_ned(*read(*ned_to_geodetic(right, ORIGIN).T), ORIGIN)
    (mistake,) = [one for one in place_mistakes("gnss", ORIGIN) if one.cause == cause]
    undone = mistake.undo(wrong)
    assert undone is not None
    np.testing.assert_allclose(undone, right, atol=1e-3)


def test_however_well_attitudes_are_stated_the_camera_is_not_known_that_well():
    """Clicks are held against what is expected: beside next to nothing all of them would be wrong."""
    expected = []
    for stated in (1e-9, 0.01, 1.0):
        found = sightings(simulate(Survey(images=6, stated_deg=stated)), "logged")
        expected.append(found.sd[0, [0, 3]])
    assert np.array_equal(expected[0], expected[1]) and (expected[0] > np.radians(0.1)).all()
    assert np.allclose(expected[2], np.radians(1.0))


def test_a_degree_of_latitude_turns_level_by_a_degree():
    assert motion.turned(np.array([111_195.0, 0.0, 0.0]), ORIGIN) == pytest.approx(1.0, abs=0.02)
    # Along a parallel, north turns by the sine of the latitude and level by its cosine.
    assert motion.turned(np.array([0.0, 49_900.0, 0.0]), ORIGIN) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("north", "level"), [(5e3, None), (30e3, "warning"), (300e3, "problem")])
def test_an_origin_far_away(make_flight, north, level):
    flight = make_flight()
    flight.nav["autopilot"]["north_m"] += north
    found = list(motion.origin(flight))
    assert [one.level for one in found] == ([] if level is None else [level])


def test_whole_hours_between_stamps_are_a_zone(make_flight):
    flight = make_flight()
    assert list(check.stamps(flight)) == []
    flight.tables["frames"]["time_s"] += 7200.0
    (found,) = check.stamps(flight)
    assert found.table == "frames" and "2 h late" in found.sentence
    flight.tables["frames"]["time_s"] += 400.0  # no whole quarter of an hour
    assert list(check.stamps(flight)) == []


def test_positions_that_stand_still_are_no_unit_of_speed():
    flight = simulate_twin("fast-vessel", 1)
    nav = flight.nav["autopilot"]
    flight.nav = {"autopilot": nav.assign(north_m=0.0, east_m=0.0, down_m=-300.0)}
    (said,) = [one for one in motion.motion(flight) if one.table != "gnss"]
    assert said.level == "warning" and said.causes == ()


def said_of(words: str) -> np.ndarray:
    """The matrix that ``"x is minus y"`` stands for: what is right, of what is read."""
    M = np.eye(3)
    for clause in words.split(", "):
        right, read = clause.split(" is ")
        row = np.zeros(3)
        row["xyz".index(read[-1])] = -1.0 if read.startswith("minus") else 1.0
        M["xyz".index(right)] = row
    return M


def test_axes_are_undone_as_the_words_say():
    rng = np.random.default_rng(4)
    right = rng.normal(size=(5, 3))
    turns = np.tile(np.eye(3), (5, 1, 1))
    everything = list(other_axes())
    assert len(everything) == 47 and len({M.tobytes() for M in everything}) == 47
    for M in everything:
        words = axes_words(M)
        assert np.array_equal(said_of(words), M)
        read = right @ said_of(words)  # row by row: right = M read, and M has its transpose for inverse
        (mistake,) = [one for one in felt_mistakes("log") if one.cause == f"axes of [imu.rate]: {words}"]
        undone = mistake.undo(Felt(turns, turns, np.ones(5), read, read, turns, right, np.arange(5.0)))
        assert np.allclose(undone.rate, right) and np.array_equal(undone.force, read)
        (mistake,) = [one for one in field_mistakes("log") if one.cause.endswith(f"magnetometer: {words}")]
        seen = mistake.undo(FieldStep(read, read, turns, turns, None))
        assert seen is not None and np.allclose(seen.before, right) and np.allclose(seen.after, right)
