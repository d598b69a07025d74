"""Detections that stand in the table twice, as where a file was read by two parts of a recipe."""

from __future__ import annotations

from collections.abc import Iterator

from wildlab.flight.checks.findings import Finding
from wildlab.flight.store import Flight

#: What may differ between two rows of one detection: what it is called, and whose it is said to be.
NAMES = ("detection_id", "target_id")
#: One clicked twice now and then is worth a word; this share of all is a file that was read twice.
FEW = 0.01


def twice(flight: Flight) -> Iterator[Finding]:
    """Detections of one source and one look that are alike in all that was measured.

    Parameters
    ----------
    flight
        The flight.

    Yields
    ------
    Finding
        One, with how many of how many stand there again, and the first.
    """
    detections = flight.detections
    if detections is None or not len(detections):
        return
    measured = [name for name in detections.columns if name not in NAMES]
    # Without a look, equal values may be of two times.
    placed = (detections["frame_id"] != "").to_numpy()
    again = detections.duplicated(measured).to_numpy() & placed
    if not again.any():
        return
    rows = detections.loc[again]
    first = rows.iloc[0]
    n, looks = len(rows), rows["frame_id"].nunique()
    yield Finding(
        "warning" if n > FEW * len(detections) else "note",
        "detections",
        "detection_id",
        f"{n} of {len(detections)} detections {'is' if n == 1 else 'are'} exactly like another one of the "
        f"same look, in {looks} look{'' if looks == 1 else 's'}, first {first['detection_id']!r} in "
        f"{first['frame_id']!r}: a target would be seen twice there",
        "take out the rows that stand there twice, or the part of the recipe that reads the same file again",
    )
