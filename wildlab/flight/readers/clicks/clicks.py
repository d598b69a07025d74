"""Clicks and boxes in images, out of what other programs write: COCO, MegaDetector, CVAT, tables, YOLO.

A box stands for its middle. Programs that give shares of an image want its size: `sizes` by the name of the
file, or that of the images that lie beside; without either such rows say so and are not used.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.clicks.image_sizes import sizes_beside
from wildlab.flight.readers.label_json import read_json_boxes
from wildlab.flight.readers.label_table import (
    CLASS_COLUMNS,
    CORNERS,
    IMAGE_COLUMNS,
    POINTS,
    SCORE_COLUMNS,
    SIZES,
)
from wildlab.flight.readers.label_yolo import read_yolo_folder
from wildlab.flight.readers.logs.log import RawLog, make_stream
from wildlab.flight.readers.marked import Marked
from wildlab.flight.readers.marks.text_table import (
    header_of,
    plain,
    read_text_table,
    said_of_short,
    to_number,
)

Array = NDArray[np.float64]
Sizes = Mapping[str, tuple[float, float]]

#: Columns that say of what a click is, before those of a class.
NAME_COLUMNS = ("name", "target", "target_id", "marker", "mark", "point", *CLASS_COLUMNS)
#: Attributes of CVAT that name a thing more closely than its label.
NAMES = frozenset({"name", "target", "target_id", "id", "marker"})
#: Elements inside each other, and things of one file, at most.
DEEPEST, MOST = 50, 1_000_000
MOST_LETTERS = 200


def recognise(head: bytes, name: str) -> bool:
    """Whether a file is one of the known kinds, by its content."""
    start = head.lstrip(b"\xef\xbb\xbf \r\n\t")
    if start[:1] in (b"{", b"["):
        words = (b'"annotations"', b'"detection_categories"', b'"detections"', b'"bbox"', b'"file_name"')
        return any(one in head for one in words)
    if start[:1] == b"<":
        return b"<annotations" in head and (b"<image" in head or b"<meta" in head or b"<version" in head)
    names = [one.replace("_", "") for one in header_of(head)]
    return any(_plain(one) in names for one in IMAGE_COLUMNS) and _way(names) is not None


def read(path: Path, data: bytes, zone: str | None = None, sizes: Sizes | None = None) -> RawLog:
    """Clicks and boxes of one file.

    Parameters
    ----------
    path
        For messages, and to find the images beside it.
    data
        The file's content.
    zone
        Not used: nothing here has a time.
    sizes
        Width and height by the name of the image, px, for formats that give shares of it; left out, those of
        images beside the file.

    Returns
    -------
    RawLog
        With the part ``clicks``.

    Raises
    ------
    WildlabError
        Where it is of no format that is known, or something in it is wrong.
    """
    start = data.lstrip(b"\xef\xbb\xbf \r\n\t")[:1]
    if start in (b"{", b"["):
        return _of_marked(read_json_boxes(data.removeprefix(b"\xef\xbb\xbf"), path), sizes, path, path.parent)
    if start == b"<":
        return _cvat(data, path)
    return _table(data, path)


def clicks_of_folder(folder: Path, sizes: Sizes | None = None) -> RawLog:
    """Boxes of a folder of YOLO's text files, one for each image.

    Parameters
    ----------
    folder
        Of the text files.
    sizes
        Width and height by the name of the image (or without its ending), px; left out, those of images
        beside the folder.

    Returns
    -------
    RawLog
        With the part ``clicks``; ``image`` is the name of the text file without its ending.

    Raises
    ------
    WildlabError
        Where there is no such file, or a line is wrong.
    """
    return _of_marked(read_yolo_folder(folder), sizes, folder, folder)


def read_clicks_folder(folder: Path, zone: str | None = None) -> RawLog:
    """Boxes of a folder of YOLO's, with the sizes of the images that lie beside it: as `clicks_of_folder`."""
    return clicks_of_folder(folder)


def _log(columns: dict[str, Any], rows: Any, counted_in: str, lost: list[str], notes: list[str]) -> RawLog:
    place = np.asarray(columns["u_px"], float) + np.asarray(columns["v_px"], float)
    wrong = {"no place in the image": ~np.isfinite(place)}
    columns["name"] = [printable(str(one)[:MOST_LETTERS]) for one in columns["name"]]
    columns["image"] = [str(one)[:MOST_LETTERS] for one in columns["image"]]
    wrong["no image"] = np.array([not one for one in columns["image"]], bool)
    part = make_stream("clicks", columns, rows, counted_in, wrong)
    return RawLog("clicks", {"clicks": part}, lost=tuple(lost), notes=tuple(notes))


