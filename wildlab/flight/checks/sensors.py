"""What sensors saw: the camera, its pixels, the ground that rays are cut with, and the terrain; then of other
sensors in whose looks, and whether it is where the truth is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import (
    ALIKE,
    FAR_BETTER_ALONE,
    Finding,
    Level,
    Misfit,
    Mistake,
    bad_rows,
    blame,
    change_by,
    explain,
    far_better,
    finite_rows,
    messages,
    mistake,
    one_row,
    phrase,
    place_mistakes,
    rows_of,
    thin,
    undo_in,
)
from wildlab.flight.clocks import frame_poses, frame_times, gimbal_angles, poses_at, truth_at
from wildlab.flight.manifest import CameraPart, Settings, absent_sensors
from wildlab.flight.schema import DETECTION_KINDS, POSITION
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, Indices, wrap
from wildlab.geometry.georeference import Terrain, georeference_pixels, pixels_to_terrain
from wildlab.geometry.rays import BELOW
from wildlab.names import listed

#: No lens magnifies one way 2 % more than the other: then the calibration is of something else.
FOCAL_RATIO = 0.02
#: Fields of view (deg) across the image that a camera of a drone may have: long telephoto to fisheye.
NARROW, WIDE = 1.0, 150.0
#: Lenses are centred to a few percent of the image; further off, an image was cropped, or it is a mistake.
OFF_CENTRE, OFF_FAR, CENTRED = 0.08, 0.2, 0.03
#: So many rays say all there is to say.
MOST_RAYS = 200
#: A mark is where something was marked, so its ray goes down: more that do not than this share are a fault.
LOST = 0.5
#: Ground heights that differ from those of the truth by more than this (m), by so many times what is stated,
#: and by so many times their own spread.
STEP_M, STATED, SPREAD = 8.0, 5.0, 3.0


def image(flight: Flight) -> Iterator[Finding]:
    """Detections against the camera: pixels in the image, ground below the lens."""
    camera, detections = flight.manifest.camera, flight.detections
    if camera is not None:
        yield from _calibration(camera)
    if detections is None:
        return
    kind = detections["kind"].to_numpy()
    for name, columns in DETECTION_KINDS.items():
        for column in columns if (kind == name).any() else ():
            bad = (kind == name) & ~np.isfinite(detections[column].to_numpy())
            named = {"kind": name, "first": detections["detection_id"].to_numpy(object)}
            yield from bad_rows(bad, "problem", "detections", column, "detection-not-finite", named)
    pixel = kind == "pixel"
    if not pixel.any():
        return
    if camera is None:
        yield Finding("problem", "flight.toml", "camera", "no-camera")
        return
    u, v = detections["u_px"].to_numpy(), detections["v_px"].to_numpy()
    outside = pixel & ((u < -0.5) | (u > camera.width_px) | (v < -0.5) | (v > camera.height_px))
    level: Level = "problem" if outside[pixel].all() else "warning"
    facts: dict[str, Any] = {"width": camera.width_px, "height": camera.height_px, "u": u, "v": v}
    yield from bad_rows(outside, level, "detections", "u_px", "pixel-outside", facts)
    if flight.frames is None or not flight.nav or flight.terrain is not None:
        return  # without a terrain the ground is a plane
    if "plane_down_m" not in detections or not np.isfinite(detections.loc[pixel, "plane_down_m"]).any():
        yield Finding("note", "detections", "plane_down_m", "no-ground-height")
        return
    for name in flight.nav:
        try:
            p, _, _ = frame_poses(flight, name, np.inf)
        except WildlabError:  # said by `order` already
            continue
        lens = pd.Series(p[:, 2], index=flight.frames["frame_id"])
        height = detections["frame_id"].map(lens[~lens.index.duplicated()]).to_numpy(float)
        above = pixel & (detections["plane_down_m"].to_numpy() <= height)
        level = "problem" if above[pixel].all() else "warning"
        yield from bad_rows(above, level, "detections", "plane_down_m", "plane-above", {"source": name})


def _calibration(camera: CameraPart) -> Iterator[Finding]:
    ratio = camera.fx_px / camera.fy_px
    if abs(ratio - 1) > FOCAL_RATIO:
        facts = {"percent": 100 * abs(ratio - 1)}
        yield Finding("note", "flight.toml", "camera.fx_px", "focal-lengths-differ", facts)
    if not (0 < camera.cx_px < camera.width_px and 0 < camera.cy_px < camera.height_px):
        facts = {"cx": camera.cx_px, "cy": camera.cy_px}
        yield Finding("warning", "flight.toml", "camera.cx_px", "centre-outside", facts)


def lens(flight: Flight) -> Iterator[Finding]:
    """What cannot be the calibration of this image: principal point, focal length and field of view."""
    camera = flight.manifest.camera
    if camera is None:
        return
    widest = max(camera.width_px / camera.fx_px, camera.height_px / camera.fy_px)
    across = np.degrees(2 * np.arctan(widest / 2))
    facts = {"fx": camera.fx_px, "across": across}
    if across > WIDE:
        causes = ("focal length in mm",)
        yield Finding("problem", "flight.toml", "camera.fx_px", "view-wide", facts, causes)
    elif across < NARROW:
        yield Finding("warning", "flight.toml", "camera.fx_px", "view-narrow", facts)
    c = np.array([camera.cx_px, camera.cy_px])
    size = np.array([camera.width_px, camera.height_px], float)
    now = _off_centre(c, size)
    if now <= OFF_CENTRE:
        return
    named: list[Mistake[Any]] = []
    for row in rows_of("centre"):
        point, of = change_by(row, size)(c), size[row.get("size_order", [0, 1])]
        if point is not None and _off_centre(point, of) <= CENTRED:
            width, height = of / row.get("scale", 1.0)
            stated = {"cx": point[0], "cy": point[1], "width": width, "height": height}
            named.append(mistake(row, lambda x: x, fitted=False, **stated))
    inside = bool(((c > 0) & (c < size)).all())
    if named or (now > OFF_FAR and inside):  # outside of the image: said with the calibration
        facts = {"cx": c[0], "cy": c[1], "width": size[0], "height": size[1]}
        code = "centre-explained" if named else "centre-far"
        yield blame("warning", "flight.toml", "camera.cx_px", code, named, facts)


def _off_centre(point: np.ndarray, of: np.ndarray) -> float:
    return float(np.abs(point / of - 0.5).max())


def ground(flight: Flight) -> Iterator[Finding]:
    """Rays of detections against the ground, and ground against truth."""
    detections, truth, frames = flight.detections, flight.truth, flight.frames
    if detections is None or frames is None or flight.manifest.camera is None:
        return
    pixel = (detections["kind"] == "pixel").to_numpy()
    if pixel.sum() < 4 or frames["frame_id"].duplicated().any():
        return
    yield from _rays(flight, detections[pixel], frames)
    if truth is None or not len(truth) or "plane_down_m" not in detections or flight.terrain is not None:
        return
    down = detections["plane_down_m"].to_numpy(float)
    if flight.manifest.scoring.rule == "labelled" and "target_id" in detections:
        heights = truth.groupby("target_id")["down_m"].median()
        known = detections["target_id"].map(heights).to_numpy(float)
    else:
        known = np.full(len(down), truth["down_m"].median())
    apart = (down - known)[pixel & np.isfinite(down - known)]
    if len(apart) < 4:
        return
    off = np.median(apart)
    spread = 1.4826 * np.median(np.abs(apart - off))
    of_truth = float(truth["sd_vertical_m"].median()) if "sd_vertical_m" in truth else np.nan
    sd = of_truth if np.isfinite(of_truth) else 2.0
    stated = np.hypot(flight.manifest.uncertainty.plane_height_m or 1.0, sd)
    if abs(off) > max(STEP_M, STATED * stated, SPREAD * spread):
        facts = {"off": off, "correction": -off}
        causes = ("ground heights against truth",)
        yield Finding("warning", "detections", "plane_down_m", "ground-off-truth", facts, causes)


def _rays(flight: Flight, pixels: pd.DataFrame, frames: pd.DataFrame) -> Iterator[Finding]:
    """The share of rays that meet the ground, where it is known how high that is."""
    pixels = pixels.iloc[thin(len(pixels), MOST_RAYS)]
    plane = np.full(len(pixels), np.nan)
    if "plane_down_m" in pixels:
        plane = pixels["plane_down_m"].to_numpy(float)
    if flight.truth is not None and len(flight.truth):
        plane = np.where(np.isfinite(plane), plane, flight.truth["down_m"].median())
    terrain, manifest = flight.terrain, flight.manifest
    frame = pd.Index(frames["frame_id"]).get_indexer(pd.Index(pixels["frame_id"]))
    for name, nav in flight.nav.items():
        if manifest.mount.poses not in ("", name):
            continue  # the mount says nothing of a camera on these poses
        try:
            p, R, _ = poses_at(nav, frame_times(flight)[frame], pixels["frame_id"])
            pan, tilt = (angle[frame] for angle in gimbal_angles(flight))
            poses = CameraPoses(manifest.geometry_camera(), manifest.geometry_mount(), p, R, pan, tilt)
            uv = pixels[["u_px", "v_px"]].to_numpy(float)
            if terrain is None:
                met, under = georeference_pixels(poses, uv, plane), p[:, 2] >= plane
            else:
                found = pixels_to_terrain(poses, uv, terrain)
                met, under = found.points, found.became == BELOW
        except ValueError:  # said by the checks of times
            continue
        known = np.isfinite(p).all(axis=1) & (frame >= 0) & (np.isfinite(plane) | (terrain is not None))
        if known.sum() < 4:
            continue
        lost = 1 - np.isfinite(met[known, 0]).mean()
        if lost > LOST:
            other = "forward" if manifest.mount.looks == "down" else "down"
            below = np.mean(under[known]) > LOST
            facts = {"percent": 100 * lost, "source": name, "other": other}
            code = "rays-from-below" if below else "rays-past-ground"
            level: Level = "problem" if lost > 0.9 else "warning"
            yield Finding(level, f"nav/{name}", "", code, facts, ("rays miss the ground",))


#: Poses that far below the ground are said, metres: a terrain's cell rounds the place it takes off from.
DEEP = 5.0
#: Fewer of them are what the noise of low flights does, as a share.
FEW = 0.01
#: Known points off the ground by more than that, metres, and by so many times their spread, are said.
OFF, OFF_SPREAD = 3.0, 2.0


def terrain_sentence(flight: Flight) -> str:
    """What terrain a flight has, as a clause; no coordinates."""
    texts = messages("checks")
    ground, record = flight.terrain, flight.manifest.terrain
    if ground is None:
        return str(texts["no-terrain"]["said"])
    north, far_north, east, far_east = ground.extent
    known = np.isfinite(ground.height)
    facts: dict[str, Any] = {
        "north": _length(far_north - north),
        "east": _length(far_east - east),
        "step": ground.step,
        "relief": np.ptp(ground.height[known]),
        "holes": 100 * (1 - known.mean()),
        "record": record,
    }
    if record is not None:
        facts["counted"] = texts["terrain-recorded"][record.heights]
    return phrase(texts["terrain" if record is None else "terrain-recorded"]["said"], facts)


def terrain_findings(flight: Flight) -> Iterator[Finding]:
    """What terrain there is; poses that are not over it, or below it."""
    ground = flight.terrain
    if ground is None:
        return
    facts: dict[str, Any] = {
        "terrain": terrain_sentence(flight),
        "sd": ground.sd,
        "unknown": bool(np.isnan(ground.sd)),
    }
    yield Finding("note", "terrain.tif", "", "terrain-there", facts)
    yield from _known_points(flight, ground)
    for name, nav in flight.nav.items():
        p = finite_rows(nav, POSITION)
        if not len(p):
            continue
        above = -p[:, 2] - ground.heights_at(p[:, :2])
        over = np.isfinite(above)
        north, far_north, east, far_east = ground.extent
        beyond = (p[:, 0] < north) | (p[:, 0] > far_north) | (p[:, 1] < east) | (p[:, 1] > far_east)
        for which, code in ((~over & beyond, "beyond-terrain"), (~over & ~beyond, "over-hole")):
            if which.any():
                yield Finding("warning", f"nav/{name}", "", code, {"percent": 100 * which.mean()})
        above = above[over]
        below = above < -DEEP
        if below.mean() > FEW:
            level: Level = "problem" if below.all() else "warning"
            facts = {"percent": 100 * below.mean(), "deep": DEEP, "most": -above.min()}
            yield Finding(level, f"nav/{name}", "down_m", "below-ground", facts)
        elif over.any():
            facts = {"median": np.median(above), "low": above.min(), "high": above.max()}
            yield Finding("note", f"nav/{name}", "down_m", "above-ground", facts)


def _known_points(flight: Flight, ground: Terrain) -> Iterator[Finding]:
    """Whether points of the truth that never move lie on the ground."""
    truth = flight.truth
    if truth is None:
        return
    still = truth[truth["time_s"].isna()].drop_duplicates("target_id")[POSITION].to_numpy(float)
    above = -still[:, 2] - ground.heights_at(still[:, :2])
    above = above[np.isfinite(above)]
    if len(above) < 3:
        return
    middle = np.median(above)
    spread = 1.4826 * np.median(np.abs(above - middle))
    off = abs(middle) > max(OFF, OFF_SPREAD * spread)
    facts = {"n": len(above), "above": middle, "spread": spread}
    code = "points-off-ground" if off else "points-on-ground"
    yield Finding("warning" if off else "note", "terrain.tif", "", code, facts)


def _length(metres: float) -> str:
    return f"{metres / 1000:.1f} km" if metres >= 1000 else f"{metres:.0f} m"


# -- other sensors

#: A detection is of a target within this of it: so far (m) and a share of the distance, or this angle (rad).
NEAR_M, NEAR_SHARE, NEAR_RAD = 8.0, 0.02, np.radians(2.0)
#: Detections looked at of one source, as many of every look, and the fewest that say anything.
MOST, ENOUGH = 600, 40
#: Among clutter and shores, this share of what a sensor sees is usually a target; below that one, none is.
USUAL, NONE = 0.25, 0.01
#: Clocks and zones that are tried, s.
CLOCKS = (*np.arange(-75.0, 76.0, 1.5), -3600.0, 3600.0, -7200.0, 7200.0)
#: Turns that are looked for, deg: what declination, compasses and mountings are off by. At either end it is
#: no constant of some degrees, but the flank of something else.
TURNS = np.arange(-20.0, 20.5, 0.5)
#: So many standard deviations of what looks differ by, another explanation has to be better by.
CLEARLY = 2.0
#: What is seen this near (m) to a target may be of it; a constant offset is at least so large, and holds for
#: at least this share of it and so many detections.
AROUND_M, OFF_M, SHARE, ENOUGH_AROUND = 60.0, 15.0, 0.4, 30


def looks_of_others(frames: pd.DataFrame, detections: pd.DataFrame) -> pd.DataFrame:
    """The detections whose frame names another sensor than their source does.

    Parameters
    ----------
    frames, detections
        As in a flight.

    Returns
    -------
    DataFrame
        Those rows of the detections, with ``sensor``, that of their frame; "" where it names none. Without
        rows where the frames name no sensors at all, and so each source is one.
    """
    if "sensor" not in frames:
        return detections.iloc[:0].assign(sensor="")
    of_frame = frames.drop_duplicates("frame_id").set_index("frame_id")["sensor"]
    sensor = detections["frame_id"].map(of_frame)
    # A frame that is in no table is another fault, said elsewhere.
    return detections.assign(sensor=sensor)[sensor.notna() & (sensor != detections["source"])]


def sensors(flight: Flight) -> Iterator[Finding]:
    """Detections that a sensor made in the looks of another one, sources that are no sensor's, and sensors of
    ``[sensors]`` that there are not."""
    frames, detections = flight.frames, flight.detections
    if frames is None or detections is None:
        return
    named = {name for name in frames["sensor"] if name} if "sensor" in frames else set(detections["source"])
    stated = Settings(sensors=flight.manifest.sensors)
    for name, meant in absent_sensors(stated, named).items() if named else ():
        yield Finding("warning", "flight.toml", f"sensors.{name}", "sensor-absent", {"meant": meant})
    for (source, sensor), rows in looks_of_others(frames, detections).groupby(
        ["source", "sensor"], sort=True
    ):
        facts = {
            "n": len(rows),
            "of": int((detections["source"] == source).sum()),
            "source": source,
            "sensor": sensor,
            "first": rows.iloc[0]["frame_id"],
            "names": bool(sensor),
        }
        if source in named:
            yield Finding("problem", "detections", "source", "source-contradicts-sensor", facts)
        elif sensor:
            level: Level = "note" if (detections["source"] == sensor).any() else "warning"
            yield Finding(level, "detections", "source", "source-is-no-sensor", facts)


# -- what sensors saw against the truth


@dataclass(frozen=True)
class SourceLooks:
    """What one source saw: places (N, 3) in n or azimuths (N,), from where (N, 3), and the targets (M, N, 3);
    where the bow pointed, (N,) rad from north towards east; the number of the look (N,), counted from 0
    without gaps; own place, targets and bow had the sensor's stamps and then the truth been later by so much;
    and how far away (N,) m, where it says so beside the azimuth."""

    source: str
    places: Array | None
    azimuth: Array | None
    own: Array
    targets: Array
    heading: Array
    look: Indices
    at: Callable[[float, float], tuple[Array, Array, Array]]
    distance: Array | None = None

    @property
    def seen_at(self) -> Array:
        """Towards where each detection is, (N,) rad from true north towards east."""
        if self.azimuth is not None:
            return self.azimuth
        away = np.asarray(self.places) - self.own
        return np.arctan2(away[:, 1], away[:, 0])

    def turned(self, by_deg: float) -> SourceLooks:
        """The same looks with all bearings, or all places about the own one, turned clockwise."""
        by = np.radians(by_deg)
        if self.azimuth is not None:
            return replace(self, azimuth=self.azimuth + by)
        c, n = np.cos(by), np.sin(by)
        about = (np.asarray(self.places) - self.own) @ np.array([[c, n, 0.0], [-n, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(self, places=self.own + about)

    def with_stamps(self, by: float) -> SourceLooks:
        """The same looks had the sensor's stamps been later: what it placed about itself goes along."""
        own, targets, heading = self.at(by, 0.0)
        places = None if self.places is None else self.places + (own - self.own)
        return replace(self, own=own, targets=targets, heading=heading, places=places)


