"""The rows of tables by themselves: numbers, bounds, order, names, and what stands there twice."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.flight.checks.findings import (
    NORM_TOLERANCE,
    POSE,
    POSITION,
    QUATERNION,
    Finding,
    Level,
    bad_rows,
    part_of,
)
from wildlab.flight.clocks import covariances
from wildlab.flight.files import printable
from wildlab.flight.schema import NAV, TABLES, Table, extra_columns
from wildlab.flight.store import Flight

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
    norm = np.linalg.norm(nav[list(QUATERNION)].to_numpy(), axis=1)
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
    poses = np.concatenate([nav[list(POSITION)].to_numpy() for nav in flight.nav.values()])
    poses = poses[np.isfinite(poses).all(axis=1)]
    truth = flight.truth[list(POSITION)].to_numpy()
    if len(poses) == 0 or len(truth) == 0:
        return
    low, high = poses.min(axis=0)[:2], poses.max(axis=0)[:2]
    beyond = np.maximum(np.maximum(low - truth[:, :2], truth[:, :2] - high), 0)
    distance = np.hypot(beyond[:, 0], beyond[:, 1])
    far = distance > FAR_M
    facts = {"name": flight.truth["target_id"].to_numpy(object), "km": distance / 1e3}
    yield from bad_rows(far, "problem", "truth", "north_m", "truth-far", facts)
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
    for table, field, what, names in twice:
        again = names.duplicated().to_numpy()
        yield from bad_rows(again, "problem", table, field, f"{what}-twice", {"name": names.to_numpy(object)})
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


def _in_one_look(detections: pd.DataFrame, again: NDArray[np.bool_]) -> Finding:
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