def _of_boxes(boxes: Array) -> dict[str, Array]:
    """Columns of boxes (N, 4) left, top, width, height; one without extent is a point."""
    sides = ("box_u_px", "box_v_px", "box_width_px", "box_height_px")
    wide = (boxes[:, 2:] > 0).any(axis=1)
    found = {"u_px": boxes[:, 0] + boxes[:, 2] / 2, "v_px": boxes[:, 1] + boxes[:, 3] / 2}
    return found | {one: np.where(wide, boxes[:, at], np.nan) for at, one in enumerate(sides)}


def _of_marked(marked: Marked, sizes: Sizes | None, path: Path, folder: Path) -> RawLog:
    keep = np.isfinite(marked.boxes).all(axis=1) & ~marked.crowd
    if not keep.any():
        raise WildlabError("marks nothing", "give a file with boxes or points", file=path)
    at = np.flatnonzero(keep)
    boxes, names = marked.boxes[at], [marked.names[row] for row in at]
    notes, lost = [], [f"{count}: {what}" for what, count in marked.left_out.items()]
    if marked.crowd.any():
        lost.append(f"{int(marked.crowd.sum())} regions of many that are not told apart")
    if marked.relative:
        known = _known(sizes_beside(folder, names) if sizes is None else sizes, names)
        boxes = boxes * np.concatenate([known, known], axis=1)
        without = int((~np.isfinite(known).all(axis=1)).sum())
        if without:
            notes.append(f"{without} of {len(at)} boxes are shares of images whose size is not known")
    if marked.by == "id":
        notes.append("images are told by their ids, and which file has which id is not said")
    columns: dict[str, Any] = {"image": names, "name": [marked.kinds[row] for row in at], **_of_boxes(boxes)}
    columns["score"] = marked.scores[at]
    return _log(
        columns,
        at + 1,
        "box",
        lost,
        [f"{marked.format}: {len(at)} {'box' if len(at) == 1 else 'boxes'}", *notes],
    )


def _known(sizes: Sizes, names: list[str]) -> Array:
    """(N, 2) width and height of each image, NaN where they are not known."""
    short: dict[str, tuple[float, float]] = {}
    for name, size in sizes.items():
        place = PurePosixPath(name.replace("\\", "/"))
        short |= {place.stem: size, place.name: size}
    nothing = (np.nan, np.nan)

    def find(name: str) -> tuple[float, float]:
        place = PurePosixPath(name.replace("\\", "/"))
        return sizes.get(name) or short.get(place.name) or short.get(place.stem) or nothing

    return np.array([find(one) for one in names], float).reshape(-1, 2)


# -- tables


def _plain(name: str) -> str:
    return plain(name).replace("_", "")


def _way(names: list[str]) -> tuple[str, tuple[str, ...]] | None:
    """How a table says where things are: a point goes before a box, of which it may be the centroid."""
    for kind, ways in (("points", POINTS), ("sizes", SIZES), ("corners", CORNERS), ("points", (("x", "y"),))):
        for way in ways:
            if {_plain(one) for one in way} <= set(names):
                return kind, way
    return None


