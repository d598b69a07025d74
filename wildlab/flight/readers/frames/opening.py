"""Frames of a folder of images, of one image or of a video, one after another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.frames import image as images
from wildlab.flight.readers.frames import video as videos
from wildlab.flight.readers.frames.frame import Frame, Polarity, spoilt
from wildlab.flight.readers.frames.image import read_image
from wildlab.flight.readers.frames.valid import find_overlay
from wildlab.flight.readers.frames.video import frame_name, open_video, read_video

#: Images of a folder that are looked at, and those that are read to find burnt-in text.
MOST_FILES, SAMPLE = 1_000_000, 12


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
    """

    path: Path
    files: tuple[Path, ...]
    count: int | None
    polarity: Polarity = "unknown"
    known: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    _overlay: list[NDArray[np.bool_] | None] = field(default_factory=list, repr=False)
    _size: list[tuple[int, ...]] = field(default_factory=list, repr=False)

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
        found: Iterator[Frame]
        if self.files:
            found = (read_image(path, polarity=self.polarity) for path in self.files[first:])
        else:
            found = read_video(self.path, lambda number: number >= first, polarity=self.polarity)
        yield from self._checked(found)

    def some(self, numbers: Collection[int]) -> Iterator[Frame]:
        """Some of the frames; the others are not decoded.

        Parameters
        ----------
        numbers
            From 0.

        Yields
        ------
        Frame
            As of `starting_at`, in their order.
        """
        wanted = set(numbers)
        found: Iterator[Frame]
        if self.files:
            files = (path for number, path in enumerate(self.files) if number in wanted)
            found = (read_image(path, polarity=self.polarity) for path in files)
        else:
            found = read_video(self.path, wanted.__contains__, polarity=self.polarity)
        yield from self._checked(found)

    def _checked(self, found: Iterator[Frame]) -> Iterator[Frame]:
        overlay, size = self.overlay, self.size
        for one in found:
            name, time = self.known.get(one.name, (one.name, one.time))
            frame = replace(one, name=name, time=time)
            if frame.usable and len(size) and frame.image.shape[:2] != size:
                wanted, got = ("{1} x {0}".format(*shape) for shape in (size, frame.image.shape))
                said = f"it has {got} pixels, and most of these frames have {wanted}"
                yield spoilt(frame.name, said, frame.time)
            elif frame.usable and overlay is not None and overlay.shape == frame.valid.shape:
                yield replace(frame, valid=frame.valid & ~overlay)
            else:
                yield frame

    @property
    def overlay(self) -> NDArray[np.bool_] | None:
        """(H, W) where text is burnt in; None where it cannot be told."""
        self._sample()
        return self._overlay[0]

    @property
    def size(self) -> tuple[int, ...]:
        """Height and width of most frames, px; () where no size has a majority."""
        self._sample()
        return self._size[0]

    def _sample(self) -> None:
        """Looks at some frames, once: reading all of a long flight twice would take as long as detecting."""
        if self._overlay:
            return
        some = [one for one in self._some() if one.usable]
        sizes = Counter(one.image.shape[:2] for one in some).most_common(1)
        # Where no size has a majority there is none that others fall short of.
        size = sizes[0][0] if sizes and 2 * sizes[0][1] > len(some) else ()
        # Counts and temperatures are taken before anything is written into a picture.
        seen = [one for one in some if one.unit in ("grey", "colour") and one.image.shape[:2] == size]
        greys = [_grey(one.image) for one in seen]
        self._overlay.append(find_overlay(greys))
        self._size.append(size)

    def _some(self) -> Iterator[Frame]:
        numbers = np.unique(np.linspace(0, max((self.count or 1) - 1, 0), SAMPLE).round().astype(int))
        if self.files:
            yield from (read_image(self.files[number], polarity=self.polarity) for number in numbers)
            return
        capture = open_video(self.path)
        try:
            for number in numbers:
                capture.set(cv2.CAP_PROP_POS_FRAMES, float(number))
                done, picture = capture.read()
                if done:
                    yield videos.as_frame(frame_name(self.path, int(number)), None, picture, self.polarity)
        finally:
            capture.release()


def open_frames(path: Path, *, polarity: Polarity = "unknown") -> Frames:
    """Open a folder of images, one image, or a video.

    Parameters
    ----------
    path
        Folder: its images in the order of their names, no folders below it.
    polarity
        Of the camera, where its files do not say it.

    Returns
    -------
    Frames
        Nothing but names is read yet, and of a video its header.

    Raises
    ------
    WildlabError
        Where there is nothing, or nothing that is an image or a video.
    """
    kinds = ", ".join(sorted(images.SUFFIXES | videos.SUFFIXES))
    if path.is_dir():
        found = sorted(one for one in path.iterdir() if one.suffix.lower() in images.SUFFIXES)[:MOST_FILES]
        if not found:
            clips = sorted(one.name for one in path.iterdir() if one.suffix.lower() in videos.SUFFIXES)
            fix = (
                f"name one of its videos, {clips[0]} for instance"
                if clips
                else f"images end in one of {kinds}"
            )
            raise WildlabError("this folder has no images", fix, file=path)
        return Frames(path, tuple(found), len(found), polarity)
    if not path.exists():
        raise WildlabError("there is no such file or folder", "check the path", file=path)
    if path.suffix.lower() in images.SUFFIXES:
        return Frames(path, (path,), 1, polarity)
    if path.suffix.lower() in videos.SUFFIXES:
        capture = open_video(path)
        claimed = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        capture.release()
        known = np.isfinite(claimed) and 0 < claimed <= videos.MOST_FRAMES
        return Frames(path, (), int(claimed) if known else None, polarity)
    raise WildlabError(
        f"the name ends in {path.suffix!r}", f"give a folder, or a file in one of {kinds}", file=path
    )


def _grey(image: NDArray[Any]) -> NDArray[Any]:
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
