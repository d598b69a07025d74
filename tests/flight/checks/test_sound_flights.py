"""Sound flights are accused of nothing, and a mistake made in one is named, alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.flight.checks.test_mistakes_named import NAV, euler, shift
from tests.sound_flights import simulate_sound_flight, sound_flights
from wildlab.flight.checks.attitude import Felt, heading_error
from wildlab.flight.checks.check import find
from wildlab.flight.checks.findings import Finding, state
from wildlab.flight.store import Flight
from wildlab.simulation.twins import simulate_twin


def turning(
    t: np.ndarray, speed: float, turn: float, seed: int, *, banked: bool, late_s: float = 0.0
) -> Felt:
    """Steady turns by a late receiver; attitude and accelerometer are wrong by what they usually are.

    The nose goes along and the airframe banks, or it stays where it is.
    """
    rng = np.random.default_rng(seed)

    def acceleration(t: np.ndarray) -> np.ndarray:
        return speed * turn * np.stack([-np.sin(turn * t), np.cos(turn * t), 0 * t], axis=1)

    true = Rotation.identity(len(t))
    if banked:
        bank = Rotation.from_euler("X", np.arctan(turn * speed / 9.81))
        true = Rotation.from_euler("Z", (turn * t)[:, None]) * bank
    force = true.inv().apply(acceleration(t) - [0.0, 0.0, 9.81])
    force += rng.normal(0, 1.0, 3) + rng.normal(0, 0.1, force.shape)
    R = (true * Rotation.from_rotvec(rng.normal(0, np.radians(1.5), force.shape))).as_matrix()
    a = acceleration(t - late_s) + rng.normal(0, 0.1, force.shape)
    return Felt(R[:-1], R[1:], np.diff(t), 0 * force[1:], force, R, a, t)


#: Those that fly sideways, look straight down along their course, or have a camera's attitude beside an
#: airframe's inertial sensor.
FEW = [("multirotor", 7), ("gimbal oblique", 10), ("nadir", 6), ("nadir", 10), ("boat", 9)]


def accusations(flight: Flight) -> list[Finding]:
    return [one for one in find(flight) if one.level != "note"]


@pytest.mark.parametrize(("kind", "seed"), FEW)
def test_a_sound_flight_is_not_accused(kind, seed):
    assert accusations(simulate_sound_flight(kind, seed)) == []


@pytest.mark.slow
def test_no_sound_flight_is_accused():
    accused = {(kind, seed): accusations(flight) for kind, seed, flight in sound_flights()}
    assert len(accused) >= 10
    assert {which: found for which, found in accused.items() if found} == {}


@pytest.mark.slow
@pytest.mark.parametrize("twin", ["gondola", "large-ship", "uav-search-low"])
def test_a_twin_is_not_accused(twin):
    assert accusations(simulate_twin(twin, 3)) == []


def focal_length(flight: Flight) -> Flight:
    camera = {name: 1000 * getattr(flight.manifest.camera, name) for name in ("fx_px", "fy_px")}
    return state({"camera": camera})(flight)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "mistake", "cause"),
    [
        ("fixed wing", shift(NAV, 18.0), "clock of the receiver"),
        ("fixed wing", focal_length, "focal length a thousandth"),
        ("multirotor", euler(NAV, lambda e: e[:, [1, 0, 2]]), "attitude: roll and pitch exchanged"),
        ("nadir", shift("frames", 18.0), "clock of the camera"),
    ],
)
def test_a_mistake_that_explains_others_is_named_alone(kind, mistake, cause):
    (found,) = accusations(mistake(simulate_sound_flight(kind, 2)))
    assert cause in found.causes


@pytest.mark.parametrize(("seed", "late_s", "tilt_deg"), [(1, 0.4, 2.0), (1, 1.0, 2.0), (3, 1.0, -3.0)])
def test_a_clock_is_found_beside_a_tilt(seed, late_s, tilt_deg):
    """To a tenth of a second: a search for the clock alone would take the tilt's part, too."""
    flight = shift("frames", -late_s)(simulate_sound_flight("fixed wing", seed))
    (found,) = accusations(euler(NAV, lambda e: e + np.array([0.0, tilt_deg, 0.0]))(flight))
    assert found.causes == ("clock of the camera",)
    offset = found.corrections[0](flight).manifest.clocks.camera_offset_s
    assert offset == pytest.approx(late_s, abs=0.05)


