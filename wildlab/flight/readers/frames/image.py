"""Image files as frames: read as regular files, their headers believed before their content is decoded."""

from __future__ import annotations

import io
import os
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular, unreadable
from wildlab.flight.readers.frames.scene import find_clipped, find_no_data, problem_of
from wildlab.flight.readers.frames.thermal import (
    AS_COUNTS,
    RECORDS,
    gather_pieces,
    open_image,
    pixels_of,
    read_dji,
    read_records,
    segments_of,
    to_kelvin,
)

#: What is taken for an image in a folder.
SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".fff"})
#: A mask of no pixel.
NOTHING = np.zeros((0, 0), bool)
#: The most bytes of an image file that are read.
MOST_BYTES = 300_000_000
#: The tag of EXIF that says how an image is to be turned.
ORIENTATION = 0x0112
#: Grey levels by which the colours of a grey JPEG differ.
GREY = 6
#: The most that a pixel may be read as, K: hotter than what a thermal camera measures is a broken constant.
HOTTEST = 3000.0

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
    return Frame(name, time, np.zeros((0, 0), np.uint8), "grey", "unknown", NOTHING, said)


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


def read_image(path: Path, *, polarity: Polarity = "unknown") -> Frame:
    """An image file as a frame; what cannot be used is a frame with a problem, never an error.

    Parameters
    ----------
    path
        A PNG, JPEG or TIFF of 8 or 16 bits, a TIFF of floats, a radiometric JPEG of FLIR, or an ``.fff``.
    polarity
        Of the camera, where the file does not say it.

    Returns
    -------
    Frame
        In K where the file has Planck constants, in counts where it has 16 bits, else grey or colour.
        ``time`` is None.

    Examples
    --------
    >>> read_image(Path("none.png")).problem
    'There is no such file.'
    """
    name = file_name(path)
    try:
        data = read_regular(path, MOST_BYTES)
    except FileNotFoundError:
        return spoilt(name, "there is no such file")
    except WildlabError as error:
        return spoilt(name, f"it {error.problem}")
    found = decode(data)
    if isinstance(found, str):
        return spoilt(name, found)
    image, unit, note = found
    warm = unit == "kelvin" or note.startswith(AS_COUNTS)
    return masked(Frame(name, None, image, unit, "white-hot" if warm else polarity, NOTHING, note=note))


def masked(frame: Frame) -> Frame:
    """A frame with the mask of what shows the scene, or with the problem that nothing does."""
    valid = ~find_no_data(frame.image) & ~find_clipped(frame.image)
    problem = problem_of(frame.image, valid)
    return spoilt(frame.name, problem, frame.time) if problem else replace(frame, valid=valid)


def _turned(image: Image.Image) -> str:
    """What is said of an image that viewers show turned: its pixels stay those of the sensor."""
    try:
        orientation = image.getexif().get(ORIENTATION, 1)
    except Exception:  # whatever a broken EXIF gives: the picture itself may be sound
        return ""
    if orientation in (None, 1) or not isinstance(orientation, int):
        return ""
    return (
        f"some images say that viewers are to show them turned (EXIF orientation {orientation}): pixels and "
        "labels count in the image as it is stored"
    )


def decode(data: bytes) -> tuple[NDArray[Any], Unit, str] | str:
    """Bytes of an image file as numbers with their unit and a note, or a clause that says why not.

    Parameters
    ----------
    data
        All bytes of the file.

    Returns
    -------
    (image, unit, note) or str
        As `Frame` has them.

    Examples
    --------
    >>> decode(b"")
    'the file is empty'
    """
    if data[:4] in RECORDS:
        records = _radiometric(data)
        return records if isinstance(records, str) else (*records, "")
    if not data:
        return "the file is empty"
    image = open_image(io.BytesIO(data), whole=True)
    if isinstance(image, str):
        return image
    segments = segments_of(image)
    turned = _turned(image) if segments else ""
    pieces = gather_pieces(segments)
    found = _radiometric(pieces) if pieces else ""
    if not isinstance(found, str):
        return (*found, turned)
    # Records without a raw image: the picture is still a picture.
    counts, note = read_dji(segments, *image.size)
    note = "; ".join(one for one in (note, turned) if one)
    if counts is not None:
        return counts, "counts", note
    pixels = pixels_of(image, data)
    picture = pixels if isinstance(pixels, str) else as_grey_or_colour(pixels)
    return picture if isinstance(picture, str) else (*picture, note)


