"""Labels of images as a detector is judged by them, and clicks in images as a log: COCO, MegaDetector, CVAT,
tables, YOLO.

The format is known by the content. As clicks a box stands for its middle. Programs that give shares of an
image want its size, that of the images beside; without one such rows say so and are not used.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import yaml
from pydantic import BaseModel, Field, RootModel

from wildlab.errors import WildlabError
from wildlab.flight.files import check_model, printable, read_regular, unreadable
from wildlab.flight.readers.frames.image import SUFFIXES
from wildlab.flight.readers.log import RawLog, Stream, holding, named
from wildlab.flight.readers.photos import read_tags, size_of
from wildlab.flight.readers.text import (
    Identity,
    Real,
    Several,
    header_of,
    number,
    numbers,
    parse_json,
    parse_xml,
    plain,
    plural,
    read_text_table,
    told,
)
from wildlab.geometry.frames import Array, Mask
from wildlab.names import match_names, plain_path

#: The most bytes of a file of labels.
MOST_BYTES = 200_000_000
#: Boxes of one frame at most: every pair of a label and a detection is looked at.
MOST_IN_FRAME = 3000
#: Left, top, width, height; of a point zero.
SIDES = ["left", "top", "width", "height"]


@dataclass(frozen=True, eq=False)
class Marked:
    """What one file marks.

    Attributes
    ----------
    format
        What the file is, as it is said to a user.
    table
        A row for each box, in the order of the file: ``name`` of its frame, `SIDES` (px or shares of the
        image; NaN where it marks nothing), ``kind`` (class), ``score`` (NaN where its author did not say how
        sure it is), ``crowd`` (a region that is not judged), ``row`` (where it stands in the file).
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
    counted_in
        What ``row`` counts.
    """

    format: str
    table: pd.DataFrame
    looked_at: tuple[str, ...]
    known_kinds: tuple[str, ...]
    relative: bool = False
    sizes: dict[str, tuple[int, int]] = field(default_factory=dict)
    ids: Mapping[int | str, str] = field(default_factory=dict)
    categories: Mapping[int | str, str] = field(default_factory=dict)
    groups: dict[str, str] | None = None
    by: str = "name"
    left_out: Mapping[str, int] = field(default_factory=dict)
    counted_in: str = "box"


def box_table(rows: Sequence[tuple[Any, ...]]) -> pd.DataFrame:
    """`Marked.table` of (name, box, kind, score, crowd), each counted as it stands here."""
    table = pd.DataFrame(rows, columns=["name", "box", "kind", "score", "crowd"])
    table[SIDES] = np.array(table.pop("box").tolist(), float).reshape(-1, 4)
    return table.assign(score=table["score"].astype(float), row=np.arange(1, len(table) + 1))


@dataclass(frozen=True, eq=False)
class Labels:
    """What was marked in the frames of one folder or clip.

    Attributes
    ----------
    boxes
        By the name of the frame: (N, 4) left, top, width, height, px (or shares of the image, see
        `Marked.relative`); points have no extent. A frame that was looked at and is empty has (0, 4); one
        that is not named is not judged.
    ignore
        By the name of the frame: (I, 4) regions that are not judged.
    group
        By the name of the frame: to what it belongs, where the file says it; else its own name, or which
        tenth of its clip it lies in.
    scores
        By the name of the frame: (N,) how sure the author of each box was, NaN where that is not said.
    marked
        The file's content, before classes were chosen.
    path
        Of the file or folder.
    """

    boxes: dict[str, Array]
    ignore: dict[str, Array]
    group: dict[str, str]
    scores: dict[str, Array]
    marked: Marked = field(repr=False)
    path: Path

    @cached_property
    def _match(self) -> Callable[[str], str | None]:
        return match_names(self.boxes)

    def name_of(self, frame: str) -> str | None:
        """The name that the file has for a frame, None where it does not name it."""
        stem = frame if self.marked.by == "number" else Path(frame).stem
        number = stem.rpartition("#")[2]
        by_number = self.marked.by != "name"
        name = str(int(number)) if by_number and number.isdecimal() else frame
        if name in self.boxes:
            return name
        return None if self.marked.by == "number" else self._match(frame)

    def of_other_frames(self, frames: Iterable[str]) -> WildlabError:
        """What is said where the file names none of the frames."""
        first, here = (printable(next(iter(one), "none")) for one in (self.boxes, frames))
        return WildlabError(
            f"names {len(self.boxes)} frames (the first is {first}), and none of those here (first: {here})",
            "give the labels of these frames: names are file names, numbers count a clip's frames from 0",
            file=self.path,
        )

    def boxes_of(self, frame: str, name: str, width: int, height: int) -> tuple[Array, Array]:
        """What is marked in a frame, and where it is not judged, in px."""
        given = self.marked.sizes.get(name)
        if given is not None and width and given != (width, height):
            raise WildlabError(
                f"says {given[0]} x {given[1]} pixels, and {printable(frame)} has {width} x {height}",
                "give the images that were labelled",
                file=self.path,
                field=f"the image {printable(name)}",
            )
        by = np.tile([width, height], 2).astype(float) if self.marked.relative else np.ones(4)
        return self.boxes[name] * by, self.ignore[name] * by


def read_labels(
    path: Path,
    *,
    classes: tuple[str, ...] = (),
    group: str | None = None,
    truth: Labels | None = None,
) -> Labels:
    """Labels, or what another detector found, out of a file or folder whose format is known by its content.

    Things of other `classes` (empty: of none) are regions that are not judged; `group` is the column, or
    field of COCO's images, of what frames belong together; `truth` has the ids that results of COCO name."""
    return choose_classes(_read(path, group, None if truth is None else truth.marked), path, classes)


