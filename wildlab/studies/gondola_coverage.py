"""Four ways to move the camera of a gondola that goes round five enclosures: what each of them covers.

F 7.5.2 shows maps (figures 7.15 to 7.18) and prints no number of them. The gondola goes where its cable goes;
the land is drawn for each seed, since F's map is not public, and so is where the swing begins.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.plan_coverage import ExecutionErrors, as_planned
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import Terrain
from wildlab.planning.courses import fly
from wildlab.planning.coverage import Coverage, nodes_in
from wildlab.planning.gimbal import (
    NADIR,
    GimbalAngles,
    adapt_roll,
    camera_on_course,
    look_down,
    swing_roll,
    swing_yaw,
    view_inside,
)
from wildlab.simulation.courses import cable_heights, filleted_course, shape_corners
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import TwinParameters, load_twin
from wildlab.studies.uav_coverage import (
    LOOKS,
    camera_of,
    fences_of,
    land_of,
    required,
    seen_numbers,
)

DOWN = "down"
#: Degrees: 45 on either side is printed (F figure 7.16), the pitches are not; -90 is straight down.
YAW_LIMIT, PITCHES = 45.0, (-75.0, -60.0, -45.0)
#: Degrees on either side, not printed: 60 is the limit of F 7.5.1.
LIMITS = (45.0, 60.0, 75.0)
#: The least angle at which the adaptive strategy turns round, degrees. Chosen: half of what an image shows.
LEAST = 15.0
YAW = {f"yaw-pitch{-pitch:.0f}": pitch for pitch in PITCHES}
ROLL = {f"roll-{limit:.0f}": limit for limit in LIMITS}
ADAPT = {f"adaptive-{limit:.0f}": limit for limit in LIMITS}
STRATEGIES = (DOWN, *YAW, *ROLL, *ADAPT)
#: Within so many metres of the cable is close to it. Chosen: what a swing of 45 degrees reaches from 15 m.
NEAR = 15.0
#: How well it is known where the cabin hangs, metres, each axis. Chosen: a cable is surveyed once.
CABIN = 0.5
#: Decisions of the adaptive strategy for each second, whatever the camera's rate: it turns by less than two
#: degrees between two. Chosen.
DECISIONS = 25.0
#: How far apart the places (s) and angles (degrees) are at which the strategy knows what it would see.
#: Chosen: the cabin moves by less than a cell of the land meanwhile.
KNOWN, APART = 0.5, 2.5


class Ride(NamedTuple):
    """One lap along the cable.

    Attributes
    ----------
    times, headings
        (N,) s and radians.
    places
        (N, 3) of the lens in n, metres.
    duration
        s.
    at
        Headings and places at other times: what does not wait for an image asks here.
    """

    times: Array
    headings: Array
    places: Array
    duration: float
    at: Callable[[Array], tuple[Array, Array]]


def ride(twin: TwinParameters, land: Terrain, rate: float, share: float) -> Ride:
    """The gondola's lap, or a share of it, at ``rate`` (Hz): 3 to 20 m above the ground (F 8.2)."""
    route, cable = required(twin.route, "route"), required(twin.cable, "cable")
    corners = shape_corners("racetrack", route.length.si, route.width.si)
    corners += np.array([route.ahead.si, route.right.si])
    cos, sin = np.cos(route.course.si), np.sin(route.course.si)
    way = filleted_course(corners @ np.array([[cos, sin], [-sin, cos]]), route.turn_radius.si)
    course = fly(way, twin.flight.airspeed.si)
    profile = cable_heights(cable, course.duration, course.duration)

    def at(times: Array) -> tuple[Array, Array]:
        places, headings = course.at(times)
        above = np.interp(times, profile[:, 0], profile[:, 1])
        return headings, np.column_stack([places, -land.heights_at(places) - above])

    duration = share * course.duration
    times = np.arange(0.0, duration, 1 / rate)
    return Ride(times, *at(times), duration, at)


def errors_of_execution(twin: TwinParameters) -> ExecutionErrors:
    """The cabin hangs where its cable is; the gimbal holds the attitude as well as the autopilot knows it."""
    a = twin.autopilot
    return ExecutionErrors(
        CABIN, CABIN, a.position_correlation_time.si,
        a.roll_sd.si, a.pitch_sd.si, a.yaw_sd.si, a.attitude_correlation_time.si,
    )  # fmt: skip