Scans = tuple[SourceLooks, ...]


def scans_of(flight: Flight) -> Scans:
    """The sources of positions and bearings, with enough detections each."""
    detections, frames, truth = flight.detections, flight.frames, flight.truth
    if detections is None or frames is None or truth is None or not len(truth) or not flight.nav:
        return ()
    # Positions for the same pixels are answers of another program, and judged with them.
    if frames["frame_id"].duplicated().any() or (detections["kind"] == "pixel").any():
        return ()
    found = []
    nav, offset = next(iter(flight.nav.values())), flight.manifest.clocks.truth_offset_s
    for (source, kind), rows in detections.groupby(["source", "kind"], sort=False):
        if kind not in ("position", "bearing", "range-bearing") or len(rows) < ENOUGH:
            continue
        rows = _some_of_each_look(rows)
        frame = pd.Index(frames["frame_id"]).get_indexer(pd.Index(rows["frame_id"]))
        rows, frame = rows[frame >= 0], frame[frame >= 0]
        times = frame_times(flight)[frame] + _clock(flight, str(source))

        def at(
            shift: float, of_truth: float, times: Array = times, ids: pd.Series = rows["frame_id"]
        ) -> tuple[Array, Array, Array]:
            own, R, _ = poses_at(nav, times + shift, ids)
            targets = truth_at(truth, times + shift + of_truth, offset_s=offset)[1]
            return own, targets, np.arctan2(R[:, 1, 0], R[:, 0, 0])

        try:
            own, targets, heading = at(0.0, 0.0)
        except (WildlabError, ValueError):  # said by the checks of times
            continue
        if len(rows) < ENOUGH:
            continue
        position = kind == "position"
        found.append(
            SourceLooks(
                str(source),
                rows[POSITION].to_numpy(float) if position else None,
                None if position else rows["azimuth_rad"].to_numpy(float),
                own,
                targets,
                heading,
                np.unique(frame, return_inverse=True)[1],
                at,
                rows["range_m"].to_numpy(float) if kind == "range-bearing" else None,
            )
        )
    return tuple(found)