def choose_classes(marked: Marked, path: Path, classes: tuple[str, ...] = ()) -> Labels:
    """Labels of some classes out of what a file holds."""
    unknown = sorted(set(classes) - set(marked.known_kinds))
    if unknown:
        there = ", ".join(printable(one) for one in sorted(set(marked.known_kinds))[:20])
        raise WildlabError(f"no label is of the class {unknown[0]!r}", f"there are {there}", file=path)
    table = marked.table[marked.table[SIDES].notna().all(axis=1)]
    judged = (~table["crowd"].astype(bool) & (table["kind"].isin(classes) | (not classes))).to_numpy(bool)
    boxes, scores = table[SIDES].to_numpy(float), table["score"].to_numpy(float)
    rows = table.groupby("name", sort=False).indices
    of_frame = {one: rows.get(one, np.zeros(0, np.intp)) for one in marked.looked_at}
    for frame, found in of_frame.items():
        if len(found) > MOST_IN_FRAME:
            raise WildlabError(
                f"{printable(frame)} has {len(found):,} boxes, and {MOST_IN_FRAME:,} are the most",
                "leave out those with low scores",
                file=path,
            )
    return Labels(
        {one: boxes[found[judged[found]]] for one, found in of_frame.items()},
        {one: boxes[found[~judged[found]]] for one, found in of_frame.items()},
        marked.groups or {one: one for one in of_frame},
        {one: scores[found[judged[found]]] for one, found in of_frame.items()},
        marked,
        path,
    )


def _read(path: Path, group: str | None, truth: Marked | None) -> Marked:
    try:
        folder = path.is_dir()
    except OSError as error:
        raise unreadable(error, path) from None
    if folder:
        if group is not None:
            problem = "a folder of YOLO's says nothing of groups"
            raise WildlabError(problem, "leave --group out", file=path, field=group)
        return read_yolo_folder(path)
    try:
        data = read_regular(path, MOST_BYTES)
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    if data[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"["):
        return read_json_boxes(data, path, group=group, truth=truth)
    return read_table(data, path, group=group)


# -- JSON

Name = Annotated[str, Field(strict=True, min_length=1)]
Size = Annotated[Real, Field(ge=0)]
#: Of the image; a written number is rounded.
Share = Annotated[Real, Field(ge=-1e-3, le=1 + 1e-3)]
#: Categories of images in which nothing is (COCO Camera Traps has them), without regard to capitals.
EMPTY = frozenset({"empty"})


