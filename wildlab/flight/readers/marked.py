"""Boxes as a file has them, whatever its format: what readers of labels give, and refuse alike."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import printable

Array = NDArray[np.float64]

#: The most bytes of a file of labels.
MOST_BYTES = 200_000_000
#: Boxes of one frame at most: every pair of a label and a detection is looked at.
MOST_IN_FRAME = 3000


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
    left_out: dict[str, int] = field(default_factory=dict)


class Rows:
    """Boxes that are read one by one, and checked alike."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.names: list[str] = []
        self.boxes: list[tuple[float, ...]] = []
        self.kinds: list[str] = []
        self.scores: list[float] = []
        self.crowd: list[bool] = []
        self.left_out: dict[str, int] = {}

    def add(self, where: str, name: str, box: Any, kind: str, score: Any = None, crowd: bool = False) -> None:
        """Take a box; `where` is the field of it, for messages.

        Raises
        ------
        WildlabError
            Where it is not four numbers with sizes of zero or more, or the score is no number.
        """
        numbers = tuple(map(number, box)) if isinstance(box, list | tuple) else ()
        if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
            raise WildlabError(
                f"is {shown(box)}, and four numbers are wanted: left, top, width, height",
                "mend it, or take the entry out",
                file=self.path,
                field=where,
            )
        if min(numbers[2:]) < 0:
            raise WildlabError(
                f"is {shown(box)}, and a box has no size below zero",
                "mend it, or take the entry out",
                file=self.path,
                field=where,
            )
        sure = math.nan if score is None else number(score)
        if score is not None and not math.isfinite(sure):
            raise WildlabError(
                f"the score of this box is {shown(score)}",
                "give a number, or leave it out",
                file=self.path,
                field=where,
            )
        self.names.append(name)
        self.boxes.append(numbers)
        self.kinds.append(kind)
        self.scores.append(sure)
        self.crowd.append(crowd)

    def leave_out(self, reason: str) -> None:
        """Count one thing that is not used."""
        self.left_out[reason] = self.left_out.get(reason, 0) + 1

    def marked(self, what: str, looked_at: tuple[str, ...], known: tuple[str, ...], **others: Any) -> Marked:
        """All rows; `others` are further fields of `Marked`."""
        boxes = np.array(self.boxes, float).reshape(-1, 4)
        scores, crowd = np.array(self.scores, float), np.array(self.crowd, bool)
        rest = {"left_out": self.left_out, **others}
        return Marked(what, self.names, boxes, self.kinds, scores, crowd, looked_at, known, **rest)


def number(value: Any) -> float:
    """A JSON value as a finite number, NaN where it is none.

    Parameters
    ----------
    value
        Anything; truth values are no numbers.

    Returns
    -------
    float

    Examples
    --------
    >>> number(3), number("3"), number(10**400)
    (3.0, nan, nan)
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value) if math.isfinite(value) else math.nan
    except OverflowError:
        return math.nan


def shown(value: Any) -> str:
    """A value of a hostile file, short and printable.

    Parameters
    ----------
    value
        Anything.

    Returns
    -------
    str
        At most 60 characters.
    """
    if value is None:
        return "missing"
    try:
        text = printable(repr(value))
    except ValueError:  # an integer with thousands of digits
        text = "a number with too many digits"
    return text if len(text) <= 60 else f"{text[:57]}..."
