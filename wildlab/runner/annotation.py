"""Points marked in images on a page of this machine, kept in a table that is written at every click; they
become detections of a flight.

The server listens on 127.0.0.1 and answers only where the address holds the random token and the browser
means this server by its Host; so neither another machine nor another page in the same browser gets anything.
Images are asked for by number, never by name.
"""

from __future__ import annotations

import hmac
import json
import math
import re
import secrets
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path, PurePosixPath
from threading import Lock
from typing import Any, NamedTuple

import cv2
import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.files import csv_text, write_atomic
from wildlab.flight.files import printable, read_regular, unreadable
from wildlab.flight.manifest import FILE_NAME
from wildlab.flight.readers import read_log
from wildlab.flight.readers.frames.image import MOST_BYTES, SUFFIXES, decode, file_name, images_below
from wildlab.flight.readers.photos import is_photos, natural_key
from wildlab.flight.schema import TABLES, conform
from wildlab.flight.store import accept_changes, load_flight, write_table
from wildlab.paths import DATA
from wildlab.replay.images import stretch_contrast

#: Images of a folder, points in one image, letters of a name, and bytes of a table, at most.
MOST_IMAGES, MOST_POINTS, MOST_LETTERS, MOST_TABLE = 200_000, 2000, 60, 50_000_000
#: No image is wider, px.
WIDEST = 1e6
COLUMNS = ("image", "name", "u_px", "v_px")

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
        """What the image of a number is called in the table: the name of its file, on one line."""
        return printable(file_name(self.images[number])).strip()

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
        data = read_regular(table, MOST_TABLE)
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
    # Everything else in the folder stays, images too.
    part = folder / ".detections.part"
    write_table(conform(TABLES["detections"], joined, "detections"), part)
    part.replace(folder / "detections.parquet")
    accept_changes(folder)
    return Taken(len(own), own["frame_id"].nunique(), left, replaced)


def _joined(before: pd.DataFrame, own: pd.DataFrame) -> pd.DataFrame:
    """Both tables: what a detection does not have is NaN, or empty text."""
    joined = pd.concat([before, own], ignore_index=True) if len(before) else own
    texts = {column.name for column in TABLES["detections"].columns if column.dtype == "text"}
    empty = {name: "" for name in joined if name in texts or joined[name].dtype == object}
    return joined.fillna(empty)


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


#: Bytes that a page may send at once, and how long it may take for it, s.
MOST_SENT, PATIENCE_S = 1_000_000, 60
#: Pictures that are decoded at once: each may be large.
AT_ONCE = 2
#: Colour images with more pixels are sent as JPEG, which takes a twentieth of the time.
MOST_EXACT = 4_000_000
QUALITY = 95
_HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "X-Frame-Options": "DENY",
}