class Category(BaseModel):
    """Of COCO."""

    id: Identity
    name: Name


class Image(BaseModel, extra="allow"):
    """Of COCO."""

    id: Identity
    file_name: Name
    width: float | str | None = None  # of no use but as numbers
    height: float | str | None = None


class Annotation(BaseModel):
    """Of COCO's truth."""

    image_id: Identity
    category_id: Identity
    bbox: tuple[Real, Real, Size, Size] | None = None
    score: Real | None = None
    iscrowd: Any = None


class Result(Annotation):
    """Of COCO's results."""

    bbox: tuple[Real, Real, Size, Size]
    score: Real


class Truth(BaseModel):
    """COCO's truth."""

    images: Annotated[Several[Image], Field(min_length=1)]
    categories: Several[Category]
    annotations: Several[Annotation]


class Found(BaseModel):
    """What MegaDetector found."""

    category: Identity
    bbox: tuple[Share, Share, Share, Share]
    conf: Real | None = None


class Seen(BaseModel):
    """An image that MegaDetector saw."""

    file: Name
    detections: list[Found] | None = None
    failure: Any = None


class Batch(BaseModel):
    """MegaDetector's file."""

    detection_categories: dict[str, str]
    images: Several[Seen]


def read_json_boxes(
    data: bytes, path: Path, *, group: str | None = None, truth: Marked | None = None
) -> Marked:
    """Boxes out of a JSON file of one of the three formats."""
    found = parse_json(data, path, "the JSON that it begins like")
    keys = set(found) if isinstance(found, dict) else set()
    if {"images", "annotations"} <= keys:
        return _truth(check_model(Truth, found, path), path, group)
    seen = found.get("images") if keys else None
    batch = isinstance(seen, list) and any(isinstance(one, dict) and "detections" in one for one in seen)
    if group is not None:
        raise WildlabError("says nothing of groups", "leave --group out", file=path, field=group)
    if isinstance(found, list):
        return _results(check_model(RootModel[Several[Result]], found, path).root, path, truth)
    if batch or {"images", "detection_categories"} <= keys:
        return _megadetector(check_model(Batch, found, path), path)
    raise WildlabError(
        f"is JSON with {', '.join(map(printable, sorted(keys)[:8])) or 'no key'}, of no format that is known",
        "give COCO's truth or results, or a batch of MegaDetector",
        file=path,
    )


def _truth(found: Truth, path: Path, group: str | None) -> Marked:
    _once([one.id for one in found.categories], "category", path)
    _once([one.id for one in found.images], "image", path)
    _once([one.file_name for one in found.images], "image", path)
    categories = {one.id: one.name for one in found.categories}
    names = {one.id: one.file_name for one in found.images}
    groups = {one.file_name: str(one.model_dump().get(group or "", "")) for one in found.images}
    for one in found.images:
        if group is not None and group not in one.model_dump():
            problem = f"{printable(one.file_name)} has no such field"
            raise WildlabError(problem, "name one that all images have", file=path, field=group)
    rows: list[tuple[Any, ...]] = []
    unjudged: list[str] = []
    for at, given in enumerate(found.annotations):
        name = _known(given.image_id, names, "images", f"annotations[{at}].image_id", path)
        kind = _known(given.category_id, categories, "categories", f"annotations[{at}].category_id", path)
        if given.bbox is not None:
            rows.append((name, given.bbox, kind, given.score, bool(given.iscrowd)))
        elif kind.lower() not in EMPTY:
            unjudged.append(name)
    left = set(unjudged)
    return Marked(
        "COCO",
        box_table(rows),
        tuple(one for one in groups if one not in left),
        tuple(dict.fromkeys(categories.values())),
        sizes={
            one.file_name: (int(one.width), int(one.height))
            for one in found.images
            if isinstance(one.width, float) and isinstance(one.height, float)
            if min(one.width, one.height) >= 1
        },
        ids=names,
        categories=categories,
        groups=groups if group else None,
        left_out=_counted("annotation without a box: image not judged", len(unjudged)),
    )


