"""Labels of images as a detector is judged by them, and clicks in images as a log: COCO, MegaDetector, CVAT,
tables, YOLO.

A box stands for its middle. Programs that give shares of an image want its size, which is that of the images
that lie beside; without one such rows say so and are not used.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import leaves_folder, printable, read_regular, unreadable
from wildlab.flight.readers.boxes import (
    IMAGE_COLUMNS,
    MOST_BYTES,
    MOST_IN_FRAME,
    Boxes,
    Marked,
    plain_names,
    read_json_boxes,
    read_table_boxes,
    read_table_clicks,
    read_yolo_folder,
    way_of,
)
from wildlab.flight.readers.frames.image import SUFFIXES
from wildlab.flight.readers.log import Decoded, Readings
from wildlab.flight.readers.photo_tags import read_tags, size_of
from wildlab.flight.readers.text import header_of, number, parse_xml, plural

Array = NDArray[np.float64]


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
    def _by_ending(self) -> dict[str, list[str]]:
        """Names without their folders, and without folders and endings."""
        found: dict[str, list[str]] = {}
        for name in self.boxes:
            place = _plain(name)
            for key in {place.name, place.stem}:
                found.setdefault(key, []).append(name)
        return found

    def name_of(self, frame: str) -> str | None:
        """The name that the file has for a frame, None where it does not name it.

        Parameters
        ----------
        frame
            `wildlab.flight.readers.frames.Frame.name`.

        Returns
        -------
        str or None
        """
        stem = frame if self.marked.by == "number" else Path(frame).stem
        number = stem.rpartition("#")[2]
        by_number = self.marked.by != "name"
        name = str(int(number)) if by_number and number.isdecimal() else frame
        if name in self.boxes:
            return name
        # A flight may name its frames without the ending of their files, and so may the labels; other
        # programs name them with their folder.
        for key in (frame, Path(frame).stem) if self.marked.by != "number" else ():
            same = self._by_ending.get(key, [])
            if len(same) == 1:
                return same[0]
        return None

    def boxes_of(self, frame: str, name: str, width: int, height: int) -> tuple[Array, Array]:
        """What is marked in a frame, and where it is not judged, in px.

        Parameters
        ----------
        frame, name
            Of the frame, and what `name_of` calls it.
        width, height
            Of the frame, px; 0 where it could not be read.

        Returns
        -------
        (N, 4), (I, 4)
            Left, top, width, height, px.

        Raises
        ------
        WildlabError
            Where the file says that the frame is of another size.
        """
        given = self.marked.sizes.get(name)
        if given is not None and width and given != (width, height):
            raise WildlabError(
                f"says {given[0]} x {given[1]} pixels, and {printable(frame)} has {width} x {height}",
                "give the images that the boxes were drawn in, or labels of these",
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

    Parameters
    ----------
    path
        A CSV table, JSON of COCO (truth or results) or of MegaDetector, or a folder of YOLO's text files.
    classes
        Which classes are looked for; all others are then regions that are not judged. Empty: all.
    group
        Column (or field of COCO's images) that says what frames belong together, as those of one clip; folds
        never split these.
    truth
        Labels of the same images, whose ids the results of COCO have.

    Returns
    -------
    Labels

    Raises
    ------
    WildlabError
        Where the file cannot be read, lacks something or holds something that cannot be used, or where no
        label is of a class that is looked for.
    """
    return choose_classes(_read(path, group, None if truth is None else truth.marked), path, classes)


