"""Twins as flights: a trajectory, the sensors that saw it, and the tables they wrote.

`simulate_twin` gives a flight as `load_flight` gives one. What differs from a logged flight is that the nav
source ``truth`` exists; nothing downstream needs it.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.simulation.camera_detections import exposure_times, frames_and_detections
from wildlab.simulation.courses import twin_trajectory
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import twin_land
from wildlab.simulation.manifest import as_flown, twin_manifest
from wildlab.simulation.onboard_sensors import (
    autopilot_tables,
    gimbal_table,
    gnss_table,
    imu_table,
    nav_table,
    payload_boresight,
    sample_times,
)
from wildlab.simulation.parameters import TwinParameters, load_twin
from wildlab.simulation.target_motion import animals_truth, truth_table
from wildlab.simulation.trajectory import Motion, camera_motion, turned

#: Nav sources of a twin.
AUTOPILOT = "autopilot"
UNCALIBRATED = "autopilot-uncalibrated"
TRUTH = "truth"
PAYLOAD_TRUTH = "truth-payload"

#: Tables that take most of the time and most of the room, and that not every study needs.
OPTIONAL_TABLES = ("imu", "gnss")


def simulate_twin(name_or_path: str | Path, seed: int, without: Collection[str] = ()) -> Flight:
    """A twin as a flight in memory. The same seed gives the same flight, to the last bit.

    The nav source ``truth`` is the pose of the airframe with the camera, ``truth-payload`` that of the
    payload with the IMU and the antennas, which is what a navigation system with these sensors can know. A
    twin without such a payload has neither that nor the tables ``imu`` and ``gnss``.

    Parameters
    ----------
    name_or_path
        A twin that comes with wildlab (``"static-antenna"``), or a file like those in ``data/twins``.
    seed
        A whole number from 0.
    without
        Tables to leave out, to save time: any of ``OPTIONAL_TABLES``. The others are the same without them.

    Returns
    -------
    Flight

    Raises
    ------
    WildlabError
        Where the twin or one of its parameters is unusable, its course cannot be flown, the seed is no whole
        number from 0 and below 2^63, ``without`` names another table, or what the twin looks for does not
        come into view often enough.
    """
    return simulate(load_twin(name_or_path), seed, without)


def simulate(twin: TwinParameters, seed: int, without: Collection[str] = ()) -> Flight:
    """As :func:`simulate_twin`, from parameters in memory.

    Parameters
    ----------
    twin
        As `wildlab.simulation.parameters.load_twin` gives it.
    seed
        A whole number from 0.
    without
        Tables to leave out: any of ``OPTIONAL_TABLES``.

    Returns
    -------
    Flight

    Raises
    ------
    WildlabError
        Where the seed is no whole number from 0 and below 2^63, ``without`` names another table, the course
        cannot be flown, or what the twin looks for does not come into view often enough.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
        raise WildlabError(f"{seed!r} is not a seed", "give a whole number from 0", field="seed")
    if unknown := sorted(set(without) - set(OPTIONAL_TABLES)):
        raise WildlabError(
            f"{unknown[0]!r} is not a table that can be left out",
            f"use any of {', '.join(OPTIONAL_TABLES)}",
            field="without",
        )
    seed = int(seed)
    flown = as_flown(twin, seed)  # what the sensors are; the manifest states what is said of them
    trajectory = twin_trajectory(twin, stream(seed, "trajectory"))
    duration = twin.flight.duration.si
    calibrated, uncalibrated = autopilot_tables(
        twin, trajectory(sample_times(twin.autopilot.rate.si, duration)), seed
    )
    nav = {AUTOPILOT: calibrated}
    if uncalibrated is not None:
        nav[UNCALIBRATED] = uncalibrated
    known = trajectory(sample_times(twin.truth.rate.si, duration))
    nav[TRUTH] = nav_table(known)
    frames, detections = frames_and_detections(
        flown, camera_motion(twin, trajectory, exposure_times(twin), seed), seed
    )
    if twin.animals is not None:
        truth = animals_truth(twin, twin.animals, seed)
    else:
        logs = [truth_table(target, duration, seed) for target in twin.targets]
        truth = pd.concat(logs, ignore_index=True)
    tables = {"frames": frames, "detections": detections, "truth": truth}
    if twin.gimbal is not None:
        tables["gimbal"] = gimbal_table(twin.gimbal, duration, seed)
    if twin.boresight is not None:
        boresight = payload_boresight(twin, seed)
        nav[PAYLOAD_TRUTH] = nav_table(turned(known, boresight))

        def payload(times: Array) -> Motion:
            return turned(trajectory(times), boresight)

        if twin.imu is not None and "imu" not in without:
            tables["imu"] = imu_table(flown, payload, seed)
        if twin.gnss is not None and "gnss" not in without:
            tables["gnss"] = gnss_table(flown, payload, seed, twin.gnss)
    return Flight(twin_manifest(twin, seed), nav, tables, terrain=twin_land(twin))
