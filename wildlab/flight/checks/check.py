"""Is this flight usable, for what, and does it make sense? What is asked of its tables and of what they mean,
and the answers."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from wildlab.flight.checks.attitude import field, forces, heading
from wildlab.flight.checks.findings import (
    NORM_TOLERANCE,
    POSE,
    Finding,
    Level,
    bad_rows,
    finite_rows,
    part_of,
    report_alone,
    say,
)
from wildlab.flight.checks.inertial import inertial, turning, why_no_start
from wildlab.flight.checks.known_points import known_points
from wildlab.flight.checks.motion import (
    CLOCKS,
    LARGE_M,
    leaps,
    motion,
    origin,
    positions,
    stray_places,
    together,
    without_leaps,
)
from wildlab.flight.checks.sensors import (
    ground,
    image,
    lens,
    scans,
    sensors,
    targets,
    terrain_findings,
)
from wildlab.flight.clock_fitting import Span
from wildlab.flight.clocks import covariances, frame_times, gnss_times, longest_gap
from wildlab.flight.files import printable
from wildlab.flight.schema import NAV, POSITION, QUATERNION, TABLES, Table, extra_columns
from wildlab.flight.store import Flight, locations_confirmed, manifest_changed
from wildlab.geometry.frames import Array, Mask
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
    return sentences_of(find(flight, plain=False))


def sentences_of(findings: Iterable[Finding]) -> list[str]:
    """Findings in sentences with the remedy; notes are left out."""
    return [f"{one.level}: {one.sentence} {one.fix}" for one in findings if one.level != "note"]


def problems_of(flight: Flight) -> tuple[Finding, ...]:
    """Why a flight, or a table of it, cannot be read."""
    return tuple(one for one in find(flight, meaning=False) if one.level == "problem")


def usable_for(flight: Flight, problems: Sequence[Finding] | None = None) -> list[Use]:
    """What the flight can be used for: georeferencing accuracy, tracking, navigation.

    Parameters
    ----------
    flight
        The flight.
    problems
        Of `problems_of`, where they are known.

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
    broken = {finding.table for finding in (problems_of(flight) if problems is None else problems)}
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
    # Detections without a name are of one.
    seen = flight.table("detections")
    names = [seen["target_id"].fillna("")] if "target_id" in seen else []
    if (most := int(seen.groupby([seen["source"], *names])["frame_id"].nunique().max())) < FEWEST_SCANS:
        return False, say("few-scans", most=most, fewest=FEWEST_SCANS)
    return True, say("tracking" if scored else "tracking-without-truth")


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
        return not flight.manifest.targets.others
    pixels = flight.detections[flight.detections["kind"] == "pixel"]
    return "target_id" in pixels and bool(pixels["target_id"].isin(flight.truth["target_id"]).any())


def _kinds(flight: Flight) -> set[str]:
    return set() if flight.detections is None else set(flight.detections["kind"])


# -- the rows of tables by themselves, and whether tables are of the same time

#: Truth further from every pose than this belongs to another flight, or has its coordinates exchanged.
FAR_M = 20_000.0
#: What may differ between two rows of one detection: what it is called, and whose it is said to be.
NAMES = ("detection_id", "target_id")
#: One clicked twice now and then is worth a word; this share of all is a file that was read twice.
FEW = 0.01
#: So many detections of one source, and so large a share of them, are never by chance those of another one.
ENOUGH, MOST = 10, 0.5
#: So large a share that stands there again is a log, or a part of one, that was read twice.
PART = 0.1


def schemas(flight: Flight) -> Iterator[tuple[str, Table, pd.DataFrame]]:
    """Every table of a flight by its name, with its schema."""
    for name, nav in flight.nav.items():
        yield f"nav/{name}", NAV, nav
    for name, table in flight.tables.items():
        yield name, TABLES[name], table


