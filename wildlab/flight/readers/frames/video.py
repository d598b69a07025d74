"""A video as frames. The container is looked at before a decoder is: playlists lead to other files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import regular_size
from wildlab.flight.readers.frames.decoding import quiet
from wildlab.flight.readers.frames.frame import Frame, Polarity, frame_name, spoilt
from wildlab.flight.readers.frames.headers import MOST_PIXELS
from wildlab.flight.readers.frames.image import as_grey_or_colour
from wildlab.flight.readers.frames.valid import find_clipped, find_no_data, problem_of

#: What is taken for a video.
SUFFIXES = frozenset({".mp4", ".mov", ".m4v", ".avi", ".mkv"})
#: The most bytes of a video: a day of a thermal camera.
MOST_BYTES = 200_000_000_000
#: Frames after which a video that claims more is taken for broken.
MOST_FRAMES = 10_000_000
#: By how many frames a sound video may have fewer than it claims.
UNSURE = 2


def open_video(path: Path) -> Any:
    """A decoder for a video file.

    Parameters
    ----------
    path
        MP4, MOV, AVI or MKV.

    Returns
    -------
    cv2.VideoCapture
        Opened.

    Raises
    ------
    WildlabError
        Where it is no such file, claims too large a picture or cannot be decoded.
    """
    fix = "give a video as MP4, MOV, AVI or MKV, or a folder of its frames as images"
    try:
        regular_size(path, MOST_BYTES)
        with path.open("rb") as stream:
            start = stream.read(12)
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    known = start[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free") or start[:4] == b"\x1aE\xdf\xa3"
    if not known and not (start[:4] == b"RIFF" and start[8:12] == b"AVI "):
        raise WildlabError("does not begin as a video does", fix, file=path)
    # FFmpeg would write to the terminal what is said below; OpenCV looks for this once, at the first video.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    # OpenCV's other readers would take a name with a per cent sign for a series of images.
    with quiet():
        capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        raise WildlabError("cannot be decoded as a video", fix, file=path)
    width, height = capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
    if not 0 < width * height <= MOST_PIXELS:
        capture.release()
        raise WildlabError(f"claims pictures of {width:.0f} x {height:.0f} pixels", fix, file=path)
    return capture


def read_video(
    path: Path, wanted: Callable[[int], bool] = lambda number: True, *, polarity: Polarity = "unknown"
) -> Iterator[Frame]:
    """Frames of a video, one after another.

    Parameters
    ----------
    path
        Of the video.
    wanted
        Of the number of a frame, from 0: whether it is wanted. Others are gone over: seeking is not exact in
        compressed video.
    polarity
        Of the camera.

    Yields
    ------
    Frame
        Named ``clip#000012``; its time is by the frame rate. Where the video breaks off, a last one has the
        problem.

    Raises
    ------
    WildlabError
        As `open_video`.
    """
    capture = open_video(path)
    try:
        rate = capture.get(cv2.CAP_PROP_FPS)
        claimed = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        for number in range(MOST_FRAMES):
            done, picture = capture.read() if wanted(number) else (capture.grab(), None)
            if not done and number < claimed - UNSURE and wanted(number):
                yield spoilt(
                    frame_name(path, number), f"the video breaks off: it claims {claimed:.0f} frames"
                )
            if not done:
                return
            if picture is None:
                continue
            name = frame_name(path, number)
            time = number / rate if np.isfinite(rate) and rate > 0 else None
            yield as_frame(name, time, picture, polarity)
    finally:
        capture.release()


def as_frame(name: str, time: float | None, picture: Any, polarity: Polarity) -> Frame:
    """A decoded picture (H, W, 3), blue first, as a frame with its mask."""
    found = as_grey_or_colour(picture)
    if isinstance(found, str):
        return spoilt(name, found, time)
    image, unit = found
    valid = ~find_no_data(image) & ~find_clipped(image)
    problem = problem_of(image, valid)
    return spoilt(name, problem, time) if problem else Frame(name, time, image, unit, polarity, valid)
