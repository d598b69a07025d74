"""Pictures of what was found: frames with boxes and ellipses, and sheets of what was missed and invented."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.detection.warm import to_grey
from wildlab.files import write_atomic
from wildlab.flight.readers.frames import Frame, Frames
from wildlab.geometry.frames import Array

Picture = NDArray[np.uint8]

#: Blue, green, red; of Okabe and Ito's palette, told apart by the colour-blind too.
COLOURS = {
    "found": (115, 158, 0),
    "invented": (0, 94, 213),
    "missed": (66, 228, 240),
    "not judged": (160, 160, 160),
    "detected": (233, 180, 86),
}
#: px of the image that a tile of a sheet shows, what it is enlarged to, and how many stand in a row.
AROUND, TILE, IN_A_ROW = 64, 160, 8
#: Tiles on one sheet at most.
MOST_TILES = 80
#: Of what was found, fewer: these are looked through, not searched for a mistake.
MOST_FOUND = 40
_BOX = ["left_px", "top_px", "width_px", "height_px"]


def overlay_picture(frame: Frame, things: pd.DataFrame) -> Picture:
    """A frame with what was found in it.

    Parameters
    ----------
    frame
        One that can be used.
    things
        Rows with ``left_px``, ``top_px``, ``width_px``, ``height_px`` and ``verdict``, a word of `COLOURS`.

    Returns
    -------
    (H, W, 3) uint8
        Blue, green, red. What is not valid is hatched.
    """
    picture = _picture(frame)
    hatched = ~frame.valid & (np.add.outer(*(np.arange(n) for n in frame.valid.shape)) % 8 < 2)
    picture[hatched] = (90, 60, 60)
    boxes = things[_BOX].to_numpy(float)
    for box, verdict in zip(boxes, things["verdict"], strict=True):
        near, far = np.rint(box[:2] - 5).astype(int), np.rint(box[:2] + box[2:] + 5).astype(int)
        cv2.rectangle(picture, near.tolist(), far.tolist(), COLOURS[str(verdict)], 1, cv2.LINE_AA)
    return picture


def contact_sheet(tiles: list[tuple[Picture, str, str]], columns: int = IN_A_ROW) -> Picture:
    """Small pictures in rows, each with a line below it.

    Parameters
    ----------
    tiles
        (picture (TILE, TILE, 3), line, word of `COLOURS` for its frame).
    columns
        How many stand in a row.

    Returns
    -------
    (H, W, 3) uint8
    """
    below, gap = 18, 4
    rows = max(1, -(-len(tiles) // columns))
    height, width = rows * (TILE + below + gap) + gap, columns * (TILE + gap) + gap
    sheet = np.full((height, width, 3), 255, np.uint8)
    for number, (picture, line, word) in enumerate(tiles):
        top = gap + (number // columns) * (TILE + below + gap)
        left = gap + (number % columns) * (TILE + gap)
        sheet[top : top + TILE, left : left + TILE] = picture
        cv2.rectangle(sheet, (left, top), (left + TILE - 1, top + TILE - 1), COLOURS[word], 2)
        text = "".join(sign if sign.isascii() and sign.isprintable() else "?" for sign in line)[-26:]
        place = (left, top + TILE + below - 5)
        cv2.putText(sheet, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.36, (0, 0, 0), 1, cv2.LINE_AA)
    return sheet


def cut_tile(frame: Frame, box: Array, colour: tuple[int, int, int]) -> Picture:
    """The surroundings of a box, enlarged.

    Parameters
    ----------
    frame
        Whose.
    box
        (4,) left, top, width, height, px.
    colour
        Of the box.

    Returns
    -------
    (TILE, TILE, 3) uint8
    """
    side = int(max(AROUND, 2 * max(box[2], box[3])))
    centre = (float(box[0] + box[2] / 2), float(box[1] + box[3] / 2))
    scale = TILE / side
    turn = np.array([[scale, 0, TILE / 2 - scale * centre[0]], [0, scale, TILE / 2 - scale * centre[1]]])
    tile = cv2.warpAffine(_picture(frame), turn, (TILE, TILE), borderValue=(200, 200, 200))
    corner = scale * (box[:2] - centre) + TILE / 2
    far = corner + scale * box[2:]
    first, second = ((int(one[0]), int(one[1])) for one in (corner - 3, far + 3))
    cv2.rectangle(tile, first, second, colour, 1, cv2.LINE_AA)
    return np.asarray(tile, np.uint8)


def write_pictures(
    frames: Frames,
    names: Sequence[str],
    things: pd.DataFrame,
    into: Path,
    most: int,
    tell: Callable[[int], None] | None = None,
) -> dict[str, int]:
    """Overlay pictures of some frames, evenly over the flight, and sheets of what was missed and invented.

    Parameters
    ----------
    frames
        Where they come from; only those that are drawn are read.
    names
        Of all frames, in order.
    things
        ``frame_id``, ``verdict``, the box and ``score``; from
        `wildlab.analysis.detecting.scores.DetectorScore`, or all ``detected``.
    into
        Folder: ``overlays/NAME.jpg``, ``missed.jpg``, ``invented.jpg``, and ``found.jpg``, or
        ``detected.jpg`` where nothing is judged.
    most
        How many overlays.
    tell
        Called with the number of frames that were drawn.

    Returns
    -------
    dict
        How many overlays there are, and tiles on each sheet that was written.
    """
    folder = into / "overlays"
    folder.mkdir(parents=True, exist_ok=True)
    files = picture_names(names)
    for file in files.values():
        # Of an earlier run: only what has a frame's name is taken away.
        (folder / file).unlink(missing_ok=True)
    evenly = np.linspace(0, len(names) - 1, min(most, len(names))).round().astype(int) if names else ()
    drawn = {names[number] for number in evenly}
    chosen = {word: _most_telling(things, word) for word in ("found", "detected", "missed", "invented")}
    on_sheets = {str(one) for rows in chosen.values() for one in things.loc[rows, "frame_id"]}
    wanted = [number for number, name in enumerate(names) if name in drawn or name in on_sheets]
    by_frame = dict(tuple(things.groupby("frame_id", sort=False))) if len(things) else {}
    tiles: dict[str, list[tuple[float, Picture, str]]] = {word: [] for word in chosen}
    overlays = 0
    for done, frame in enumerate(frames.some(wanted), start=1):
        if tell:
            tell(done)
        if not frame.usable:
            continue
        own = by_frame.get(frame.name, things.iloc[:0])
        if frame.name in drawn:
            write_atomic(folder / files[frame.name], _jpeg(overlay_picture(frame, own)))
            overlays += 1
        for word, rows in chosen.items():
            some = own.loc[own.index.intersection(rows)]
            ranks = np.nan_to_num(some["score"].to_numpy(float))
            for box, rank in zip(some[_BOX].to_numpy(float), ranks, strict=True):
                tiles[word].append((float(rank), cut_tile(frame, box, COLOURS[word]), frame.name))
    counts = {"overlays": overlays}
    for word, cut in tiles.items():
        (into / f"{word}.jpg").unlink(missing_ok=True)
        if cut:
            ranked = sorted(cut, key=lambda one: -one[0])
            sheet = contact_sheet([(picture, name, word) for _, picture, name in ranked])
            write_atomic(into / f"{word}.jpg", _jpeg(sheet))
            counts[word] = len(cut)
    return counts


def _most_telling(things: pd.DataFrame, word: str) -> Any:
    """Which rows go on a sheet: the surest of what was invented, the first of what was missed, and some of
    all scores of what was found."""
    some = things[things["verdict"] == word].sort_values("score", ascending=False, kind="stable").index
    if word in ("found", "detected") and len(some) > MOST_FOUND:
        return some[np.linspace(0, len(some) - 1, MOST_FOUND).round().astype(int)]
    return some[:MOST_TILES]


def picture_names(names: Sequence[str]) -> dict[str, str]:
    """File names of the pictures of frames; a number tells those apart that would get the same.

    Parameters
    ----------
    names
        Of frames, in their order.

    Returns
    -------
    dict
        By the name of the frame.

    Examples
    --------
    >>> list(picture_names(["a.png", "a.jpg", "b c.png"]).values())
    ['a.jpg', 'a-2.jpg', 'b_c.jpg']
    """
    taken: set[str] = set()
    found = {}
    for name in dict.fromkeys(names):
        stem = file = safe_stem(name)
        number = 1
        # Names that differ in their case alone are one file on some systems.
        while file.lower() in taken:
            number += 1
            file = f"{stem}-{number}"
        taken.add(file.lower())
        found[name] = f"{file}.jpg"
    return found


def safe_stem(name: str) -> str:
    """A frame's name as that of a file on every system.

    Parameters
    ----------
    name
        Of a frame.

    Returns
    -------
    str

    Examples
    --------
    >>> safe_stem("DJI 01.JPG"), safe_stem("clip#000012")
    ('DJI_01', 'clip_000012')
    """
    stem = Path(name).stem if "#" not in name else name
    return "".join(sign if sign.isascii() and (sign.isalnum() or sign in "-_") else "_" for sign in stem)[
        :120
    ]


def _picture(frame: Frame) -> Picture:
    """(H, W, 3) blue, green, red, whatever the frame measures."""
    if frame.image.ndim == 3:
        return np.ascontiguousarray(frame.image[..., ::-1])
    shown = np.where(np.isfinite(frame.image), frame.image, np.nanmedian(frame.image))
    return np.asarray(cv2.cvtColor(to_grey(shown.astype(frame.image.dtype)), cv2.COLOR_GRAY2BGR), np.uint8)


def _jpeg(picture: Picture) -> bytes:
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes())
