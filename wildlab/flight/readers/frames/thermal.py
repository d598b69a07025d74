"""Thermal images inside files: FLIR's own records and DJI's raw numbers.

A radiometric JPEG of FLIR carries records in pieces, in its APP1 segments; an ``.fff`` file is nothing
else. The raw image is either plain 16-bit numbers or a PNG, and that PNG may hold its two bytes the wrong
way round. Temperatures are those of a black body behind no air (emissivity 1): what the file says of
emissivity, air and distance was set by somebody, and is rarely true of an animal far below.

Known of DJI's own is (exiftool's tables of JPEG and DJI tags): APP3 holds raw thermal data, APP4
parameters, APP5 a calibration. The raw data are 16 bits for each pixel and grow with warmth. How they
become temperatures differs from camera to camera and is known to DJI's own program library alone, which is
not open. Cameras of DJI with a sensor of FLIR (XT, XT2) write FLIR's records instead.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.frames.headers import MOST_PIXELS, Header, jpeg_pieces, read_header

_PIECE = b"FLIR\0"
#: What FLIR's records begin with, and kinds of records.
RECORDS, RAW, CAMERA = (b"FFF\0", b"AFF\0"), 1, 32
#: Records that are looked at.
MOST_RECORDS = 256


class Planck(NamedTuple):
    """Constants of ``T = B / ln(R1 / (R2 (counts + O)) + F)``, T in K."""

    R1: float
    R2: float
    B: float
    F: float
    O: float  # noqa: E741 - the constant's name


class Radiometric(NamedTuple):
    """What a file holds beside its picture.

    Attributes
    ----------
    counts
        (H, W) uint16.
    planck
        None where the file has no usable constants.
    """

    counts: NDArray[np.uint16]
    planck: Planck | None


def flir_order(pieces: Iterable[bytes]) -> list[int]:
    """Which of the contents of APP1 segments (or their beginnings) are pieces of FLIR's records, in their
    order.

    Empty where there are none, or one is missing.
    """
    found = {
        one[6]: (at, one[7]) for at, one in enumerate(pieces) if one.startswith(_PIECE) and len(one) >= 8
    }
    last = max((last for _, last in found.values()), default=-1)
    return [found[number][0] for number in range(last + 1)] if set(found) >= set(range(last + 1)) else []


def gather_pieces(data: bytes) -> bytes:
    """FLIR's records of a JPEG, put together from its APP1 segments; b"" where it has none.

    Parameters
    ----------
    data
        All bytes of the JPEG.

    Returns
    -------
    bytes
        Beginning with ``FFF``; empty, too, where a piece is missing.
    """
    pieces = _segments(data, 0xE1)
    return b"".join(pieces[at][8:] for at in flir_order(pieces))


def _segments(data: bytes, marker: int) -> list[bytes]:
    found = jpeg_pieces(io.BytesIO(data), len(data)).found
    return [data[one.at : one.at + one.length] for one in found if one.kind == marker]


def find_records(take: Callable[[int, int], bytes]) -> dict[int, tuple[int, int]]:
    """Where the records of each kind stand, and their lengths, of FLIR's records; empty where these are none.

    Parameters
    ----------
    take
        Gives bytes from a place, as many as asked for or as there are.

    Raises
    ------
    struct.error
        Where they are cut off.
    """
    head = take(0, 64)
    if head[:4] not in RECORDS:
        return {}
    # The version is a small number in the right order of bytes.
    order = ">" if struct.unpack_from(">I", head, 20)[0] < 0x10000 else "<"
    start, count = struct.unpack_from(f"{order}II", head, 24)
    index = take(start, 32 * min(count, MOST_RECORDS))
    found: dict[int, tuple[int, int]] = {}
    for place in range(0, len(index) - 31, 32):
        (kind,) = struct.unpack_from(f"{order}H", index, place)
        found.setdefault(kind, struct.unpack_from(f"{order}II", index, place + 12))
    return found


def record_order(record: bytes) -> str:
    """The order of the bytes in a record, for `struct`."""
    return "<" if struct.unpack_from("<H", record)[0] == 2 else ">"


def read_records(data: bytes) -> Radiometric | str:
    """Raw image and constants out of FLIR's records.

    Parameters
    ----------
    data
        Beginning with ``FFF`` or ``AFF``: an ``.fff`` file, or what `gather_pieces` gives.

    Returns
    -------
    Radiometric or str
        A clause where there is no raw image that can be read.

    Examples
    --------
    >>> read_records(b"nothing")
    'it has no records of FLIR'
    """
    if data[:4] not in RECORDS:
        return "it has no records of FLIR"
    try:
        found = find_records(lambda at, length: data[at : at + length])
        raw, camera = (data[at : at + n] for at, n in (found.get(one, (0, 0)) for one in (RAW, CAMERA)))
        if sum(found.get(RAW, (0, 0))) > len(data):
            return "the file is cut off inside its raw image"
        counts = _raw_image(raw)
    except struct.error:
        return "its records of FLIR are cut off"
    return counts if isinstance(counts, str) else Radiometric(counts, _planck(camera))


def _raw_image(record: bytes) -> NDArray[np.uint16] | str:
    if len(record) < 34:
        return "its records of FLIR hold no raw image"
    order = record_order(record)
    width, height = struct.unpack_from(f"{order}HH", record, 2)
    body = record[32:]
    if body.startswith(b"\x89PNG"):
        claim = read_header(body)
        problem = claim.problem if isinstance(claim, Header) else claim
        if problem:
            return f"its raw image: {problem}"
        found = decode_image(body)
        if found is None or found.ndim != 2 or found.dtype != np.uint16:
            return "its raw image is no 16-bit PNG that can be decoded"
        return smoother_order(np.asarray(found, np.uint16))
    if not 0 < width * height <= MOST_PIXELS or len(body) < 2 * width * height:
        return f"its raw image claims {width} x {height} pixels and has {len(body):,} bytes"
    plain = np.frombuffer(body, f"{order}u2", width * height).reshape(height, width)
    return plain.astype(np.uint16)


def smoother_order(counts: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """The image with its bytes in the order in which neighbours are alike.

    Parameters
    ----------
    counts
        (H, W), as decoded; PNG says that the high byte comes first, and some cameras write the low one there.

    Returns
    -------
    (H, W) uint16

    Examples
    --------
    >>> swapped = np.arange(1000, 1064, dtype=np.uint16).reshape(8, 8).byteswap()
    >>> int(smoother_order(swapped)[0, 0])
    1000
    """

    def roughness(image: NDArray[np.uint16]) -> float:
        return float(np.median(np.abs(np.diff(image.astype(np.int64), axis=1)))) if image.shape[1] > 1 else 0

    swapped = counts.byteswap()
    return swapped if roughness(swapped) < roughness(counts) else counts


def _planck(record: bytes) -> Planck | None:
    if len(record) < 0x310:
        return None
    order = record_order(record)
    R1, B, F = struct.unpack_from(f"{order}fff", record, 0x58)
    O, R2 = struct.unpack_from(f"{order}if", record, 0x308)  # noqa: E741 - the constant's name
    found = Planck(R1, R2, B, F, float(O))
    usable = np.isfinite(found).all() and R1 > 0 and R2 > 0 and B > 0
    return found if usable else None


def to_kelvin(counts: NDArray[np.uint16], planck: Planck) -> NDArray[np.float32]:
    """Temperature of a black body that would give these counts.

    Parameters
    ----------
    counts
        (H, W).
    planck
        Constants of the camera.

    Returns
    -------
    (H, W) float32
        K; NaN where the constants give none.

    Examples
    --------
    >>> constants = Planck(17837.531, 0.012332781, 1450.4, 1.0, -1143.0)
    >>> print(round(float(to_kelvin(np.array([[12612]], np.uint16), constants)[0, 0]) - 273.15, 2))
    26.21
    """
    # Two bytes have 65536 values: a table of all of them is quicker than a logarithm for each pixel.
    every = np.arange(65536, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        kelvin = planck.B / np.log(planck.R1 / (planck.R2 * (every + planck.O)) + planck.F)
    kelvin[(every + planck.O <= 0) | ~np.isfinite(kelvin) | (kelvin <= 0)] = np.nan
    return kelvin.astype(np.float32)[counts]


# -- DJI

#: What is said of such a file.
AS_COUNTS = (
    "DJI's own thermal data (APP3) are read as counts: how they become temperatures is known to DJI's "
    "program library alone, which is not open; the preview picture is not used"
)
AS_PREVIEW = (
    "DJI's own thermal data (APP3) have another size than the picture and are not read, and DJI's program "
    "library for them is not open: the preview picture is used, with its own gain and palette"
)
#: The fewest bytes of APP3 that are taken for an image: others keep small notes there.
LEAST = 4096


def read_dji(data: bytes, width: int, height: int) -> tuple[NDArray[np.uint16] | None, str]:
    """Raw numbers of DJI's sensor out of a JPEG, and what is to be said.

    Parameters
    ----------
    data
        All bytes of the JPEG.
    width, height
        Of its picture, px.

    Returns
    -------
    counts, note
        (H, W) uint16, or None where there are none of the picture's size; the note is "" where the file has
        no thermal data of DJI at all.

    Examples
    --------
    >>> read_dji(b"no JPEG", 8, 8)
    (None, '')
    """
    named = any(b"DJI" in one or b"drone-dji" in one for one in _segments(data, 0xE1))
    raw = b"".join(_segments(data, 0xE3))
    if not named or len(raw) < LEAST:
        return None, ""
    if len(raw) != 2 * width * height:
        return None, AS_PREVIEW
    return smoother_order(np.frombuffer(raw, "<u2").reshape(height, width).astype(np.uint16)), AS_COUNTS


# -- OpenCV


def decode_image(data: bytes) -> NDArray[Any] | None:
    """Numbers of an image file, as OpenCV has them.

    Parameters
    ----------
    data
        All bytes of a file whose header was looked at (`read_header`).

    Returns
    -------
    (H, W) or (H, W, C), blue first, or None
        None where it cannot be decoded.

    Examples
    --------
    >>> decode_image(b"no image") is None
    True
    """
    with quiet():
        try:
            found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            return None
    return None if found is None else np.asarray(found)


@contextmanager
def quiet() -> Iterator[None]:
    """While this lasts, OpenCV writes nothing to the terminal."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)
