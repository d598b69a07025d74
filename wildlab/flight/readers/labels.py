"""Labels of images: a table with a box or a point for each thing that somebody marked."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular

Array = NDArray[np.float64]

#: The most bytes of a table of labels.
MOST_BYTES = 200_000_000
#: Columns that name the frame: a file name, or the number of a clip's frame from 0.
IMAGE_COLUMNS = ("image", "frame", "frame_id", "file", "filename")
NUMBER_COLUMNS = ("frame0",)
#: Ways to say where something is: corner and size, two corners, a point.
SIZES, CORNERS, POINTS = (
    (("x", "y", "w", "h"), ("left", "top", "width", "height")),
    (("x_min", "y_min", "x_max", "y_max"), ("x0", "y0", "x1", "y1")),
    (("u_px", "v_px"), ("u", "v")),
)
CLASS_COLUMNS = ("class", "label", "category")
#: Into how many parts a clip is divided whose frames belong together.
STRETCHES = 10
#: Classes that mark what is not to be judged, without regard to capitals.
IGNORED = frozenset({"dontcare", "ignore", "crowd"})


@dataclass(frozen=True, eq=False)
class Labels:
    """What was marked in the frames of one folder or clip.

    Attributes
    ----------
    boxes
        By the name of the frame: (N, 4) left, top, width, height, px; points have no extent. A frame that was
        looked at and is empty has (0, 4); one that is not named is not judged.
    ignore
        By the name of the frame: (I, 4) regions that are not judged.
    group
        By the name of the frame: to what it belongs, where the table says it; else its own name, or which
        tenth of its clip it lies in.
    by_number
        Whether names are numbers of a clip's frames, as text.
    """

    boxes: dict[str, Array]
    ignore: dict[str, Array]
    group: dict[str, str]
    by_number: bool

    def name_of(self, frame: str) -> str | None:
        """The name that the table has for a frame, None where it does not name it.

        Parameters
        ----------
        frame
            `wildlab.flight.readers.frames.Frame.name`.

        Returns
        -------
        str or None
        """
        number = frame.rpartition("#")[2]
        name = str(int(number)) if self.by_number and number.isdigit() else frame
        if name in self.boxes:
            return name
        # A flight may name its frames without the ending of their files, and so may the labels.
        same = [one for one in self.boxes if Path(one).stem == Path(frame).stem]
        return same[0] if len(same) == 1 and not self.by_number else None


def read_labels(path: Path, *, classes: tuple[str, ...] = (), group: str | None = None) -> Labels:
    """Labels out of a CSV table with one row for each thing.

    Parameters
    ----------
    path
        With a column that names the image (`IMAGE_COLUMNS`) or numbers the clip's frame (``frame0``), and a
        box or a point in px (`SIZES`, `CORNERS`, `POINTS`). A row without numbers is an empty frame.
    classes
        Which classes are looked for; all others are then regions that are not judged. Empty: all.
    group
        Column that says what frames belong together, as those of one clip; folds never split these.

    Returns
    -------
    Labels

    Raises
    ------
    WildlabError
        Where the table cannot be read, lacks a column, or has no row.
    """
    table = _read_table(path)
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
    unknown = sorted(set(classes) - set(kinds))
    if unknown:
        there = ", ".join(printable(one) for one in sorted(set(kinds))[:20])
        raise WildlabError(f"no label is of the class {unknown[0]!r}", f"there are {there}", file=path)
    there_is: NDArray[np.bool_] = np.isfinite(boxes.sum(axis=1))
    judged = np.zeros(len(kinds), bool)
    for row, kind in enumerate(kinds):
        judged[row] = kind.lower() not in IGNORED and (not classes or kind in classes)
    if group is not None:
        groups = [str(one) for one in table[group]]
    else:
        groups = _stretches(names) if by_number else names
    place = pd.Series(names)
    chosen: dict[str, Array] = {}
    ignored: dict[str, Array] = {}
    for frame, rows in place.groupby(place, sort=False).groups.items():
        of = np.asarray(rows)
        chosen[str(frame)] = boxes[of[there_is[of] & judged[of]]]
        ignored[str(frame)] = boxes[of[there_is[of] & ~judged[of]]]
    return Labels(chosen, ignored, dict(zip(names, groups, strict=True)), by_number)


def _stretches(numbers: list[str]) -> list[str]:
    """To which of ten stretches of a clip each frame belongs: its neighbours show the same."""
    known = sorted({int(one) for one in numbers})
    place = {number: STRETCHES * at // len(known) for at, number in enumerate(known)}
    return [f"stretch {place[int(one)]}" for one in numbers]


def _read_table(path: Path) -> pd.DataFrame:
    try:
        data = read_regular(path, MOST_BYTES)
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
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
            return given if kind == "sizes" else np.concatenate([given, 0 * given], axis=1)
    ways_known = "; ".join(", ".join(way) for ways in (SIZES, CORNERS, POINTS) for way in ways)
    raise WildlabError("no columns say where things are", f"call them one of: {ways_known}", file=path)
