"""What there is to know of a flight whatever it lacks: its streams, its path, what is wrong on it, what its
images have shown of the ground, and what a log has lost of it.

Nothing here needs a certain table: where one lacks, what would come of it is None, or an empty table.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.georeference import camera_poses, observe, truth_of
from wildlab.errors import WildlabError
from wildlab.evaluation.streams import FINE, HARMFUL, Pace, pace_of, runs_of, vibration_of
from wildlab.flight.clocks import frame_poses, frame_times, gimbal_angles, gnss_times, longest_gap
from wildlab.flight.schema import POSITION, QUATERNION, VELOCITY
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, Mask, matrix_to_euler, quaternion_to_matrix
from wildlab.geometry.georeference import georeference_pixels, pixel_rays, pixels_to_terrain

#: Rays along each side of an image, and how far below the horizon (rad) all of them have to point: flatter
#: ones end anywhere.
SIDE, FLATTEST = 5, np.radians(5.0)
#: Cells of the grid across the narrower side of a usual footprint, and at most in all.
ACROSS, MOST_CELLS = 40, 4_000_000


class Coverage(NamedTuple):
    """Images on the ground.

    Attributes
    ----------
    posed
        (N,) bool, those with a pose and gimbal angles.
    flat
        (N,) bool, posed ones that look too near the horizon to have a footprint.
    outlines
        (N, B, 2) m north and east, the border of each on the ground; NaN where it has none.
    counts
        (R, C) how many images show a cell.
    north, east, step
        Of the centre of the cell (0, 0), and between cells, m; rows run north.
    ground
        In words: what the footprints lie on.
    """

    posed: Mask
    flat: Mask
    outlines: Array
    counts: NDArray[np.int32]
    north: float
    east: float
    step: float
    ground: str

    @property
    def placed(self) -> Mask:
        """(N,) bool: the images with a footprint."""
        return np.asarray(np.isfinite(self.outlines).all(axis=(1, 2)))

    @property
    def area_m2(self) -> float:
        """Of the ground that at least one image shows."""
        return float((self.counts > 0).sum()) * self.step**2


def ground_height(flight: Flight) -> tuple[float, str] | None:
    """Down coordinate of level ground, and where it is from: the truth, else the detections; None without.

    Of a truth it is the mean of the points that never move, as an import has it, and the tracks of targets,
    whose heights are a receiver's, only where there are none.
    """
    truth, detections = flight.truth, flight.detections
    if truth is not None and np.isfinite(truth["down_m"]).any():
        known = truth[np.isfinite(truth["down_m"])]
        fixed = known[known["time_s"].isna()]
        if len(fixed):
            what = "surveyed point" if flight.manifest.kind == "logged" else "fixed point"
            words = f"level ground at the mean height of {len(fixed)} {what}{'' if len(fixed) == 1 else 's'}"
            return float(fixed["down_m"].mean()), words
        tracks = known["target_id"].nunique()
        of = "the track of one target" if tracks == 1 else f"the tracks of {tracks} targets"
        return float(known["down_m"].median()), f"level ground at the median height of {of}"
    if detections is not None and "plane_down_m" in detections:
        stated = detections["plane_down_m"].to_numpy(float)
        if np.isfinite(stated).any():
            return float(np.nanmedian(stated)), "level ground at the median height stated of the detections"
    return None


def cover_images(flight: Flight, source: str | None) -> Coverage | None:
    """What the images of a flight have shown of the ground, as far as their poses and the ground are known.

    Parameters
    ----------
    flight
        The flight.
    source
        Name of the ``nav`` table, or None where it has none.

    Returns
    -------
    Coverage or None
    """
    frames = flight.frames
    if frames is None or not len(frames) or source is None or flight.manifest.camera is None:
        return None
    level = (0.0, "the flight's terrain") if flight.terrain is not None else ground_height(flight)
    if level is None:
        return None
    try:
        poses = camera_poses(flight, source, frame_times(flight), np.arange(len(frames)))
    except WildlabError:
        return None
    known = np.isfinite(poses.p_nc).all(axis=1) & np.isfinite(poses.R_nc).all(axis=(1, 2))
    posed = np.asarray(known)
    poses = poses.take(posed)
    uv = _border(poses.camera.width, poses.camera.height)
    outlines = np.full((len(frames), len(uv), 2), np.nan)
    flat = np.zeros(len(frames), bool)
    if posed.any():
        each = poses.take(np.repeat(np.arange(posed.sum()), len(uv)))
        pixels = np.tile(uv, (int(posed.sum()), 1))
        down = pixel_rays(poses.camera, pixels, each.R_nc)
        steep = down[:, 2] / np.linalg.norm(down, axis=1) > np.sin(FLATTEST)
        steep = steep.reshape(-1, len(uv)).all(axis=1)
        flat[np.flatnonzero(posed)[~steep]] = True
        if flight.terrain is not None:
            points = pixels_to_terrain(each, pixels, flight.terrain).points
        else:
            points = georeference_pixels(each, pixels, np.full(len(pixels), level[0]))
        border = points[:, :2].reshape(-1, len(uv), 2)
        border[~steep] = np.nan
        outlines[posed] = border
    return _counted(posed, flat, outlines, level[1])


def _border(width: int, height: int) -> Array:
    """(4 (SIDE - 1), 2) pixels around an image, in order."""
    along = np.linspace(0, 1, SIDE)[:-1]
    u, v = float(width), float(height)
    sides = [(along * u, 0 * along), (0 * along + u, along * v), (u - along * u, 0 * along + v)]
    sides.append((0 * along, v - along * v))
    return np.concatenate([np.stack(side, axis=1) for side in sides])


def _counted(posed: Mask, flat: Mask, outlines: Array, ground: str) -> Coverage:
    known = outlines[np.isfinite(outlines).all(axis=(1, 2))]
    if not len(known):
        return Coverage(posed, flat, outlines, np.zeros((1, 1), np.int32), 0.0, 0.0, 1.0, ground)
    # Imported where it is called: it takes its time.
    from rasterio import Affine
    from rasterio.enums import MergeAlg
    from rasterio.features import rasterize

    low, high = known.reshape(-1, 2).min(axis=0), known.reshape(-1, 2).max(axis=0)
    extent = high - low
    size = float(np.median(np.ptp(known, axis=1).min(axis=1)))
    step = max(size / ACROSS, float(np.sqrt(extent.prod() / MOST_CELLS)), 1e-3)
    rows, columns = (int(cells) for cells in np.maximum(np.ceil(extent / step), 1).astype(int))
    # Columns run east and rows north; a cell counts where its centre is inside. Edges of an outline seldom
    # run through centres where the grid begins at its corner: such cells would count twice.
    grid = Affine(step, 0, low[1], 0, step, low[0])
    shapes = [({"type": "Polygon", "coordinates": [one[:, ::-1].tolist()]}, 1) for one in _closed(known)]
    counts = rasterize(shapes, (rows, columns), transform=grid, merge_alg=MergeAlg.add, dtype="int32")
    return Coverage(posed, flat, outlines, counts, low[0] + step / 2, low[1] + step / 2, step, ground)


def _closed(outlines: Array) -> Array:
    return np.concatenate([outlines, outlines[:, :1]], axis=1)


class Gain(NamedTuple):
    """One thing to fix.

    Attributes
    ----------
    key
        ``cause``, ``far_out``, or what is lost: `lost_data`.
    causes
        Of a constant error, which; else empty.
    value, of
        What is gained, metres or how many, and of how many metres, or of how many.
    share
        Of the error or of the data.
    """

    key: str
    causes: tuple[str, ...]
    value: float
    of: float
    share: float


def _lost(key: str, count: int, of: int) -> Gain:
    """Data that are lost: so many of so many."""
    return Gain(key, (), count, of, count / of if of else 0.0)


def ordered(table: pd.DataFrame, columns: list[str], stamps: Array | None = None) -> tuple[Array, Array]:
    """Increasing stamps (N,) and values (N, K): what is finite, in order, the first of equal stamps.

    The stamps are those of the table, unless others are given.
    """
    values = table[columns].to_numpy(float)
    stamps = table["time_s"].to_numpy(float) if stamps is None else stamps
    known = np.isfinite(stamps) & np.isfinite(values).all(axis=1)
    t, values = stamps[known], values[known]
    _, first = np.unique(t, return_index=True)
    return t[first], values[first]


def detections_of(flight: Flight, source: str | None) -> tuple[int, int, int]:
    detections = flight.detections
    if detections is None:
        return 0, 0, 0
    images = 0 if flight.frames is None else int(flight.frames["frame_id"].isin(detections["frame_id"]).sum())
    placed, _ = _placed(flight, source)
    return len(detections), images, int(placed.sum())


def _placed(flight: Flight, source: str | None) -> tuple[Mask, Mask]:
    """Of the pixel detections, which have a place on the ground, and which a pose; nothing without poses."""
    none = np.zeros(0, bool)
    if source is None or flight.manifest.camera is None:
        return none, none
    try:
        seen = observe(flight, source)
    except WildlabError:
        return none, none
    posed = np.isfinite(seen.poses.p_nc).all(axis=-1)
    points = georeference_pixels(seen.poses, seen.uv, seen.plane_down)
    return np.asarray(np.isfinite(points).all(axis=1)), np.asarray(posed)


def lost_data(flight: Flight, source: str | None, streams: dict[str, Pace]) -> list[Gain]:
    """What is lost, with its denominator: images, detections, seconds."""
    found = []
    frames = flight.frames
    if frames is not None and len(frames) and source is not None:
        posed, turned = np.zeros(len(frames), bool), np.ones(len(frames), bool)
        with suppress(WildlabError):
            p, angles = frame_poses(flight, source)[0], gimbal_angles(flight)
            posed, turned = np.asarray(np.isfinite(p).all(axis=1)), np.isfinite(np.sum(angles, axis=0))
        found.append(_lost("images_without_pose", int((~posed).sum()), len(frames)))
        found.append(_lost("images_without_gimbal", int((posed & ~turned).sum()), len(frames)))
        placed, has_pose = _placed(flight, source)
        found.append(_lost("detections_off_ground", int((has_pose & ~placed).sum()), len(placed)))
    if flight.timed:
        found += _unrecorded(flight, source, streams)
    imu = streams.get("imu")
    if flight.timed and imu is not None and imu.missing:
        found.append(_lost("inertial_samples", imu.missing, imu.n + imu.missing))
    found += _untrue(flight)
    return [one for one in found if one.value]


def _unrecorded(flight: Flight, source: str | None, streams: dict[str, Pace]) -> list[Gain]:
    """Seconds of the record without poses, satellite positions or inertial samples."""
    carried = [pace for name, pace in streams.items() if pace.n and name != "truth"]
    if not carried:
        return []
    begin, end = min(pace.begin for pace in carried), max(pace.end for pace in carried)
    names = {"time_without_satellites": "gnss", "time_without_inertial": "imu"}
    if source is not None and "frame_id" not in flight.nav[source]:
        names = {"time_without_poses": f"nav/{source}"} | names
    found = []
    for key, name in names.items():
        pace = streams.get(name)
        if pace is None or not pace.n or end <= begin:
            continue
        lost = round(pace.begin - begin + end - pace.end + pace.paused_s)
        found.append(_lost(key, lost, max(1, round(end - begin))))
    return found


def _untrue(flight: Flight) -> list[Gain]:
    """Detections that name a target whose truth is not known at the time."""
    truth, detections, frames = flight.truth, flight.detections, flight.frames
    if truth is None or detections is None or frames is None or "target_id" not in detections or truth.empty:
        return []
    named = detections[detections["target_id"].fillna("") != ""]
    at = flight.frame_rows(named["frame_id"])
    times = np.where(at >= 0, frame_times(flight)[at], np.nan)
    with suppress(WildlabError):  # of a truth whose stamps do not increase nothing is known
        places = truth_of(flight, named.assign(time_s=times))
        missing = int(np.isnan(places[:, 0]).sum())
        return [_lost("detections_without_truth", missing, len(named))]
    return []


#: A step between poses that is off by so many usual differences, and so many metres, from what their speeds
#: make of it; without speeds, from the steps before and after it.
JUMP, JUMP_M = 8.0, 3.0
#: Steps longer than so many usual ones are pauses, over which speeds explain nothing.
MOST_STEPS = 3.0
#: An airframe that leans by more, degrees, does not fly as anybody means it to.
LEANT_DEG = 80.0
#: Poses contradict a satellite position that lies so many metres, and so many of its stated standard
#: deviations, beside them; more than this share of such positions is too many for chance.
APART_M, APART_SD, APART_SHARE = 5.0, 3.0, 0.05
#: What an alarm may be of, worst first; True where the flight or its poses went wrong for certain.
ALARMS = {"jumps": True, "leans": True, "apart": False, "shakes": False}


class Alarm(NamedTuple):
    """One thing that is very wrong.

    Attributes
    ----------
    what
        A key of `ALARMS`.
    often
        How often: jumps, spells, or satellite positions that are contradicted.
    worst, size
        Stamp of the worst one, s, and how large it is: m, degrees, m or m/s^2.
    share
        Of the time, or of the satellite positions; of jumps 0.
    """

    what: str
    often: int
    worst: float
    size: float
    share: float

    @property
    def broken(self) -> bool:
        """Whether the flight or its poses went wrong for certain."""
        return ALARMS[self.what]


def alarms_of(
    flight: Flight, source: str | None, pace: Pace | None, vibration: tuple[Array, Array] | None
) -> list[Alarm]:
    """Everything that is very wrong, worst first.

    Parameters
    ----------
    flight
        Whose times are times.
    source, pace
        The poses that are shown, and their pace; None without any.
    vibration
        (N, 3) of the inertial sensor, m/s^2, with its (N,) stamps; None where it cannot be told.

    Returns
    -------
    list of Alarm
    """
    found = []
    if source is not None and pace is not None and "frame_id" not in flight.nav[source]:
        nav = flight.nav[source]
        spells, sizes = jumps_of(nav, pace)
        if len(spells):
            at = int(np.argmax(sizes))
            found.append(Alarm("jumps", len(spells), spells[at, 0], float(sizes[at]), 0.0))
        t, q = ordered(nav, QUATERNION)
        length = np.linalg.norm(q, axis=1)
        t, q = t[length > 0], q[length > 0] / length[length > 0, None]
        # Between down in the body and down in n: the last element of the rotation's matrix.
        lean = np.degrees(np.arccos(np.clip(1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2), -1, 1)))
        found += _beyond("leans", t, lean, LEANT_DEG)
        found += _apart(flight, source, pace)
    if vibration is not None:
        found += _beyond("shakes", vibration[1], vibration[0].max(axis=1), HARMFUL)
    return found


def jumps_of(nav: pd.DataFrame, pace: Pace) -> tuple[Array, Array]:
    """Steps between poses that the speeds, or else the steps, before and after do not explain.

    Parameters
    ----------
    nav
        Poses over time, with or without velocities.
    pace
        Of them.

    Returns
    -------
    (K, 2) begin and end, s, and (K,) m by which they are off.
    """
    stated = set(VELOCITY) <= set(nav) and bool(nav[VELOCITY].notna().any().all())
    t, values = ordered(nav, POSITION + (VELOCITY if stated else []))
    if len(t) < 4:
        return np.empty((0, 2)), np.empty(0)
    step, way = np.diff(t)[:, None], np.diff(values[:, :3], axis=0)
    if stated:
        off = np.linalg.norm(way - (values[1:, 3:] + values[:-1, 3:]) / 2 * step, axis=1)
    else:
        v = way / step
        # Beside a jump one neighbour is right; the jump itself agrees with neither.
        before = np.linalg.norm(way[1:] - v[:-1] * step[1:], axis=1)
        after = np.linalg.norm(way[:-1] - v[1:] * step[:-1], axis=1)
        off = np.minimum(np.append(np.inf, before), np.append(after, np.inf))
    usual = float(np.median(off))
    far = (off > max(JUMP * usual, JUMP_M)) & (step[:, 0] <= MOST_STEPS * pace.step_s)
    return np.stack([t[:-1][far], t[1:][far]], axis=1), off[far]


def beside_satellites(flight: Flight, times: Array, place: Array, gaps: Array) -> tuple[Array, Array, Array]:
    """How far poses lie from the satellite positions.

    Parameters
    ----------
    flight
        With satellite positions.
    times, place
        (N,) s and (N, 3) m of the poses.
    gaps
        (K, 2) pauses of the poses, in which they lie nowhere.

    Returns
    -------
    (M,) stamps in s, (M, 3) m in n, poses less satellites, and (M,) their stated standard deviation, NaN
    where there is none.
    """
    gnss = flight.table("gnss")
    stamps, theirs = gnss_times(flight), gnss[POSITION].to_numpy(float)
    inside = np.isfinite(theirs).all(axis=1) & (stamps >= times[0]) & (stamps <= times[-1])
    for begin, end in gaps:
        inside &= ~((stamps > begin) & (stamps < end))
    own = np.stack([np.interp(stamps[inside], times, column) for column in place.T], axis=1)
    sd = gnss["sd_horizontal_m"].to_numpy(float) if "sd_horizontal_m" in gnss else np.full(len(gnss), np.nan)
    return stamps[inside], own - theirs[inside], sd[inside]


def _beyond(what: str, t: Array, values: Array, limit: float) -> list[Alarm]:
    over = values > limit
    if not over.any():
        return []
    spells, at = runs_of(over, t), int(np.argmax(values))
    return [Alarm(what, len(spells), t[at], float(values[at]), float(over.mean()))]


def _apart(flight: Flight, source: str, pace: Pace) -> list[Alarm]:
    nav = flight.nav[source]
    t, place = ordered(nav, POSITION)
    if flight.gnss is None or not len(t):
        return []
    stamps, off, sd = beside_satellites(flight, t, place, pace.gaps)
    level = np.hypot(off[:, 0], off[:, 1])
    over = level > np.fmax(APART_M, APART_SD * sd)
    if not len(level) or over.mean() <= APART_SHARE:
        return []
    at = int(np.argmax(np.where(over, level, 0.0)))
    return [Alarm("apart", int(over.sum()), stamps[at], float(level[at]), float(over.mean()))]


FORCE = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]
#: Four satellites give a place, five show that one of them is wrong, and six which.
FEW_SATELLITES = 6
#: A position that is this many times as uncertain as it usually is.
UNSURE = 3.0
#: What may be wrong on a path, worst first.
TROUBLES = (
    "no poses",
    "position jumps",
    "no satellite positions",
    f"fewer than {FEW_SATELLITES} satellites",
    f"satellite position {UNSURE:g} times as uncertain as usual",
    f"shaken by more than {FINE:g} m/s²",
    "no inertial samples",
)


class Path(NamedTuple):
    """Where a platform, or else a receiver or a target, was: (N,) times in s and (N, 3) m in n.

    ``who`` is what it is of, ``timed`` whether the times are times and do not number the images.
    """

    who: str
    times: Array
    place: Array
    timed: bool


class Issue(NamedTuple):
    """One thing that is wrong for some time: one of `TROUBLES`, and (K, 2) begin and end, s."""

    what: str
    spells: Array

    @property
    def seconds(self) -> float:
        """All spells together."""
        return float(np.diff(self.spells, axis=1).sum())


@dataclass(frozen=True)
class Overview:
    """Everything that the overview of a flight shows.

    Attributes
    ----------
    flight, source
        The flight, and the poses that are shown of it, if there are any.
    streams
        Pace of every stream by its name.
    length_s
        From the first to the last stamp of what was carried, s; NaN where there is no time.
    path
        Where it flew, or the nearest to that which is known.
    alarms
        What is so wrong that it comes before all else, worst first.
    troubles
        Those of `TROUBLES` that there are.
    series
        Over time: ``height``, ``speed``, ``attitude``, each {name: (times, values)}.
    above
        Height above ground: (N,) m along the path, and what the ground is; None where it is not known.
    vibration
        (N, 3) of the inertial sensor, m/s^2, with its (N,) stamps; None where it cannot be told.
    coverage
        What the images showed; None where that is not known.
    detections
        How many, in how many of the images, and how many of their pixels have a place on the ground.
    lost
        Data that are lost, most first.
    """

    flight: Flight
    source: str | None
    streams: dict[str, Pace]
    length_s: float
    path: Path | None
    alarms: tuple[Alarm, ...]
    troubles: tuple[Issue, ...]
    series: dict[str, dict[str, tuple[Array, Array]]]
    above: tuple[Array, str] | None
    vibration: tuple[Array, Array] | None
    coverage: Coverage | None
    detections: tuple[int, int, int]
    lost: tuple[Gain, ...]

    @property
    def detections_in_images(self) -> int:
        """How many detections are pixels: no other can be put on the ground by a camera's ray."""
        found = self.flight.detections
        return 0 if found is None else int((found["kind"] == "pixel").sum())