def values(flight: Flight) -> Iterator[Finding]:
    """Numbers that are not numbers, and columns nobody knows."""
    for name, schema, table in schemas(flight):
        if schema is NAV:
            yield from _pose_values(name, table)
        else:
            for known in schema.columns:
                if known.dtype == "float" and known.name in table:
                    value = table[known.name].to_numpy()
                    bad = np.isinf(value) if known.may_be_nan else ~np.isfinite(value)
                    yield from bad_rows(bad, "problem", name, known.name, "not-finite")
        for column in extra_columns(schema, table):
            close = difflib.get_close_matches(column, schema.column_names, n=1)
            facts = {"close": close[0] if close else "", "known": bool(close)}
            yield Finding("warning", name, printable(column), "unknown-column", facts)


def _pose_values(table: str, nav: pd.DataFrame) -> Iterator[Finding]:
    for column in POSE:
        yield from bad_rows(~np.isfinite(nav[column].to_numpy()), "problem", table, column, "pose-not-finite")
    norm = np.linalg.norm(nav[QUATERNION].to_numpy(), axis=1)
    yield from bad_rows(
        np.abs(norm - 1) > NORM_TOLERANCE, "problem", table, "q_w", "not-normalised", {"norm": norm}
    )
    P = covariances(nav)
    if P is not None:
        P = P[np.isfinite(P).all(axis=(1, 2))]
        negative = np.linalg.eigvalsh(P)[:, 0] < -1e-9 * np.trace(P, axis1=1, axis2=2)
        yield from bad_rows(negative, "problem", table, "cov_00", "no-covariance")


def bounds(flight: Flight) -> Iterator[Finding]:
    """Values that nothing on Earth has: the bounds are in the schema, with each column. NaN is not beyond.

    Parameters
    ----------
    flight
        The flight.

    Yields
    ------
    Finding
    """
    for name, schema, table in schemas(flight):
        for column in schema.columns:
            if column.bounds is None or column.name not in table:
                continue
            value = table[column.name].to_numpy(float)
            low, high = column.bounds
            bad = ((value < low) | (value > high)) & np.isfinite(value)
            facts = {"low": low, "high": high, "unit": column.unit, "value": value, "part": part_of(name)}
            causes = ("beyond bounds",)
            yield from bad_rows(bad, "problem", name, column.name, "beyond-bounds", facts, causes)


def order(flight: Flight) -> Iterator[Finding]:
    """Timestamps that run backwards or stand still."""
    series = [(f"nav/{name}", nav) for name, nav in flight.nav.items() if "frame_id" not in nav]
    on_board = ("imu", "gnss", "magnetometer", "gimbal")
    series += [(name, flight.tables[name]) for name in on_board if name in flight.tables]
    for name, table in series:
        yield from _increasing(name, table["time_s"], "")
    if flight.truth is not None:
        for target, rows in flight.truth.groupby("target_id", sort=False):
            times = rows["time_s"]
            if times.isna().all():
                continue
            if times.isna().any():
                yield Finding("problem", "truth", "time_s", "times-missing", {"target": target})
            else:
                yield from _increasing("truth", times, f" of target {target!r}")
    frames = flight.frames
    if frames is not None:
        if (np.diff(frames["time_s"].to_numpy()) < 0).any():
            yield from _increasing("frames", frames["time_s"], "")
            return
        # Two sensors may look at once.
        by_sensor = "sensor" in frames
        looks = [rows for _, rows in frames.groupby("sensor", sort=False)] if by_sensor else [frames]
        again = sum(int((np.diff(rows["time_s"].to_numpy()) == 0).sum()) for rows in looks)
        if again:
            yield Finding("warning", "frames", "time_s", "same-time", {"n": again, "by_sensor": by_sensor})


def _increasing(name: str, times: pd.Series, of_target: str) -> Iterator[Finding]:
    stamps = times.to_numpy()
    yield from bad_rows(
        np.diff(stamps) <= 0,
        "problem",
        name,
        "time_s",
        "not-increasing",
        {"of_target": of_target, "stamp": stamps[:-1], "next": stamps[1:]},
    )