def circling(
    pitch_deg: float,
    heading_deg: float,
    swings: bool,
    noise: float = 0.1,
    roll_deg: float = 0.0,
    seed: int = 1,
) -> Felt:
    """What a sensor feels that is tilted and whose heading is off, on a circle, or on a way that swings."""
    t = np.arange(0.0, 120.0, 0.2)
    course = 1.2 * np.sin(0.15 * t) + 0.4 * np.sin(0.4 * t) if swings else 0.2 * t
    v = 15 * np.stack([np.cos(course), np.sin(course), np.zeros(len(t))], axis=1)
    v *= 1 + swings * 0.3 * np.sin(0.23 * t)[:, None]
    a = np.gradient(v, t, axis=0)
    true = Rotation.from_euler("Z", course[:, None])
    force = true.inv().apply(a - [0.0, 0.0, 9.81])
    a = a + np.random.default_rng(seed).normal(0, noise, v.shape)
    logged = Rotation.from_euler("z", heading_deg, degrees=True) * true
    logged = logged * Rotation.from_euler("yx", [pitch_deg, roll_deg], degrees=True)
    R = logged.as_matrix()
    return Felt(R[:-1], R[1:], np.diff(t), np.zeros((len(t) - 1, 3)), force, R, a, t)


def test_gravity_in_a_tilted_sensor_on_a_circle_is_no_heading():
    assert heading_error(circling(5.6, 0.0, swings=False)) is None


@pytest.mark.parametrize(
    ("t", "speed", "turn", "banked", "late_s"),
    [
        *((np.arange(300.0), 10.0, turn, False, late_s) for turn in (0.25, 0.6) for late_s in (0.2, 0.35)),
        (np.arange(0.0, 1200.0), 12.0, 0.25, True, 0.0),
    ],
)
def test_steady_turns_tell_no_heading(t, speed, turn, banked, late_s):
    for seed in range(4):
        assert heading_error(turning(t, speed, turn, seed, banked=banked, late_s=late_s)) is None


@pytest.mark.parametrize(("pitch_deg", "roll_deg"), [(5.6, 0.0), (15.0, 0.0), (-3.0, 8.0)])
def test_a_heading_is_told_from_a_tilt_where_the_way_swings(pitch_deg, roll_deg):
    assert heading_error(circling(pitch_deg, 0.0, swings=True, roll_deg=roll_deg)) is None
    found = heading_error(circling(pitch_deg, 12.0, swings=True, noise=0.0, roll_deg=roll_deg))
    assert found is not None and np.degrees(found.by) == pytest.approx(12.0, abs=0.5)


def test_a_heading_is_as_sure_as_it_says():
    found = [heading_error(circling(3.0, 20.0, swings=True, noise=1.0, seed=seed)) for seed in range(30)]
    off = [(np.degrees(one.by) - 20.0) / np.degrees(one.sd) for one in found if one is not None]
    # The root mean square of 30 has a standard deviation of 0.13.
    assert len(off) == 30 and 0.6 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_a_heading_from_magnetic_north_is_named():
    magnetic = euler(NAV, lambda e: e + np.array([0, 0, 12.0]))
    (found,) = accusations(magnetic(simulate_sound_flight("fixed wing", 3)))
    assert "heading off" in found.causes


def test_the_heading_error_is_the_turn_between_forces_and_accelerations():
    """Without noise the angle itself, whatever the airframe does."""
    rng = np.random.default_rng(1)
    R = Rotation.random(200, random_state=2)
    moved = rng.normal(0, 2, (200, 3))
    force = R.inv().apply(moved - [0.0, 0.0, 9.80665])
    logged = (Rotation.from_euler("z", 0.21) * R).as_matrix()
    still = np.zeros((200, 3))
    error = heading_error(Felt(logged, logged, np.ones(200), still, force, logged, moved, np.arange(200.0)))
    assert error.by == pytest.approx(0.21, abs=1e-3) and error.sd < 1e-3


def test_a_camera_tilted_by_nine_degrees_is_named():
    flight = simulate_sound_flight("multirotor", 4)
    tilt = flight.manifest.mount.tilt_deg
    (found,) = accusations(state({"mount": {"tilt_deg": tilt + 9.0}})(flight))
    assert found.causes == ("camera turned",)


def test_height_is_no_certain_cause_where_a_tilt_explains_it_too():
    flight = simulate_sound_flight("boat", 3)
    wrong = state({"mount": {"tilt_deg": 8.0}})(flight)
    for one in accusations(wrong):
        assert "constant height" not in one.causes or "camera turned" in one.causes
