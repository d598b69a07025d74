"""Is this flight usable, for what, and does it make sense? The table of what is asked, and the answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wildlab.flight.checks.attitude import field, forces, heading
from wildlab.flight.checks.camera import ground, image, lens, terrain_findings
from wildlab.flight.checks.findings import Finding, Level, report_alone, say
from wildlab.flight.checks.inertial import inertial, turning, why_no_start
from wildlab.flight.checks.known_points import known_points
from wildlab.flight.checks.motion import (
    CLOCKS,
    LARGE_M,
    leaps,
    motion,
    origin,
    positions,
    together,
    without_leaps,
)
from wildlab.flight.checks.sensors import scans, sensors, targets
from wildlab.flight.checks.tables import (
    bounds,
    duplicates,
    gaps,
    identity,
    order,
    overlap,
    stamps,
    truth_place,
    values,
)
from wildlab.flight.clocks import covariances
from wildlab.flight.store import Flight, locations_confirmed, manifest_changed
from wildlab.names import listed

__all__ = ["Finding", "Use", "check_flight", "find", "sense_sentences", "usable_for"]

#: Parts of [uncertainty] without which a detection on the ground has no error ellipse.
ASSUMED = ("pixel_px", "position_horizontal_m", "position_vertical_m", "tilt_deg", "heading_deg")
LEVELS = ("problem", "warning", "note")
#: A target that is seen in fewer images or scans has no track that can be judged.
FEWEST_SCANS = 20

Question = Callable[[Flight], Iterator[Finding]]


class Meaning(NamedTuple):
    """A question about meaning, the questions without whose findings it is asked, and whether leaps of a
    position are taken off where it would blame a clock, or they are large."""

    ask: Question
    unless: tuple[Question, ...] = ()
    smooth: bool = False


_PLACED = (origin, together, stamps)
#: Every pair that says the same twice, in turn: what hangs on another one is asked where that has no finding.
MEANINGS = (
    Meaning(bounds),
    Meaning(origin),
    Meaning(together),
    Meaning(stamps),
    Meaning(motion, _PLACED),
    Meaning(positions, _PLACED, smooth=True),
    Meaning(forces, _PLACED),
    Meaning(field, _PLACED),
    Meaning(heading, (*_PLACED, motion, forces)),
    Meaning(lens),
    Meaning(scans, smooth=True),
    Meaning(targets, (scans,)),
    Meaning(known_points, smooth=True),
    Meaning(ground, (known_points,)),
)


@dataclass(frozen=True)
class Use:
    """Whether a flight has what a purpose takes, and why (not). `check_flight` says if it makes sense."""

    purpose: str
    usable: bool
    why: str


def check_flight(flight: Flight) -> list[Finding]:
    """Everything that is wrong, doubtful or good to know about a flight, worst first.

    Structural faults (missing columns, wrong types) are errors of `load_flight` and never come this far.

    Parameters
    ----------
    flight
        The flight.

    Returns
    -------
    list of Finding
        Problems, then warnings, then notes.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> {finding.level for finding in check_flight(simulate_twin("large-ship", 1))}
    {'note'}
    """
    return find(flight)


def find(flight: Flight, *, plain: bool = True, meaning: bool = True) -> list[Finding]:
    """The same of a part: ``plain``, whether a flight can be read; ``meaning``, whether it makes sense, and
    the mistake that explains it."""

    def ask(of: Flight) -> list[Finding]:
        found = [finding for question in PLAIN for finding in question(of)] if plain else []
        return [*found, *contradictions(of)] if meaning else found

    found = report_alone(flight, ask(flight), ask) if meaning else ask(flight)
    return sorted(found, key=lambda finding: LEVELS.index(finding.level))


def contradictions(flight: Flight) -> list[Finding]:
    """Everything in which a flight contradicts itself, with what follows from another one."""
    found: dict[Question, list[Finding]] = {}
    without, leapt = without_leaps(flight)
    named = [one for one in leapt if np.linalg.norm(one.by) > LARGE_M]
    for ask, unless, smooth in MEANINGS:
        if any(found.get(other) for other in unless):
            continue
        found[ask] = list(ask(without if smooth and named else flight))
        if smooth and leapt and any(cause.startswith(CLOCKS) for one in found[ask] for cause in one.causes):
            named, found[ask] = leapt, list(ask(without))
    return [*leaps(named), *(finding for some in found.values() for finding in some)]


def sense_sentences(flight: Flight) -> list[str]:
    """In what a flight contradicts itself, in sentences with the remedy; notes are left out.

    Parameters
    ----------
    flight
        The flight.

    Returns
    -------
    list of str
        Problems first; empty where the flight makes sense. They name files of no folder, and no place.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> sense_sentences(simulate_twin("large-ship", 1))
    []
    """
    found = find(flight, plain=False)
    return [f"{one.level}: {one.sentence} {one.fix}" for one in found if one.level != "note"]


def usable_for(flight: Flight) -> list[Use]:
    """What the flight can be used for: georeferencing accuracy, tracking, navigation.

    Parameters
    ----------
    flight
        The flight.

    Returns
    -------
    list of Use
        One for each purpose, usable or not.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> [use.usable for use in usable_for(simulate_twin("large-ship", 1))]
    [True, True, False]
    """
    broken = {finding.table for finding in find(flight, meaning=False) if finding.level == "problem"}
    good_nav = [name for name in flight.estimated_sources if f"nav/{name}" not in broken]
    scored = _filled(flight, "truth")
    return [
        Use("georeferencing accuracy", *_for_georeferencing(flight, broken, good_nav, scored)),
        Use("tracking", *_for_tracking(flight, broken, good_nav, scored)),
        Use("navigation", *_for_navigation(flight, broken)),
    ]


def _for_georeferencing(
    flight: Flight, broken: set[str], good_nav: list[str], scored: bool
) -> tuple[bool, str]:
    needed = {
        "poses without a problem": bool(good_nav),
        "detections of kind pixel": "pixel" in _kinds(flight),
        "frames": _filled(flight, "frames"),
        "truth": scored,
        **{f"{name} without a problem": name not in broken for name in ("frames", "detections", "truth")},
    }
    lacks = [what for what, there in needed.items() if not there]
    if not lacks and not of_known_targets(flight):
        lacks = ["detections that are said to be of a known target"]
    if lacks:
        return False, say("lacks", what=lacks)
    pixels = int((flight.table("detections")["kind"] == "pixel").sum())
    true_targets = flight.table("truth")["target_id"].nunique()
    return True, say("georeferencing", pixels=pixels, poses=good_nav, targets=true_targets)


def _for_tracking(flight: Flight, broken: set[str], good_nav: list[str], scored: bool) -> tuple[bool, str]:
    kinds = _kinds(flight)
    if flight.manifest.time.kind != "utc":
        return False, say("no-times")
    if not kinds and "detections" not in broken:
        return False, say("lacks", what=["detections"])
    if wrong := [name for name in ("detections", "frames") if name in broken]:
        return False, say("lacks", what=[f"{listed(wrong)} without a problem"])
    if kinds == {"pixel"} and not good_nav:
        return False, say("no-poses-for-pixels")
    if (most := _most_scans(flight)) < FEWEST_SCANS:
        return False, say("few-scans", most=most, fewest=FEWEST_SCANS)
    return True, say("tracking" if scored else "tracking-without-truth")


def _most_scans(flight: Flight) -> int:
    """In how many images or scans the target is that is seen most; detections without a name are of one."""
    seen = flight.table("detections")
    names = [seen["target_id"].fillna("")] if "target_id" in seen else []
    return int(seen.groupby([seen["source"], *names])["frame_id"].nunique().max())


def _for_navigation(flight: Flight, broken: set[str]) -> tuple[bool, str]:
    needed = {"imu": "inertial measurements (imu)", "gnss": "satellite positions (gnss)"}
    lacks = [what for name, what in needed.items() if name in broken or not _filled(flight, name)]
    why_not = say("lacks", what=lacks) if lacks else why_no_start(flight)
    if why_not:
        return False, why_not
    unstated = [] if flight.manifest.twin is not None else flight.manifest.imu.unstated_noise()
    names = [f"imu.{name}" for name in unstated]
    return True, say("navigation-unreported", names=names, n=len(names)) if names else say("navigation")


def _filled(flight: Flight, table: str) -> bool:
    return table in flight.tables and len(flight.tables[table]) > 0


def of_known_targets(flight: Flight) -> bool:
    """Whether anything says of which known target pixels are: a name, or the rule that it is the nearest.

    Where others are about whose places nobody knows, the nearest known target says nothing.
    """
    if flight.detections is None or flight.truth is None:
        return False
    if flight.manifest.scoring.rule == "nearest":
        return not others_about(flight)
    pixels = flight.detections[flight.detections["kind"] == "pixel"]
    return "target_id" in pixels and bool(pixels["target_id"].isin(flight.truth["target_id"]).any())


def others_about(flight: Flight) -> bool:
    """Whether it is stated that targets are about whose places nobody knows."""
    many = flight.manifest.targets.many
    return many is not None and many.others


def _kinds(flight: Flight) -> set[str]:
    return set() if flight.detections is None else set(flight.detections["kind"])


# -- what is missing, assumed or changed


def missing(flight: Flight) -> Iterator[Finding]:
    """Tables that are not there or empty, and detections that cannot be scored."""
    manifest, frames, detections = flight.manifest, flight.frames, flight.detections
    if not flight.nav:
        yield Finding("warning", "nav", "", "no-poses")
    for name, nav in flight.nav.items():
        if len(nav) == 0:
            yield Finding("problem", f"nav/{name}", "", "no-pose")
    if manifest.camera is None and detections is None and frames is None:
        yield Finding("note", "flight.toml", "camera", "navigation-only")
        return
    if not _filled(flight, "detections"):
        if detections is not None and frames is not None and len(frames):
            facts = {"n": len(frames), "what": "look" if "sensor" in frames else "frame"}
            yield Finding("warning", "detections", "", "none-detected", facts)
        else:
            yield Finding("warning", "detections", "", "no-detections")
    elif frames is None and "pixel" in _kinds(flight):
        yield Finding("problem", "frames", "", "no-frames")
    if not _filled(flight, "truth"):
        yield Finding("warning", "truth", "", "no-truth")
    elif detections is None or not len(detections):
        return
    elif manifest.scoring.rule == "labelled":
        labelled = "target_id" in detections and (detections["target_id"] != "").any()
        several = flight.table("truth")["target_id"].nunique() > 1
        if not labelled and ("pixel" in _kinds(flight) or several):
            others = others_about(flight)
            level: Level = "note" if others else "warning"
            yield Finding(level, "detections", "target_id", "none-names-a-target", {"others": others})
    elif others_about(flight):
        yield Finding("warning", "flight.toml", "scoring.rule", "nearest-among-others")


def uncertainty(flight: Flight) -> Iterator[Finding]:
    """Poses without covariances."""
    if flight.manifest.camera is None:
        return  # no point on the ground is computed
    lacking = [name for name in ASSUMED if getattr(flight.manifest.uncertainty, name) is None]
    for name, nav in flight.nav.items():
        P = covariances(nav)
        if P is not None and np.isfinite(P).any():
            continue
        if lacking:
            yield Finding("warning", f"nav/{name}", "cov_00", "covariance-unknown", {"names": lacking})
        else:
            yield Finding("note", f"nav/{name}", "cov_00", "covariance-assumed")


def clocks(flight: Flight) -> Iterator[Finding]:
    """Times, clocks, mount and heights of which nothing is stated, or what does not fit."""
    manifest, frames = flight.manifest, flight.frames
    interpolated = frames is not None and any("frame_id" not in nav for nav in flight.nav.values())
    if manifest.time.kind == "sequence":
        yield Finding("note", "flight.toml", "time.kind", "no-times")
    elif manifest.clocks.camera_offset_s == 0 and interpolated and manifest.kind == "logged":
        if manifest.camera is not None:
            yield Finding("note", "flight.toml", "clocks.camera_offset_s", "camera-clock")
        elif silent := _silent_sensors(flight):
            facts = {"names": [repr(name) for name in silent], "n": len(silent)}
            yield Finding("note", "flight.toml", "sensors", "sensor-clocks", facts)
    if manifest.mount.poses and manifest.mount.poses not in flight.nav:
        facts = {"poses": manifest.mount.poses, "names": ", ".join(sorted(flight.nav)) or "none"}
        yield Finding("problem", "flight.toml", "mount.poses", "mount-on-nothing", facts)
    reference = manifest.vertical.reference
    if reference != "ellipsoid" and manifest.vertical.correction_m == 0:
        # Where nothing is placed on the ground, a constant height changes no result.
        placed = manifest.camera is not None or flight.truth is not None
        level: Level = "warning" if placed else "note"
        yield Finding(
            level, "flight.toml", "vertical.reference", "height-reference", {"reference": reference}
        )


def _silent_sensors(flight: Flight) -> list[str]:
    """Of a flight without a camera: the sensors of whose stamps nothing is said."""
    table, column = flight.frames, "sensor"
    if table is None or column not in table:
        table, column = flight.detections, "source"
    names = set() if table is None else {str(name) for name in table[column] if name}
    sensors = flight.manifest.sensors.items()
    return sorted(names - {name for name, one in sensors if "clock_offset_s" in one.model_fields_set})


def checksums(flight: Flight) -> Iterator[Finding]:
    """What was changed since it was written."""
    if flight.folder is None:
        return
    changed = manifest_changed(flight.folder)
    if changed is None:
        yield Finding("note", "flight.toml", "checksums", "no-checksums")
    elif changed:
        yield Finding("warning", "flight.toml", "", "manifest-changed")
    if changed is not None and not locations_confirmed(flight.folder):
        yield Finding("warning", "flight.toml", "locations", "locations-changed")


#: Whether a flight can be read, in the order in which it is told.
PLAIN: tuple[Question, ...] = (
    values,
    order,
    overlap,
    gaps,
    truth_place,
    identity,
    sensors,
    duplicates,
    image,
    inertial,
    turning,
    terrain_findings,
    missing,
    uncertainty,
    clocks,
    checksums,
)
