"""Is this flight usable, and for what: sentences for people, made from a loaded flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wildlab.flight.checks import camera as findings_seen
from wildlab.flight.checks import findings
from wildlab.flight.checks import inertial as findings_inertial
from wildlab.flight.checks.corrections import report_alone
from wildlab.flight.checks.duplicates import twice
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.flown import why_no_start
from wildlab.flight.checks.sense.sense import contradictions
from wildlab.flight.checks.sensors import sensors
from wildlab.flight.checks.terrain import terrain_findings
from wildlab.flight.checks.times import gaps, overlap
from wildlab.flight.checksums import locations_confirmed, manifest_changed
from wildlab.flight.clocks import covariances
from wildlab.flight.store import Flight

__all__ = ["Finding", "Use", "check_flight", "find", "usable_for"]

#: Parts of [uncertainty] without which a detection on the ground has no error ellipse.
ASSUMED = ("pixel_px", "position_horizontal_m", "position_vertical_m", "tilt_deg", "heading_deg")


@dataclass(frozen=True)
class Use:
    """Whether a flight has what a purpose takes, and why (not). `check_flight` says if it makes sense."""

    purpose: str
    usable: bool
    why: str


def check_flight(flight: Flight) -> list[Finding]:
    """Everything that is wrong, doubtful or good to know about a flight, worst first, in whole sentences.

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
    return [findings.whole(one) for one in find(flight)]


def find(flight: Flight, *, meaning: bool = True) -> list[Finding]:
    """The same in clauses, for those who make sentences of their own; without `meaning`, whether a flight can
    be read, and not whether it makes sense."""
    found = list(_all(flight, meaning))
    if meaning:
        found = report_alone(flight, found, lambda one: list(_all(one, True)))
    return sorted(found, key=lambda finding: ("problem", "warning", "note").index(finding.level))


def _all(flight: Flight, meaning: bool) -> Iterator[Finding]:
    yield from findings.values(flight)
    yield from findings.order(flight)
    yield from overlap(flight)
    yield from gaps(flight)
    yield from findings_seen.truth_place(flight)
    yield from findings_seen.identity(flight)
    yield from sensors(flight)
    yield from twice(flight)
    yield from findings_seen.image(flight)
    yield from findings_inertial.inertial(flight)
    yield from terrain_findings(flight)
    yield from _missing(flight)
    yield from _uncertainty(flight)
    yield from _clocks(flight)
    yield from _checksums(flight)
    if meaning:
        yield from contradictions(flight)


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
    kinds = _kinds(flight)
    scored = flight.truth is not None and len(flight.truth) > 0

    lacks = []
    if not good_nav:
        lacks.append("poses without a problem")
    if "pixel" not in kinds:
        lacks.append("detections of kind pixel")
    if flight.frames is None or len(flight.frames) == 0:
        lacks.append("frames")
    if not scored:
        lacks.append("truth")
    lacks += [f"{name} without a problem" for name in ("frames", "detections", "truth") if name in broken]
    if not lacks and not of_known_targets(flight):
        lacks.append("detections that are said to be of a known target")
    if lacks:
        georeferencing = f"it lacks {_and(lacks)}"
    else:
        pixels = int((flight.table("detections")["kind"] == "pixel").sum())
        targets = flight.table("truth")["target_id"].nunique()
        georeferencing = (
            f"{_some(pixels, 'pixel')}, poses from {_and(good_nav)}, {_some(targets, 'true target')}"
        )

    times = flight.manifest.time.kind == "utc"
    if not times:
        tracking = "the photos carry no time, and a track is over time"
    elif not kinds and "detections" not in broken:
        tracking = "it lacks detections"
    elif "detections" in broken or "frames" in broken:
        what = _and([name for name in ("detections", "frames") if name in broken])
        tracking = f"it lacks {what} without a problem"
    elif kinds == {"pixel"} and not good_nav:
        tracking = "pixels need poses, and there are none without a problem"
    else:
        tracking = "" if scored else "without truth only the filter's own consistency can be judged"
    tracks = times and not tracking.startswith(("it lacks", "pixels need"))

    imu = flight.imu is not None and len(flight.imu) > 0 and "imu" not in broken
    gnss = flight.gnss is not None and len(flight.gnss) > 0 and "gnss" not in broken
    navigation = [
        *([] if imu else ["inertial measurements (imu)"]),
        *([] if gnss else ["satellite positions (gnss)"]),
    ]
    slow = "" if navigation else why_no_start(flight)
    unstated = ""
    if flight.manifest.twin is None and (missing := flight.manifest.imu.unstated_noise()):
        unstated = (
            f"; but no report on it, for {_and([f'imu.{name}' for name in missing])} "
            f"{'is' if len(missing) == 1 else 'are'} not stated in flight.toml"
        )
    return [
        Use("georeferencing accuracy", not lacks, georeferencing),
        Use("tracking", tracks, tracking or "detections with times, and truth to judge by"),
        Use(
            "navigation",
            not navigation and not slow,
            f"it lacks {_and(navigation)}" if navigation else slow or f"imu and gnss are there{unstated}",
        ),
    ]


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


