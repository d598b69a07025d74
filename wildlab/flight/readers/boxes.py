"""Boxes as files have them, whatever the format: COCO's truth and results, and what MegaDetector writes, as
JSON.

The format is known by its content: COCO's truth has ``images``, ``annotations`` and ``categories``, its
results are a list with ``image_id``, ``bbox`` and ``score``, and MegaDetector's ``images`` have ``file`` and
``detections``. Tables and YOLO's folders: `wildlab.flight.readers.box_files`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.documents import Field, number, parse_json, shown

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
        box = tuple(map(number, at.value)) if isinstance(at.value, list | tuple) else ()
        fix = "mend it, or take the entry out"
        if len(box) != 4 or not all(map(math.isfinite, box)):
            raise at.fail("four numbers are wanted: left, top, width, height", fix)
        if min(box[2:]) < 0:
            raise at.fail("a box has no size below zero", fix)
        sure = math.nan if score is None else number(score)
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
        width, height = (number(one.member(side).value) for side in ("width", "height"))
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