def _results(found: list[Result], path: Path, truth: Marked | None) -> Marked:
    ids = {} if truth is None else truth.ids
    categories = {} if truth is None else truth.categories
    rows = [
        (
            ids.get(one.image_id, str(one.image_id)),
            one.bbox,
            _known(one.category_id, categories, "categories", f"[{at}].category_id", path)
            if categories
            else str(one.category_id),
            one.score,
            False,
        )
        for at, one in enumerate(found)
        if not ids or one.image_id in ids
    ]
    if found and not rows:
        problem = f"none of {len(found)} results is of an image of the labels"
        fix = "give COCO of the same images with --labels"
        raise WildlabError(problem, fix, file=path, field="image_id")
    table = box_table(rows)
    return Marked(
        "COCO results",
        table,
        tuple(dict.fromkeys(table["name"])),
        tuple(dict.fromkeys(table["kind"])),
        by="name" if ids else "id",
        left_out=_counted("result of an image that the labels do not have", len(found) - len(rows)),
    )


def _megadetector(found: Batch, path: Path) -> Marked:
    _once([one.file for one in found.images], "image", path)
    kinds = found.detection_categories
    read = [
        (at, one) for at, one in enumerate(found.images) if not one.failure and one.detections is not None
    ]
    rows = [
        (
            image.file,
            one.bbox,
            _known(one.category, kinds, "detection_categories", f"images[{at}].detections", path),
            one.conf,
            False,
        )
        for at, image in read
        for one in image.detections or ()
    ]
    return Marked(
        "MegaDetector",
        box_table(rows),
        tuple(one.file for _, one in read),
        tuple(kinds.values()),
        relative=True,
        left_out=_counted("image that the detector failed on", len(found.images) - len(read)),
    )


def _counted(what: str, count: int) -> dict[str, int]:
    return {what: count} if count else {}


def _known(key: int | str, known: Mapping[Any, str], listed: str, where: str, path: Path) -> str:
    if key not in known:
        there = ", ".join(printable(str(one)) for one in list(known)[:20]) or "none"
        problem = f"is {printable(str(key))[:60]}, and {listed} has {there}"
        raise WildlabError(problem, "mend it, or add it there", file=path, field=where)
    return known[key]


def _once(values: Iterable[int | str], what: str, path: Path) -> None:
    twice = next((one for one, count in Counter(values).items() if count > 1), None)
    if twice is not None:
        problem = f"{printable(str(twice))[:60]} stands for more than one {what}"
        raise WildlabError(problem, "leave one of them out", file=path)


# -- tables

#: Columns that name the frame: a file name, or the number of a clip's frame from 0.
IMAGE_COLUMNS, NUMBER_COLUMN = ("image", "frame", "frame_id", "file", "filename"), "frame0"
#: Ways to say where something is: a point, corner and size, two corners.
WAYS = {
    ("u_px", "v_px"): "point",
    ("u", "v"): "point",
    ("x", "y", "w", "h"): "size",
    ("left_px", "top_px", "width_px", "height_px"): "size",
    ("x_min", "y_min", "x_max", "y_max"): "corners",
    ("x0", "y0", "x1", "y1"): "corners",
    ("x", "y"): "point",
}
CLASS_COLUMNS = ("class", "label", "category")
#: Columns that say of what a click is, before those of a class.
NAME_COLUMNS = ("name", "target", "target_id", "marker", "mark", "point", *CLASS_COLUMNS)
SCORE_COLUMNS = ("score", "confidence", "conf")
#: Into how many parts a clip is divided whose frames belong together.
STRETCHES = 10
#: Classes that mark what is not to be judged, without regard to capitals.
IGNORED = frozenset({"dontcare", "ignore", "crowd"})
#: What stands where there is no number.
NO_VALUE = frozenset({"", "nan", "na", "n/a", "null", "none"})


