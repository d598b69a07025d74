"""Boxes as files have them, whatever the format: COCO's truth and results, and what MegaDetector writes, as
JSON.

The format is known by its content: COCO's truth has ``images``, ``annotations`` and ``categories``, its
results are a list with ``image_id``, ``bbox`` and ``score``, and MegaDetector's ``images`` have ``file`` and
``detections``.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular, unreadable
from wildlab.flight.readers.text import (
    Field,
    TextTable,
    finite,
    number,
    parse_json,
    plain,
    read_text_table,
    shown,
)

Array = NDArray[np.float64]

#: The most bytes of a file of labels.
MOST_BYTES = 200_000_000
#: Boxes of one frame at most: every pair of a label and a detection is looked at.
MOST_IN_FRAME = 3000
#: Categories of images in which nothing is (COCO Camera Traps has them), without regard to capitals.
EMPTY = frozenset({"empty"})


@dataclass(frozen=True, eq=False)
class Marked:
    """Boxes of one file, in its order.

    Attributes
    ----------
    format
        What the file is, as it is said to a user.
    names
        (N,) name of the frame that each box lies in.
    boxes
        (N, 4) left, top, width, height, px or shares of the image; NaN for a row that marks nothing.
    kinds
        (N,) class of each.
    scores
        (N,) how sure its author was, NaN where that is not said.
    crowd
        (N,) bool: a region that is not judged.
    looked_at
        Names of all frames that the file speaks of, empty ones too.
    known_kinds
        Classes that the file knows, used or not.
    relative
        Whether boxes are shares of the image's width and height.
    sizes
        By the name of the frame: its width and height in px, where the file says them.
    ids, categories
        By the id of an image the name of the frame, and by that of a category its class, where there are ids.
    groups
        By the name of the frame: to what it belongs; None where that is not asked for.
    by
        How names are to be read: ``name``, ``number`` of a clip's frame, or ``id`` that a file is called by.
    left_out
        By the reason: how many things of the file are not used.
    rows, counted_in
        (N,) where each stands in the file, and what that counts; None: as they are counted here.
    """

    format: str
    names: list[str]
    boxes: Array
    kinds: list[str]
    scores: Array
    crowd: NDArray[np.bool_]
    looked_at: tuple[str, ...]
    known_kinds: tuple[str, ...]
    relative: bool = False
    sizes: dict[str, tuple[int, int]] = field(default_factory=dict)
    ids: dict[int | str, str] = field(default_factory=dict)
    categories: dict[int | str, str] = field(default_factory=dict)
    groups: dict[str, str] | None = None
    by: str = "name"
    left_out: Mapping[str, int] = field(default_factory=dict)
    rows: NDArray[np.int64] | None = None
    counted_in: str = "box"


class Boxes:
    """Boxes that are read one by one, and checked alike."""

    def __init__(self) -> None:
        self.found: list[tuple[str, tuple[float, ...], str, float, bool]] = []
        self.left_out: Counter[str] = Counter()

    def add(
        self, at: Field, name: str, kind: str, score: Any = None, crowd: bool = False
    ) -> tuple[float, ...]:
        """Take a box out of a field, of a frame and a class.

        Raises
        ------
        WildlabError
            Where it is not four numbers with sizes of zero or more, or the score is no number.
        """
        box = tuple(map(finite, at.value)) if isinstance(at.value, list | tuple) else ()
        fix = "mend it, or take the entry out"
        if len(box) != 4 or not all(map(math.isfinite, box)):
            raise at.fail("four numbers are wanted: left, top, width, height", fix)
        if min(box[2:]) < 0:
            raise at.fail("a box has no size below zero", fix)
        sure = math.nan if score is None else finite(score)
        if score is not None and not math.isfinite(sure):
            raise at._replace(value=score).fail("the score of a box is a number", "mend it, or leave it out")
        self.found.append((name, box, kind, sure, crowd))
        return box

    def marked(
        self, what: str, looked_at: tuple[str, ...] | None, known: tuple[str, ...] | None, **others: Any
    ) -> Marked:
        """All boxes; None for those frames and classes that they are of; `others` are further fields."""
        names, boxes, kinds, scores, crowd = (
            map(list, zip(*self.found, strict=True)) if self.found else [[]] * 5
        )
        return Marked(
            what,
            names,
            np.array(boxes, float).reshape(-1, 4),
            kinds,
            np.array(scores, float),
            np.array(crowd, bool),
            tuple(dict.fromkeys(names)) if looked_at is None else looked_at,
            tuple(dict.fromkeys(kinds)) if known is None else known,
            **{"left_out": self.left_out, **others},
        )


def read_json_boxes(
    data: bytes, path: Path, *, group: str | None = None, truth: Marked | None = None
) -> Marked:
    """Boxes out of a JSON file of one of the three formats.

    Parameters
    ----------
    data
        The file's content.
    path
        For messages.
    group
        Field of COCO's images that says what belongs together; None where that is not asked for.
    truth
        COCO's truth of the same images, whose ids results have; None takes an id for the name of a file.

    Returns
    -------
    Marked

    Raises
    ------
    WildlabError
        Where it is no JSON, of none of the formats, or something in it is wrong: with its place.
    """
    whole = parse_json(data, path, "the JSON that it begins like", plain=False)
    found = whole.value
    listed = isinstance(found, list)
    images: Any = found.get("images") if isinstance(found, dict) else None
    entries = isinstance(images, list) and all(isinstance(one, dict) for one in images)
    batch = entries and ("detection_categories" in found or any("detections" in one for one in images))
    if isinstance(images, list) and isinstance(found.get("annotations"), list):
        return _truth(whole, group)
    if group is not None and (listed or batch):
        what = "a list of COCO results" if listed else "a batch of MegaDetector"
        raise WildlabError(
            f"is {what}, which says nothing of groups", "leave --group out", file=path, field=group
        )
    if listed:
        return _results(whole, truth)
    if batch:
        return _megadetector(whole)
    keys = ", ".join(printable(one) for one in list(found)[:8]) if isinstance(found, dict) else shown(found)
    raise WildlabError(
        f"is JSON with {keys or 'no key'}, of no format that is known",
        "give COCO (images, annotations, categories), a list of COCO results, or a batch of MegaDetector "
        "(images with detections, detection_categories)",
        file=path,
    )


def _truth(whole: Field, group: str | None) -> Marked:
    categories: dict[int | str, str] = {}
    for one in whole.member("categories").items():
        key = _once(one.member("id"), "category", categories).identity()
        categories[key] = one.member("name").name()
    ids: dict[int | str, str] = {}
    sizes: dict[str, tuple[int, int]] = {}
    groups: dict[str, str] = {}
    for one in whole.member("images").items():
        key = _once(one.member("id"), "image", ids).identity()
        name = _once(one.member("file_name"), "image", groups).name()
        ids[key] = name
        width, height = (finite(one.member(side).value) for side in ("width", "height"))
        if min(width, height) >= 1:
            sizes[name] = (int(width), int(height))
        if group is not None and group not in one.value:
            raise one.member(group).fail("this image has no such field", "name one that all have")
        groups[name] = str(one.value[group]) if group else name
    if not ids:
        raise whole.member("images").fail("it names no image", "list the images that were looked at")
    boxes = Boxes()
    unjudged: set[str] = set()
    for one in whole.member("annotations").items():
        image = one.member("image_id")
        name = ids.get(image.identity(), "")
        if not name:
            raise image.fail("no image has this id", "add the image, or take the annotation out")
        kind = _kind(one.member("category_id"), categories, "categories")
        box = one.member("bbox")
        if box.value is not None:
            boxes.add(box, name, kind, one.value.get("score"), bool(one.value.get("iscrowd")))
        elif kind.lower() not in EMPTY:
            unjudged.add(name)
            boxes.left_out["annotation without a box, whose image is not judged"] += 1
    seen = tuple(one for one in groups if one not in unjudged)
    given = {"sizes": sizes, "ids": ids, "categories": categories, "groups": groups if group else None}
    return boxes.marked("COCO", seen, tuple(dict.fromkeys(categories.values())), **given)


def _results(whole: Field, truth: Marked | None) -> Marked:
    ids: Mapping[int | str, str] = {} if truth is None else truth.ids
    boxes = Boxes()
    for one in whole.items():
        key, score = one.member("image_id").identity(), one.member("score")
        if score.value is None:
            raise score.fail("a result of COCO has a score", "add it")
        if ids and key not in ids:
            boxes.left_out["result of an image that the labels do not have"] += 1
            continue
        category = one.member("category_id")
        known = {} if truth is None else truth.categories
        kind = _kind(category, known, "the labels' categories") if known else str(category.identity())
        boxes.add(one.member("bbox"), ids.get(key, str(key)), kind, score.value)
    if whole.value and not boxes.found:
        raise WildlabError(
            f"none of {len(whole.value)} results is of an image of the labels",
            "give the COCO file of the same images with --labels",
            file=whole.path,
            field="image_id",
        )
    return boxes.marked("COCO results", None, None, by="name" if ids else "id")


def _megadetector(whole: Field) -> Marked:
    categories = whole.member("detection_categories")
    if not isinstance(categories.value, dict):
        raise categories.fail("what the categories are called is wanted", 'give them, as {"1": "animal"}')
    boxes = Boxes()
    seen: dict[str, None] = {}
    for one in whole.member("images").items():
        name = _once(one.member("file"), "image", seen).name()
        found = one.member("detections")
        if one.value.get("failure") or found.value is None:
            boxes.left_out["image that the detector failed on"] += 1
            continue
        seen[name] = None
        for box in found.items():
            kind = _kind(box.member("category"), categories.value, "detection_categories")
            place = box.member("bbox")
            check_relative(boxes.add(place, name, kind, box.value.get("conf")), place)
    kinds = tuple(map(str, categories.value.values()))
    return boxes.marked("MegaDetector", tuple(seen), kinds, relative=True)


def check_relative(box: tuple[float, ...], given: Field) -> None:
    """Refuse four numbers that are not shares of the image.

    Raises
    ------
    WildlabError
        Where one is below 0 or above 1, by more than the rounding of a written number.
    """
    if not all(-1e-3 <= one <= 1 + 1e-3 for one in box):
        raise given.fail("shares of the image from 0 to 1 are wanted", "divide by its width and height")


def _kind(value: Field, known: Mapping[Any, Any], listed: str) -> str:
    if value.identity() not in known:
        there = ", ".join(printable(f"{a}") for a in list(known)[:20]) or "none"
        raise value.fail(f"{listed} has {there}", "mend it, or add it there")
    return str(known[value.value])


def _once(value: Field, what: str, known: Mapping[Any, Any]) -> Field:
    if isinstance(value.value, int | str) and value.value in known:
        raise value.fail(f"{shown(value.value)} stands for more than one {what}", "leave one of them out")
    return value


# -- tables

#: Columns that name the frame: a file name, or the number of a clip's frame from 0.
IMAGE_COLUMNS, NUMBER_COLUMN = ("image", "frame", "frame_id", "file", "filename"), "frame0"
#: Ways to say where something is: a point, corner and size, two corners.
WAYS = {
    ("u_px", "v_px"): "point",
    ("u", "v"): "point",
    ("x", "y", "w", "h"): "size",
    ("left", "top", "width", "height"): "size",
    ("left_px", "top_px", "width_px", "height_px"): "size",
    ("x_min", "y_min", "x_max", "y_max"): "corners",
    ("x0", "y0", "x1", "y1"): "corners",
    ("x", "y"): "point",
}
CLASS_COLUMNS = ("class", "label", "category")
#: Columns that say of what a click is, before those of a class.
NAME_COLUMNS = ("name", "target", "target_id", "marker", "mark", "point", *CLASS_COLUMNS)
SCORE_COLUMNS = ("score", "confidence", "conf")
#: Columns that an error names at most.
MOST_SHOWN = 12
#: Into how many parts a clip is divided whose frames belong together.
STRETCHES = 10
#: Classes that mark what is not to be judged, without regard to capitals.
IGNORED = frozenset({"dontcare", "ignore", "crowd"})
#: What stands where there is no number.
NO_VALUE = frozenset({"", "nan", "na", "n/a", "null", "none"})


class BoxTable:
    """A table of boxes or points, and which of its columns say what."""

    def __init__(self, table: TextTable, path: Path) -> None:
        self.table, self.path = table, path
        self.names = plain_names(table.header)

    def find(self, *wanted: str) -> int | None:
        """The column of the first of these names that there is, as people vary it: ``X_min`` is ``xmin``."""
        return next((self.names.index(one) for one in plain_names(wanted) if one in self.names), None)

    def texts(self, column: int | None) -> list[str]:
        """Values of a column, empty where there is none."""
        return ["" if column is None else row[column].strip() for row in self.table.rows]

    def numbers(self, column: int | None) -> Array:
        """Values of a column as numbers, NaN where there is none."""
        return np.full(len(self.table.rows), np.nan) if column is None else self.table.numbers(column)

    def boxes(self, *, points_first: bool) -> tuple[Array, list[int]]:
        """(N, 4) left, top, width, height, NaN where there is no such box; and the columns that they are
        from.

        With `points_first`, a point goes before a box, of which it may be the centroid, and ``x, y`` is one.
        """
        way = way_of(self.names, points_first=points_first)
        if way is None:
            known = "; ".join(", ".join(one) for one in WAYS)
            raise self.fail(
                f"no columns say where things are: there are {self.shown()}", f"call them one of: {known}"
            )
        columns = [self.names.index(one) for one in plain_names(way)]
        given = np.stack([self.numbers(one) for one in columns], axis=1)
        middle = [self.find("u_px"), self.find("v_px")]
        if WAYS[way] == "corners":
            given[:, 2:] -= given[:, :2]
        elif WAYS[way] == "point":
            given = np.concatenate([given, 0 * given], axis=1)
        elif way[0] == "left_px" and None not in middle:
            # A table of detections: it is their centroids that they are judged by.
            given[:, :2] = np.stack([self.numbers(one) for one in middle], axis=1) - given[:, 2:] / 2
        shares = given[np.isfinite(given).all(axis=1)]
        if (shares[:, 2:] > 0).any() and (np.abs(shares) <= 1).all():
            raise self.fail(
                "the boxes are shares of the image: none is wider or farther than 1",
                "give pixels, or the folder of text files that they are from (YOLO)",
                ", ".join(self.table.header[one] for one in columns),
            )
        wrong = (given[:, 2:] < 0).any(axis=1) | ~np.isfinite(given).all(axis=1)
        given[wrong] = np.nan
        return given, columns

    def is_empty(self, columns: list[int]) -> NDArray[np.bool_]:
        """(N,) rows that have a value in none of these columns."""
        rows = self.table.rows
        return np.array([all(row[one].strip().lower() in NO_VALUE for one in columns) for row in rows], bool)

    def shown(self) -> str:
        """Its columns, for messages."""
        return ", ".join(printable(one) for one in self.table.header[:MOST_SHOWN])

    def fail(self, problem: str, fix: str, field: str | None = None) -> WildlabError:
        """An error about this table, to be raised."""
        return WildlabError(problem, fix, file=self.path, field=field)

    def refuse(self, wrong: NDArray[np.bool_], what: str, fix: str, columns: list[int]) -> None:
        """Refuse the first row that is wrong.

        Raises
        ------
        WildlabError
            Naming its line, and what stands in some columns.
        """
        if wrong.any():
            row, header = int(np.flatnonzero(wrong)[0]), self.table.header
            seen = ", ".join(f"{header[one]} {printable(self.table.rows[row][one])}" for one in columns)
            raise self.fail(f"line {self.table.lines[row]} has {what}: {seen}", fix, header[columns[0]])


def plain_names(names: object) -> list[str]:
    """Names of columns as people vary them, without ``_``."""
    return [plain(str(one)).replace("_", "") for one in names]  # type: ignore[attr-defined]


def way_of(names: list[str], *, points_first: bool) -> tuple[str, ...] | None:
    """How a table with these plain names says where things are, see `WAYS`; None where it does not."""
    found = [
        way for way in WAYS if set(plain_names(way)) <= set(names) and (points_first or way != ("x", "y"))
    ]
    return next(iter(found if points_first else sorted(found, key=lambda one: WAYS[one] == "point")), None)


def read_table_boxes(data: bytes, path: Path, *, group: str | None = None) -> Marked:
    """Boxes out of a table of text with one row for each thing, each of which has to be right.

    Parameters
    ----------
    data
        The file's content: a column names the image (`IMAGE_COLUMNS`) or numbers the clip's frame
        (``frame0``), others are a box or a point in px (`WAYS`), and perhaps the class and a score. A row
        without numbers is an empty frame.
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
    table = read_text_table(data, path)
    if table.short:
        line, values = table.short[0]
        raise WildlabError(
            f"line {line} has {values} values, and there are {len(table.header)} columns",
            "write it as CSV, one row for each thing",
            file=path,
        )
    own = BoxTable(table, path)
    image, numbered = own.find(*IMAGE_COLUMNS), own.find(NUMBER_COLUMN)
    name = numbered if image is None else image
    if name is None:
        known = ", ".join((*IMAGE_COLUMNS, NUMBER_COLUMN))
        raise own.fail(f"no column names the image: there are {own.shown()}", f"call it one of {known}")
    if group is not None and group not in table.header:
        raise own.fail("there is no such column", f"name one of {own.shown()}", group)
    names = own.texts(name)
    if image is None:
        counted = own.numbers(name)
        own.refuse(np.isnan(counted), "no number", "number frames from 0", [name])
        names = [str(int(one)) for one in counted]
    boxes, place = own.boxes(points_first=False)
    there_is = np.isfinite(boxes).all(axis=1)
    fix = "give finite numbers, and a width and height not below zero; or leave the row out"
    own.refuse(~there_is & ~own.is_empty(place), "no box", fix, place)
    kinds = own.texts(own.find(*CLASS_COLUMNS))
    sure = own.find(*SCORE_COLUMNS)
    scores = own.numbers(sure)
    if sure is not None:
        fix = "give each box a score, or take the column out"
        own.refuse(there_is & np.isnan(scores), "no number", fix, [sure])
    twice = pd.DataFrame(boxes).assign(name=names, kind=kinds).duplicated().to_numpy() & there_is
    belongs = None if image is not None else _stretches(names)
    if group is not None:
        belongs = own.texts(table.header.index(group))
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
        groups=None if belongs is None else dict(zip(names, belongs, strict=True)),
        by="number" if image is None else "name",
        left_out={"a row that stands in the file twice": int(twice.sum())} if twice.any() else {},
    )