def troubled_for(overview: Overview, share: float) -> list[Issue]:
    """Troubles that last for a share of the flight or more, longest first.

    Parameters
    ----------
    overview
        Of the flight.
    share
        Of its length.

    Returns
    -------
    list of Issue
    """
    if not overview.length_s > 0:
        return []
    long = [one for one in overview.troubles if one.seconds >= share * overview.length_s]
    return sorted(long, key=lambda one: -one.seconds)


def look_over(flight: Flight, source: str | None = None) -> Overview:
    """Collect what there is to know of a flight.

    Parameters
    ----------
    flight
        With anything missing.
    source
        Name of the ``nav`` table to show; left out, the best known one.

    Returns
    -------
    Overview

    Raises
    ------
    WildlabError
        Where a source is named that the flight has not.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> found = look_over(simulate_twin("large-ship", 1))
    >>> found.path.who
    'nav/autopilot'
    """
    if source is not None:
        flight.pose_source(source)
    source = source or next(iter(flight.estimated_sources), None)
    streams, timed = paces(flight), flight.timed
    carried = [pace for name, pace in streams.items() if pace.n and name != "truth"] or [
        pace for pace in streams.values() if pace.n
    ]
    length = max(p.end for p in carried) - min(p.begin for p in carried) if carried and timed else np.nan
    path = path_of(flight, source)
    vibration = _vibration(flight)
    return Overview(
        flight=flight,
        source=source,
        streams=streams,
        length_s=float(length),
        path=path,
        alarms=tuple(alarms_of(flight, source, streams.get(f"nav/{source}"), vibration)) if timed else (),
        troubles=tuple(_troubles(flight, source, streams, vibration)) if timed else (),
        series=_series(flight) if timed else {},
        above=_above(flight, path),
        vibration=vibration,
        coverage=cover_images(flight, source),
        detections=detections_of(flight, source),
        lost=tuple(sorted(lost_data(flight, source, streams), key=lambda one: -one.share)),
    )


