"""Images and the points marked in them, kept in a table that is written at every click."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import pandas as pd

from wildlab.errors import WildlabError
from wildlab.files import csv_text, write_atomic
from wildlab.flight.files import printable, read_regular, unreadable
from wildlab.flight.manifest import FILE_NAME
from wildlab.flight.readers.formats import read_log
from wildlab.flight.readers.frames.image import SUFFIXES, file_name, images_below
from wildlab.flight.readers.photos import is_photos, natural_key
from wildlab.flight.store import load_flight

#: Images of a folder, points in one image, letters of a name, and bytes of a table, at most.
MOST_IMAGES, MOST_POINTS, MOST_LETTERS, MOST_BYTES = 200_000, 2000, 60, 50_000_000
#: No image is wider, px.
WIDEST = 1e6
COLUMNS = ("image", "name", "u_px", "v_px")


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
