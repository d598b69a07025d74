"""One image file as a frame: read as a regular file, its header believed before its content is decoded."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wildlab.errors import WildlabError
from wildlab.flight.files import read_regular
from wildlab.flight.readers.frames.decoding import decode_image
from wildlab.flight.readers.frames.dji import AS_COUNTS, read_dji
from wildlab.flight.readers.frames.flir import gather_pieces, read_records, to_kelvin
from wildlab.flight.readers.frames.frame import Frame, Polarity, Unit, file_name, spoilt
from wildlab.flight.readers.frames.headers import Header, read_header
from wildlab.flight.readers.frames.valid import find_clipped, find_no_data, problem_of

#: What is taken for an image in a folder.
SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".fff"})
#: The most bytes of an image file that are read.
MOST_BYTES = 300_000_000
#: The tag of EXIF that says how an image is to be turned.
ORIENTATION = 0x0112
#: Grey levels by which the colours of a grey JPEG differ.
GREY = 6
#: The most that a pixel may be read as, K: hotter than what a thermal camera measures is a broken constant.
HOTTEST = 3000.0


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
    valid = ~find_no_data(image) & ~find_clipped(image)
    problem = problem_of(image, valid)
    if problem:
        return spoilt(name, problem)
    warm = unit == "kelvin" or note == AS_COUNTS
    note = "; ".join(one for one in (note, _turn(data)) if one)
    return Frame(name, None, image, unit, "white-hot" if warm else polarity, valid, note=note)


def _turn(data: bytes) -> str:
    """What is said of an image that viewers show turned: its pixels stay those of the sensor."""
    if data[:2] != b"\xff\xd8":
        return ""
    try:
        with Image.open(io.BytesIO(data)) as opened:
            orientation = opened.getexif().get(ORIENTATION, 1)
    except Exception:  # whatever a broken EXIF gives: the picture itself was decoded
        return ""
    if orientation in (None, 1) or not isinstance(orientation, int):
        return ""
    return (
        f"some images say that viewers are to show them turned (EXIF orientation {orientation}); pixels here "
        "are counted in the image as it is stored, and labels have to be drawn in that"
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
    if data[:4] in (b"FFF\0", b"AFF\0"):
        records = _radiometric(data)
        return records if isinstance(records, str) else (*records, "")
    header = read_header(data)
    if not isinstance(header, Header):
        return header
    if header.problem:
        return header.problem
    note = ""
    if header.kind == "jpeg":
        pieces = gather_pieces(data)
        found = _radiometric(pieces) if pieces else ""
        if not isinstance(found, str):
            return (*found, "")
        # Records without a raw image: the picture is still a picture.
        counts, note = read_dji(data, header.width, header.height)
        if counts is not None:
            return counts, "counts", note
    image = decode_image(data)
    if image is None:
        return f"its content cannot be decoded as {header.kind.upper()}"
    if image.shape[:2] != (header.height, header.width):
        return f"its header claims {header.width} x {header.height} pixels and it holds other ones"
    picture = as_grey_or_colour(image)
    return picture if isinstance(picture, str) else (*picture, note)


def as_grey_or_colour(image: NDArray[Any]) -> tuple[NDArray[Any], Unit] | str:
    """What OpenCV decoded, with its unit: three alike colours are one.

    Parameters
    ----------
    image
        (H, W), or (H, W, 3 or 4) blue first.

    Returns
    -------
    (image, unit) or str
        A clause where the kind of numbers is not known.

    Examples
    --------
    >>> as_grey_or_colour(np.full((2, 2, 3), 7, np.uint8))[1]
    'grey'
    """
    if image.ndim == 3 and image.shape[2] in (3, 4):
        image = image[..., :3]
        # A sample tells: whole pictures take as long as the detection.
        sample = image[:: max(1, image.shape[0] // 64), :: max(1, image.shape[1] // 64)].astype(np.int32)
        if np.ptp(sample, axis=2).max() > GREY:
            if image.dtype != np.uint8:
                return f"it is a colour image of {8 * image.dtype.itemsize} bits, and 8 are read"
            return np.ascontiguousarray(image[..., ::-1]), "colour"
        image = np.ascontiguousarray(image[..., 1])
    if image.ndim != 2:
        return f"it has {image.shape[2]} channels, and 1, 3 or 4 are read"
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