def paces(flight: Flight) -> dict[str, Pace]:
    """Pace of every stream of a flight by the name of its table; of a table without stamps there is none."""
    tables = {f"nav/{name}": nav for name, nav in flight.nav.items()} | flight.tables
    found = {}
    for name, table in tables.items():
        if name == "detections" or "time_s" not in table:
            continue
        stamps = table["time_s"].to_numpy(float)
        if name == "frames":
            stamps = frame_times(flight)
        elif name == "gnss":
            stamps = gnss_times(flight)
        elif name == "truth":
            # One of many targets stands for when all were followed.
            stamps = np.unique(stamps[np.isfinite(stamps)]) + flight.manifest.clocks.truth_offset_s
        known = np.sort(stamps[np.isfinite(stamps)])
        found[name] = pace_of(stamps, longest_gap(known))
    return found


def path_of(flight: Flight, source: str | None) -> Path | None:
    """Where it went by these poses; without any by its receiver, else the way of its first target."""
    tables: dict[str, tuple[pd.DataFrame, Array | None]] = {}
    if source is not None:
        tables[f"nav/{source}"] = flight.nav[source], None
    if flight.gnss is not None:
        tables["gnss"] = flight.gnss, gnss_times(flight)
    if flight.truth is not None and flight.truth["time_s"].notna().any():
        first = flight.truth[flight.truth["target_id"] == flight.truth["target_id"].iloc[0]]
        tables["truth"] = first, first["time_s"].to_numpy(float) + flight.manifest.clocks.truth_offset_s
    for who, (table, stamps) in tables.items():
        t, place = ordered(table, POSITION, stamps)
        if len(t) > (who == "truth"):
            return Path(who, t, place, flight.timed)
    return None


