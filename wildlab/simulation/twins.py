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
from wildlab.simulation.aboard import (
    autopilot_tables,
    gnss_table,
    imu_table,
    nav_table,
    payload_attitude,
    ticks,
)
from wildlab.simulation.courses import trajectory
from wildlab.simulation.parameters import TwinParameters, load_twin
from wildlab.simulation.seen import detections_table, exposure_times, frames_table, with_subset
from wildlab.simulation.sensors import stream
from wildlab.simulation.settings import twin_manifest
from wildlab.simulation.targets import truth_table
from wildlab.simulation.trajectory import move

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
    payload with the IMU and the antennas, which is what a navigation system with these sensors can know.

    Parameters
    ----------
    name_or_path
        A twin that comes with wildlab (``"static-antenna"``), or a file like those in ``data/twins``.
    seed
        A whole number from 0.
    without
        Tables to leave out, to save time: any of ``OPTIONAL_TABLES``. The others are the same without them.

    Raises
    ------
    WildlabError
        Where the twin or one of its parameters is unusable, the seed is negative, or the target does not come
        into view often enough.
    """
    return simulate(load_twin(name_or_path), seed, without)


def simulate(twin: TwinParameters, seed: int, without: Collection[str] = ()) -> Flight:
    """As :func:`simulate_twin`, from parameters in memory."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
        raise WildlabError(f"{seed!r} is not a seed", "give a whole number from 0", field="seed")
    if unknown := sorted(set(without) - set(OPTIONAL_TABLES)):
        raise WildlabError(
            f"{unknown[0]!r} is not a table that can be left out",
            f"use any of {', '.join(OPTIONAL_TABLES)}",
            field="without",
        )
    seed = int(seed)
    path, attitude = trajectory(twin, stream(seed, "trajectory"))
    payload = payload_attitude(twin, attitude, seed)
    manifest = twin_manifest(twin, seed)

    duration = twin.flight.duration.si
    calibrated, uncalibrated = autopilot_tables(
        twin, move(path, attitude, ticks(twin.autopilot.rate.si, duration)), seed
    )
    known = ticks(twin.truth.rate.si, duration)
    nav = {
        AUTOPILOT: calibrated,
        UNCALIBRATED: uncalibrated,
        TRUTH: nav_table(move(path, attitude, known)),
        PAYLOAD_TRUTH: nav_table(move(path, payload, known)),
    }
    exposures = exposure_times(twin)
    frames = frames_table(twin, exposures, seed)
    detections = detections_table(twin, manifest, move(path, attitude, exposures), frames, seed)
    truth = [truth_table(target, duration, seed) for target in twin.targets]
    tables = {
        "frames": with_subset(twin, frames, detections),
        "detections": detections,
        "truth": pd.concat(truth, ignore_index=True),
    }
    if "imu" not in without:
        tables["imu"] = imu_table(twin, path, payload, seed)
    if "gnss" not in without:
        tables["gnss"] = gnss_table(twin, path, payload, seed)
    return Flight(manifest, nav, tables)
