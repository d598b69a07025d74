"""The error-state filter beside the one of pyins, on the same logged flight, against the attitude on board.

pyins 1.0 (Nikolay Mayorov) has the same nine states of motion in another frame, and a bias and its random
walk for each sensor. It gets what ours gets: samples, fixes with the latency taken off, deviations, and the
start. Positions and velocities are nobody's truth here: the reference is a third filter, on the same sensors.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.pipeline.test_navigate_logged import THOR_AIRBORNE, euler_differences, rms
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import Flight, load_flight
from wildlab.geometry.frames import matrix_to_euler, ned_to_geodetic, quaternion_to_matrix
from wildlab.geometry.gravity import local_earth
from wildlab.navigation.mekf import run_mekf
from wildlab.navigation.noise import AxisErrors, ImuNoise
from wildlab.navigation.timeline import ImuSamples
from wildlab.paths import DATA
from wildlab.pipeline.navigate import Navigated
from wildlab.pipeline.navigation_inputs import VELOCITY, Inputs, axis_errors, imu_noise, inputs_of

REASON = "pyins is on no package index: put a checkout of it (github.com/nmayorov/pyins, 1.0) on PYTHONPATH"
#: "At least as close": what counts as a tie, whichever is more.
SHARE, ANGLE, SPEED = 0.05, 0.05, 0.02

Array = np.ndarray


class Scored(NamedTuple):
    """RMS in the air of roll, pitch, yaw (deg) and of the velocities (m/s) off those on board, the estimate
    itself, and what it took, s."""

    attitude: Array
    velocity: Array
    nav: pd.DataFrame
    seconds: float


class Thor(NamedTuple):
    flight: Flight
    given: Inputs
    noise: ImuNoise
    pyins: Scored


def compare(flight: Flight, nav: pd.DataFrame, seconds: float) -> Scored:
    attitude = euler_differences(flight, Navigated(nav, pd.DataFrame(), pd.DataFrame()), *THOR_AIRBORNE)
    flown = nav[nav["time_s"].between(*THOR_AIRBORNE)]
    both = flown.merge(flight.nav["onboard"], on="time_s", suffixes=("", "_onboard"))  # rows of one log
    assert len(both) > 0.99 * len(flown)
    off = [both[name] - both[f"{name}_onboard"] for name in VELOCITY]
    return Scored(rms(attitude), rms(np.stack(off, axis=-1)), nav, seconds)


def nav_table(times: Array, velocity: Array, quaternion: Array) -> pd.DataFrame:
    """Without the positions, which are not compared: they lean on the same fixes everywhere."""
    names = ["time_s", *VELOCITY, "q_w", "q_x", "q_y", "q_z", "north_m", "east_m", "down_m"]
    return pd.DataFrame(
        np.column_stack([times, velocity, quaternion, np.zeros((len(times), 3))]), columns=names
    )


def by_pyins(pyins: Any, flight: Flight, given: Inputs, noise: ImuNoise) -> Scored:
    origin, start = flight.manifest.origin_tuple(), given.start
    p_0, v_0, q_0, accelerometer_bias, gyro_bias = np.split(start.state, [3, 6, 10, 13])
    R_0 = quaternion_to_matrix(q_0)
    sd = np.sqrt(np.diag(start.covariance))
    level, _, heading = np.degrees(np.sqrt(np.diag(R_0 @ start.covariance[6:9, 6:9] @ R_0.T)))

    def geodetic(p_n: Array) -> Array:
        return ned_to_geodetic(p_n, origin) * [180 / np.pi, 180 / np.pi, 1.0]

    # It starts with no biases, so those of the start are taken off beforehand.
    t, f, w = given.imu
    after = t >= start.time
    assert t[after][0] == start.time
    imu = pd.DataFrame(
        np.hstack([w - gyro_bias, f - accelerometer_bias])[after],
        index=t[after],
        columns=[f"{name}_{axis}" for name in ("gyro", "accel") for axis in "xyz"],
    )
    position, velocity = given.aiding["position"], given.aiding["velocity"]
    place, speed = ["lat", "lon", "alt"], ["VN", "VE", "VD"]
    # One deviation is meant for all axes; three do as well.
    fixes = pyins.measurements.Position(
        pd.DataFrame(geodetic(position.value), position.times, place), np.sqrt(position.variance[0])
    )
    speeds = pyins.measurements.NedVelocity(
        pd.DataFrame(velocity.value, velocity.times, speed), np.sqrt(velocity.variance[0])
    )
    # Its biases wander freely, ours (H 7.24) come back to zero: driven by the same density.
    walk = walking(noise)
    gyros = pyins.inertial_sensor.EstimationModel(sd[12], noise.angle_random_walk, walk.gyro_bias_sd)
    accelerometers = pyins.inertial_sensor.EstimationModel(
        sd[9], noise.velocity_random_walk, walk.accelerometer_bias_sd
    )
    first = pd.Series(
        np.concatenate([geodetic(p_0), v_0, np.degrees(matrix_to_euler(R_0))]),
        index=[*place, *speed, "roll", "pitch", "heading"],
        name=start.time,
    )
    increments = pyins.strapdown.compute_increments_from_imu(imu, "rate")
    begin = time.perf_counter()
    found = pyins.filters.run_feedback_filter(
        first, sd[0], sd[3], level, heading, increments, gyros, accelerometers, [fixes, speeds]
    ).trajectory
    seconds = time.perf_counter() - begin
    angles = found[["roll", "pitch", "heading"]].to_numpy(float)
    q = Rotation.from_euler("xyz", angles, degrees=True).as_quat()[:, [3, 0, 1, 2]]
    return compare(flight, nav_table(found.index.to_numpy(float), found[speed].to_numpy(float), q), seconds)


def by_wildlab(thor: Thor, noise: ImuNoise, axes: AxisErrors | None, gate_probability: float) -> Scored:
    latitude, _, height = thor.flight.manifest.origin_tuple()
    given = thor.given, local_earth(latitude, height)
    times = thor.pyins.nav["time_s"].to_numpy(float)

    def run():
        (imu, aiding, start), earth = given
        return run_mekf(imu, start, noise, earth, list(aiding.values()), times, axes=axes,
                        gate_probability=gate_probability)  # fmt: skip

    run()  # compiles
    begin = time.perf_counter()
    found = run()
    seconds = time.perf_counter() - begin
    return compare(thor.flight, nav_table(found.times, found.velocity, found.quaternion), seconds)


def walking(noise: ImuNoise) -> ImuNoise:
    """The same noise with biases that never come back to zero."""
    return noise._replace(
        accelerometer_bias_sd=noise.accelerometer_bias_sd * np.sqrt(2 / noise.accelerometer_bias_time),
        accelerometer_bias_time=np.inf,
        gyro_bias_sd=noise.gyro_bias_sd * np.sqrt(2 / noise.gyro_bias_time),
        gyro_bias_time=np.inf,
    )


@pytest.fixture(scope="module")
def thor(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Thor:
    pyins = pytest.importorskip("pyins", reason=REASON)
    into = tmp_path_factory.mktemp("thor") / "flight"
    import_flight(DATA / "recipes" / "umn-thor75.toml", shared_data("logs", "umn_thor75"), into)
    flight = load_flight(into)
    noise = imu_noise(flight)
    given = inputs_of(flight, noise=noise)
    flown = given.imu.times < THOR_AIRBORNE[1] + 1.0  # neither filter looks ahead
    given = given._replace(imu=ImuSamples(*(part[flown] for part in given.imu)))
    return Thor(flight, given, noise, by_pyins(pyins, flight, given, noise))


def show(name: str, scored: Scored) -> None:
    print(f"{name}: {scored.attitude.round(3)} deg, {scored.velocity.round(3)} m/s, {scored.seconds:.2f} s")


@pytest.mark.slow
def test_told_the_same_both_filters_find_the_same(thor: Thor) -> None:
    """Biases that wander freely, true axes, no gate: then nothing is left to differ in but how it is done."""
    ours = by_wildlab(thor, walking(thor.noise), axes=None, gate_probability=1.0)
    show("pyins", thor.pyins)
    show("ours, told the same", ours)
    assert np.abs(ours.attitude - thor.pyins.attitude).max() < 0.03
    assert np.abs(ours.velocity - thor.pyins.velocity).max() < 0.005
    flown = ours.nav["time_s"].between(*THOR_AIRBORNE)
    apart = (ours.nav - thor.pyins.nav)[flown][VELOCITY].to_numpy()
    R_ours, R_theirs = (
        quaternion_to_matrix(nav.loc[flown, ["q_w", "q_x", "q_y", "q_z"]].to_numpy())
        for nav in (ours.nav, thor.pyins.nav)
    )
    cosine = (np.einsum("kij,kij->k", R_ours, R_theirs) - 1) / 2
    turned = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    print(f"apart: {rms(apart).round(3)} m/s, {rms(turned):.3f} deg")
    # It puts a fix to the sample before it, and takes steps of a tenth of a second for its covariance.
    assert rms(apart).max() < 0.03
    assert rms(turned) < 0.1


@pytest.mark.slow
def test_the_filter_is_at_least_as_close(thor: Thor) -> None:
    """The filter as it is delivered, with what the manifest says: axes reckoned with, biases that fade.

    Of the reference's own: its filter finds accelerometers off by 0.36 and -0.39 m/s^2, pyins 0.43 and -0.54.
    Before the manifest stated how far off they may be at switching on, ours took them for 0.09 m/s^2, was
    0.2 deg closer in roll, and 0.04 m/s further in level velocity than pyins.
    """
    pyins, ours = thor.pyins, by_wildlab(thor, thor.noise, axis_errors(thor.flight), gate_probability=0.9999)
    show("pyins", pyins)
    show("ours", ours)
    print(f"pyins takes {pyins.seconds / ours.seconds:.0f} times as long")
    assert (ours.attitude <= np.maximum(pyins.attitude * (1 + SHARE), pyins.attitude + ANGLE)).all()
    assert (ours.velocity <= np.maximum(pyins.velocity * (1 + SHARE), pyins.velocity + SPEED)).all()
    assert ours.seconds < pyins.seconds / 20