def bare_names(names: Iterable[str]) -> list[str]:
    """Names of columns as people vary them, without ``_``: ``X_min`` is ``xmin``."""
    return [plain(one).replace("_", "") for one in names]


def way_of(names: list[str], clicks: bool) -> tuple[str, ...] | None:
    """How a table with these bare names says where things are, see `WAYS`; None where it does not.

    Of clicks a point goes before a box, of which it may be the centroid, and ``x, y`` is one.
    """
    found = [way for way in WAYS if set(bare_names(way)) <= set(names) and (clicks or way != ("x", "y"))]
    return next(iter(found if clicks else sorted(found, key=lambda one: WAYS[one] == "point")), None)


def read_table(data: bytes, path: Path, *, group: str | None = None, clicks: bool = False) -> Marked:
    """Boxes and points out of a table of text with one row for each thing.

    A column names the image (`IMAGE_COLUMNS`) or numbers the clip's frame (``frame0``), others are a box or a
    point in px (`WAYS`), and perhaps the class and a score. A row without numbers is an empty frame. Of
    `clicks` wrong rows stay, as NaN; of labels they are refused.
    """
    table = read_text_table(data, path)
    bare, header = bare_names(table.header), table.header
    shown = ", ".join(map(printable, header[:12]))

    def find(wanted: Iterable[str]) -> int | None:
        return next((bare.index(one) for one in bare_names(wanted) if one in bare), None)

    def texts(column: int | None) -> list[str]:
        return ["" if column is None else row[column].strip() for row in table.rows]

    def fail(problem: str, fix: str, named: str | None = None) -> WildlabError:
        return WildlabError(problem, fix, file=path, field=named)

    def refuse(wrong: Mask, fix: str, columns: list[int]) -> None:
        if wrong.any() and not clicks:
            at = int(np.flatnonzero(wrong)[0])
            seen = ", ".join(f"{header[one]} {printable(table.rows[at][one])}" for one in columns)
            raise fail(f"line {table.lines[at]} cannot be used: {seen}", fix, header[columns[0]])

    if table.short and not clicks:
        line, values = table.short[0]
        raise fail(f"line {line} has {values} values, and there are {len(header)} columns", "mend it")
    image, way = find(IMAGE_COLUMNS), way_of(bare, clicks)
    numbered = find([NUMBER_COLUMN]) if image is None else None
    name = image if numbered is None else numbered
    if name is None:
        raise fail(f"no column names the image: there are {shown}", f"use one of {', '.join(IMAGE_COLUMNS)}")
    if way is None:
        for one in (set(bare_names(way)) - set(bare) for way in WAYS if len(way) > 2 and not clicks):
            if len(one) == 1:
                raise fail(f"a box has no column {one.pop()}: there are {shown}", "add it")
        known = "; ".join(", ".join(one) for one in WAYS if clicks or one != ("x", "y"))
        raise fail(f"no columns say where things are: there are {shown}", f"call them one of: {known}")
    if group is not None and group not in header:
        raise fail("there is no such column", f"name one of {shown}", group)
    names = texts(name)
    if numbered is not None:
        counted = table.numbers(name)
        refuse(np.isnan(counted), "number frames from 0", [name])
        names = [str(int(one)) for one in counted]
    columns = [bare.index(one) for one in bare_names(way)]
    given = np.stack([table.numbers(one) for one in columns], axis=1)
    middle = [find([one]) for one in ("u_px", "v_px")]
    if WAYS[way] == "corners":
        given[:, 2:] -= given[:, :2]
    elif WAYS[way] == "point":
        given = np.concatenate([given, 0 * given], axis=1)
    elif way[0] == "left_px" and None not in middle:
        # A table of detections: it is their centroids that they are judged by.
        given[:, :2] = np.stack([table.numbers(one) for one in middle if one is not None], axis=1)
        given[:, :2] -= given[:, 2:] / 2
    wrong = ~np.isfinite(given).all(axis=1) | (given[:, 2:] < 0).any(axis=1)
    given[wrong] = np.nan
    if (given[:, 2:] > 0).any() and (np.abs(given[~wrong]) <= 1).all():
        fix = "give pixels, or YOLO's folder of text files"
        raise fail("the boxes are shares of the image", fix, ", ".join(way))
    empty = np.array([{row[one].strip().lower() for one in columns} <= NO_VALUE for row in table.rows])
    refuse(wrong & ~empty, "mend it, or leave the row out", columns)
    sure, kinds = find(SCORE_COLUMNS), texts(find(NAME_COLUMNS if clicks else CLASS_COLUMNS))
    scores = np.full(len(names), np.nan) if sure is None else table.numbers(sure)
    if sure is not None:
        refuse(~wrong & np.isnan(scores), "give each box a score", [sure])
    found = pd.DataFrame(given, columns=SIDES).assign(
        name=names,
        kind=kinds,
        score=scores,
        crowd=[one.lower() in IGNORED for one in kinds],
        row=table.lines,
    )
    twice = found.duplicated([*SIDES, "name", "kind"]).to_numpy() & ~wrong & (not clicks)
    belongs = None if numbered is None else _stretches(names)
    if group is not None:
        belongs = texts(header.index(group))
    count, _, rest = table.lost()
    return Marked(
        "CSV",
        found[~empty & ~twice],
        tuple(dict.fromkeys(names)),
        tuple(dict.fromkeys(kinds)),
        groups=None if belongs is None else dict(zip(names, belongs, strict=True)),
        by="name" if numbered is None else "number",
        left_out=_counted(rest, count) | _counted("a row that stands in the file twice", int(twice.sum())),
        counted_in="line",
    )


