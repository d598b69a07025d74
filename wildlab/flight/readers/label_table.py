"""Boxes or points out of a CSV table, a row for each thing."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.files import read_csv
from wildlab.flight.files import printable
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
#: Columns that an error names at most.
MOST_SHOWN = 12
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
    table = _table(data, path, group)
    columns = {_plain(one): one for one in reversed(table.columns)}
    name = next(
        (columns[_plain(one)] for one in (*IMAGE_COLUMNS, *NUMBER_COLUMNS) if _plain(one) in columns), None
    )
    if name is None:
        known = ", ".join((*IMAGE_COLUMNS, *NUMBER_COLUMNS))
        raise WildlabError(
            f"no column names the image: there are {_shown(table)}", f"call it one of {known}", file=path
        )
    if group is not None and group not in table.columns:
        raise WildlabError("there is no such column", f"name one of {_shown(table)}", file=path, field=group)
    by_number = _plain(name) in NUMBER_COLUMNS
    names = [str(one).strip() for one in table[name]]
    if by_number:
        numbers = pd.to_numeric(table[name], errors="coerce")
        if numbers.isna().any():
            row = int(np.flatnonzero(numbers.isna())[0]) + 2
            raise WildlabError(f"line {row} has no number", "number frames from 0", file=path, field=name)
        names = [str(int(one)) for one in numbers]
    boxes, place = _boxes(table, columns, path)
    wrong = ~np.isfinite(boxes).all(axis=1) & ~table[place].isna().all(axis=1).to_numpy()
    wrong |= (boxes[:, 2:] < 0).any(axis=1)
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        seen = ", ".join(f"{one} {printable(str(table[one].iloc[row]))}" for one in place)
        raise WildlabError(
            f"line {row + 2} has no box: {seen}",
            "give finite numbers, and a width and height not below zero; or leave the row out",
            file=path,
        )
    there_is = np.isfinite(boxes).all(axis=1)
    if (boxes[there_is, 2:] > 0).any() and (np.abs(boxes[there_is]) <= 1).all():
        raise WildlabError(
            "the boxes are shares of the image: none is wider or farther than 1",
            "give pixels, or the folder of text files that they are from (YOLO)",
            file=path,
            field=", ".join(place),
        )
    kind_column = next((columns[one] for one in CLASS_COLUMNS if one in columns), None)
    kinds = [""] * len(table) if kind_column is None else [str(one) for one in table[kind_column]]
    score_column = next((columns[one] for one in SCORE_COLUMNS if one in columns), None)
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
    twice = pd.DataFrame(boxes).assign(name=names, kind=kinds).duplicated().to_numpy() & there_is
    if group is not None:
        own: list[str] | None = [str(one) for one in table[group]]
    else:
        own = _stretches(names) if by_number else None
    kept = np.flatnonzero(~twice)
    return Marked(
        "CSV",
        [names[row] for row in kept],
        boxes[kept],
        [kinds[row] for row in kept],
        scores[kept],
        np.array([kinds[row].lower() in IGNORED for row in kept], bool),
        tuple(dict.fromkeys(names)),
        tuple(dict.fromkeys(kinds)),
        groups=None if own is None else dict(zip(names, own, strict=True)),
        by="number" if by_number else "name",
        left_out={"a row that stands in the file twice": int(twice.sum())} if twice.any() else {},
    )


def _stretches(numbers: list[str]) -> list[str]:
    """To which of ten stretches of a clip each frame belongs: its neighbours show the same."""
    known = sorted({int(one) for one in numbers})
    place = {number: STRETCHES * at // len(known) for at, number in enumerate(known)}
    return [f"stretch {place[int(one)]}" for one in numbers]


def _plain(column: object) -> str:
    """A column's name as people vary it: ``X_min`` is ``xmin``."""
    return str(column).strip().lower().replace("_", "")


def _shown(table: pd.DataFrame) -> str:
    return ", ".join(printable(str(one)) for one in table.columns[:MOST_SHOWN])


def _table(data: bytes, path: Path, group: str | None) -> pd.DataFrame:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise WildlabError(
            f"line {line} is not text in UTF-8", "save it as CSV in UTF-8", file=path
        ) from None
    lines = text.splitlines()
    told = (n for n, line in enumerate(lines) if line.strip() and not line.startswith("#"))
    before = next(told, len(lines))
    head = lines[before] if before < len(lines) else ""
    if not head:
        raise WildlabError("has no row", "give one row for each label", file=path)
    sign = max(",;\t", key=head.count)
    # Where a semicolon divides, a comma is what others write as a point.
    decimal = "," if sign == ";" else "."
    words = {_plain(one) for one in (*IMAGE_COLUMNS, *CLASS_COLUMNS)}
    named = [one for one in next(csv.reader([head], delimiter=sign, skipinitialspace=True))]
    named = [one for one in named if _plain(one) in words or one == group]
    try:
        table = read_csv(
            io.StringIO(text),
            named,
            sep=sign,
            skiprows=before,
            skipinitialspace=True,
            decimal=decimal,
            float_precision="round_trip",
        )
    except ValueError as error:
        said = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error))
        what = (
            f"line {int(said[2])} has {said[3]} values, and there are {said[1]} columns"
            if said
            else "is no table of values with a sign between them"
        )
        raise WildlabError(what, "write it as CSV, one row for each thing", file=path) from None
    if not isinstance(table.index, pd.RangeIndex):
        # Of a first row with more values than columns, pandas takes the surplus for names of rows.
        many, there = table.shape[1] + table.index.nlevels, table.shape[1]
        raise WildlabError(
            f"line {before + 2} has {many} values, and there are {there} columns",
            "write it as CSV, one row for each thing",
            file=path,
        )
    if table.empty:
        raise WildlabError("has no row", "give one row for each label", file=path)
    return table


def _boxes(table: pd.DataFrame, columns: dict[str, str], path: Path) -> tuple[Array, list[str]]:
    """(N, 4) left, top, width, height, and the columns that they are from."""

    def numbers(way: Sequence[str]) -> Array:
        own = table[[columns[_plain(one)] for one in way]]
        return np.asarray(own.apply(pd.to_numeric, errors="coerce"), float)

    for kind, ways in (("sizes", SIZES), ("corners", CORNERS), ("points", POINTS)):
        for way in ways:
            if not {_plain(one) for one in way} <= set(columns):
                continue
            given, place = numbers(way), [columns[_plain(one)] for one in way]
            if kind == "corners":
                return np.concatenate([given[:, :2], given[:, 2:] - given[:, :2]], axis=1), place
            if kind == "points":
                return np.concatenate([given, 0 * given], axis=1), place
            if way[0] == "left_px" and {_plain(one) for one in POINTS[0]} <= set(columns):
                # A table of detections: it is their centroids that they are judged by.
                middle = numbers(POINTS[0])
                return np.concatenate([middle - given[:, 2:] / 2, given[:, 2:]], axis=1), place
            return np.asarray(given), place
    ways_known = "; ".join(", ".join(way) for ways in (SIZES, CORNERS, POINTS) for way in ways)
    raise WildlabError(
        f"no columns say where things are: there are {_shown(table)}",
        f"call them one of: {ways_known}",
        file=path,
    )