def _stretches(numbers: list[str]) -> list[str]:
    """To which of ten stretches of a clip each frame belongs: its neighbours show the same."""
    known = sorted({int(one) for one in numbers})
    place = {one: STRETCHES * at // len(known) for at, one in enumerate(known)}
    return [f"stretch {place[int(one)]}" for one in numbers]


def read_table_clicks(data: bytes, path: Path) -> Marked:
    """Points and boxes out of a table of text; rows that are wrong stay, as NaN.

    Raises
    ------
    WildlabError
        Where the table cannot be read, lacks a column, or marks nothing.
    """
    table = read_text_table(data, path)
    own = BoxTable(table, path)
    image = own.find(*IMAGE_COLUMNS)
    if image is None:
        known = ", ".join(IMAGE_COLUMNS)
        raise own.fail(f"no column names the image: there are {own.shown()}", f"call it one of {known}")
    boxes, place = own.boxes(points_first=True)
    kept = np.flatnonzero(~own.is_empty(place))
    names, images = own.texts(own.find(*NAME_COLUMNS)), own.texts(image)
    return Marked(
        "CSV",
        [images[row] for row in kept],
        boxes[kept],
        [names[row] for row in kept],
        own.numbers(own.find(*SCORE_COLUMNS))[kept],
        np.zeros(len(kept), bool),
        (),
        (),
        left_out={rest: count for count, _, rest in table.lost() if count},
        rows=np.array(table.lines, np.int64)[kept],
        counted_in="line",
    )


# -- YOLO

#: Text files of a folder at most, and bytes of one.
MOST_FILES, MOST_OF_FILE = 200_000, 2_000_000
#: Where names of the classes are looked for: beside the text files, and up to two folders above.
NAMES, DATA, ABOVE = "classes.txt", ("data.yaml", "data.yml", "dataset.yaml"), 2


def read_yolo_folder(path: Path) -> Marked:
    """Boxes out of a folder of text files that are called as the images are: a line for each thing, ``class
    cx cy w h [score]``.

    Parameters
    ----------
    path
        Folder. An empty file is an image in which nothing is; an image without a file is not spoken of.

    Returns
    -------
    Marked
        Boxes in shares of the image, left, top, width, height; classes by the names in ``classes.txt`` or
        ``data.yaml`` where there is one, else their numbers.

    Raises
    ------
    WildlabError
        Where there is no such file, too many of them, or a line is wrong: with file and line.
    """
    try:
        files = sorted(
            one for one in path.iterdir() if one.suffix.lower() == ".txt" and one.name.lower() != NAMES
        )
    except OSError as error:
        raise unreadable(error, path) from None
    if len(files) > MOST_FILES:
        raise WildlabError(f"has more than {MOST_FILES:,} text files", "name a smaller folder", file=path)
    if not files:
        raise WildlabError(
            "has no text file of YOLO's", "name the folder with a .txt for each image", file=path
        )
    names = class_names(path)
    boxes = Boxes()
    left = MOST_BYTES
    for file in files:
        data = read_regular(file, min(MOST_OF_FILE, left))
        left -= len(data)
        for at, line in enumerate(data.decode("utf-8", errors="replace").splitlines(), start=1):
            if line.strip():
                _line(boxes, Field(line.strip(), f"line {at}", file), names)
    known = tuple(names.values()) if names else None
    return boxes.marked("YOLO", tuple(one.stem for one in files), known, relative=True)


def _line(boxes: Boxes, line: Field, names: dict[int, str]) -> None:
    words = line.value.split()
    values = [number(word) for word in words]
    if len(values) not in (5, 6) or not words[0].isdecimal() or not np.isfinite(values).all():
        raise line.fail(
            "class, centre, size and perhaps a score are wanted",
            "give 5 or 6 numbers, the first a whole one",
        )
    which = int(words[0])
    if names and which not in names:
        there = ", ".join(map(str, list(names)[:20]))
        raise line.fail(
            f"it has the class {which}, where names are given for {there}",
            f"add it to {NAMES} or data.yaml, or mend the line",
        )
    u, v, width, height = values[1:5]
    check_relative((u, v, max(width, 0.0), max(height, 0.0)), line)
    place = line._replace(value=(u - width / 2, v - height / 2, width, height))
    sure = values[5] if len(values) == 6 else None
    boxes.add(place, line.path.stem, names.get(which, str(which)), sure)


def class_names(folder: Path) -> dict[int, str]:
    """Names of classes from ``classes.txt`` or the ``names`` of ``data.yaml``, whichever lies nearest.

    Parameters
    ----------
    folder
        Of the text files.

    Returns
    -------
    dict
        By the number of the class; empty where no file says it.

    Raises
    ------
    WildlabError
        Where such a file is there and its names cannot be read.
    """
    for place in [folder, *folder.resolve().parents][: 1 + ABOVE]:
        for name in (NAMES, *DATA):
            try:
                text = read_regular(place / name, MOST_OF_FILE).decode("utf-8", errors="replace")
            except FileNotFoundError:
                continue
            if name == NAMES:
                return dict(enumerate(one.strip() for one in text.splitlines() if one.strip()))
            return _yaml_names(text, place / name)
    return {}


def _yaml_names(text: str, path: Path) -> dict[int, str]:
    """The ``names`` of a data.yaml: a list, or by numbers. Nothing else of the file is read."""
    found = re.search(r"^names\s*:.*(?:\n(?:[ \t].*|-.*|[\]}].*|#.*)?)*", text, re.MULTILINE)
    if found is None:
        return {}
    try:
        given = yaml.safe_load(found[0])["names"]
    except (yaml.YAMLError, ValueError, RecursionError):
        given = found[0]
    named = (
        list(enumerate(given))
        if isinstance(given, list)
        else given.items()
        if isinstance(given, dict)
        else []
    )
    plain_ = {at: one for at, one in named if isinstance(at, int) and isinstance(one, str | int | float)}
    if not plain_:
        raise WildlabError(
            f"the names are {shown(given)}, and a list of names is wanted",
            f"write them into a {NAMES}, one a line",
            file=path,
            field="names",
        )
    return {at: printable(str(one)) for at, one in plain_.items()}