def _stretches(numbers: list[str]) -> list[str]:
    """To which of ten stretches of a clip each frame belongs: its neighbours show the same."""
    known = sorted({int(one) for one in numbers})
    place = {one: STRETCHES * at // len(known) for at, one in enumerate(known)}
    return [f"stretch {place[int(one)]}" for one in numbers]


# -- YOLO

#: Text files of a folder at most, and bytes of one.
MOST_FILES, MOST_OF_FILE = 200_000, 2_000_000
#: Where names of the classes are looked for: beside the text files, and up to two folders above.
NAMES, DATA, ABOVE = "classes.txt", ("data.yaml", "data.yml", "dataset.yaml"), 2
#: Bytes of a file of names at most.
MOST_OF_NAMES = 200_000


def read_yolo_folder(path: Path) -> Marked:
    """Boxes out of a folder of text files that are called as the images are: a line for each thing, ``class
    cx cy w h [score]``.
    """
    try:
        files = sorted(
            one for one in path.iterdir() if one.suffix.lower() == ".txt" and one.name.lower() != NAMES
        )
    except OSError as error:
        raise unreadable(error, path) from None
    if not 0 < len(files) <= MOST_FILES:
        fix = "name the folder with a .txt for each image"
        raise WildlabError(f"has {len(files):,} text files, and 1 to {MOST_FILES:,} are read", fix, file=path)
    names = class_names(path)
    rows: list[tuple[Any, ...]] = []
    left = MOST_BYTES
    for file in files:
        data = read_regular(file, min(MOST_OF_FILE, left))
        left -= len(data)
        for at, line in enumerate(data.decode("utf-8", errors="replace").splitlines(), start=1):
            if words := line.split():
                rows.append((file.stem, *_line(words, names, file, f"line {at}"), False))
    table = box_table(rows)
    known = tuple(names.values()) or tuple(dict.fromkeys(table["kind"]))
    return Marked("YOLO", table, tuple(one.stem for one in files), known, relative=True)


def _line(words: list[str], names: dict[int, str], path: Path, where: str) -> tuple[Any, str, float | None]:
    """Box, class and score of a line."""
    values = numbers(words)
    shares = (np.abs(values[1:5] - 0.5) <= 0.5 + 1e-3).all() and (values[3:5] >= 0).all()
    if len(values) not in (5, 6) or not words[0].isdecimal() or not shares or np.isnan(values).any():
        problem = (
            f"is {printable(' '.join(words))[:60]}: class, centre, size as shares of the image are wanted"
        )
        raise WildlabError(problem, "give 5 numbers, or 6 with a score", file=path, field=where)
    u, v, width, height = values[1:5]
    kind = _known(int(words[0]), names, "classes", where, path) if names else words[0].lstrip("0") or "0"
    return (u - width / 2, v - height / 2, width, height), kind, (*values, np.nan)[5]


def class_names(folder: Path) -> dict[int, str]:
    """Names of classes by their numbers, from ``classes.txt`` or ``data.yaml``, whichever lies nearest to a
    folder of text files; empty where there is neither.
    """
    for place in [folder, *folder.resolve().parents][: 1 + ABOVE]:
        for name in (NAMES, *DATA):
            try:
                text = read_regular(place / name, MOST_OF_NAMES).decode("utf-8", errors="replace")
            except FileNotFoundError:
                continue
            if name == NAMES:
                return dict(enumerate(one.strip() for one in text.splitlines() if one.strip()))
            return _yaml_names(text, place / name)
    return {}


def _yaml_names(text: str, path: Path) -> dict[int, str]:
    """The ``names`` of a data.yaml: a list, or by numbers."""
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):
        content = {"names": None}
    given = content.get("names", {}) if isinstance(content, dict) else {}
    named = dict(enumerate(given)) if isinstance(given, list) else given
    if not isinstance(named, dict) or not all(
        isinstance(at, int) and isinstance(one, str | int | float) for at, one in named.items()
    ):
        fix = f"write them into a {NAMES}, one a line"
        raise WildlabError("a list of names is wanted", fix, file=path, field="names")
    return {at: printable(str(one)) for at, one in named.items()}


