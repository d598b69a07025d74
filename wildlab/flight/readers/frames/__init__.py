"""Frames of cameras, one after another: folders of images, videos, radiometric JPEGs, as numbers with a unit
and a mask.

A file is opened only where it is a regular one, its claims are held against limits before it is decoded, and
what cannot be used is a frame with a sentence in ``problem``: the rest goes on.

The container of a video is looked at before a decoder is: playlists lead to other files.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import regular_size
from wildlab.flight.readers.frames.image import (
    MOST_PIXELS,
    NOTHING,
    SUFFIXES,
    Frame,
    Polarity,
    Unit,
    as_grey_or_colour,
    frame_name,
    images_below,
    images_in,
    masked,
    quiet,
    read_image,
    spoilt,
)
from wildlab.flight.readers.frames.scene import (
    HELD,
    MOST_ALIKE,
    Vignetting,
    are_alike,
    find_dead,
    find_overlay,
    is_shutter,
    measure_vignetting,
    without_vignetting,
)
from wildlab.geometry.frames import Mask

__all__ = ["Frame", "Frames", "Polarity", "Unit", "open_frames", "read_image"]

#: What the problems of such frames have in them.
CORRECTIONS = ("flat-field correction", "picture is held")
#: Images of a folder that are looked at, and those that are read, each with the next one, to find what stays:
#: burnt-in text, dead pixels, dark corners.
MOST_FILES, SAMPLE = 1_000_000, 12


@dataclass(frozen=True, eq=False)
class Kept:
    """What stays from frame to frame, as far as the sample tells it.

    Attributes
    ----------
    size
        Height and width of most frames, px; () where no size has a majority.
    overlay, dead
        (H, W) bool: burnt-in text, and pixels that do not see the scene. None where it cannot be told.
    vignetting
        None where none was asked for, or none is measured.
    held_can_be_told
        Whether neighbouring frames differ as a rule.
    notes
        Clauses on how they were read.
    """

    size: tuple[int, ...] = ()
    overlay: Mask | None = None
    dead: Mask | None = None
    vignetting: Vignetting | None = None
    held_can_be_told: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Frames:
    """What `open_frames` opened. Iterate over it; `starting_at` leaves out what was done before.

    Attributes
    ----------
    path
        Folder, image or video.
    files
        Images, in the order of their names; none of a video.
    count
        How many frames there are; of a video what it claims, None where it claims nothing.
    polarity
        What the caller said of the camera.
    known
        By the name of the file: name and time (s) that the frame has in a flight.
    even
        Whether the fall of brightness towards the corners is to be taken off, where it can be measured.
    """

    path: Path
    files: tuple[Path, ...]
    count: int | None
    polarity: Polarity = "unknown"
    known: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    even: bool = False

    def __len__(self) -> int:
        if self.count is None:
            raise TypeError("the video does not say how many frames it has")
        return self.count

    def __iter__(self) -> Iterator[Frame]:
        return self.starting_at(0)

    def starting_at(self, first: int) -> Iterator[Frame]:
        """Frames from a number on.

        Parameters
        ----------
        first
            From 0.

        Yields
        ------
        Frame
            With burnt-in overlays taken out of what is valid, and a problem where it is of another size than
            most.
        """
        return self._chosen(lambda number: number >= first)

    def some(self, numbers: Collection[int]) -> Iterator[Frame]:
        """Some of the frames; the others are not decoded.

        Parameters
        ----------
        numbers
            Which, counted from 0; in any order, and what there is none of is left out.

        Yields
        ------
        Frame
            In the order of the sequence.
        """
        return self._chosen(set(numbers).__contains__)

    def _chosen(self, wanted: Callable[[int], bool]) -> Iterator[Frame]:
        def needed(number: int) -> bool:  # a picture that is held is told by those before it
            return any(wanted(number + more) for more in range(HELD))

        for frame, number in zip(self._checked(self._read(needed)), filter(needed, count()), strict=False):
            if wanted(number):
                yield frame

    def _read(self, wanted: Callable[[int], bool]) -> Iterator[Frame]:
        if self.files:
            for number, path in enumerate(self.files):
                if wanted(number):
                    yield read_image(path, polarity=self.polarity)
        else:
            yield from read_video(self.path, wanted, polarity=self.polarity)

    def _checked(self, found: Iterator[Frame]) -> Iterator[Frame]:
        for one in mark_shutter(self._of_size(found), self.kept.held_can_be_told):
            yield self._cleaned(one) if one.usable else one

    def _of_size(self, found: Iterator[Frame]) -> Iterator[Frame]:
        size = self.kept.size
        for one in found:
            name, time = self.known.get(one.name, (one.name, one.time))
            frame = replace(one, name=name, time=time)
            if frame.usable and len(size) and frame.image.shape[:2] != size:
                wanted, got = ("{1} x {0}".format(*shape) for shape in (size, frame.image.shape))
                said = f"it has {got} pixels, and most of these frames have {wanted}"
                yield spoilt(frame.name, said, frame.time)
            else:
                yield frame

    def _cleaned(self, frame: Frame) -> Frame:
        """Without overlay, dead pixels and, where that is wanted, dark corners."""
        image, valid, kept = frame.image, frame.valid, self.kept
        if kept.vignetting is not None and kept.vignetting.offset.shape == image.shape:
            image = without_vignetting(image, kept.vignetting.offset)
        if kept.overlay is not None and kept.overlay.shape == valid.shape:
            valid = valid & ~kept.overlay
        if kept.dead is not None and kept.dead.any() and kept.dead.shape == valid.shape:
            # No filter is to spread them, so they get a number of their neighbours besides.
            image, valid = filled(image, kept.dead), valid & ~kept.dead
        return replace(frame, image=image, valid=valid)

    @cached_property
    def kept(self) -> Kept:
        """What stays from frame to frame, by a sample: to read all twice would take as long as detecting."""
        pairs = [(one, two) for one, two in self._some() if one.usable]
        some = [one for one, _ in pairs]
        sizes = Counter(one.image.shape[:2] for one in some).most_common(1)
        # Where no size has a majority there is none that others fall short of.
        size = sizes[0][0] if sizes and 2 * sizes[0][1] > len(some) else ()
        alike = [are_alike(one.image, two.image) for one, two in pairs if two is not None and two.usable]
        told = bool(alike) and sum(alike) <= MOST_ALIKE * len(alike)
        like = [one for one in some if one.image.shape[:2] == size and not is_shutter(one.image, one.valid)]
        # Counts and temperatures are taken before anything is written into a picture.
        overlay = find_overlay([_grey(one.image) for one in like if one.unit in ("grey", "colour")])
        notes = tuple(dict.fromkeys(one.note for one in some if one.note))
        if not like:
            return Kept(size, overlay, held_can_be_told=told, notes=notes)
        unit = Counter(one.unit for one in like).most_common(1)[0][0]
        like = [one for one in like if one.unit == unit]
        valid = np.logical_and.reduce([one.valid for one in like])
        if overlay is not None:
            valid &= ~overlay
        greys = [_grey(one.image) for one in like]
        dead = find_dead(greys, valid)
        vignetting = measure_vignetting(greys, valid) if self.even and unit != "colour" else None
        return Kept(size, overlay, dead, vignetting, told, notes)

    def _some(self) -> Iterator[tuple[Frame, Frame | None]]:
        """Some frames, each with the one after it."""
        count = self.count or 1
        numbers = np.unique(np.linspace(0, max(count - 1, 0), SAMPLE).round().astype(int)).tolist()
        if self.files:
            for number in numbers:
                after = self.files[number + 1 : number + 2]
                yield (
                    read_image(self.files[number], polarity=self.polarity),
                    next((read_image(path, polarity=self.polarity) for path in after), None),
                )
            return
        capture = open_video(self.path)
        try:
            for number in numbers:
                capture.set(cv2.CAP_PROP_POS_FRAMES, float(number))
                two = [
                    as_frame(frame_name(self.path, int(number)), None, picture, self.polarity)
                    for done, picture in (capture.read(), capture.read())
                    if done
                ]
                if two:
                    yield two[0], next(iter(two[1:]), None)
        finally:
            capture.release()


def open_frames(
    path: Path, *, polarity: Polarity = "unknown", even: bool = False, ids: Collection[str] = ()
) -> Frames:
    """Open a folder of images, one image, or a video.

    Parameters
    ----------
    path
        Folder: its images in the order of their names. Where it has none itself, those in the folders below
        it that `ids` names.
    polarity
        Of the camera, where its files do not say it.
    even
        Whether to take off that corners are darker, where the frames tell by how much (`measure_vignetting`).
    ids
        What a flight calls its frames: names of files, with or without their endings.

    Returns
    -------
    Frames
        Nothing but names is read yet, and of a video its header.

    Raises
    ------
    WildlabError
        Where there is nothing, or nothing that is an image or a video; as `images_below`.
    """
    kinds = ", ".join(sorted(SUFFIXES | VIDEOS))
    if path.is_dir():
        found = images_in(path)[:MOST_FILES]
        if not found and ids:
            found = images_below(path, ids)
        if not found:
            clips = sorted(one.name for one in path.iterdir() if one.suffix.lower() in VIDEOS)
            fix = (
                f"name one of its videos, {clips[0]} for instance"
                if clips
                else f"images end in one of {kinds}"
            )
            raise WildlabError("this folder itself has no images", fix, file=path)
        return Frames(path, tuple(found), len(found), polarity, even=even)
    if not path.exists():
        raise WildlabError("there is no such file or folder", "check the path", file=path)
    if path.suffix.lower() in SUFFIXES:
        return Frames(path, (path,), 1, polarity, even=even)
    if path.suffix.lower() in VIDEOS:
        capture = open_video(path)
        claimed = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        capture.release()
        known = np.isfinite(claimed) and 0 < claimed <= MOST_FRAMES
        return Frames(path, (), int(claimed) if known else None, polarity, even=even)
    raise WildlabError(f"the name ends in {path.suffix!r}", f"give a folder, or one of {kinds}", file=path)


def _grey(image: NDArray[Any]) -> NDArray[Any]:
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))


def filled(image: NDArray[Any], dead: Mask) -> NDArray[Any]:
    """An image whose dead pixels have the median of the 3 x 3 about them; colour stays as it is."""
    if image.ndim != 2:
        return image
    whole = image.copy()
    whole[dead] = cv2.medianBlur(image, 3)[dead]
    return whole


# -- flat-field corrections


def mark_shutter(frames: Iterable[Frame], held_can_be_told: bool) -> Iterator[Frame]:
    """Frames in their order; those of a shutter with a problem in place of their image.

    Parameters
    ----------
    frames
        Of one camera, one after another.
    held_can_be_told
        Whether neighbouring frames of this camera differ as a rule.

    Yields
    ------
    Frame
        From the third one alike on, a picture is held; the first two of them stay.
    """
    before: NDArray[Any] | None = None
    run = 1
    for frame in frames:
        if not frame.usable:
            yield frame
            continue
        run = run + 1 if before is not None and are_alike(before, frame.image) else 1
        before = frame.image
        if is_shutter(frame.image, frame.valid):
            said = "the shutter is closed (flat-field correction)"
            yield spoilt(frame.name, said, frame.time)
        elif held_can_be_told and run >= HELD:
            said = f"its picture is held: it repeats the {HELD - 1} frames before it to the last bit"
            yield spoilt(frame.name, said, frame.time)
        else:
            yield frame


# -- videos

#: What is taken for a video.
VIDEOS = frozenset({".mp4", ".mov", ".m4v", ".avi", ".mkv"})
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
    fix = "give MP4, MOV, AVI or MKV, or a folder of images"
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
    found = as_grey_or_colour(np.ascontiguousarray(picture[..., ::-1]))
    if isinstance(found, str):
        return spoilt(name, found, time)
    return masked(Frame(name, time, *found, polarity, NOTHING))