def truth_place(flight: Flight) -> Iterator[Finding]:
    """Truth that is nowhere near the flight."""
    if flight.truth is None or not flight.nav:
        return
    poses = np.concatenate([finite_rows(nav, POSITION) for nav in flight.nav.values()])
    truth = flight.truth[POSITION].to_numpy()
    if len(poses) == 0 or len(truth) == 0:
        return
    low, high = poses.min(axis=0)[:2], poses.max(axis=0)[:2]
    beyond = np.maximum(np.maximum(low - truth[:, :2], truth[:, :2] - high), 0)
    distance = np.hypot(beyond[:, 0], beyond[:, 1])
    far = distance > FAR_M
    facts = {"name": flight.truth["target_id"].to_numpy(object), "km": distance / 1e3}
    code = "all-truth-far" if far.all() else "truth-far"
    yield from bad_rows(far, "problem", "truth", "north_m", code, facts)
    if not far.any():
        above = truth[:, 2] < poses[:, 2].min()
        yield from bad_rows(above, None, "truth", "down_m", "truth-above")


def identity(flight: Flight) -> Iterator[Finding]:
    """Names that occur twice, or name nothing."""
    frames, detections, truth = flight.frames, flight.detections, flight.truth
    twice: list[tuple[str, str, str, pd.Series]] = [
        (f"nav/{name}", "frame_id", "pose", nav["frame_id"])
        for name, nav in flight.nav.items()
        if "frame_id" in nav
    ]
    if frames is not None:
        twice.append(("frames", "frame_id", "frame", frames["frame_id"]))
    if truth is not None:
        twice.append(("truth", "target_id", "point", truth.loc[truth["time_s"].isna(), "target_id"]))
    if detections is not None and len(detections):
        pairs = detections[["detection_id", "source"]].agg(" of ".join, axis=1)
        twice.append(("detections", "detection_id", "detection", pairs))
    for table, column, what, names in twice:
        again = names.duplicated().to_numpy()
        yield from bad_rows(
            again, "problem", table, column, f"{what}-twice", {"name": names.to_numpy(object)}
        )
    if detections is None:
        return
    ids = detections["frame_id"].to_numpy(object)
    # Another sensor's bearing or position need not belong to an image.
    lost = ~detections["frame_id"].isin([] if frames is None else frames["frame_id"]).to_numpy()
    lost &= ~((ids == "") & (detections["kind"] != "pixel").to_numpy())
    yield from bad_rows(lost, "problem", "detections", "frame_id", "frame-unknown", {"first": ids})
    if truth is not None and "target_id" in detections:
        targets = detections["target_id"]
        strange = ~targets.isin({"", *truth["target_id"]}).to_numpy()
        first = {"first": targets.to_numpy(object)}
        yield from bad_rows(strange, "warning", "detections", "target_id", "target-unknown", first)


def duplicates(flight: Flight) -> Iterator[Finding]:
    """Detections that are alike in all that was measured: in one look, or of another look at the same time.

    Parameters
    ----------
    flight
        The flight.

    Yields
    ------
    Finding
        Of one look, with how many of how many stand there again, and the first; and one for each source that
        says what another one says, as a log that was read under two names.
    """
    detections = flight.detections
    if detections is None or not len(detections):
        return
    measured = [name for name in detections.columns if name not in NAMES]
    # Without a look, equal values may be of two times.
    again = detections.duplicated(measured).to_numpy() & (detections["frame_id"] != "").to_numpy()
    if again.any():
        yield _in_one_look(detections, again)
    else:
        yield from _in_other_looks(flight, detections)


def held_against_itself(flight: Flight) -> Iterator[Finding]:
    """Poses that are those of the truth, row by row: of these, errors of zero say nothing."""
    row = ["time_s", *POSITION]
    for truth in (name for name in flight.nav if name.startswith("truth")):
        for name in flight.estimated_sources:
            one, other = (flight.nav[source][row].drop_duplicates(POSITION) for source in (name, truth))
            n = len(one.merge(other, on=row))
            if n >= ENOUGH and n > MOST * min(len(one), len(other)):
                facts = {"n": n, "of": len(one), "truth": truth}
                yield Finding("warning", f"nav/{name}", "time_s", "own-truth", facts)


def _in_one_look(detections: pd.DataFrame, again: Mask) -> Finding:
    rows = detections.loc[again]
    n, of, first = len(rows), len(detections), rows.iloc[0]
    level: Level = "warning" if n > FEW * of else "note"
    if n >= ENOUGH and n > PART * of:
        level = "problem"
    facts = {"n": n, "of": of, "looks": rows["frame_id"].nunique()}
    facts |= {"first": first["detection_id"], "frame": first["frame_id"]}
    return Finding(level, "detections", "detection_id", "alike-in-one-look", facts)