def _troubles(
    flight: Flight, source: str | None, streams: dict[str, Pace], vibration: tuple[Array, Array] | None
) -> list[Issue]:
    found: dict[str, Array] = {}
    nav = flight.nav.get(source) if source is not None else None
    if nav is not None and "frame_id" not in nav:
        found["no poses"] = streams[f"nav/{source}"].gaps
        found["position jumps"] = jumps_of(nav, streams[f"nav/{source}"])[0]
    if flight.gnss is not None and "gnss" in streams:
        gnss, stamps = flight.gnss, gnss_times(flight)
        found["no satellite positions"] = streams["gnss"].gaps
        if "satellites" in gnss:
            t, count = ordered(gnss, ["satellites"], stamps)
            found[TROUBLES[3]] = runs_of(count[:, 0] < FEW_SATELLITES, t)
        if "sd_horizontal_m" in gnss:
            t, sd = ordered(gnss, ["sd_horizontal_m"], stamps)
            if len(t):
                found[TROUBLES[4]] = runs_of(sd[:, 0] > UNSURE * np.median(sd), t)
    if vibration is not None:
        found[TROUBLES[5]] = runs_of(vibration[0].max(axis=1) > FINE, vibration[1])
    if "imu" in streams:
        found["no inertial samples"] = streams["imu"].gaps
    return [Issue(what, found[what]) for what in TROUBLES if len(found.get(what, ()))]


