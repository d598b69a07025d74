"""Images and the points marked in them, kept in a table that is written at every click; they become
detections of a flight."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet

from wildlab.errors import WildlabError
from wildlab.files import csv_text, write_atomic
from wildlab.flight.files import printable, read_regular, unreadable
from wildlab.flight.manifest import FILE_NAME
from wildlab.flight.readers import read_log
from wildlab.flight.readers.frames.image import SUFFIXES, file_name, images_below
from wildlab.flight.readers.photos import is_photos, natural_key
from wildlab.flight.schema import TABLES, conform
from wildlab.flight.store import accept_changes, load_flight

#: Images of a folder, points in one image, letters of a name, and bytes of a table, at most.
MOST_IMAGES, MOST_POINTS, MOST_LETTERS, MOST_BYTES = 200_000, 2000, 60, 50_000_000
#: No image is wider, px.
WIDEST = 1e6
COLUMNS = ("image", "name", "u_px", "v_px")
# pyarrow carries no types.
arrow: Any = pyarrow
parquet: Any = pyarrow.parquet

#: Who says so, in the table of detections.
SOURCE = "clicks"


class Point(NamedTuple):
    """A point in an image: what it is of, and where; the middle of the first pixel is (0, 0)."""

    name: str
    u: float
    v: float


@dataclass
class Session:
    """What a page works on.

    Attributes
    ----------
    images
        Files, in the order in which people count.
    table
        The file that points are written to.
    points
        By the name of the image.
    names
        Names that are offered: targets of the flight, then what was used before.
    title
        What the page is of.
    """

    images: list[Path]
    table: Path
    points: dict[str, list[Point]] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    title: str = ""
    _revisions: dict[str, int] = field(default_factory=dict, repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)

    def name_of(self, number: int) -> str:
        """What the image of a number is called in the table."""
        return shown_name(self.images[number])

    def state(self) -> dict[str, Any]:
        """All that the page shows, but for the pictures, as JSON has it."""
        with self._lock:
            named = [self.name_of(number) for number in range(len(self.images))]
            return {
                "title": self.title,
                "images": named,
                "names": self.names,
                "points": [[list(one) for one in self.points.get(name, [])] for name in named],
                "revisions": [self._revisions.get(name, 0) for name in named],
            }

    def mark(self, number: int, points: Iterable[Point], revision: int) -> int | None:
        """Replace the points of an image and write the table.

        Parameters
        ----------
        number
            Of the image.
        points
            All of its points.
        revision
            How often they were replaced, as far as the page knows.

        Returns
        -------
        int or None
            How often now; None where another page replaced them meanwhile, and nothing was done.

        Raises
        ------
        WildlabError
            Where the table cannot be written; the points are then as before.
        """
        name = self.name_of(number)
        with self._lock:
            if revision != self._revisions.get(name, 0):
                return None
            before = self.points.get(name, [])
            self.points[name] = list(points)
            try:
                write_atomic(self.table, self._text())
            except OSError as error:
                self.points[name] = before
                raise unreadable(error, self.table) from None
            self._revisions[name] = revision + 1
            used = [one.name for one in self.points[name]]
            self.names += [one for one in dict.fromkeys(used) if one and one not in self.names]
            return revision + 1

    def _text(self) -> str:
        images = sorted(self.points, key=lambda one: (natural_key(one), one))
        rows = [(image, *one) for image in images for one in self.points[image]]
        return csv_text(pd.DataFrame(rows, columns=COLUMNS), "%.2f")


def open_session(folder: Path, images: Path | None = None) -> Session:
    """Images of a flight, or of a folder, with what was marked in them before.

    Parameters
    ----------
    folder
        Of the flight; or of images, where it holds no flight.
    images
        Folder of the images, or the one above those that a flight's are in; left out, ``images`` in the
        flight.

    Returns
    -------
    Session

    Raises
    ------
    WildlabError
        Where there is no image, or what was marked before cannot be read.
    """
    if not folder.is_dir():
        raise WildlabError("there is no such folder", "name a flight, or a folder of images", file=folder)
    is_flight = (folder / FILE_NAME).is_file()
    where = images or (folder / "images" if is_flight or (folder / "images").is_dir() else folder)
    flight = load_flight(folder) if is_flight else None
    below: list[Path] = []
    if flight is not None and flight.frames is not None and where.is_dir() and not is_photos(where):
        below = images_below(where, [str(one) for one in flight.frames["frame_id"]])
    if not below and not is_photos(where):
        ends = ", ".join(sorted(SUFFIXES))
        fix = f"name the folder of its images with --images; they end in {ends}"
        raise WildlabError("there are no images in this folder", fix, file=where)
    try:
        files = below or [one for one in where.iterdir() if one.suffix.lower() in SUFFIXES and one.is_file()]
    except OSError as error:
        raise unreadable(error, where) from None
    files = sorted(files, key=lambda one: (natural_key(one.name), one.name))[:MOST_IMAGES]
    names: list[str] = []
    if flight is not None:
        truth = flight.tables.get("truth")
        if truth is not None:
            names = [str(one)[:MOST_LETTERS] for one in dict.fromkeys(truth["target_id"]) if str(one)]
    table = table_of(folder)
    points = read_points(table)
    used = dict.fromkeys(one.name for several in points.values() for one in several if one.name)
    names += [one for one in used if one not in names]
    return Session(files, table, points, names, file_name(folder.resolve()))


def shown_name(path: Path) -> str:
    """What an image is called: the name of its file, on one line."""
    return printable(file_name(path)).strip()


def table_of(folder: Path) -> Path:
    """The table of the points of a flight: beside its folder, since a flight holds nothing but its own."""
    place = folder.resolve()
    return place.parent / f"{place.name}.clicks.csv"


def read_points(table: Path) -> dict[str, list[Point]]:
    """Points of a table, by the name of the image.

    Parameters
    ----------
    table
        As `Session` writes it.

    Returns
    -------
    dict
        Empty where there is no such file.

    Raises
    ------
    WildlabError
        Where a line of it cannot be read: it would be lost at the next click.
    """
    try:
        data = read_regular(table, MOST_BYTES)
    except FileNotFoundError:
        return {}
    if data.strip() == ",".join(COLUMNS).encode():
        return {}
    log = read_log(table, data, "clicks")
    part = log.parts["clicks"]
    if log.lost or not part.used.all():
        bad = [f"line {row}" for row in part.rows[~part.used][:1]] or list(log.lost[:1])
        raise WildlabError(
            f"{bad[0]} cannot be read, and would be lost", "mend it, or move the file elsewhere", file=table
        )
    found: dict[str, list[Point]] = {}
    for image, name, u, v in zip(*(part.columns[one] for one in COLUMNS), strict=True):
        found.setdefault(str(image), []).append(Point(str(name), float(u), float(v)))
    return found


def check_points(given: Any) -> list[Point] | str:
    """Points as a page sends them, or a sentence on what is wrong with them.

    Parameters
    ----------
    given
        JSON: a list of [name, u, v].

    Returns
    -------
    list of Point, or str
    """
    if not isinstance(given, list) or len(given) > MOST_POINTS:
        return f"at most {MOST_POINTS:,} points are kept for one image"
    found = []
    for one in given:
        if not isinstance(one, list) or len(one) != 3 or not isinstance(one[0], str):
            return "a point has a name and two numbers"
        name = one[0].strip()
        if len(name) > MOST_LETTERS or not name.isprintable():
            return f"a name has at most {MOST_LETTERS} letters, and no signs that cannot be printed"
        place = [float(part) for part in one[1:] if isinstance(part, int | float) and abs(part) < WIDEST]
        if len(place) != 2 or not all(map(math.isfinite, place)):
            return "a point has two numbers, in pixels"
        found.append(Point(name, round(place[0], 2), round(place[1], 2)))
    return found


class Taken(NamedTuple):
    """What became of the points.

    Attributes
    ----------
    points, frames
        How many were taken, and in how many frames.
    left
        Names of images that are no frames of the flight, with the number of their points.
    replaced
        Detections of an earlier time that these took the place of.
    """

    points: int
    frames: int
    left: dict[str, int]
    replaced: int


def take_clicks(folder: Path) -> Taken:
    """Write the points marked in a flight's images into its detections, in place of earlier ones.

    Parameters
    ----------
    folder
        Of the flight.

    Returns
    -------
    Taken

    Raises
    ------
    WildlabError
        Where nothing is marked, no image is a frame of the flight, or the flight cannot be read or written.
    """
    flight = load_flight(folder)
    table = table_of(folder)
    points = read_points(table)
    if not any(points.values()):
        fix = f'mark points first: wildlab click "{folder}"'
        raise WildlabError("no point is marked in this flight's images", fix, file=table)
    frames = flight.table("frames")["frame_id"].astype(str).tolist()
    find = _finder(frames)
    rows: list[tuple[str, str, float, float]] = []
    of_frame: dict[str, str] = {}
    left: dict[str, int] = {}
    for image, marked in points.items():
        frame = find(image)
        if frame is None:
            left[image] = len(marked)
            continue
        if marked and (other := of_frame.setdefault(frame, image)) != image:
            raise WildlabError(
                f"points are marked in two images of the frame {printable(frame)}: {printable(other)} and "
                f"{printable(image)}",
                "mark those of one camera, and take the lines of the other out",
                file=table,
                field="image",
            )
        rows += [(frame, one.name, one.u, one.v) for one in marked]
    if not rows:
        first = printable(next(iter(left)))
        raise WildlabError(
            f"none of {len(left)} images with points is a frame of this flight: {first}",
            f"frames are called as {printable(frames[0])!r}; name the folder of their images with --images"
            if frames
            else "import the flight with its images",
            file=table,
            field="image",
        )
    before = flight.tables.get("detections")
    replaced = 0 if before is None else int((before["source"] == SOURCE).sum())
    own = pd.DataFrame(rows, columns=["frame_id", "target_id", "u_px", "v_px"])
    own.insert(0, "detection_id", [f"click-{number:05d}" for number in range(1, len(own) + 1)])
    own["source"], own["kind"] = SOURCE, "pixel"
    joined = own if before is None else _joined(before[before["source"] != SOURCE], own)
    _write(folder, conform(TABLES["detections"], joined, "detections"))
    return Taken(len(own), own["frame_id"].nunique(), left, replaced)


def _joined(before: pd.DataFrame, own: pd.DataFrame) -> pd.DataFrame:
    """Both tables, each column in its type: what a detection does not have is NaN, or empty text."""
    columns = list(dict.fromkeys([*before.columns, *own.columns]))
    texts = {column.name for column in TABLES["detections"].columns if column.dtype == "text"}

    def filled(table: pd.DataFrame) -> pd.DataFrame:
        whole = {}
        for name in columns:
            other = before if name in before else own
            text = name in texts or other[name].dtype == object
            nothing = np.full(len(table), "", dtype=object) if text else np.full(len(table), np.nan)
            whole[name] = table[name].to_numpy() if name in table else nothing
        return pd.DataFrame(whole)

    return pd.concat([filled(before), filled(own)], ignore_index=True) if len(before) else filled(own)


def _finder(frames: list[str]) -> Callable[[str], str | None]:
    """Which frame an image is: by its name, else without its ending, if that is of one frame alone."""
    whole = set(frames)
    stems = Counter(PurePosixPath(one).stem for one in frames)
    by_stem = {PurePosixPath(one).stem: one for one in frames}

    def find(image: str) -> str | None:
        if image in whole:
            return image
        stem = PurePosixPath(image).stem
        if stem in whole:
            return stem
        return by_stem[stem] if stems[stem] == 1 else None

    return find


def _write(folder: Path, table: pd.DataFrame) -> None:
    """The table in its place, and its checksum: everything else in the folder stays, images too."""
    sink = arrow.BufferOutputStream()
    plain = arrow.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
    parquet.write_table(plain, sink)
    write_atomic(folder / "detections.parquet", sink.getvalue().to_pybytes())
    accept_changes(folder)