def choose_classes(marked: Marked, path: Path, classes: tuple[str, ...] = ()) -> Labels:
    """Labels of some classes out of what a file holds.

    Parameters
    ----------
    marked
        All of it.
    path
        Of the file.
    classes
        Which are looked for; all others are then regions that are not judged. Empty: all.

    Returns
    -------
    Labels

    Raises
    ------
    WildlabError
        Where no label is of a class that is looked for, or a frame has too many boxes.
    """
    unknown = sorted(set(classes) - set(marked.known_kinds))
    if unknown:
        there = ", ".join(printable(one) for one in sorted(set(marked.known_kinds))[:20])
        raise WildlabError(f"no label is of the class {unknown[0]!r}", f"there are {there}", file=path)
    there_is: NDArray[np.bool_] = np.isfinite(marked.boxes.sum(axis=1))
    wanted = np.array([not classes or kind in classes for kind in marked.kinds], bool)
    judged = wanted & ~marked.crowd
    of_frame: dict[str, NDArray[np.intp]] = {one: np.zeros(0, np.intp) for one in marked.looked_at}
    place = pd.Series(marked.names, dtype=object)
    of_rows = {str(one): np.asarray(rows) for one, rows in place.groupby(place, sort=False).groups.items()}
    of_frame |= {one: rows for one, rows in of_rows.items() if one in of_frame}
    for frame, rows in of_frame.items():
        if len(rows) > MOST_IN_FRAME:
            raise WildlabError(
                f"{printable(frame)} has {len(rows):,} boxes, and {MOST_IN_FRAME:,} are the most of an image",
                "leave out those with low scores",
                file=path,
            )
    chosen = {one: rows[there_is[rows] & judged[rows]] for one, rows in of_frame.items()}
    others = {one: rows[there_is[rows] & ~judged[rows]] for one, rows in of_frame.items()}
    return Labels(
        {one: marked.boxes[rows] for one, rows in chosen.items()},
        {one: marked.boxes[rows] for one, rows in others.items()},
        marked.groups or {one: one for one in of_frame},
        {one: marked.scores[rows] for one, rows in chosen.items()},
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
            raise WildlabError(
                "a folder of YOLO's says nothing of groups", "leave --group out", file=path, field=group
            )
        return read_yolo_folder(path)
    try:
        data = read_regular(path, MOST_BYTES)
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    if data[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"["):
        return read_json_boxes(data, path, group=group, truth=truth)
    return read_table_boxes(data, path, group=group)


# -- clicks


#: Attributes of CVAT that name a thing more closely than its label.
NAMES = frozenset({"name", "target", "target_id", "id", "marker"})
#: Things of one file, letters of a name, and files of a folder that are looked through, at most.
MOST, MOST_LETTERS, MOST_FILES = 1_000_000, 200, 200_000


def clicks_sniff(head: bytes) -> bool:
    """Whether a file is one of the known kinds, by its content."""
    start = head.lstrip(b"\xef\xbb\xbf \r\n\t")
    if start[:1] in (b"{", b"["):
        words = (b'"annotations"', b'"detection_categories"', b'"detections"', b'"bbox"', b'"file_name"')
        return any(one in head for one in words)
    if start[:1] == b"<":
        return b"<annotations" in head and (b"<image" in head or b"<meta" in head or b"<version" in head)
    names = plain_names(header_of(head))
    image = any(one in names for one in plain_names(IMAGE_COLUMNS))
    return image and way_of(names, points_first=True) is not None


def clicks_decode(path: Path, data: bytes, zone: str | None) -> Decoded:
    """Clicks and boxes of one file; images whose sizes are wanted lie beside it.

    Raises
    ------
    WildlabError
        Where it is of no format that is known, or something in it is wrong.
    """
    start = data.lstrip(b"\xef\xbb\xbf \r\n\t")[:1]
    if start in (b"{", b"["):
        return _decoded(read_json_boxes(data, path), path, path.parent)
    return _decoded(_cvat(data, path) if start == b"<" else read_table_clicks(data, path), path, path)


def folder_decode(folder: Path, zone: str | None) -> Decoded:
    """Boxes of a folder of YOLO's text files, one for each image; ``image`` is its name without the ending.

    Raises
    ------
    WildlabError
        Where there is no such file, or a line is wrong.
    """
    return _decoded(read_yolo_folder(folder), folder, folder)


def _decoded(marked: Marked, path: Path, folder: Path) -> Decoded:
    at = np.flatnonzero(~marked.crowd)
    if not len(at):
        raise WildlabError("marks nothing", "give a file with boxes or points", file=path)
    boxes, names = marked.boxes[at], [marked.names[row] for row in at]
    notes = [f"{marked.format}: {plural(len(at), 'box')}"] if marked.counted_in == "box" else []
    if marked.relative:
        sizes = sizes_beside(folder, names)
        known = np.array([sizes.get(one, (np.nan, np.nan)) for one in names], float)
        boxes = boxes * np.concatenate([known, known], axis=1)
        without = int((~np.isfinite(known).all(axis=1)).sum())
        if without:
            notes.append(f"{without} of {len(at)} boxes are shares of images whose size is not known")
    if marked.by == "id":
        notes.append("images are told by their ids, and which file has which id is not said")
    # One without extent is a point.
    wide = (boxes[:, 2:] > 0).any(axis=1)
    columns: dict[str, Any] = {
        "image": [one[:MOST_LETTERS] for one in names],
        "name": [printable(marked.kinds[row][:MOST_LETTERS]) for row in at],
        "u_px": boxes[:, 0] + boxes[:, 2] / 2,
        "v_px": boxes[:, 1] + boxes[:, 3] / 2,
        "score": marked.scores[at],
    }
    for side, name in enumerate(("box_u_px", "box_v_px", "box_width_px", "box_height_px")):
        columns[name] = np.where(wide, boxes[:, side], np.nan)
    unusable = {
        "no place in the image": ~np.isfinite(columns["u_px"] + columns["v_px"]),
        "no image": np.array([not one for one in names], bool),
    }
    rows = at + 1 if marked.rows is None else marked.rows[at]
    lost = [(count, "thing", f"left out: {what}") for what, count in marked.left_out.items()]
    lost.append((int(marked.crowd.sum()), "region", "of many that are not told apart"))
    return Decoded({"clicks": Readings(columns, rows, marked.counted_in, unusable)}, lost=lost, notes=notes)


def _plain(name: str) -> PurePosixPath:
    return PurePosixPath(name.replace("\\", "/"))


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
    parts = folder.parts
    above = [
        Path(*parts[:at], "images", *parts[at + 1 :])
        for at in range(len(parts) - 1, max(len(parts) - 4, 0), -1)
        if parts[at] == "labels"
    ]
    every = dict.fromkeys([folder, folder / "images", folder.parent / "images", *above])
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
        plain = _plain(name)
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
    root = parse_xml(data, path)
    boxes = Boxes()
    for image in root.iter("image"):
        for shape in image:
            named = [
                (one.text or "").strip()
                for one in shape.iter("attribute")
                if one.get("name", "").strip().lower() in NAMES
            ]
            name = next((one for one in reversed(named) if one), shape.get("label", ""))
            if shape.tag == "box":
                left, top, right, bottom = (number(shape.get(one)) for one in ("xtl", "ytl", "xbr", "ybr"))
                places = [(left, top, right - left, bottom - top)]
            elif shape.tag == "points":
                pairs = (one.partition(",") for one in shape.get("points", "").split(";"))
                places = [(number(u), number(v), 0.0, 0.0) for u, _, v in pairs]
            else:
                left_out[f"shape {printable(shape.tag[:40])}"] += shape.tag != "tag"
                continue
            boxes.found += [(image.get("name", ""), one, name, np.nan, False) for one in places]
    if len(boxes.found) > MOST:
        raise WildlabError("marks too much", "export less of it", file=path)
    if not boxes.found:
        raise WildlabError(
            "has no box or point of CVAT", "export the task as CVAT for images 1.1", file=path, field="image"
        )
    return boxes.marked("CVAT", None, None, left_out=+left_out, counted_in="shape")