def _in_other_looks(flight: Flight, detections: pd.DataFrame) -> Iterator[Finding]:
    frames = flight.frames
    if frames is None or flight.manifest.time.kind != "utc":
        return
    at = frames.drop_duplicates("frame_id").set_index("frame_id")["time_s"]
    looks = detections.assign(frame_id=detections["frame_id"].map(at)).dropna(subset=["frame_id"])
    measured = [name for name in looks.columns if name not in (*NAMES, "source")]
    # Answers of several programs to the same pixels may well be the same.
    if bool((detections["kind"] == "pixel").any()):
        looks = looks.loc[(looks["kind"] != "position").to_numpy()]
    again = looks.duplicated(measured, keep=False)
    if not again.any():
        return
    groups = looks.loc[again].groupby(measured, dropna=False)["source"]
    count_of = Counter(tuple(sorted(set(rows))) for _, rows in groups)
    for names, count in count_of.items():
        first, last = names[0], names[-1]
        of = min(int((looks["source"] == name).sum()) for name in names) // (1 if len(names) > 1 else 2)
        if count >= ENOUGH and count >= MOST * of:
            facts = {"n": count, "of": of, "first": first, "last": last, "one": first == last}
            yield Finding("problem", "detections", "source", "read-twice", facts)


#: Logs do not begin and end together: fewer frames outside than this share are good to know, no more.
FEW_OUTSIDE = 0.02
#: More gaps than this are counted and not listed.
LISTED = 5
#: Share of the shorter that has to lie within the longer, and what it may be less while clocks are in doubt.
WITHIN, DOUBT = 0.9, 0.5
HOURS = tuple(float(h) for h in np.arange(-26.0, 26.25, 0.25) if h)


def overlap(flight: Flight) -> Iterator[Finding]:
    """Whether poses, frames and truth are of the same time."""
    frames = flight.frames
    if frames is None or len(frames) == 0:
        return
    times, ids = frame_times(flight), frames["frame_id"]
    for name, nav in flight.nav.items():
        table = f"nav/{name}"
        if "frame_id" in nav:
            lost, first = ~ids.isin(nav["frame_id"]).to_numpy(), {"first": ids.to_numpy(object)}
            yield from bad_rows(lost, None, table, "frame_id", "frame-without-pose", first)
        else:
            yield from _outside(table, {"poses": nav["time_s"].to_numpy(float)}, times)
    if flight.truth is not None and flight.manifest.time.kind == "utc":
        late = flight.manifest.clocks.truth_offset_s
        targets = flight.truth.groupby("target_id", sort=False)["time_s"]
        logs = {f"truth of {target!r}": stamps.to_numpy(float) + late for target, stamps in targets}
        yield from _outside("truth", logs, times)


def _outside(table: str, logs: dict[str, Array], times: Array) -> Iterator[Finding]:
    """The log outside of which most frames are, and how many others have some outside."""
    known, found = times[np.isfinite(times)], []
    for name, stamps in logs.items():
        if len(known) and np.isfinite(stamps).any():
            low, high = float(np.nanmin(stamps)), float(np.nanmax(stamps))
            outside = int((~((times >= low) & (times <= high))).sum())
            if outside:
                found.append((outside, name, low, high))
    if not found:
        return
    n, name, low, high = max(found, key=lambda one: one[0])
    first, last = float(known.min()), float(known.max())
    facts = {"log": name, "low": low, "high": high, "first": first, "last": last}
    facts |= {"n": n, "of": len(times), "others": len(found) - 1}
    facts |= {"late": max(low - first, 0.0), "early": max(last - high, 0.0)}
    level: Level = "problem" if n == len(times) else "note" if n < FEW_OUTSIDE * len(times) else "warning"
    code = "times-apart" if level == "problem" else "times-outside"
    yield Finding(level, table, "time_s", code, facts)


