"""What image files hold: pixels as Pillow decodes them, FLIR's own records, and DJI's raw numbers.

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
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin

#: The most pixels that are decoded: four times the largest camera sensors that fly on small aircraft.
MOST_PIXELS = 100_000_000
#: Kinds of files that are read, as Pillow calls them.
FORMATS = ("PNG", "JPEG", TiffImagePlugin.TiffImageFile.format)
_PIECE = b"FLIR\0"
#: What FLIR's records begin with, and kinds of records.
RECORDS, RAW, CAMERA = (b"FFF\0", b"AFF\0"), 1, 32
#: Records that are looked at.
MOST_RECORDS = 256

# -- pixels


def open_image(stream: BinaryIO, *, whole: bool = False) -> Image.Image | str:
    """An image of which only the header was read, or a clause that says why it is none; where it has to be
    whole, the checksums of a PNG are held against its content.

    Examples
    --------
    >>> open_image(io.BytesIO(b"GIF89a"))
    'it is no PNG, JPEG or TIFF file that can be read'
    """
    try:
        with warnings.catch_warnings():
            # Pillow warns of what is broken and goes on; what is left is judged below.
            warnings.simplefilter("ignore")
            found = Image.open(stream, formats=FORMATS)
            if whole:
                found.verify()
                found = Image.open(stream, formats=FORMATS)
            pixels = found.width * found.height
    except Image.DecompressionBombError:
        pixels = MOST_PIXELS + 1
    except Exception:  # Pillow raises whatever comes first of a broken header
        return "it is no PNG, JPEG or TIFF file that can be read"
    if pixels > MOST_PIXELS:
        return f"it claims more than {MOST_PIXELS:,} pixels, the most that is decoded"
    return found


def pixels_of(image: Image.Image, data: bytes) -> NDArray[Any] | str:
    """Numbers of an image, (H, W) or (H, W, 3) red first, or a clause that says why it has none.

    Parameters
    ----------
    image
        Of `open_image`.
    data
        The same file: TIFF is decoded by OpenCV, since Pillow's decoder writes to the terminal.
    """
    deep = image.mode == "RGB" and any(";16" in str(one) for one in image.tile)  # type: ignore[attr-defined]
    try:
        if image.format == "TIFF":
            with quiet():
                found = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED))
            found = found[..., 2::-1] if found.ndim == 3 else found
        else:
            if image.mode in ("1", "LA", "La"):
                image = image.convert("L")
            elif image.mode not in ("L", "RGB") and not image.mode.startswith("I"):
                image = image.convert("RGB")
            found = np.asarray(image)
    except Exception:  # Pillow raises whatever comes first of a broken file
        found = np.empty(0)
    if found.ndim < 2 or found.shape[:2] != (image.height, image.width):
        return "the file is cut off or damaged"
    if deep:
        return "it is a colour image of 16 bits, and 8 are read"
    return found.astype(np.uint16) if image.mode.startswith("I;16") else found


@contextmanager
def quiet() -> Iterator[None]:
    """While this lasts, OpenCV writes nothing to the terminal."""
    before = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


def segments_of(image: Image.Image) -> list[tuple[str, bytes]]:
    """Application segments of a JPEG, each with its name: ``APP1``."""
    return list(getattr(image, "applist", ()))


# -- FLIR


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


def gather_pieces(segments: list[tuple[str, bytes]]) -> bytes:
    """FLIR's records of a JPEG, put together from its segments; b"" where it has none, or one is missing."""
    found = {
        one[6]: (one[8:], one[7])
        for name, one in segments
        if name == "APP1" and one.startswith(_PIECE) and len(one) >= 8
    }
    numbers = range(1 + max((last for _, last in found.values()), default=-1))
    return b"".join(found[number][0] for number in numbers) if set(found) >= set(numbers) else b""


def find_records(data: bytes) -> dict[int, bytes]:
    """The first record of each kind, of FLIR's records; empty where these are none.

    Raises
    ------
    struct.error
        Where they are cut off.
    """
    if data[:4] not in RECORDS:
        return {}
    # The version is a small number in the right order of bytes.
    order = ">" if struct.unpack_from(">I", data, 20)[0] < 0x10000 else "<"
    start, count = struct.unpack_from(f"{order}II", data, 24)
    found: dict[int, bytes] = {}
    for place in range(start, min(start + 32 * min(count, MOST_RECORDS), len(data) - 31), 32):
        (kind,) = struct.unpack_from(f"{order}H", data, place)
        at, length = struct.unpack_from(f"{order}II", data, place + 12)
        found.setdefault(kind, data[at : at + length])
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
    'its records of FLIR hold no raw image'
    """
    try:
        found = find_records(data)
        counts = _raw_image(found.get(RAW, b""))
    except struct.error:
        return "its records of FLIR are cut off"
    return counts if isinstance(counts, str) else Radiometric(counts, _planck(found.get(CAMERA, b"")))


def _raw_image(record: bytes) -> NDArray[np.uint16] | str:
    if len(record) < 34:
        return "its records of FLIR hold no raw image"
    order = record_order(record)
    width, height = struct.unpack_from(f"{order}HH", record, 2)
    body = record[32:]
    if body.startswith(b"\x89PNG"):
        image = open_image(io.BytesIO(body), whole=True)
        found = image if isinstance(image, str) else pixels_of(image, body)
        if isinstance(found, str) or found.ndim != 2 or found.dtype != np.uint16:
            return f"its raw image is no PNG of 16 bits ({found if isinstance(found, str) else found.dtype})"
        return smoother_order(found)
    if not 0 < width * height <= MOST_PIXELS or len(body) < 2 * width * height:
        return f"its raw image claims {width} x {height} pixels and has {len(body):,} bytes: it is cut off"
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
    "DJI's thermal data (APP3) are read as counts: only DJI's own library, which is not open, makes "
    "temperatures of them"
)
AS_PREVIEW = (
    "DJI's thermal data (APP3) have another size than the picture and are not read: the preview picture is "
    "used, with its own gain and palette"
)
#: The fewest bytes of APP3 that are taken for an image: others keep small notes there.
LEAST = 4096


def read_dji(
    segments: list[tuple[str, bytes]], width: int, height: int
) -> tuple[NDArray[np.uint16] | None, str]:
    """Raw numbers of DJI's sensor out of a JPEG, and what is to be said.

    Parameters
    ----------
    segments
        As `segments_of` gives them.
    width, height
        Of its picture, px.

    Returns
    -------
    counts, note
        (H, W) uint16, or None where there are none of the picture's size; the note is "" where the file has
        no thermal data of DJI at all.
    """
    named = any(b"DJI" in one or b"drone-dji" in one for name, one in segments if name == "APP1")
    raw = b"".join(one for name, one in segments if name == "APP3")
    if not named or len(raw) < LEAST:
        return None, ""
    if len(raw) != 2 * width * height:
        return None, AS_PREVIEW
    return smoother_order(np.frombuffer(raw, "<u2").reshape(height, width).astype(np.uint16)), AS_COUNTS