def _series(flight: Flight) -> dict[str, dict[str, tuple[Array, Array]]]:
    height, speed, attitude = {}, {}, {}
    tables: dict[str, tuple[pd.DataFrame, Array | None]] = {k: (nav, None) for k, nav in flight.nav.items()}
    if flight.gnss is not None:
        tables["satellites"] = flight.gnss, gnss_times(flight)
    for name, (table, stamps) in tables.items():
        t, place = ordered(table, POSITION, stamps)
        if not len(t):
            continue
        height[name] = t, -place[:, 2]
        if set(VELOCITY) <= set(table) and table[VELOCITY].notna().any().all():
            t, v = ordered(table, VELOCITY, stamps)
            speed[name] = t, np.hypot(v[:, 0], v[:, 1])
        if set(QUATERNION) <= set(table):
            t, q = ordered(table, QUATERNION)
            good = np.linalg.norm(q, axis=1) > 0
            if good.any():
                attitude[name] = t[good], np.degrees(matrix_to_euler(quaternion_to_matrix(q[good])))
    return {"height": height, "speed": speed, "attitude": attitude}


def _above(flight: Flight, path: Path | None) -> tuple[Array, str] | None:
    if path is None or path.who == "truth":
        return None
    if flight.terrain is not None:
        ground = flight.terrain.heights_at(path.place[:, :2])
        return -path.place[:, 2] - ground, "the flight's terrain"
    level = ground_height(flight)
    return None if level is None else (level[0] - path.place[:, 2], level[1])


def _vibration(flight: Flight) -> tuple[Array, Array] | None:
    if flight.imu is None or not flight.timed:
        return None
    t, force = ordered(flight.imu, FORCE)
    found = vibration_of(t, force)
    return None if found is None else (found, t)


def length_of_way(times: ArrayLike, places: ArrayLike) -> float:
    """Length of a path over the ground, m: steps below half a second are joined, for what shakes is no way.

    They are counted from the first pose, so that no clock has a say in it.

    Parameters
    ----------
    times
        (N,) s, in order.
    places
        (N, 2) m.

    Examples
    --------
    >>> t = np.arange(0.0, 10.0, 0.01)
    >>> shaken = np.column_stack([5 * t, 0.1 * np.tile([1.0, -1.0], len(t) // 2)])
    >>> round(length_of_way(t, shaken), 1)
    47.5
    """
    t, place = np.asarray(times, float), np.asarray(places, float)
    if not len(t):
        return 0.0
    keep = np.concatenate([[0], np.flatnonzero(np.diff(np.floor(2 * (t - t[0] + 1e-6))) > 0) + 1])
    return float(np.linalg.norm(np.diff(place[keep], axis=0), axis=1).sum())
