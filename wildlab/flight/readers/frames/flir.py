"""FLIR's own records: the raw thermal image and its Planck constants, in a JPEG or in an ``.fff`` file.

A radiometric JPEG carries the records in pieces, in its APP1 segments. The raw image is either plain 16-bit
numbers or a PNG, and that PNG may hold its two bytes the wrong way round. Temperatures are those of a black
body behind no air (emissivity 1): what the file says of emissivity, air and distance was set by somebody, and
is rarely true of an animal far below.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.frames.decoding import decode_image
from wildlab.flight.readers.frames.headers import MOST_PIXELS, Header, read_header

_PIECE = b"FLIR\0"
#: Kinds of records.
_RAW, _CAMERA = 1, 32
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
    pieces: dict[int, bytes] = {}
    last, at = -1, 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
        (length,) = struct.unpack_from(">H", data, at + 2)
        body = data[at + 4 : at + 2 + length]
        if data[at + 1] == 0xE1 and body.startswith(_PIECE) and len(body) > 8:
            pieces[body[6]], last = body[8:], body[7]
        at += 2 + max(length, 2)
    whole = last >= 0 and set(pieces) >= set(range(last + 1))
    return b"".join(pieces[number] for number in range(last + 1)) if whole else b""


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
    if data[:4] not in (b"FFF\0", b"AFF\0"):
        return "it has no records of FLIR"
    try:
        # The version is a small number in the right order of bytes.
        order = ">" if struct.unpack_from(">I", data, 20)[0] < 0x10000 else "<"
        start, count = struct.unpack_from(f"{order}II", data, 24)
        raw, camera = b"", b""
        for number in range(min(count, MOST_RECORDS)):
            kind, *_ = struct.unpack_from(f"{order}H", data, start + 32 * number)
            at, length = struct.unpack_from(f"{order}II", data, start + 32 * number + 12)
            if kind == _RAW and not raw:
                if at + length > len(data):
                    return "the file is cut off inside its raw image"
                raw = data[at : at + length]
            elif kind == _CAMERA and not camera:
                camera = data[at : at + length]
        counts = _raw_image(raw)
    except struct.error:
        return "its records of FLIR are cut off"
    return counts if isinstance(counts, str) else Radiometric(counts, _planck(camera))


def _raw_image(record: bytes) -> NDArray[np.uint16] | str:
    if len(record) < 34:
        return "its records of FLIR hold no raw image"
    order = "<" if struct.unpack_from("<H", record)[0] == 2 else ">"
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
    order = "<" if struct.unpack_from("<H", record)[0] == 2 else ">"
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
