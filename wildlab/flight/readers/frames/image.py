"""Image files as frames: read as regular files, their headers believed before their content is decoded by
Pillow; FLIR's own records, and DJI's raw numbers.

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
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular, unreadable
from wildlab.flight.readers.frames.scene import find_clipped, find_no_data, problem_of
from wildlab.geometry.frames import Mask

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
    'it is no PNG, JPEG or TIFF'
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
        return "it is no PNG, JPEG or TIFF"
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
        return "it is a colour image of 16 bits"
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
AS_COUNTS = "DJI's thermal data (APP3) are read as counts, since only DJI's library knows temperatures"
AS_PREVIEW = "DJI's thermal data (APP3) have another size than the picture: the preview is used instead"
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


# -- frames

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
    valid: Mask
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
        f"some images are shown turned (EXIF orientation {orientation}): pixels and "
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
            return "its floats are no temperatures in kelvin"
        return np.where(plausible, kelvin, np.float32(np.nan)), "kelvin"
    return f"its numbers are of the kind {image.dtype}, and 8 or 16 bits are read"


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
    for path in sorted(folder.rglob("*")):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if hidden or path.suffix.lower() not in SUFFIXES or not {path.name, path.stem} & (wanted | stems):
            continue
        other = found.setdefault(path.name, path)
        if other != path:
            both = [printable(one.parent.relative_to(folder).as_posix()) for one in (other, path)]
            raise WildlabError(
                f"{printable(path.name)}, a frame of the flight, is in {both[0]} and in {both[1]}",
                f"name one of both: {both[0]} or {both[1]} in it",
                file=folder,
                field="--images",
            )
    return sorted(found.values())
