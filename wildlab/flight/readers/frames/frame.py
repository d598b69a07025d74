"""One image of a camera as numbers: what it measures, and where it may be believed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Unit = Literal["grey", "counts", "kelvin", "colour"]
Polarity = Literal["white-hot", "black-hot", "unknown"]


@dataclass(frozen=True, eq=False)
class Frame:
    """One image.

    Attributes
    ----------
    name
        File name, or name of the clip and number of the frame in it, from 0.
    time
        s, from the first frame of a clip; None where it is not known.
    image
        (H, W) uint8 for ``grey``, (H, W, 3) uint8 red-green-blue for ``colour``, (H, W) uint16 for
        ``counts``, (H, W) float32 K for ``kelvin``.
    unit
        What the numbers are.
    polarity
        Whether warm is bright.
    valid
        (H, W) bool: False where there is no scene, or nothing can be told of it.
    problem
        "" where the frame can be used, else a sentence; the image is then of size (0, 0).
    note
        What is to be known of how it was read, as a clause; "" where there is nothing.

    Examples
    --------
    >>> Frame("a.png", None, np.zeros((2, 3), np.uint8), "grey", "unknown", np.ones((2, 3), bool)).usable
    True
    """

    name: str
    time: float | None
    image: NDArray[Any]
    unit: Unit
    polarity: Polarity
    valid: NDArray[np.bool_]
    problem: str = ""
    note: str = ""

    @property
    def usable(self) -> bool:
        """Whether there is no problem."""
        return not self.problem


def spoilt(name: str, problem: str, time: float | None = None) -> Frame:
    """A frame that cannot be used, with the sentence that says why.

    Parameters
    ----------
    name, time
        As those of `Frame`.
    problem
        A clause or a sentence; it gets a capital and a full stop.

    Returns
    -------
    Frame
        Its image has no pixels.
    """
    said = problem[:1].upper() + problem[1:].rstrip(".") + "."
    return Frame(name, time, np.zeros((0, 0), np.uint8), "grey", "unknown", np.zeros((0, 0), bool), said)


def file_name(path: Path) -> str:
    """A file's name as text that can be written: what is no UTF-8 in it stands as ``\\udcff``.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    str

    Examples
    --------
    >>> file_name(Path("flight/a\\udcff.png"))
    'a\\\\udcff.png'
    """
    return path.name.encode("utf-8", "backslashreplace").decode("utf-8")


def frame_name(path: Path, number: int) -> str:
    """What a frame of a clip is called.

    Parameters
    ----------
    path
        Of the clip.
    number
        Of the frame, from 0.

    Returns
    -------
    str

    Examples
    --------
    >>> frame_name(Path("flights/a.mp4"), 12)
    'a#000012'
    """
    return f"{Path(file_name(path)).stem}#{number:06d}"