def _table(data: bytes, path: Path) -> RawLog:
    table = read_text_table(data, path)
    names = [_plain(one) for one in table.header]
    there = printable(", ".join(table.header[:12]))[:200]
    image = next((names.index(_plain(one)) for one in IMAGE_COLUMNS if _plain(one) in names), None)
    way = _way(names)
    if image is None or way is None:
        what = "names the image" if image is None else "says where things are"
        wanted = ", ".join(IMAGE_COLUMNS) if image is None else "u and v, or x, y, w and h, in pixels"
        raise WildlabError(f"no column {what}: there are {there}", f"call it {wanted}", file=path)
    kind, columns_ = way
    numbers = np.array(
        [[to_number(row[names.index(_plain(one))], table.comma) for one in columns_] for row in table.rows]
    )
    empty = [not any(row[names.index(_plain(one))] for one in columns_) for row in table.rows]
    keep = np.flatnonzero(~np.array(empty))
    if not len(keep):
        raise WildlabError("marks nothing", "give rows with a place", file=path)
    boxes = (
        np.concatenate([numbers[:, :2], np.zeros((len(numbers), 2))], axis=1) if kind == "points" else numbers
    )
    if kind == "corners":
        boxes = np.concatenate([numbers[:, :2], numbers[:, 2:] - numbers[:, :2]], axis=1)
    boxes[(boxes[:, 2:] < 0).any(axis=1)] = np.nan
    if kind != "points" and (np.abs(boxes[np.isfinite(boxes).all(axis=1)]) <= 1).all():
        raise WildlabError(
            "the boxes are shares of the image: none is wider or farther than 1", "give pixels", file=path
        )
    found: dict[str, Any] = {
        "image": [table.rows[row][image] for row in keep],
        **_of_boxes(boxes[keep]),
    }
    who = next((names.index(_plain(one)) for one in NAME_COLUMNS if _plain(one) in names), None)
    found["name"] = ["" if who is None else table.rows[row][who] for row in keep]
    sure = next((names.index(_plain(one)) for one in SCORE_COLUMNS if _plain(one) in names), None)
    if sure is not None:
        found["score"] = [to_number(table.rows[row][sure], table.comma) for row in keep]
    return _log(found, [table.lines[row] for row in keep], "line", said_of_short(table), [])


# -- CVAT


def _cvat(data: bytes, path: Path) -> RawLog:
    reader = _Cvat(path)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.words.append
    parser.StartDoctypeDeclHandler = reader.refuse
    parser.EntityDeclHandler = reader.refuse
    lost = []
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        said = printable(str(error))[:100]
        if not reader.found:
            raise WildlabError(f"is not readable XML ({said})", "export it anew", file=path) from None
        lost.append(f"what stands after the place where the XML breaks off ({said})")
    if not reader.found:
        raise WildlabError(
            "has no box or point of CVAT", "export the task as CVAT for images 1.1", file=path, field="image"
        )
    lost += [f"{count} of the shape {printable(what)}" for what, count in reader.others.items()]
    boxes = np.array([one[2] for one in reader.found], float)
    columns: dict[str, Any] = {
        "image": [one[0] for one in reader.found],
        "name": [one[1] for one in reader.found],
        **_of_boxes(boxes),
    }
    return _log(columns, [one[3] for one in reader.found], "shape", lost, [])


class _Cvat:
    """What expat tells of CVAT's format for images, 1.1: image, what it is, box, which of all."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found: list[tuple[str, str, tuple[float, ...], int]] = []
        self.others: dict[str, int] = {}
        self.words: list[str] = []
        self._inside: list[str] = []
        self._image = self._attribute = ""
        self._first = 0

    def refuse(self, *_: object) -> None:
        raise WildlabError(
            "declares a document type or entities, which CVAT needs none of", "export it anew", file=self.path
        )

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if len(self._inside) >= DEEPEST or len(self.found) >= MOST:
            raise WildlabError("is nested too deeply, or marks too much", "export less of it", file=self.path)
        parent = self._inside[-1] if self._inside else ""
        self._inside.append(tag)
        self.words.clear()
        if tag == "image":
            self._image = attributes.get("name", "")
        elif parent == "image":
            self._first = len(self.found)
            self._shape(tag, attributes)
        elif tag == "attribute":
            self._attribute = attributes.get("name", "").strip().lower()

    def _shape(self, tag: str, given: dict[str, str]) -> None:
        label = given.get("label", "")
        if tag == "box":
            left, top, right, bottom = (to_number(given.get(one, "")) for one in ("xtl", "ytl", "xbr", "ybr"))
            self.found.append(
                (self._image, label, (left, top, right - left, bottom - top), len(self.found) + 1)
            )
        elif tag == "points":
            for one in given.get("points", "").split(";")[: MOST - len(self.found)]:
                u, _, v = one.partition(",")
                place = (to_number(u), to_number(v), 0.0, 0.0)
                self.found.append((self._image, label, place, len(self.found) + 1))
        elif tag not in ("tag",):
            self.others[tag[:40]] = self.others.get(tag[:40], 0) + 1

    def end(self, tag: str) -> None:
        self._inside.pop()
        named = "".join(self.words).strip()
        if tag == "attribute" and self._attribute in NAMES and named and "image" in self._inside[:-1]:
            own = [(image, named, box, row) for image, _, box, row in self.found[self._first :]]
            self.found[self._first :] = own
        self.words.clear()
