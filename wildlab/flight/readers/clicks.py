"""Clicks and boxes in images as a log: COCO, MegaDetector, CVAT, tables, YOLO.

A box stands for its middle. Programs that give shares of an image want its size, which is that of the images
that lie beside; without one such rows say so and are not used.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import leaves_folder, printable
from wildlab.flight.readers.frames.image import SUFFIXES
from wildlab.flight.readers.labels import (
    IMAGE_COLUMNS,
    MOST_FILES,
    SIDES,
    Marked,
    bare_names,
    box_table,
    read_json_boxes,
    read_table,
    read_yolo_folder,
    way_of,
)
from wildlab.flight.readers.log import RawLog, Stream, holding, named
from wildlab.flight.readers.photos import read_tags, size_of
from wildlab.flight.readers.text import header_of, number, parse_xml, plural, told
from wildlab.names import plain_path

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
    """Clicks and boxes of one file; images whose sizes are wanted lie beside it.

    Raises
    ------
    WildlabError
        Where it is of no format that is known, or something in it is wrong.
    """
    start = data.lstrip(b"\xef\xbb\xbf \r\n\t")[:1]
    if start in (b"{", b"["):
        return _decoded(read_json_boxes(data, path), path, path.parent)
    return _decoded(_cvat(data, path) if start == b"<" else read_table(data, path, clicks=True), path, path)


def folder_decode(folder: Path, zone: str | None) -> RawLog:
    """Boxes of a folder of YOLO's text files, one for each image; ``image`` is its name without the ending.

    Raises
    ------
    WildlabError
        Where there is no such file, or a line is wrong.
    """
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
    """Width and height of images, px, out of their headers.

    Parameters
    ----------
    folder
        Of the labels. Images are looked for in it, in ``images`` in it and beside it, and where a folder
        ``labels`` above it has one ``images`` beside it, as programs that train detectors have them.
    names
        Of images, with or without their ending, perhaps with folders; none of them leads elsewhere.

    Returns
    -------
    dict
        By those names that an image was found for.
    """
    swapped = Path(*("images" if one == "labels" else one for one in folder.parts))
    every = dict.fromkeys([folder, folder / "images", folder.parent / "images", swapped])
    places = [one for one in every if one.is_dir()]
    listed: dict[str, Path] = {}
    for place in reversed(places):
        try:
            for one in islice(place.iterdir(), MOST_FILES):
                if one.suffix.lower() in SUFFIXES:
                    listed |= {one.stem: one, one.name: one}
        except OSError:
            continue
    found = {}
    for name in dict.fromkeys(names):
        plain = plain_path(name)
        deep = len(plain.parts) > 1 and not leaves_folder(name)
        own = next((place / plain for place in places if deep and _is_image(place / plain)), None)
        path = own or listed.get(plain.name) or listed.get(plain.stem)
        size = (0, 0) if path is None else size_of(read_tags(path))
        if all(size):
            found[name] = (float(size[0]), float(size[1]))
    return found


def _is_image(path: Path) -> bool:
    try:
        return path.suffix.lower() in SUFFIXES and path.is_file()
    except (OSError, ValueError):
        return False


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
