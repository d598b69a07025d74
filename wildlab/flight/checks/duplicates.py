"""Detections that stand in the table twice, as where a file was read by two parts of a recipe."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pandas as pd

from wildlab.flight.checks.findings import Finding, Level
from wildlab.flight.store import Flight

#: What may differ between two rows of one detection: what it is called, and whose it is said to be.
NAMES = ("detection_id", "target_id")
#: One clicked twice now and then is worth a word; this share of all is a file that was read twice.
FEW = 0.01
#: So many detections of one source, and so large a share of them, are never by chance those of another one.
ENOUGH, MOST = 10, 0.5
#: So large a share that stands there again is a log, or a part of one, that was read twice.
PART = 0.1


def twice(flight: Flight) -> Iterator[Finding]:
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
    placed = (detections["frame_id"] != "").to_numpy()
    again = detections.duplicated(measured).to_numpy() & placed
    if again.any():
        yield _in_one_look(detections, again)
    else:
        yield from _in_other_looks(flight, detections)


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
    count_of: Counter[tuple[str, ...]] = Counter()
    for _, rows in looks.loc[again].groupby(measured, dropna=False)["source"]:
        count_of[tuple(sorted(set(rows)))] += 1
    for names, count in count_of.items():
        first, last = names[0], names[-1]
        of = min(int((looks["source"] == name).sum()) for name in names) // (1 if len(names) > 1 else 2)
        if count < ENOUGH or count < MOST * of:
            continue
        whose = (
            f"of {last!r} are exactly those of {first!r}" if last != first else f"of {first!r} stand twice"
        )
        yield Finding(
            "problem",
            "detections",
            "source",
            f"{count} of {of} detections {whose} at the same times, in looks of their own: one log was read "
            "twice, and a tracker would take each target for two",
            f"take out the part of the recipe that reads {last!r} from a copy of the file, or its rows",
        )


def _in_one_look(detections: pd.DataFrame, again: np.ndarray) -> Finding:
    rows = detections.loc[again]
    first = rows.iloc[0]
    n, looks = len(rows), rows["frame_id"].nunique()
    level: Level = "warning" if n > FEW * len(detections) else "note"
    return Finding(
        "problem" if n >= ENOUGH and n > PART * len(detections) else level,
        "detections",
        "detection_id",
        f"{n} of {len(detections)} detections {'is' if n == 1 else 'are'} exactly like another one of the "
        f"same look, in {looks} look{'' if looks == 1 else 's'}, first {first['detection_id']!r} in "
        f"{first['frame_id']!r}: a target would be seen twice there",
        "take out the rows that stand there twice, or the part of the recipe that reads the same file again",
    )
