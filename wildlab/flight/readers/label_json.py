"""Boxes out of JSON: COCO's truth and results, and what MegaDetector writes of a batch of images.

The format is known by its content: COCO's truth has ``images``, ``annotations`` and ``categories``, its
results are a list with ``image_id``, ``bbox`` and ``score``, and MegaDetector's ``images`` have ``file`` and
``detections``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.marked import Marked, Rows, number, shown

#: Categories of images in which nothing is (COCO Camera Traps has them), without regard to capitals.
EMPTY = frozenset({"empty"})


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
    try:
        found = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise WildlabError(
            f"begins like JSON and is none ({printable(str(error))[:100]})", "write it anew", file=path
        ) from None
    if isinstance(found, list):
        _no_groups(group, path, "a list of COCO results")
        return _results(found, path, truth)
    images = found.get("images")
    if isinstance(images, list) and isinstance(found.get("annotations"), list):
        return _truth(found, path, group)
    listed = isinstance(images, list) and all(isinstance(one, dict) for one in images)
    if listed and ("detection_categories" in found or any("detections" in one for one in images)):
        _no_groups(group, path, "a batch of MegaDetector")
        return _megadetector(found, path)
    keys = ", ".join(printable(one) for one in list(found)[:8]) or "no key"
    raise WildlabError(
        f"is JSON with {keys}, of no format that is known",
        "give COCO (images, annotations, categories), a list of COCO results, or a batch of MegaDetector "
        "(images with detections, detection_categories)",
        file=path,
    )


def _no_groups(group: str | None, path: Path, what: str) -> None:
    if group is not None:
        raise WildlabError(
            f"is {what}, which says nothing of groups", "leave --group out", file=path, field=group
        )


def _truth(found: dict[str, Any], path: Path, group: str | None) -> Marked:
    categories: dict[int | str, str] = {}
    for where, one in _entries(found, "categories", path):
        key = _id(one, "id", where, path)
        if key in categories:
            raise _twice(f"{where}.id", key, "category", path)
        categories[key] = _text(one, "name", where, path)
    ids: dict[int | str, str] = {}
    sizes: dict[str, tuple[int, int]] = {}
    groups: dict[str, str] = {}
    for where, one in _entries(found, "images", path):
        key, name = _id(one, "id", where, path), _text(one, "file_name", where, path)
        if key in ids:
            raise _twice(f"{where}.id", key, "image", path)
        if name in groups:
            raise _twice(f"{where}.file_name", name, "image", path)
        ids[key] = name
        size = [number(one.get(side)) for side in ("width", "height")]
        if all(side >= 1 for side in size):
            sizes[name] = (int(size[0]), int(size[1]))
        if group is not None and group not in one:
            raise WildlabError(
                "this image has no such field", "name one that all have", file=path, field=f"{where}.{group}"
            )
        groups[name] = str(one[group]) if group else name
    if not ids:
        raise WildlabError("names no image", "list the images that were looked at", file=path, field="images")
    rows = Rows(path)
    unjudged: set[str] = set()
    for where, one in _entries(found, "annotations", path):
        key = _id(one, "image_id", where, path)
        if key not in ids:
            raise WildlabError(
                f"is {shown(key)}, and no image has this id",
                "add the image, or take the annotation out",
                file=path,
                field=f"{where}.image_id",
            )
        kind = _kind(categories, one, "category_id", where, path, "categories")
        if one.get("bbox") is None:
            if kind.lower() not in EMPTY:
                unjudged.add(ids[key])
                rows.leave_out("annotation without a box, whose image is not judged")
            continue
        rows.add(f"{where}.bbox", ids[key], one["bbox"], kind, one.get("score"), bool(one.get("iscrowd")))
    seen = tuple(one for one in groups if one not in unjudged)
    known = tuple(dict.fromkeys(categories.values()))
    given = {"sizes": sizes, "ids": ids, "categories": categories, "groups": groups if group else None}
    return rows.marked("COCO", seen, known, **given)


def _results(found: list[Any], path: Path, truth: Marked | None) -> Marked:
    ids = {} if truth is None else truth.ids
    kinds = {} if truth is None else truth.categories
    rows = Rows(path)
    for at, one in enumerate(found):
        where = f"[{at}]"
        _object(one, where, path)
        key = _id(one, "image_id", where, path)
        score = one.get("score")
        if score is None:
            raise WildlabError(
                "a result of COCO has a score, and this has none", "add it", file=path, field=f"{where}.score"
            )
        if ids and key not in ids:
            rows.leave_out("result of an image that the labels do not have")
            continue
        kind = str(_id(one, "category_id", where, path))
        if kinds:
            kind = _kind(kinds, one, "category_id", where, path, "the labels' categories")
        rows.add(f"{where}.bbox", ids.get(key, str(key)), one.get("bbox"), kind, score)
    if found and not rows.names:
        raise WildlabError(
            f"none of {len(found)} results is of an image of the labels",
            "give the COCO file of the same images with --labels",
            file=path,
            field="image_id",
        )
    seen = tuple(dict.fromkeys(rows.names))
    by = "name" if ids else "id"
    return rows.marked("COCO results", seen, tuple(dict.fromkeys(rows.kinds)), by=by)


def _megadetector(found: dict[str, Any], path: Path) -> Marked:
    categories = found.get("detection_categories")
    if not isinstance(categories, Mapping):
        raise WildlabError(
            f"is {shown(categories)}, and what the categories are called is wanted",
            'give them, as {"1": "animal"}',
            file=path,
            field="detection_categories",
        )
    rows = Rows(path)
    seen: dict[str, None] = {}
    for where, one in _entries(found, "images", path):
        name = _text(one, "file", where, path)
        if one.get("failure") or one.get("detections") is None:
            rows.leave_out("image that the detector failed on")
            continue
        if name in seen:
            raise _twice(f"{where}.file", name, "image", path)
        seen[name] = None
        for place, box in _entries(one, "detections", path, f"{where}."):
            kind = _kind(categories, box, "category", place, path, "detection_categories")
            numbers = box.get("bbox")
            rows.add(f"{place}.bbox", name, numbers, kind, box.get("conf"))
            check_relative(rows.boxes[-1], numbers, f"{place}.bbox", path)
    return rows.marked("MegaDetector", tuple(seen), tuple(map(str, categories.values())), relative=True)


def check_relative(box: tuple[float, ...], given: Any, where: str, path: Path) -> None:
    """Refuse a box that is not in shares of the image.

    Parameters
    ----------
    box
        Four numbers.
    given
        As it stands in the file.
    where, path
        For the message.

    Raises
    ------
    WildlabError
        Where a number is below 0 or above 1, by more than the rounding of a written number.
    """
    if not all(-1e-3 <= one <= 1 + 1e-3 for one in box):
        raise WildlabError(
            f"is {shown(given)}, and shares of the image from 0 to 1 are wanted",
            "divide by its width and height",
            file=path,
            field=where,
        )


def _entries(found: dict[str, Any], key: str, path: Path, before: str = "") -> list[tuple[str, Any]]:
    entries = found.get(key)
    if not isinstance(entries, list):
        raise WildlabError(f"is {shown(entries)}, and a list is wanted", "mend it", file=path, field=key)
    named = [(f"{before}{key}[{at}]", one) for at, one in enumerate(entries)]
    for where, one in named:
        _object(one, where, path)
    return named


def _object(one: Any, where: str, path: Path) -> None:
    if not isinstance(one, dict):
        raise WildlabError(f"is {shown(one)}, and an object is wanted", "mend it", file=path, field=where)


def _id(one: dict[str, Any], key: str, where: str, path: Path) -> int | str:
    value = one.get(key)
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise WildlabError(
            f"is {shown(value)}, and a number or a name is wanted",
            "mend it",
            file=path,
            field=f"{where}.{key}",
        )
    return value


def _text(one: dict[str, Any], key: str, where: str, path: Path) -> str:
    value = one.get(key)
    if not isinstance(value, str) or not value:
        raise WildlabError(
            f"is {shown(value)}, and a name is wanted", "mend it", file=path, field=f"{where}.{key}"
        )
    return value


def _kind(
    known: Mapping[Any, Any], one: dict[str, Any], key: str, where: str, path: Path, listed: str
) -> str:
    value = _id(one, key, where, path)
    if value not in known:
        there = ", ".join(printable(f"{a}") for a in list(known)[:20]) or "none"
        raise WildlabError(
            f"is {shown(value)}, and {listed} has {there}",
            "mend it, or add it there",
            file=path,
            field=f"{where}.{key}",
        )
    return str(known[value])


def _twice(where: str, value: int | str, what: str, path: Path) -> WildlabError:
    return WildlabError(
        f"{shown(value)} stands for more than one {what}", "leave one of them out", file=path, field=where
    )