def gaps(flight: Flight) -> Iterator[Finding]:
    """Frames between poses that are too far apart for one to be given, and what was detected in them."""
    frames, detections = flight.frames, flight.detections
    if frames is None or len(frames) == 0:
        return
    times = frame_times(flight)
    for name, nav in flight.nav.items():
        stamps = nav["time_s"].to_numpy(float)
        if "frame_id" in nav or len(stamps) < 2 or not (np.diff(stamps) > 0).all():
            continue  # said elsewhere, or a pose that holds at all times
        before = np.clip(np.searchsorted(stamps, times) - 1, 0, len(stamps) - 2)
        within = (times > stamps[before]) & (times < stamps[before + 1])
        lost = within & (np.diff(stamps)[before] > longest_gap(stamps))
        without = 0
        if detections is not None:
            of_lost = detections["frame_id"].isin(frames["frame_id"][lost])
            # A position needs no pose to have a place.
            without = int((of_lost & (detections["kind"] != "position")).sum())
        spans = [f"{stamps[k]:.3f} s to {stamps[k + 1]:.3f} s" for k in np.unique(before[lost])]
        facts = {
            "what": "look" if "sensor" in frames else "frame",
            "spans": ", ".join(spans[:LISTED]),
            "more": max(len(spans) - LISTED, 0),
            "without": without,
            "detections": 0 if detections is None else len(detections),
        }
        yield from bad_rows(lost, "warning", f"nav/{name}", "time_s", "pose-gap", facts)


def stamps(flight: Flight) -> Iterator[Finding]:
    """Parts of a flight that a whole number of hours brings together: zones."""
    if flight.manifest.time.kind != "utc":
        return
    spans = _spans(flight)
    off = {name: [o for o in spans if o != name and _common(spans[name], spans[o]) < DOUBT] for name in spans}
    # Who disagrees with the most is the one that is wrong; of two, the one that is not of the poses.
    most = max((len(others) for others in off.values()), default=0)
    if most == 0:
        return
    wrong = [name for name, others in off.items() if len(others) == most]
    name = wrong[0] if len(spans) > 2 and most == len(spans) - 1 else wrong[-1]
    other = off[name][0]
    for hours in HOURS:
        if _common(spans[name], spans[other], 3600 * hours) >= WITHIN:
            facts = {"hours": hours, "other": other, "part": part_of(name)}
            causes = (f"zone ({hours:+g} h)",)
            yield Finding("problem", name, "time_s", "stamps-of-another-zone", facts, causes)
            return


def _spans(flight: Flight) -> dict[str, Span]:
    """First and last time of each part that has two."""
    times: dict[str, Any] = {
        f"nav/{name}": nav["time_s"] for name, nav in flight.nav.items() if not name.startswith("truth")
    }
    if flight.imu is not None:
        times["imu"] = flight.imu["time_s"]
    if flight.gnss is not None:
        times["gnss"] = gnss_times(flight)
    if "magnetometer" in flight.tables:
        times["magnetometer"] = flight.tables["magnetometer"]["time_s"]
    if flight.truth is not None:
        times["truth"] = flight.truth["time_s"] + flight.manifest.clocks.truth_offset_s
    if flight.frames is not None:
        times["frames"] = frame_times(flight)
    known = {name: np.asarray(t, float)[np.isfinite(np.asarray(t, float))] for name, t in times.items()}
    spans = {name: (float(t.min()), float(t.max())) for name, t in known.items() if len(t) > 1}
    return {name: span for name, span in spans.items() if span[1] > span[0]}


def _common(one: Span, other: Span, by: float = 0.0) -> float:
    """Share of the shorter that both have once ``by`` is added to the first."""
    common = min(one[1] + by, other[1]) - max(one[0] + by, other[0])
    return max(common, 0.0) / max(min(one[1] - one[0], other[1] - other[0]), 1e-9)


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
            others = manifest.targets.others
            level: Level = "note" if others else "warning"
            yield Finding(level, "detections", "target_id", "none-names-a-target", {"others": others})
    elif manifest.targets.others:
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
    reference = manifest.vertical.counted_from
    if reference != "ellipsoid":
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


# -- what is asked, in turn

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
    held_against_itself,
    stray_places,
    image,
    inertial,
    turning,
    terrain_findings,
    missing,
    uncertainty,
    clocks,
    checksums,
)
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
