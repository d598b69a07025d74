"""Surveyed points, whatever the file: what their parts share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wildlab.flight.files import printable
from wildlab.flight.readers.logs.log import RawLog, Stream, make_stream

#: Letters of a name that are kept.
MOST_LETTERS = 200


def marks_part(columns: dict[str, Any], rows: Sequence[int], counted_in: str) -> Stream:
    """Columns of marks as a part; what has no place, no height or a name twice says so.

    Parameters
    ----------
    columns
        As `log.PARTS` has them for ``marks``, (N,) each.
    rows, counted_in
        Where each stands in the file, and what that counts.

    Returns
    -------
    Stream
    """
    latitude, longitude = (np.asarray(columns[f"{one}_deg"], float) for one in ("latitude", "longitude"))
    heights = [np.asarray(columns[one], float) for one in columns if one.startswith("height_")]
    high = np.isfinite(np.array(heights)).any(axis=0) if heights else np.zeros(len(latitude), bool)
    names = [printable(str(one).strip()[:MOST_LETTERS]) for one in columns["name"]]
    # Marks are counted where nothing names them.
    names = [name or str(at) for at, name in enumerate(names, 1)]
    first = {name: at for at, name in reversed(list(enumerate(names)))}
    twice = np.array([first[name] != at for at, name in enumerate(names)], dtype=np.bool_)
    with np.errstate(invalid="ignore"):
        outside = (np.abs(latitude) > 90) | (np.abs(longitude) > 180)
    return make_stream(
        "marks",
        {**columns, "name": names},
        rows,
        counted_in,
        {
            "no position": ~np.isfinite(latitude + longitude),
            "position that is none on Earth": outside,
            "placeholder of a position": (latitude == 0) & (longitude == 0),
            "a name that stands there twice": twice,
            "no height": ~high,
        },
    )


def marks_log(format_: str, part: Stream, lost: Sequence[str], notes: Sequence[str]) -> RawLog:
    """A log of nothing but marks, with sentences on those that are not used."""
    why = part.columns["why"]
    said = [f"{int((why == one).sum())} of {len(part)} marks: {one}" for one in dict.fromkeys(why) if one]
    return RawLog(format_, {"marks": part}, lost=tuple(lost), notes=(*notes, *said))