def as_grey_or_colour(image: NDArray[Any]) -> tuple[NDArray[Any], Unit] | str:
    """Decoded pixels with their unit: three alike colours are one.

    Parameters
    ----------
    image
        (H, W), or (H, W, 3) red first.

    Returns
    -------
    (image, unit) or str
        A clause where the kind of numbers is not known.

    Examples
    --------
    >>> as_grey_or_colour(np.full((2, 2, 3), 7, np.uint8))[1]
    'grey'
    """
    if image.ndim == 3:
        # A sample tells: whole pictures take as long as the detection.
        sample = image[:: max(1, image.shape[0] // 64), :: max(1, image.shape[1] // 64)].astype(np.int32)
        if np.ptp(sample, axis=2).max() > GREY:
            return np.ascontiguousarray(image), "colour"
        image = np.ascontiguousarray(image[..., 1])
    if image.dtype == np.uint8:
        return image, "grey"
    if image.dtype == np.uint16:
        return image, "counts"
    if image.dtype.kind == "f":
        kelvin = image.astype(np.float32)
        plausible = np.isfinite(kelvin) & (kelvin > 100) & (kelvin < HOTTEST)
        if plausible.mean() < 0.5:
            return "it holds floating-point numbers that are no temperatures in kelvin"
        return np.where(plausible, kelvin, np.float32(np.nan)), "kelvin"
    return f"its numbers are of the kind {image.dtype}, and 8 or 16 bits without sign are read"


def _radiometric(records: bytes) -> tuple[NDArray[Any], Unit] | str:
    found = read_records(records)
    if isinstance(found, str):
        return found
    if found.planck is None:
        return found.counts, "counts"
    kelvin = to_kelvin(found.counts, found.planck)
    kelvin[kelvin > HOTTEST] = np.nan
    return (kelvin, "kelvin") if np.isfinite(kelvin).mean() > 0.5 else (found.counts, "counts")


def images_in(folder: Path) -> list[Path]:
    """Images of a folder by their endings, in the order of their names.

    Raises
    ------
    WildlabError
        Where it cannot be read.
    """
    try:
        return sorted(one for one in folder.iterdir() if one.suffix.lower() in SUFFIXES)
    except OSError as error:
        raise unreadable(error, folder) from None


def still_files(paths: list[Path]) -> list[Path]:
    """Image files named one by one, and those in folders, each once.

    Raises
    ------
    WildlabError
        Where a path is not there, or a folder holds none.
    """
    found: list[Path] = []
    for path in paths:
        if not path.exists():
            raise WildlabError("there is no such file or folder", "check the path", file=path)
        inside = [one for one in images_in(path) if one.is_file()] if path.is_dir() else [path]
        if not inside:
            raise no_images(path)
        found += inside
    return list(dict.fromkeys(found))


def no_images(folder: Path) -> WildlabError:
    """An error about a folder without images, to be raised."""
    endings = ", ".join(sorted(SUFFIXES))
    return WildlabError("there are no images in this folder", f"name one with {endings} files", file=folder)


def images_below(folder: Path, ids: Collection[str]) -> list[Path]:
    """Images in the folders below a folder that are frames of a flight, in the order of their paths.

    Parameters
    ----------
    folder
        As ``DCIM``; links and hidden folders in it are not followed.
    ids
        What the flight calls its frames: names of files, with or without their endings.

    Returns
    -------
    list of Path
        Empty where no image there is one of these.

    Raises
    ------
    WildlabError
        Where two files in different folders have one name: which of them is meant nobody says.
    """
    wanted = {str(one) for one in ids}
    stems = {Path(one).stem for one in wanted}
    found: dict[str, Path] = {}
    for here, folders, files in os.walk(folder):
        folders[:] = sorted(one for one in folders if not one.startswith("."))
        for name in sorted(files):
            path = Path(here) / name
            if path.suffix.lower() not in SUFFIXES or (name not in wanted and path.stem not in stems):
                continue
            if name in found:
                both = [printable(one.parent.relative_to(folder).as_posix()) for one in (found[name], path)]
                raise WildlabError(
                    f"{printable(name)}, a frame of the flight, is in {both[0]} and in {both[1]}",
                    f"name the folder that the flight has its images from: {both[0]} or {both[1]} in it",
                    file=folder,
                    field="--images",
                )
            found[name] = path
    return sorted(found.values())
