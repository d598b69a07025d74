"""Whatever is neither a plain table nor MATLAB's: bytes in, columns out.

A reader of a raw log has two functions, ``sniff`` and ``decode``; `formats.FORMATS` knows them all. What is
decoded is judged in one place (`log`) and becomes a `log.RawLog`, whatever the format: named parts with
the same columns and units. A reader believes nothing that the log says of itself: what cannot be read is
left out and said in `RawLog.lost`, rows that cannot be true stay where they are and are marked (``use``,
``why``).

Areas, labels, frames, terrain and the Autoferry data have readers of their own. All raise
`wildlab.errors.WildlabError` with the place where a file is not what it should be.

A reader's module has two functions::

    def sniff(head: bytes) -> bool
    def decode(path: Path, data: bytes, zone: str | None) -> RawLog

``head`` are the first `HEAD` bytes; the path is only for messages; ``zone`` is that of wall clocks without
one. A module is imported when a file may be of its format.
"""

from __future__ import annotations

import hashlib
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from wildlab.errors import WildlabError
from wildlab.flight.readers.log import RawLog, judge_log

#: So many bytes are enough to tell a format.
HEAD = 8192


class Format(NamedTuple):
    """A format: where its functions are, and what it is called in sentences.

    `start`: what the names of its functions begin with, where a module has several formats.
    """

    module: str
    called: str
    start: str = ""

    def function(self, name: str) -> Any:
        """``sniff`` or ``decode`` of its module."""
        return getattr(import_module(f"wildlab.flight.readers.{self.module}"), self.start + name)


#: By their names in recipes, asked in this order.
FORMATS: dict[str, Format] = {
    "dataflash": Format("ardupilot", "ArduPilot DataFlash log"),
    "dataflash-text": Format("ardupilot", "ArduPilot DataFlash log as text", start="text_"),
    "ulog": Format("telemetry", "PX4 ULog", start="ulog_"),
    "tlog": Format("telemetry", "MAVLink telemetry log", start="tlog_"),
    "ubx": Format("tracks", "u-blox UBX", start="ubx_"),
    "gpx": Format("tracks", "GPX track", start="gpx_"),
    "dji-srt": Format("dji", "DJI subtitles", start="srt_"),
    "dji-mrk": Format("dji", "DJI time stamps of images", start="mrk_"),
    "airdata": Format("dji", "AirData table", start="airdata_"),
    "rtklib-pos": Format("tracks", "RTKLIB positions", start="pos_"),
    "nmea": Format("tracks", "NMEA 0183", start="nmea_"),
    "marks-kml": Format("vector", "KML placemarks", start="kml_"),
    "marks-geojson": Format("vector", "GeoJSON points", start="geojson_"),
    "marks-csv": Format("vector", "table of surveyed points", start="table_"),
    "clicks": Format("labels", "clicks or boxes in images", start="clicks_"),
}


def recognise(head: bytes) -> str | None:
    """The format of a file by its first `HEAD` bytes, None where none is known."""
    return next((found for found, one in FORMATS.items() if one.function("sniff")(head)), None)


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
    one = FORMATS[format_]
    try:
        return judge_log(one.function("decode")(path, data, zone))
    except RecursionError:
        raise WildlabError("is nested too deeply to be read", "copy the file again", file=path) from None


#: Formats of whole folders, by their names in recipes.
FOLDERS: dict[str, Format] = {
    "photos": Format("photos", "folder of images", start="folder_"),
    "clicks-yolo": Format("labels", "folder of YOLO's labels", start="folder_"),
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
    log = judge_log(FOLDERS[format_].function("decode")(folder, zone))
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            with path.open("rb") as stored:
                head = stored.read(HASHED)
            named = f"{path.relative_to(folder).as_posix()}\0{path.stat().st_size}\0"
            digest.update(named.encode("utf-8", errors="surrogateescape") + hashlib.sha256(head).digest())
    return log, digest.hexdigest()
