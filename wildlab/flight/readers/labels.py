"""Labels of images: a box or a point for each thing that somebody, or another detector, marked."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePosixPath

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular, unreadable
from wildlab.flight.readers.boxes import (
    MOST_BYTES,
    MOST_IN_FRAME,
    Marked,
    read_json_boxes,
    read_table_boxes,
    read_yolo_folder,
)

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
            place = PurePosixPath(name.replace("\\", "/"))
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