def _seen(flight: Flight) -> pd.DataFrame:
    return pd.DataFrame() if flight.detections is None else flight.detections


def _missing(flight: Flight) -> Iterator[Finding]:
    if not flight.nav:
        yield Finding(
            "warning", "nav", "", "there are no poses", "add the log of the autopilot as a nav source"
        )
    for name, nav in flight.nav.items():
        if len(nav) == 0:
            yield Finding(
                "problem", f"nav/{name}", "", "there is no pose in it", "add rows, or remove the table"
            )
    if flight.manifest.camera is None and flight.detections is None and flight.frames is None:
        yield Finding(
            "note",
            "flight.toml",
            "camera",
            "there is no camera and there are no images: the flight is for navigation only",
            "add frames, detections and the camera if there are any",
        )
        return
    if flight.detections is None or len(flight.detections) == 0:
        said, fix = (
            "nothing was detected in this flight",
            "add detections, or use the flight for navigation only",
        )
        if flight.detections is not None and flight.frames is not None and len(flight.frames):
            what = "look" if "sensor" in flight.frames else "frame"
            said += f": of {_some(len(flight.frames), what)}, none has a detection"
            fix = "leave it where that is so, there is nothing to track then; else look at that file"
        yield Finding("warning", "detections", "", said, fix)
    elif flight.frames is None and "pixel" in _kinds(flight):
        fix = "add the table of frames"
        yield Finding("problem", "frames", "", "there are pixels, but no frames they could be in", fix)
    if flight.truth is None or len(flight.truth) == 0:
        yield Finding(
            "warning",
            "truth",
            "",
            "there is no truth: positions can be computed and tracked, but their errors cannot be judged",
            "add surveyed points, or the GPS track of a target",
        )
    elif flight.manifest.scoring.rule == "labelled" and len(_seen(flight)):
        seen = _seen(flight)
        labelled = "target_id" in seen and (seen["target_id"] != "").any()
        if not labelled and ("pixel" in _kinds(flight) or flight.truth["target_id"].nunique() > 1):
            others = others_about(flight)
            yield Finding(
                "note" if others else "warning",
                "detections",
                "target_id",
                "detections are scored by the target they name, and none names one: how accurate their "
                "places are cannot be judged",
                "fill target_id where it is known"
                + (
                    "; `wildlab track --many` needs no names"
                    if others
                    else '; where every detection is of a known target, set [scoring] rule = "nearest"; '
                    "where others are about, state `others = true` in [targets.many]: `wildlab track --many` "
                    "needs no names"
                ),
            )
    elif flight.manifest.scoring.rule == "nearest" and others_about(flight) and len(_seen(flight)):
        yield Finding(
            "warning",
            "flight.toml",
            "scoring.rule",
            "detections are scored by the nearest known target, and others are about: most may be of those",
            'name what is known in target_id and set [scoring] rule = "labelled"',
        )


