"""Which formats of raw logs there are, and which one a file is of, by its content.

A reader's module has two functions::

    def recognise(head: bytes, name: str) -> bool
    def read(path: Path, data: bytes, zone: str | None = None) -> RawLog

``head`` are the first `HEAD` bytes, and the name decides only where content is not enough; the path is
only for messages; ``zone`` is that of wall clocks without one. A module is imported when a file may be of
its format.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import RawLog

#: So many bytes are enough to tell a format.
HEAD = 8192

#: Name in recipes -> (module of the reader, what it is called in sentences). Asked in this order.
FORMATS: dict[str, tuple[str, str]] = {
    "dataflash": ("wildlab.flight.readers.ardupilot.binary", "ArduPilot DataFlash log"),
    "dataflash-text": ("wildlab.flight.readers.ardupilot.text", "ArduPilot DataFlash log as text"),
    "ulog": ("wildlab.flight.readers.px4.ulog", "PX4 ULog"),
    "tlog": ("wildlab.flight.readers.mavlink.telemetry", "MAVLink telemetry log"),
    "ubx": ("wildlab.flight.readers.tracks.ubx", "u-blox UBX"),
    "gpx": ("wildlab.flight.readers.tracks.gpx", "GPX track"),
    "dji-srt": ("wildlab.flight.readers.dji.srt", "DJI subtitles"),
    "dji-mrk": ("wildlab.flight.readers.dji.mrk", "DJI time stamps of images"),
    "airdata": ("wildlab.flight.readers.dji.airdata", "AirData table"),
    "rtklib-pos": ("wildlab.flight.readers.tracks.rtklib_pos", "RTKLIB positions"),
    "nmea": ("wildlab.flight.readers.tracks.nmea", "NMEA 0183"),
    "marks-kml": ("wildlab.flight.readers.marks.kml", "KML placemarks"),
    "marks-geojson": ("wildlab.flight.readers.marks.geojson", "GeoJSON points"),
    "marks-csv": ("wildlab.flight.readers.marks.table", "table of surveyed points"),
    "clicks": ("wildlab.flight.readers.clicks.clicks", "clicks or boxes in images"),
}


def _reader(name: str) -> Any:
    return import_module(FORMATS[name][0])


def recognise(head: bytes, name: str) -> str | None:
    """The format of a file by its first `HEAD` bytes, None where none is known; `name` is the file's."""
    for found in FORMATS:
        if _reader(found).recognise(head, name):
            return found
    return None


def read_log(path: Path, data: bytes, format_: str, zone: str | None = None) -> RawLog:
    """A log of a known format.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    format_
        One of `FORMATS`.
    zone
        Of wall clocks that carry none, as ``"Europe/Oslo"`` or ``"+02:00"``.

    Returns
    -------
    RawLog

    Raises
    ------
    WildlabError
        Where nothing of it can be read.
    """
    read: Callable[[Path, bytes, str | None], RawLog] = _reader(format_).read
    try:
        return read(path, data, zone)
    except RecursionError:
        raise WildlabError("is nested too deeply to be read", "copy the file again", file=path) from None


#: Formats of whole folders: name in recipes -> (module, its reader, what it is called in sentences).
FOLDERS: dict[str, tuple[str, str, str]] = {
    "photos": ("wildlab.flight.readers.photos.folder", "read_tree", "folder of images"),
    "clicks-yolo": ("wildlab.flight.readers.clicks.clicks", "read_clicks_folder", "folder of YOLO's labels"),
}
#: So much of the beginning of each file goes into a folder's checksum: images are large and many.
HASHED = 65536


def read_folder(folder: Path, format_: str, zone: str | None = None) -> tuple[RawLog, str]:
    """A folder as a log, and a SHA-256 of the names, sizes and beginnings of its files.

    Parameters
    ----------
    folder
        Only read.
    format_
        One of `FOLDERS`.
    zone
        Of wall clocks that carry none.

    Returns
    -------
    RawLog and hexadecimal digits

    Raises
    ------
    WildlabError
        Where there is no such folder, or nothing of it can be read.
    """
    if not folder.is_dir():
        raise WildlabError("there is no such folder", "check the name, and the source folder", file=folder)
    module, name, _ = FOLDERS[format_]
    log: RawLog = getattr(import_module(module), name)(folder, zone)
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            with path.open("rb") as stored:
                head = stored.read(HASHED)
            named = f"{path.relative_to(folder).as_posix()}\0{path.stat().st_size}\0"
            digest.update(named.encode("utf-8", errors="surrogateescape") + hashlib.sha256(head).digest())
    return log, digest.hexdigest()