# -- clicks as a log

#: Attributes of CVAT that name a thing more closely than its label.
ATTRIBUTES = frozenset({"name", "target", "target_id", "id", "marker"})
#: Letters of a name at most.
MOST_LETTERS = 200


def clicks_sniff(head: bytes) -> bool:
    """Whether a file is one of the known kinds, by its content."""
    start = head.lstrip(b"\xef\xbb\xbf \r\n\t")
    if start[:1] in (b"{", b"["):
        words = (b'"annotations"', b'"detection_categories"', b'"detections"', b'"bbox"', b'"file_name"')
        return any(one in head for one in words)
    if start[:1] == b"<":
        return b"<annotations" in head and re.search(b"<(image|meta|version)", head) is not None
    names = bare_names(header_of(head))
    return bool(set(bare_names(IMAGE_COLUMNS)) & set(names)) and way_of(names, clicks=True) is not None


def clicks_decode(path: Path, data: bytes, zone: str | None) -> RawLog:
    """Clicks and boxes of one file; images whose sizes are wanted lie beside it."""
    start = data.lstrip(b"\xef\xbb\xbf \r\n\t")[:1]
    if start in (b"{", b"["):
        return _decoded(read_json_boxes(data, path), path, path.parent)
    return _decoded(_cvat(data, path) if start == b"<" else read_table(data, path, clicks=True), path, path)


def folder_decode(folder: Path, zone: str | None) -> RawLog:
    """Boxes of a folder of YOLO's text files, one for each image, whose name without the ending they have."""
    return _decoded(read_yolo_folder(folder), folder, folder)


def note_of_kinds(clicks: Stream, shown: str) -> str:
    """A sentence where names are of kinds, not of single things: one stands twice in an image; else "".

    A surveyed point that was clicked twice is one point all the same: ask where none is surveyed.
    """
    pairs = zip(clicks.columns["image"], clicks.columns.get("name", ()), strict=False)
    kind = next((name for (_, name), count in Counter(pairs).items() if name and count > 1), "")
    said = f"{shown}: {kind!r} stands twice in one image, so names are of kinds and name no target"
    return f"{said}: track them by wildlab track --many." if kind else ""