def _uncertainty(flight: Flight) -> Iterator[Finding]:
    assumed = flight.manifest.uncertainty
    lacking = [name for name in ASSUMED if getattr(assumed, name) is None]
    if flight.manifest.camera is None:
        return  # no point on the ground is computed
    for name, nav in flight.nav.items():
        P = covariances(nav)
        if P is not None and np.isfinite(P).any():
            continue
        if lacking:
            yield Finding(
                "warning",
                f"nav/{name}",
                "cov_00",
                "the poses have no covariance, and the manifest assumes nothing for "
                f"{_and(lacking)}: the usual values are taken, and error ellipses rest on them",
                "state in [uncertainty] what the data sheets promise",
            )
        else:
            yield Finding(
                "note",
                f"nav/{name}",
                "cov_00",
                "the poses have no covariance: the standard deviations of [uncertainty] are assumed instead",
                "compare them with the errors that the report finds",
            )


def _clocks(flight: Flight) -> Iterator[Finding]:
    manifest = flight.manifest
    if manifest.time.kind == "sequence":
        yield Finding(
            "note",
            "flight.toml",
            "time.kind",
            "the photos carry no time, time_s merely numbers them: nothing that takes time can be judged",
            "import with times if the photos have any",
        )
    elif manifest.clocks.camera_offset_s == 0 and _interpolated(flight) and manifest.kind == "logged":
        if manifest.camera is None:
            yield from _clocks_of_sensors(flight)
        else:
            yield Finding(
                "note",
                "flight.toml",
                "clocks.camera_offset_s",
                "the clock of the camera is taken to agree with that of the poses",
                "let `wildlab clock` estimate the offset: at 20 m/s a tenth of a second is 2 m",
            )
    if manifest.mount.poses and manifest.mount.poses not in flight.nav:
        yield Finding(
            "problem",
            "flight.toml",
            "mount.poses",
            f"the mount is said to be on the poses {manifest.mount.poses!r}, and there are none of that name",
            f"name one of those there are: {', '.join(sorted(flight.nav)) or 'none'}",
        )
    if manifest.vertical.reference != "ellipsoid" and manifest.vertical.correction_m == 0:
        # Where nothing is placed on the ground, a constant height changes no result.
        placed = manifest.camera is not None or flight.truth is not None
        yield Finding(
            "warning" if placed else "note",
            "flight.toml",
            "vertical.reference",
            f"heights are said to be {manifest.vertical.reference!r}, and nothing was taken off them",
            "state correction_m in the recipe and import again: inside, heights are ellipsoidal",
        )


def _clocks_of_sensors(flight: Flight) -> Iterator[Finding]:
    """Of a flight without a camera: the sensors of whose stamps nothing is said."""
    frames, detections = flight.frames, flight.detections
    named = frames["sensor"] if frames is not None and "sensor" in frames else None
    names = named if named is not None else detections["source"] if detections is not None else pd.Series()
    stated = {
        name for name, one in flight.manifest.sensors.items() if "clock_offset_s" in one.model_fields_set
    }
    silent = sorted({str(name) for name in names if name} - stated)
    if silent:
        clocks, are = ("the clock of", "is") if len(silent) == 1 else ("the clocks of", "are")
        listed = _and([repr(name) for name in silent])
        yield Finding(
            "note",
            "flight.toml",
            "sensors",
            f"{clocks} {listed} {are} taken to agree with that of the poses",
            "state clock_offset_s in [sensors.NAME] where it is known, or let `wildlab track --tune` learn "
            "it from another flight",
        )


def _checksums(flight: Flight) -> Iterator[Finding]:
    if flight.folder is None:
        return
    changed = manifest_changed(flight.folder)
    if changed is None:
        yield Finding(
            "note",
            "flight.toml",
            "checksums",
            "there are no checksums, so damage to the tables would not be found",
            "write them: wildlab check --accept",
        )
    elif changed:
        yield Finding(
            "warning",
            "flight.toml",
            "",
            "its text is another one than was written: it was changed by hand, or damaged",
            "if the change is meant: wildlab check --accept",
        )
    if changed is not None and not locations_confirmed(flight.folder):
        yield Finding(
            "warning",
            "flight.toml",
            "locations",
            "how sensitive its places are is not what was written; in copies the more careful counts",
            "if the change is meant: wildlab check --accept",
        )


def _interpolated(flight: Flight) -> bool:
    return flight.frames is not None and any("frame_id" not in nav for nav in flight.nav.values())


def _some(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _and(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
