"""Images of a flight for its replay: reduced, and JPEG without a word on where and when they were taken.

The pixels alone are kept: an image is decoded and written anew, so nothing else in its file comes along.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.frames import Frame, open_frames
from wildlab.flight.readers.frames.image import file_name, frame_name

#: Bytes of all images, and images, at most; the longest side, px.
MOST_BYTES, MOST_IMAGES, LONGEST = 24_000_000, 1000, 960
#: What a pixel takes in a JPEG that looks well, bytes: it decides how far images are reduced.
PER_PIXEL = 0.15
#: Qualities that are tried until an image is small enough.
QUALITIES = (80, 65, 50, 35, 20)
#: Shares of the pixels, %, that are black and white where counts or temperatures are made grey.
DARK, BRIGHT = 0.5, 99.8
#: By how much the shape of an image may differ from that of the camera's, as a share.
UNLIKE = 0.01


class Shot(NamedTuple):
    """A picture of a frame: JPEG, and its pixels for one of the frame's."""

    jpeg: bytes
    scale: float


class Shots(NamedTuple):
    """Pictures by the row of the frames that they are of, and clauses on those that are not shown."""

    by_row: dict[int, Shot]
    lacks: tuple[str, ...]


def read_shots(
    folder: Path,
    ids: Sequence[object],
    size: tuple[int, int] | None,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Shots:
    """Pictures of a flight's frames.

    Parameters
    ----------
    folder
        Of images, or a video.
    ids
        (N,) what the flight calls its frames: names of files, with or without their endings.
    size
        Width and height of the camera's image, px, where it is known: images of another shape are not shown.
    progress
        Is told how many are done, of how many.

    Returns
    -------
    Shots

    Raises
    ------
    WildlabError
        Where the folder is not there, or holds no image of these frames.
    """
    frames = open_frames(folder, ids=[str(one) for one in ids])
    names: Iterable[str]
    if frames.files:
        names = [file_name(path) for path in frames.files]
    else:
        names = [frame_name(folder, number) for number in range(frames.count or 0)]
    rows = {str(name): row for row, name in reversed(list(enumerate(ids)))}
    stems = {Path(name).stem: row for name, row in reversed(list(rows.items()))}
    found = [(number, rows.get(name, stems.get(Path(name).stem))) for number, name in enumerate(names)]
    numbers = {number: row for number, row in found if row is not None}
    if not numbers:
        raise WildlabError(
            "none of these images is one of the flight's frames",
            "name the folder of the images that the flight was imported with",
            file=folder,
            field="--images",
        )
    lacks = []
    wanted = sorted(numbers)
    if len(wanted) > MOST_IMAGES:
        lacks.append(f"every image: {MOST_IMAGES} of {len(wanted)} are, evenly")
        wanted = [wanted[i] for i in np.linspace(0, len(wanted) - 1, MOST_IMAGES).round().astype(int)]
    taken: dict[int, Shot] = {}
    amiss: dict[str, int] = {}
    scale: float | None = None
    for done, (number, frame) in enumerate(zip(wanted, frames.some(wanted), strict=False)):
        why = _why_not(frame, size)
        if why:
            amiss[why] = amiss.get(why, 0) + 1
        else:
            wide = size[0] if size is not None else frame.image.shape[1]
            high = size[1] if size is not None else frame.image.shape[0]
            scale = scale or reduction(wide, high, len(wanted))
            taken[numbers[number]] = Shot(
                jpeg_of(frame, (round(wide * scale), round(high * scale)), MOST_BYTES // len(wanted)), scale
            )
        progress(done + 1, len(wanted))
    lacks += [f"{count} images: {why}" for why, count in amiss.items()]
    return Shots(taken, tuple(lacks))


def reduction(width: int, height: int, count: int) -> float:
    """By what images are made smaller so that `count` of them fit into `MOST_BYTES`; one at most.

    Examples
    --------
    >>> reduction(640, 512, 10)
    1.0
    >>> round(reduction(4000, 3000, 10), 2)
    0.24
    """
    pixels = MOST_BYTES / max(count, 1) / PER_PIXEL
    return min(1.0, LONGEST / max(width, height), float(np.sqrt(pixels / (width * height))))


def _why_not(frame: Frame, size: tuple[int, int] | None) -> str:
    if not frame.usable:
        return frame.problem.rstrip(".")
    height, width = frame.image.shape[:2]
    if size is not None and abs(width * size[1] / (height * size[0]) - 1) > UNLIKE:
        return f"they are {width} x {height} pixels, and the camera's {size[0]} x {size[1]}"
    return ""


def jpeg_of(frame: Frame, size: tuple[int, int], most: int) -> bytes:
    """A frame as JPEG of a width and height, of as good a quality as `most` bytes allow."""
    image = frame.image if frame.unit in ("grey", "colour") else stretch_contrast(frame.image)
    if image.ndim == 3:
        image = image[..., ::-1]
    if (image.shape[1], image.shape[0]) != size:
        image = cv2.resize(np.ascontiguousarray(image), size, interpolation=cv2.INTER_AREA)
    packed = b""
    for quality in QUALITIES:
        _, data = cv2.imencode(".jpg", np.ascontiguousarray(image), [cv2.IMWRITE_JPEG_QUALITY, quality])
        packed = data.tobytes()
        if len(packed) <= most:
            break
    return packed


def stretch_contrast(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Counts or temperatures as grey levels.

    Parameters
    ----------
    image
        (H, W), NaN where nothing is known.

    Returns
    -------
    (H, W) uint8
        Black to white from the 0.5th to the 99.8th percentile.

    Examples
    --------
    >>> stretch_contrast(np.arange(1000, 1500, dtype=np.uint16).reshape(20, 25))[[0, -1], [0, -1]].tolist()
    [0, 255]
    """
    numbers = image.astype(np.float32)
    known = numbers[np.isfinite(numbers)]
    if not known.size:
        return np.zeros(image.shape, np.uint8)
    low, high = np.percentile(known, [DARK, BRIGHT])
    scaled = (numbers - low) / max(float(high - low), 1e-6)
    return np.asarray(np.nan_to_num(np.clip(scaled, 0, 1) * 255).round(), np.uint8)