def angles_of(
    name: str, twin: TwinParameters, land: Terrain, fences: list[Array], there: Ride, start: float
) -> GimbalAngles:
    """Where the camera looks along a ride. All swing at the rate of the twin's gimbal.

    The adaptive strategy decides `DECISIONS` times a second: images are taken of what it does, and how many
    changes nothing of it.
    """
    g = required(twin.gimbal, "gimbal")
    rate = 4 * g.limit.si / g.period.si
    if name in YAW:
        return swing_yaw(there.times, np.radians(YAW_LIMIT), rate, np.radians(YAW[name]), start)
    if name in ROLL:
        return swing_roll(there.times, np.radians(ROLL[name]), rate, start=start)
    if name not in ADAPT:
        return look_down(there.times)
    known = np.arange(0.0, there.duration, KNOWN)
    headings, places = there.at(known)
    rolls = np.radians(np.arange(-ADAPT[name], ADAPT[name] + APART / 2, APART))
    inside = view_inside(camera_of(twin), places, headings, rolls, NADIR, fences, land)
    limits = (np.radians(LEAST), np.radians(ADAPT[name]))
    times = np.arange(0.0, there.duration + 1 / DECISIONS, 1 / DECISIONS)
    nearest = np.minimum(np.rint(times / KNOWN).astype(np.intp), len(known) - 1)
    return adapt_roll(times, inside[nearest], rolls, limits, rate, start=start).at(there.times)


def poses_of(
    name: str, twin: TwinParameters, land: Terrain, fences: list[Array], there: Ride, seed: int
) -> CameraPoses:
    """Of the images along a ride, as planned: the swing begins where the seed has it."""
    start = float(stream(seed, "swing").uniform())
    angles = angles_of(name, twin, land, fences, there, start)
    return camera_on_course(camera_of(twin), there.places, there.headings, angles)


def near_cable(land: Terrain, there: Ride) -> NDArray[np.bool_]:
    """(R, C) bool: nodes within `NEAR` of the way, over ground."""
    rows, columns = land.height.shape
    close = np.zeros((rows, columns), bool)
    reach = int(np.ceil(NEAR / land.step))
    steps = np.stack(np.meshgrid(*2 * [np.arange(-reach, reach + 1)], indexing="ij"), axis=-1).reshape(-1, 2)
    at = (there.places[:, :2] - (land.north, land.east)) / land.step
    nodes = np.rint(at).astype(int)[:, None] + steps
    far = np.linalg.norm(nodes - at[:, None], axis=-1) * land.step
    inside = (far <= NEAR) & (nodes >= 0).all(axis=-1) & (nodes < (rows, columns)).all(axis=-1)
    close[nodes[inside][:, 0], nodes[inside][:, 1]] = True
    return close


def trial(seed: int, *, twin: str, rate: float, percent_of_lap: float) -> dict[tuple[str, str], float]:
    """All strategies over the land of one seed.

    Parameters
    ----------
    seed
        Of land and swing.
    twin
        Whose cable, enclosures, camera and gimbal it is.
    rate
        Images that are looked at for each second.
    percent_of_lap
        That the gondola goes.
    """
    return all_runs(seed, twin, rate, percent_of_lap)[1]


def all_runs(
    seed: int, twin: str, rate: float, percent_of_lap: float
) -> tuple[dict[str, Coverage], dict[tuple[str, str], float]]:
    """What every one of `STRATEGIES` covers, by name, and the numbers of `trial`."""
    parameters = load_twin(twin)
    land = land_of(seed)
    fences = fences_of(parameters, len(parameters.enclosures))
    there = ride(parameters, land, rate, percent_of_lap / 100)
    inside = nodes_in(land, fences) >= 0
    near = near_cable(land, there)
    runs = {}
    for name in STRATEGIES:
        poses = poses_of(name, parameters, land, fences, there, seed)
        runs[name] = as_planned(land, poses, there.times, LOOKS)
    numbers = {
        (name, key): value
        for name, covered in runs.items()
        for key, value in numbers_of(covered, inside, near, 1 / rate).items()
    }
    return runs, numbers


def numbers_of(
    covered: Coverage, inside: NDArray[np.bool_], near: NDArray[np.bool_], step: float
) -> dict[str, float]:
    """What is compared of a strategy, by name; ``step`` is the time between two images, s."""
    return seen_numbers(covered, inside, step) | {"near": covered.seen[near].mean()}


#: Quantities of the page's table.
TABLE = ("seen", "near", "ground", "share_outside", "in_sight")
#: The settings that are compared in words: of the thesis's limits the middle one.
PLAIN, ADAPTIVE = list(ROLL)[1], list(ADAPT)[1]


def with_share_outside(runs: pd.DataFrame) -> pd.DataFrame:
    """``runs`` with the share of the ground seen that lies outside the enclosures, as ``share_outside``."""
    more = runs.copy()
    for one in STRATEGIES:
        more[one, "share_outside"] = runs[one, "outside"] / runs[one, "ground"]
    return more