def _clock(flight: Flight, source: str) -> float:
    """What is stated of the clock of a sensor, s."""
    stated = flight.manifest.sensors.get(source)
    return 0.0 if stated is None else stated.clock_offset_s


def _some_of_each_look(rows: pd.DataFrame) -> pd.DataFrame:
    """At most `MOST` detections, as many of every look where there are, drawn with a fixed seed."""
    looks = rows["frame_id"].drop_duplicates().to_numpy()
    looks = looks[thin(len(looks), MOST)]
    rows = rows.reset_index(drop=True)
    mixed = rows[rows["frame_id"].isin(looks)].sample(frac=1.0, random_state=0)
    return mixed[mixed.groupby("frame_id").cumcount() < max(1, MOST // len(looks))].sort_index()


def hits(s: SourceLooks) -> Array:
    """Whether each detection is where a target is, (N,), 0 or 1."""
    away = s.targets - s.own
    distance = np.hypot(away[..., 0], away[..., 1])
    with np.errstate(invalid="ignore"):
        if s.places is not None:
            off = np.hypot(*np.moveaxis((s.targets - s.places)[..., :2], -1, 0))
            near = off < NEAR_M + NEAR_SHARE * distance
        else:
            near = np.abs(wrap(s.azimuth - np.arctan2(away[..., 1], away[..., 0]))) < NEAR_RAD
            if s.distance is not None:
                apart = np.linalg.norm(away, axis=-1)
                near &= np.abs(apart - s.distance) < NEAR_M + NEAR_SHARE * apart
    return np.asarray(near.any(axis=0), float)


def shares(s: SourceLooks) -> Array:
    """Of every look, the share of its detections that are where a target is, (L,)."""
    return np.bincount(s.look, hits(s)) / np.bincount(s.look)


def misfit(scans: Scans) -> Misfit:
    """The usual share of hits over the one there is, (2, 3), the mean of all sources; both rows alike.

    The share is the mean of those of all looks; halves are every other look, NaN where there is one alone.
    """
    result = np.zeros(3)
    for s in scans:
        share = shares(s)
        halves = (share[::2], share[1::2]) if len(share) > 1 else (share * np.nan, share * np.nan)
        means = [part.mean() for part in (share, *halves)]
        result += np.log(np.maximum(means, NONE)) / len(scans)
    return USUAL * np.tile(np.exp(-result), (2, 1))


def _percent(scans: Scans) -> float:
    return float(100 * USUAL / misfit(scans)[0, 0])


def scans(flight: Flight) -> Iterator[Finding]:
    """Other sensors against the truth: what concerns all of them first, then each."""
    given = scans_of(flight)
    if not given:
        return
    named = explain(misfit, given, common_mistakes(flight))
    of_each = [explain(misfit, (one,), source_mistakes(one, _clock(flight, one.source))) for one in given]
    # Each source as its own mistakes leave it, where it has any.
    undone = tuple(own[0].undone[0] if own else one for one, own in zip(given, of_each, strict=True))
    turn = best_turn(given, [*(one.undone for one in named), *([undone] if any(of_each) else [])])
    if turn is not None:
        yield _turned_finding(given, turn)
        return
    # What concerns all is simpler; but it is not it where the sources' own mistakes explain far more.
    if named and misfit(named[0].undone)[0, 0] <= ALIKE * misfit(undone)[0, 0]:
        facts = {"share": _percent(given), "then": _percent(named[0].undone)}
        yield blame("problem", "truth", "", "scans-explained", named, facts, [])
        return
    for one, own in zip(given, of_each, strict=True):
        turn = best_turn((one,), [way.undone for way in own])
        if turn is not None:
            yield _turned_finding((one,), turn)
        elif own:
            then = {"share": _percent((one,)), "then": _percent(own[0].undone), "source": one.source}
            field = "north_m" if one.places is not None else "azimuth_rad"
            yield blame("problem", "detections", field, "source-explained", own, then, [])


def common_mistakes(flight: Flight) -> Iterator[Mistake[Scans]]:
    """Mistakes about the truth, about the own place, and about clocks."""
    for part, field in (("truth", "targets"), (f"poses.{next(iter(flight.nav))}", "own")):
        for place in place_mistakes(part, flight.manifest.origin_tuple()):
            if place.about != "height":
                yield place.within(part, _each(undo_in(place.undo, field)))
    for seconds in CLOCKS:
        if seconds:
            hours = abs(seconds) >= 3600

            def later(s: SourceLooks, by: float = seconds) -> SourceLooks:
                own, targets, _ = s.at(0.0, by)
                return replace(s, own=own, targets=targets)

            yield mistake(
                one_row("truth-clock"),
                _each(later),
                fitted=True,
                amount=f"{abs(seconds) / 3600:g} h" if hours else f"{abs(seconds):g} s",
                by=seconds,
                hours=hours,
                offset=flight.manifest.clocks.truth_offset_s - seconds,
            )


def _each(change: Callable[[SourceLooks], SourceLooks | None]) -> Callable[[Scans], Scans | None]:
    def undo(given: Scans) -> Scans | None:
        done = tuple(one for one in map(change, given) if one is not None)
        return done if len(done) == len(given) else None

    return undo


def source_mistakes(one: SourceLooks, offset_s: float = 0.0) -> Iterator[Mistake[Scans]]:
    """Mistakes about the positions, the bearings or the clock of one source.

    Parameters
    ----------
    one
        What it saw, with the offset of its clock as it is stated.
    offset_s
        That offset.
    """
    # The clock of the sensor alone: what it saw stays, and all else is where it was at other times.
    by = min(CLOCKS, key=lambda t: misfit((one.with_stamps(t),))[0, 0])
    if by != 0:
        undo = _each(lambda s: s.with_stamps(by))
        row = one_row("sensor-clock")
        yield mistake(row, undo, fitted=True, source=one.source, by=by, offset=offset_s + by)
    groups = {"seen-places": "places", "range": "distance", "azimuth": "azimuth"}
    for group, field in groups.items():
        if getattr(one, field) is not None:
            for row in rows_of(group):
                change = change_by(row, np.radians(1.0))
                undo = _each(undo_in(change, field) if "bow" not in row else _from_bow(change, row["bow"]))
                yield mistake(row, undo, source=one.source)


def _from_bow(change: Callable[[Array], Array | None], times: float) -> Callable[[SourceLooks], SourceLooks]:
    return lambda s: replace(s, azimuth=change(np.asarray(s.azimuth)) + times * s.heading)  # type: ignore[operator]


# -- a constant turn of all that a sensor sees, as of a compass or a mounting that is off by some degrees


def best_turn(given: Scans, rivals: Sequence[Scans]) -> float | None:
    """The turn (deg, clockwise) that brings what is seen to the targets.

    Parameters
    ----------
    given
        The looks of all sources that are turned alike.
    rivals
        The same as other explanations have them.

    Returns
    -------
    float or None
        None where no turn brings far more of it to a target, or where a rival does clearly more.
    """
    before = misfit(given)
    if not before[0, 0] > 1.0:
        return None

    def turned(by: float) -> Scans:
        return tuple(s.turned(by) for s in given)

    # All within the gate of a bearing fit alike: the middle of these.
    k = int(np.argmin([misfit(turned(by))[0, 0] for by in TURNS]))
    by = float(TURNS[k])
    if k in (0, len(TURNS) - 1):
        return None
    for _ in range(3):
        by += float(np.degrees(np.median(np.concatenate([_off(s) for s in turned(by)]))))
    done = turned(by)
    if not far_better(before, misfit(done), fitted=True):
        return None
    for other in rivals:
        more = np.concatenate([shares(a) - shares(b) for a, b in zip(other, done, strict=True)])
        # By more than looks differ by chance.
        if more.mean() > CLEARLY * more.std() / np.sqrt(len(more)):
            return None
    return by


def _off(s: SourceLooks) -> Array:
    """By how much (rad, clockwise) each detection that is where a target is would have to be turned."""
    good = hits(s) > 0
    away = (s.targets - s.own)[:, good]
    off = wrap(np.arctan2(away[..., 1], away[..., 0]) - s.seen_at[good])
    off = np.where(np.isfinite(off), off, np.inf)
    return np.asarray(np.take_along_axis(off, np.abs(off).argmin(axis=0)[None], axis=0)[0])


def _turned_finding(given: Scans, turn_deg: float) -> Finding:
    first = given[0]
    facts = {
        "share": _percent(given),
        "then": _percent(tuple(s.turned(turn_deg) for s in given)),
        "turn": turn_deg,
        "heading": -turn_deg,
        "names": listed([s.source for s in given]),
        "first": first.source,
    }
    field = "azimuth_rad" if first.azimuth is not None else "north_m"
    return Finding("warning", "detections", field, "sensors-turned", facts, ("heading off",))


# -- one target whose truth is off: other sensors see it beside where it is said to be


def offset_of(away: Array) -> tuple[Array, float, float]:
    """Where most of what is seen around a target lies: the offset (2,) m, and the shares there and at it.

    Parameters
    ----------
    away
        (N, 2): detections less the target, m, all of them near.

    Returns
    -------
    The offset, the share of detections near it, and the share near the target itself.

    Examples
    --------
    >>> offset, there, here = offset_of(np.array([[25.0, 0.0]] * 40 + [[-30.0, 9.0]] * 10))
    >>> print(offset, there, here)
    [25.  0.] 0.8 0.0
    """
    near = np.linalg.norm(away[:, None] - away[None], axis=2) < NEAR_M
    centre = away[int(np.argmax(near.sum(axis=1)))]
    for _ in range(3):
        centre = away[np.linalg.norm(away - centre, axis=1) < NEAR_M].mean(axis=0)
    there = float(np.mean(np.linalg.norm(away - centre, axis=1) < NEAR_M))
    return centre, there, float(np.mean(np.linalg.norm(away, axis=1) < NEAR_M))


def targets(flight: Flight) -> Iterator[Finding]:
    """Every target against the sources of positions."""
    scans = [one for one in scans_of(flight) if one.places is not None]
    if flight.truth is None:
        return
    for k, name in enumerate(dict.fromkeys(flight.truth["target_id"])):
        for scan in scans:
            level = (scan.targets - np.asarray(scan.places))[..., :2]
            others = np.linalg.norm(level, axis=2)
            with np.errstate(invalid="ignore"):
                nearest = np.nanmin(np.where(np.isfinite(others), others, np.inf), axis=0)
                own = (nearest == others[k]) & (others[k] < AROUND_M)
            if own.sum() < ENOUGH_AROUND:
                continue
            offset, there, here = offset_of(-level[k, own])
            size = np.hypot(*offset)
            if size > OFF_M and there > SHARE and there > FAR_BETTER_ALONE * max(here, 0.01):
                seen = {"there": 100 * there, "here": 100 * here, "size": size}
                facts = {"source": scan.source, "name": name, **seen}
                yield Finding("warning", "truth", "target_id", "target-beside", facts, ("one mark off",))
                break
