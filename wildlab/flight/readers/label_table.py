"""Boxes or points out of a CSV table, a row for each thing."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.marked import Marked

Array = NDArray[np.float64]

#: Columns that name the frame: a file name, or the number of a clip's frame from 0.
IMAGE_COLUMNS = ("image", "frame", "frame_id", "file", "filename")
NUMBER_COLUMNS = ("frame0",)
#: Ways to say where something is: corner and size, two corners, a point.
SIZES, CORNERS, POINTS = (
    (
        ("x", "y", "w", "h"),
        ("left", "top", "width", "height"),
        ("left_px", "top_px", "width_px", "height_px"),
    ),
    (("x_min", "y_min", "x_max", "y_max"), ("x0", "y0", "x1", "y1")),
    (("u_px", "v_px"), ("u", "v")),
)
CLASS_COLUMNS = ("class", "label", "category")
SCORE_COLUMNS = ("score", "confidence", "conf")
#: Into how many parts a clip is divided whose frames belong together.
STRETCHES = 10
#: Classes that mark what is not to be judged, without regard to capitals.
IGNORED = frozenset({"dontcare", "ignore", "crowd"})


def read_table_boxes(data: bytes, path: Path, *, group: str | None = None) -> Marked:
    """Boxes out of a CSV table with one row for each thing.

    Parameters
    ----------
    data
        The file's content: a column names the image (`IMAGE_COLUMNS`) or numbers the clip's frame
        (``frame0``), others are a box or a point in px (`SIZES`, `CORNERS`, `POINTS`), and perhaps the class
        and a score. A row without numbers is an empty frame.
    path
        For messages.
    group
        Column that says what frames belong together; None where that is not asked for.

    Returns
    -------
    Marked

    Raises
    ------
    WildlabError
        Where the table cannot be read, lacks a column, has no row, or has one that cannot be used.
    """
    table = _table(data, path)
    columns = list(table.columns)
    name = next((one for one in (*IMAGE_COLUMNS, *NUMBER_COLUMNS) if one in columns), None)
    if name is None:
        known = ", ".join((*IMAGE_COLUMNS, *NUMBER_COLUMNS))
        raise WildlabError("no column names the image", f"call it one of {known}", file=path)
    for wanted in (group,) if group else ():
        if wanted not in columns:
            raise WildlabError(
                "there is no such column", "name one that the table has", file=path, field=wanted
            )
    by_number = name in NUMBER_COLUMNS
    names = [str(one).strip() for one in table[name]]
    if by_number:
        numbers = pd.to_numeric(table[name], errors="coerce")
        if numbers.isna().any():
            row = int(np.flatnonzero(numbers.isna())[0]) + 2
            raise WildlabError(f"line {row} has no number", "number frames from 0", file=path, field=name)
        names = [str(int(one)) for one in numbers]
    boxes = _boxes(table, path)
    wrong = np.isfinite(boxes).any(axis=1) & ~(
        np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] >= 0).all(axis=1)
    )
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0]) + 2
        raise WildlabError(f"line {row} has no box of numbers", "mend it, or leave the row out", file=path)
    kind_column = next((one for one in CLASS_COLUMNS if one in columns), None)
    kinds = [""] * len(table) if kind_column is None else [str(one) for one in table[kind_column]]
    score_column = next((one for one in SCORE_COLUMNS if one in columns), None)
    scores = np.full(len(table), np.nan)
    if score_column is not None:
        scores = pd.to_numeric(table[score_column], errors="coerce").to_numpy(float)
        bad = np.flatnonzero(~np.isfinite(scores) & np.isfinite(boxes).all(axis=1))
        if len(bad):
            raise WildlabError(
                f"line {bad[0] + 2} has no number",
                "give each box a score, or take the column out",
                file=path,
                field=score_column,
            )
    if group is not None:
        own: list[str] | None = [str(one) for one in table[group]]
    else:
        own = _stretches(names) if by_number else None
    return Marked(
        "CSV",
        names,
        boxes,
        kinds,
        scores,
        np.array([one.lower() in IGNORED for one in kinds], bool),
        tuple(dict.fromkeys(names)),
        tuple(dict.fromkeys(kinds)),
        groups=None if own is None else dict(zip(names, own, strict=True)),
        by="number" if by_number else "name",
    )


def _stretches(numbers: list[str]) -> list[str]:
    """To which of ten stretches of a clip each frame belongs: its neighbours show the same."""
    known = sorted({int(one) for one in numbers})
    place = {number: STRETCHES * at // len(known) for at, number in enumerate(known)}
    return [f"stretch {place[int(one)]}" for one in numbers]


def _table(data: bytes, path: Path) -> pd.DataFrame:
    try:
        table = pd.read_csv(io.BytesIO(data), encoding="utf-8-sig")
    except (ValueError, UnicodeDecodeError) as error:
        raise WildlabError(
            f"is no table of comma-separated values ({error})", "write it as CSV", file=path
        ) from None
    if table.empty:
        raise WildlabError("has no row", "give one row for each label", file=path)
    return table


def _boxes(table: pd.DataFrame, path: Path) -> Array:
    for kind, ways in (("sizes", SIZES), ("corners", CORNERS), ("points", POINTS)):
        for way in ways:
            if not set(way) <= set(table.columns):
                continue
            given = table[list(way)].apply(pd.to_numeric, errors="coerce").to_numpy(float)
            if kind == "corners":
                return np.concatenate([given[:, :2], given[:, 2:] - given[:, :2]], axis=1)
            if kind == "points":
                return np.concatenate([given, 0 * given], axis=1)
            if way[0] == "left_px" and set(POINTS[0]) <= set(table.columns):
                # A table of detections: it is their centroids that they are judged by.
                middle = table[list(POINTS[0])].apply(pd.to_numeric, errors="coerce").to_numpy(float)
                return np.concatenate([middle - given[:, 2:] / 2, given[:, 2:]], axis=1)
            return np.asarray(given)
    ways_known = "; ".join(", ".join(way) for ways in (SIZES, CORNERS, POINTS) for way in ways)
    raise WildlabError("no columns say where things are", f"call them one of: {ways_known}", file=path)
