"""Twins in another wind or at another speed still fly, see their target, and say what they cannot show."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix
from wildlab.simulation.courses import twin_trajectory
from wildlab.simulation.landscape import ground_heights
from wildlab.simulation.parameters import TwinParameters, load_twin, scaled, twin_names, varied
from wildlab.simulation.twins import OPTIONAL_TABLES, simulate

quick = partial(simulate, without=OPTIONAL_TABLES)
MOVES = {
    "half the wind": {"flight.wind_speed": 0.5},
    "a fifth more wind": {"flight.wind_speed": 1.2},
    "a fifth slower": {"flight.airspeed": 0.8},
    "a fifth faster": {"flight.airspeed": 1.2},
}


def altitudes(twin: TwinParameters) -> tuple[float, float]:
    """Between which the flight is to be, m, without what control leaves."""
    known = [twin.flight.altitude.si]
    known += [] if twin.climb is None else [twin.climb.altitude.si]
    known += [] if twin.cable is None else [twin.cable.lowest.si, twin.cable.highest.si]
    return min(known), max(known)


@pytest.mark.slow
@pytest.mark.parametrize("name", twin_names())
@pytest.mark.parametrize("move", ["a fifth more wind", "a fifth slower"])
def test_no_twin_breaks_in_another_wind_or_at_another_speed(name, move):
    written = load_twin(name)
    twin = scaled(written, MOVES[move])
    flight = quick(twin, 1)
    for source, nav in flight.nav.items():
        assert np.isfinite(nav.to_numpy(float)).all(), source
    if "gimbal" in flight.tables:
        assert np.isfinite(flight.table("gimbal").to_numpy(float)).all()
    detections, truth = flight.table("detections"), flight.nav["truth"]
    assert np.isfinite(detections[["u_px", "v_px"]].to_numpy()).all()
    lowest, highest = altitudes(twin)
    place = truth[["north_m", "east_m"]].to_numpy()
    height, off = (
        -truth["down_m"].to_numpy() - ground_heights(twin, place),
        5 * twin.flight.altitude_sd.si + 0.5,
    )
    if twin.land is not None:
        off += 0.15 * twin.land.follow.si + 0.5  # what is shorter than that is flown over
    assert lowest - off < height.min() and height.max() < highest + off
    R = quaternion_to_matrix(truth[["q_w", "q_x", "q_y", "q_z"]].to_numpy())
    roll, pitch, _ = np.degrees(matrix_to_euler(R)).T
    assert np.abs(roll).max() < 60 and np.abs(pitch).max() < 30
    if twin.flight.kind is None:
        # A fixed wing keeps its airspeed, but for what the smoothing of its turns takes off the way.
        v = truth[[f"v_{axis}_m_s" for axis in ("north", "east", "down")]].to_numpy()
        blows = twin.flight.wind_from.si + np.pi
        wind = twin.flight.wind_speed.si * np.array([np.cos(blows), np.sin(blows), 0.0])
        assert np.median(np.linalg.norm(v - wind, axis=1)) == pytest.approx(twin.flight.airspeed.si, rel=0.05)
    printed = {target.identifier.text: int(target.observations.number) for target in written.targets}
    seen = detections["target_id"].value_counts().to_dict()
    assert set(printed) <= set(seen) if printed else len(detections) > 0
    for target, most in printed.items():
        # A fifth of the speed changes how long a pass lasts by about as much.
        assert 0.6 * most <= seen[target] <= most


@pytest.mark.parametrize("name", ["fast-vessel", "slow-vessel", "drifting-vessel-eight"])
@pytest.mark.parametrize("move", MOVES)
def test_recording_begins_at_the_same_place_of_the_lap(name, move):
    """Against the target, which the course goes along with."""
    written = load_twin(name)
    begins = np.array([written.camera.recording_start.si])
    there, moved = (
        twin_trajectory(twin, np.random.default_rng(3))(begins)
        for twin in (written, scaled(written, MOVES[move]))
    )
    # Corners are rounded by the time that rolling takes, which is another distance at another speed.
    assert np.linalg.norm(there.position[0] - moved.position[0]) < 20
    course = [np.arctan2(*motion.velocity[0, 1::-1]) for motion in (there, moved)]
    assert np.degrees(abs(np.angle(np.exp(1j * (course[0] - course[1]))))) < 25


def test_what_is_not_moved_is_as_it_is_written():
    written = load_twin("fast-vessel")
    assert written.moved_from is None and scaled(written, {}) is written
    with varied({"flight.wind_speed": 0.5}):
        assert load_twin("fast-vessel").moved_from == written
    twice = scaled(scaled(written, {"flight.wind_speed": 0.5}), {"flight.wind_speed": 2.0})
    assert twice.moved_from == written
    ours, theirs = quick(twice, 1), quick(written, 1)
    for table in ("frames", "detections", "truth"):
        assert ours.table(table).equals(theirs.table(table)), "moved to and fro, it is where it was"


def test_a_wind_that_cannot_be_flown_in_is_refused():
    written = load_twin("fast-vessel")
    with pytest.raises(WildlabError, match="wind_speed"):
        scaled(written, {"flight.wind_speed": 5.0})
    # Slower than the airframe, but not than what goes along with the vessel against it.
    with pytest.raises(WildlabError, match="cannot be flown"):
        quick(scaled(written, {"flight.wind_speed": 3.3}), 1)