class ClickServer(ThreadingHTTPServer):
    """Serves one session, on any free port of 127.0.0.1."""

    daemon_threads = True

    def __init__(self, session: Session) -> None:
        self.session = session
        self.token = secrets.token_urlsafe(24)
        self.decoding = threading.BoundedSemaphore(AT_ONCE)
        super().__init__(("127.0.0.1", 0), _Handler)
        self.hosts = frozenset(f"{name}:{self.server_port}" for name in ("127.0.0.1", "localhost"))

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://127.0.0.1:{self.server_port}/{self.token}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Browsers break off as they like; whatever else happens is the terminal's."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: ClickServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "wildlab", ""
    timeout = PATIENCE_S

    def do_GET(self) -> None:
        place = self._place()
        if place is None:
            return
        number = re.fullmatch(r"image/(\d{1,9})", place)
        if place == "":
            nonce = secrets.token_urlsafe(18)
            self._answer(200, "text/html; charset=utf-8", make_page(nonce).encode(), _policy(nonce))
        elif place == "state":
            self._json(200, self.server.session.state())
        elif number and int(number[1]) < len(self.server.session.images):
            with self.server.decoding:
                found = picture_of(self.server.session.images[int(number[1])])
            if isinstance(found, str):
                self._text(422, found)
            else:
                self._answer(200, found.kind, found.data)
        else:
            self._text(404, "there is nothing here")

    def do_POST(self) -> None:
        place = self._place()
        if place is None:
            return
        origin = self.headers.get("Origin")
        if origin is not None and origin.removeprefix("http://") not in self.server.hosts:
            self._text(403, "this page is not of this server")
        elif self.headers.get_content_type() != "application/json":
            self._text(415, "JSON is wanted")
        elif place == "clicks":
            self._mark(self._sent())
        elif place == "finish":
            self._json(200, {})
            threading.Thread(target=self.server.shutdown, daemon=True).start()
        else:
            self._text(404, "there is nothing here")

    def _mark(self, sent: Any) -> None:
        if not isinstance(sent, dict):
            self._text(400, "no object of JSON, or too much of it")
            return
        session = self.server.session
        image, revision = sent.get("image"), sent.get("revision")
        if type(image) is not int or type(revision) is not int or not 0 <= image < len(session.images):
            self._text(400, "there is no such image")
            return
        points = check_points(sent.get("points"))
        if isinstance(points, str):
            self._text(400, points)
            return
        try:
            now = session.mark(image, points, revision)
        except WildlabError as error:
            self._text(500, error.problem)
            return
        if now is None:
            self._text(409, "another window marked this image meanwhile: load the page again")
        else:
            self._json(200, {"revision": now})

    def _place(self) -> str | None:
        """What is asked for below the token; None where it is refused, and that was said."""
        host = self.headers.get("Host", "")
        _, token, place = [*self.path.split("?", 1)[0].split("/", 2), "", ""][:3]
        known = hmac.compare_digest(token.encode("utf-8", "replace"), self.server.token.encode())
        if host not in self.server.hosts or not known:
            self._text(403, "refused: open the address that the terminal shows")
            return None
        return place

    def _sent(self) -> Any:
        length = self.headers.get("Content-Length", "")
        if not length.isascii() or not length.isdecimal() or int(length) > MOST_SENT:
            self.close_connection = True
            return None
        try:
            return json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            return None

    def _json(self, status: int, content: Any) -> None:
        self._answer(status, "application/json", json.dumps(content).encode())

    def _text(self, status: int, said: str) -> None:
        # Whatever was sent and not read would be taken for the next request.
        self.close_connection = True
        self._answer(status, "text/plain; charset=utf-8", said.encode("utf-8", "replace"))

    def _answer(self, status: int, kind: str, body: bytes, policy: str = "default-src 'none'") -> None:
        self.send_response(status)
        headers = {"Content-Type": kind, "Content-Length": str(len(body)), "Content-Security-Policy": policy}
        for name, value in {**headers, **_HEADERS}.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the terminal shows the address and the next command."""


def make_page(nonce: str) -> str:
    """The page, whose own script and style alone may run.

    Parameters
    ----------
    nonce
        A number used once, of letters that stand in an attribute.

    Returns
    -------
    str
        HTML; names of images and points come to it as data, and are shown as text.
    """
    page, style, script = (
        (DATA / "pages" / f"click.{kind}").read_text(encoding="utf-8") for kind in ("html", "css", "js")
    )
    parts = {"{nonce}": nonce, "{style}": style, "{script}": script}
    return re.sub(r"\{(nonce|style|script)\}", lambda match: parts[match[0]], page)


def _policy(nonce: str) -> str:
    return (
        f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


class Picture(NamedTuple):
    """Bytes of a picture and their kind, as browsers call it."""

    data: bytes
    kind: str


def picture_of(path: Path) -> Picture | str:
    """An image file as a picture with the pixels that it has, or a sentence that says why not.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    Picture or str
        Pixels stand as they are stored: what a file says of turning it is not obeyed.
    """
    try:
        found = decode(read_regular(path, MOST_BYTES))
    except FileNotFoundError:
        found = "there is no such file any more"
    except WildlabError as error:
        found = f"it {error.problem}"
    if isinstance(found, str):
        return f"This image cannot be shown: {found}."
    image, unit, _ = found
    if unit not in ("grey", "colour"):
        image = stretch_contrast(image)
    if image.ndim == 3:
        image = np.ascontiguousarray(image[..., ::-1])
    if image.ndim == 3 and image.shape[0] * image.shape[1] > MOST_EXACT:
        done, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        kind = "image/jpeg"
    else:
        done, packed = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        kind = "image/png"
    return Picture(packed.tobytes(), kind) if done else "This image cannot be shown."
