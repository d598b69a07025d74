"""Images of a flight for its pages: reduced, and JPEG without a word on where and when they were taken.

The pixels alone are kept: an image is decoded and written anew, so nothing else in its file comes along.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.frames import Frame, Frames, open_frames
from wildlab.flight.readers.frames.image import file_name, frame_name
from wildlab.flight.store import Flight

#: Pictures of a page and their bytes, at most: below 3 MB a phone opens it at once; the longest side, px.
MOST_PICTURES, MOST_BYTES, LONGEST, QUALITY = 120, 800_000, 960, 70
#: Shares of the pixels, %, that are black and white where counts or temperatures are made grey.
DARK, BRIGHT = 0.5, 99.8
#: By how much the shape of an image may differ from that of the camera's, as a share.
UNLIKE = 0.01


class Shots(NamedTuple):
    """JPEG by the row of the frames that they are of, and clauses on those that are not shown."""

    by_row: dict[int, bytes]
    lacks: tuple[str, ...]


def read_shots(
    folder: Path,
    ids: Sequence[object],
    size: tuple[int, int] | None,
    seen: Collection[int] = (),
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Shots:
    """Pictures of a flight's frames; of too many half evenly, half where something was seen.

    Parameters
    ----------
    folder
        Of images, or a video.
    ids
        (N,) what the flight calls its frames: names of files, with or without their endings.
    size
        Width and height of the camera's image, px, where it is known: images of another shape are not shown.
    seen
        Rows of the frames in which something was seen.
    progress
        Is told how many are done, of how many.

    Raises
    ------
    WildlabError
        Where the folder is not there, or holds no image of these frames.
    """
    frames, numbers = _match_frames(folder, ids)
    if not numbers:
        raise WildlabError(
            "none of these images is one of the flight's frames",
            "name the folder of its images",
            file=folder,
            field="--images",
        )
    lacks, wanted = [], np.array(sorted(numbers))
    if len(wanted) > MOST_PICTURES:
        near, half = wanted[[numbers[int(one)] in seen for one in wanted]], MOST_PICTURES // 2
        kept = np.union1d(wanted[spread_evenly(len(wanted), half)], near[spread_evenly(len(near), half)])
        lacks.append(f"every image: {len(kept)} of {len(wanted)} are")
        wanted = kept
    taken: dict[int, bytes] = {}
    amiss: Counter[str] = Counter()
    for done, (number, frame) in enumerate(zip(wanted, frames.some(list(wanted)), strict=False), start=1):
        if why := _why_not(frame, size):
            amiss[why] += 1
        else:
            taken[numbers[int(number)]] = jpeg_of(frame, MOST_BYTES // len(wanted))
        progress(done, len(wanted))
    return Shots(taken, (*lacks, *(f"{count} images: {why}" for why, count in amiss.items())))


def images_of(flight: Path | None) -> Path | None:
    """The folder of a flight's images, where it holds one."""
    return flight / "images" if flight is not None and (flight / "images").is_dir() else None


def frames_of(flight: Flight, ids: Sequence[object]) -> dict[int, NDArray[Any]]:
    """Images (H, W) or (H, W, 3) in the flight's folder, by the row of ``ids`` that names them."""
    folder = images_of(flight.folder)
    if folder is None:
        return {}
    try:
        frames, numbers = _match_frames(folder, ids)
    except WildlabError:  # The folder holds no images.
        return {}
    found = zip(numbers.values(), frames.some(list(numbers)), strict=True)
    return {row: frame.image for row, frame in found if frame.usable}


def _match_frames(folder: Path, ids: Sequence[object]) -> tuple[Frames, dict[int, int]]:
    """Frames of a folder or a video, and by the number of one the row of ``ids`` that names it."""
    frames = open_frames(folder, ids=[str(one) for one in ids])
    names: Iterable[str] = map(file_name, frames.files)
    if not frames.files:
        names = (frame_name(folder, number) for number in range(frames.count or 0))
    rows = {str(name): row for row, name in reversed(list(enumerate(ids)))}
    stems = {Path(name).stem: row for name, row in reversed(list(rows.items()))}
    found = [(number, rows.get(name, stems.get(Path(name).stem))) for number, name in enumerate(names)]
    return frames, {number: row for number, row in found if row is not None}


def spread_evenly(n: int, most: int) -> NDArray[np.intp]:
    """Rows of ``n``, all or ``most`` of them evenly, the first and the last among them."""
    return np.arange(n) if n <= most else np.unique(np.linspace(0, n - 1, most).round().astype(np.intp))


def _why_not(frame: Frame, size: tuple[int, int] | None) -> str:
    if not frame.usable:
        return frame.problem.rstrip(".")
    height, width = frame.image.shape[:2]
    if size is not None and abs(width * size[1] / (height * size[0]) - 1) > UNLIKE:
        return f"they are {width} x {height} pixels, and the camera's {size[0]} x {size[1]}"
    return ""


def jpeg_of(frame: Frame, most: int) -> bytes:
    """A frame as JPEG of about so many bytes at most, with fewer pixels where it has to."""
    image = frame.image if frame.unit in ("grey", "colour") else stretch_contrast(frame.image)
    image = np.ascontiguousarray(image[..., ::-1] if image.ndim == 3 else image)
    share, packed = min(1.0, LONGEST / max(image.shape[:2])), b""
    for _ in range(3):
        size = [max(round(side * share), 1) for side in image.shape[1::-1]]
        small = image if share == 1 else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        packed = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
        if len(packed) <= most:
            break
        share *= 0.95 * float(np.sqrt(most / len(packed)))
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
