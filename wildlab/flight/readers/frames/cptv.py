"""CPTV, version 2: thermal video of the Cacophony Project's trail cameras, as counts with their times.

Facts from the format's description (github.com/TheCacophonyProject/go-cptv, SPECv2.md): all is within gzip;
``CPTV``, a byte of the version, a header section and one section for each frame; a section is a letter, a
number of fields, and fields of (length, letter, content), numbers with the low byte first. What that
description leaves open, compression 1, is: the frame less the one before it, rows by turns from left and from
right; of that the first number in 4 bytes, and then differences of neighbours, packed in so many bits each,
the high bit first, in two's complement.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import regular_size, unreadable
from wildlab.flight.readers.frames.frame import Frame, Polarity, frame_name, spoilt
from wildlab.flight.readers.frames.valid import find_no_data, problem_of

SUFFIX = ".cptv"
#: The most bytes of a file, the most pixels of a frame (cameras of today have 0.02 to 0.3 million), and the
#: most frames: a day and more at nine a second.
MOST_BYTES, MOST_PIXELS, MOST_FRAMES = 2_000_000_000, 4_000_000, 1_000_000
#: The widest difference: two numbers of 16 bits, differenced twice, need 18.
WIDEST = 24
#: s after the start of a flat-field correction, by the camera's own clock, in which its shutter may be
#: closed. Chosen: corrections of such cameras take less.
CORRECTION = 1.0
_FIX = "record it again, or convert it to images"
_DAMAGED = (EOFError, zlib.error, gzip.BadGzipFile, struct.error)


class Opened(NamedTuple):
    """What the header says: ``width``, ``height`` (px) and ``frames``, how many, None where it does not."""

    width: int
    height: int
    frames: int | None


def open_cptv(path: Path) -> Opened:
    """The header of a CPTV file.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    Opened

    Raises
    ------
    WildlabError
        Where it is no CPTV file of version 2, or claims what cannot be.
    """
    with _stream(path) as stream:
        return _header(stream, path)


def read_cptv(
    path: Path, wanted: Callable[[int], bool] = lambda number: True, *, polarity: Polarity = "unknown"
) -> Iterator[Frame]:
    """Frames of a CPTV file, one after another.

    Parameters
    ----------
    path
        Of the file.
    wanted
        Of the number of a frame, from 0: whether it is wanted. All are decoded, as each is stored as its
        difference from the one before.
    polarity
        What the caller said; else white-hot, as counts rise with warmth.

    Yields
    ------
    Frame
        In counts; times from the first frame on, by the camera's clock. A picture of the background that the
        recorder worked out, and frames of a flat-field correction by the file's own clock, have a problem.
        Where the file breaks off or is damaged, a last one says so.

    Raises
    ------
    WildlabError
        As `open_cptv`.
    """
    with _stream(path) as stream:
        header = _header(stream, path)
        before = np.zeros(header.height * header.width, np.int64)
        start: int | None = None
        for number in range(MOST_FRAMES):
            name = frame_name(path, number)
            try:
                fields = _section(stream, b"F")
                if fields is None:
                    return
                before = _decoded(stream, fields, before)
            except _DAMAGED:
                yield spoilt(name, "the file is cut off or damaged here")
                return
            except ValueError as error:
                yield spoilt(name, str(error))
                return
            clock = _whole(fields, b"t")
            start = clock if start is None else start
            time = None if clock is None or start is None else (clock - start) / 1000
            if wanted(number):
                yield _frame(name, time, _rows(before, header), fields, polarity)


def _frame(
    name: str,
    time: float | None,
    image: NDArray[np.uint16],
    fields: dict[bytes, bytes],
    polarity: Polarity,
) -> Frame:
    clock, corrected = _whole(fields, b"t"), _whole(fields, b"c")
    if _whole(fields, b"g"):
        return spoilt(name, "it is the recorder's picture of the background, and no exposure", time)
    # A camera that was never corrected says zero.
    if clock is not None and corrected and 0 <= clock - corrected < 1000 * CORRECTION:
        since = (clock - corrected) / 1000
        return spoilt(name, f"a flat-field correction began {since:.1f} s before, by the file's clock", time)
    valid = ~find_no_data(image)
    problem = problem_of(image, valid)
    if problem:
        return spoilt(name, problem, time)
    return Frame(name, time, image, "counts", "white-hot" if polarity == "unknown" else polarity, valid)


def _stream(path: Path) -> BinaryIO:
    try:
        regular_size(path, MOST_BYTES)
        # Read in pieces: how much a small file unpacks to is not known before.
        return gzip.open(path, "rb")  # type: ignore[return-value]
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    except OSError as error:
        raise unreadable(error, path) from None


def _header(stream: BinaryIO, path: Path) -> Opened:
    try:
        start = stream.read(5)
        if start[:4] != b"CPTV":
            raise WildlabError("does not begin as a CPTV video does", _FIX, file=path)
        if start[4:] != b"\x02":
            version = start[4] if len(start) > 4 else "none"
            raise WildlabError(f"is CPTV of version {version}, and 2 is read", _FIX, file=path)
        fields = _section(stream, b"H") or {}
    except _DAMAGED:
        raise WildlabError("is cut off or damaged inside its header", _FIX, file=path) from None
    except ValueError as error:
        raise WildlabError(str(error), _FIX, file=path) from None
    width, height = _whole(fields, b"X") or 0, _whole(fields, b"Y") or 0
    if not 0 < width * height <= MOST_PIXELS:
        raise WildlabError(f"claims pictures of {width:,} x {height:,} pixels", _FIX, file=path)
    if _whole(fields, b"C") != 1:
        said = _whole(fields, b"C")
        raise WildlabError(f"has the compression {said}, and 1 is read", _FIX, file=path)
    return Opened(width, height, _whole(fields, b"J") or None)


def _section(stream: BinaryIO, letter: bytes) -> dict[bytes, bytes] | None:
    """Fields by their letter; None at the end of the file."""
    found = stream.read(1)
    if not found:
        return None
    if found != letter:
        raise ValueError(f"it has a section {found!r} where {letter!r} is due")
    (count,) = _exactly(stream, 1)
    fields = {}
    for _ in range(count):
        length, code = _exactly(stream, 2)
        fields[bytes([code])] = _exactly(stream, length)
    return fields


def _exactly(stream: BinaryIO, count: int) -> bytes:
    content = stream.read(count)
    if len(content) < count:
        raise EOFError
    return content


def _whole(fields: dict[bytes, bytes], code: bytes) -> int | None:
    return int.from_bytes(fields[code], "little") if code in fields else None


def _decoded(stream: BinaryIO, fields: dict[bytes, bytes], before: NDArray[np.int64]) -> NDArray[np.int64]:
    """The next frame (H * W,), in the order in which it is stored."""
    size, width = _whole(fields, b"f") or 0, _whole(fields, b"w") or 0
    if not 1 <= width <= WIDEST:
        raise ValueError(f"a frame has differences of {width} bits, and 1 to {WIDEST} are read")
    least = 4 + ((len(before) - 1) * width + 7) // 8
    # Writers round up, and one leaves a buffer of four times the size as it is.
    if not least <= size <= 4 * least + 64:
        raise ValueError(f"a frame claims {size:,} bytes, and its pixels take {least:,}")
    content = _exactly(stream, size)
    steps = np.empty(len(before), np.int64)
    steps[:1] = struct.unpack_from("<i", content)
    steps[1:] = unpack_bits(content[4:], width, len(before) - 1)
    # Counts have 16 bits, and differences may run over them.
    return np.asarray((before + np.cumsum(steps)) & 0xFFFF)


def unpack_bits(content: bytes, width: int, count: int) -> NDArray[np.int32]:
    """Whole numbers with a sign, packed in ``width`` bits each, the high bit first.

    Parameters
    ----------
    content
        Of ``count * width`` bits and more.
    width
        1 to 24.
    count
        How many numbers there are.

    Returns
    -------
    (count,) int32

    Examples
    --------
    >>> unpack_bits(bytes([0b001_111_10, 0b0_0000000]), 3, 3).tolist()
    [1, -1, -4]
    """
    # The number lies in the four bytes from where it begins, as 24 bits and 7 more are no more than 32.
    data = np.frombuffer(content + bytes(4), np.uint8)
    at = np.arange(count, dtype=np.int64) * width
    first = at >> 3
    four = np.zeros(count, np.uint32)
    for byte in range(4):
        four = (four << np.uint32(8)) | data[first + byte]
    four <<= (at & 7).astype(np.uint32)
    return np.asarray(four.view(np.int32) >> (32 - width))


def _rows(stored: NDArray[np.int64], header: Opened) -> NDArray[np.uint16]:
    image = stored.astype(np.uint16).reshape(header.height, header.width)
    image[1::2] = image[1::2, ::-1].copy()
    return image