def _decoded(marked: Marked, path: Path, folder: Path) -> RawLog:
    crowd = marked.table["crowd"].astype(bool)
    table = marked.table[~crowd]
    if not len(table):
        raise WildlabError("marks nothing", "give a file with boxes or points", file=path)
    names, boxes = table["name"].tolist(), table[SIDES].to_numpy(float)
    without = 0
    if marked.relative:
        sizes = sizes_beside(folder, names)
        known = np.array([sizes.get(one, (np.nan, np.nan)) for one in names], float)
        boxes = boxes * np.tile(known, 2)
        without = int(np.isnan(known).any(axis=1).sum())
    notes = {
        f"{marked.format}: {plural(len(table), 'box')}": marked.counted_in == "box",
        f"{without} of {len(table)} boxes are of images of unknown size": without,
        "images are known by ids alone": marked.by == "id",
    }
    # One without extent is a point.
    box = np.where((boxes[:, 2:] > 0).any(axis=1, keepdims=True), boxes, np.nan)
    columns: dict[str, Any] = {
        "image": [one[:MOST_LETTERS] for one in names],
        "name": [printable(one[:MOST_LETTERS]) for one in table["kind"]],
        "u_px": boxes[:, 0] + boxes[:, 2] / 2,
        "v_px": boxes[:, 1] + boxes[:, 3] / 2,
        "score": table["score"].to_numpy(float),
        **named(("box_u_px", "box_v_px", "box_width_px", "box_height_px"), box.T),
    }
    unusable = {
        "no place in the image": ~np.isfinite(columns["u_px"] + columns["v_px"]),
        "no image": np.array([not one for one in names], bool),
    }
    lost = [(count, "thing", f"left out: {what}") for what, count in marked.left_out.items()]
    lost.append((int(crowd.sum()), "region", "of many that are not told apart"))
    part = Stream(columns, table["row"], marked.counted_in, unusable)
    return RawLog({"clicks": part}, lost=told(*lost), notes=holding(notes))


def sizes_beside(folder: Path, names: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Width and height of images, px, out of their headers: of those below the folder of the labels, in
    ``images`` beside it, or in one for a ``labels`` above it, as programs that train detectors have them."""
    swapped = Path(*("images" if one == "labels" else one for one in folder.parts))
    listed: dict[str, Path] = {}
    for place in (swapped, folder.parent / "images", folder):
        for one in islice(place.rglob("*"), MOST_FILES):
            if one.suffix.lower() in SUFFIXES:
                listed |= {one.stem: one, one.name: one}
    found = {}
    for name in dict.fromkeys(names):
        plain = plain_path(name)
        path = listed.get(plain.name) or listed.get(plain.stem)
        size = (0, 0) if path is None else size_of(read_tags(path))
        if all(size):
            found[name] = (float(size[0]), float(size[1]))
    return found


def _cvat(data: bytes, path: Path) -> Marked:
    """Boxes and points of CVAT's format for images, 1.1."""
    left_out: Counter[str] = Counter()
    rows: list[tuple[Any, ...]] = []
    for image in parse_xml(data, path).iter("image"):
        for shape in image:
            named = [
                (one.text or "").strip()
                for one in shape.iter("attribute")
                if one.get("name", "").strip().lower() in ATTRIBUTES
            ]
            name = next((one for one in reversed(named) if one), shape.get("label", ""))
            places: list[tuple[float, ...]] = []
            if shape.tag == "box":
                left, top, right, bottom = (number(shape.get(one)) for one in ("xtl", "ytl", "xbr", "ybr"))
                places = [(left, top, right - left, bottom - top)]
            elif shape.tag == "points":
                pairs = (one.partition(",") for one in shape.get("points", "").split(";"))
                places = [(number(u), number(v), 0.0, 0.0) for u, _, v in pairs]
            elif shape.tag != "tag":
                left_out[f"shape {printable(shape.tag[:40])}"] += 1
            rows += [(image.get("name", ""), one, name, np.nan, False) for one in places]
    if not rows:
        fix = "export the task as CVAT for images 1.1"
        raise WildlabError("has no box or point of CVAT", fix, file=path, field="image")
    return Marked("CVAT", box_table(rows), (), (), left_out=left_out, counted_in="shape")
