"""Which formats of raw logs there are, and which one a file is of, by its content.

A reader's module has two functions::

    def recognise(head: bytes, name: str) -> bool
    def read(path: Path, data: bytes, zone: str | None = None) -> RawLog

``head`` are the first `HEAD` bytes, and the name decides only where content is not enough; the path is
only for messages; ``zone`` is that of wall clocks without one. A module is imported when a file may be of
its format.
"""

from __future__ import annotations

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
    "dataflash": ("wildlab.flight.readers.logs.dataflash", "ArduPilot DataFlash log"),
    "dataflash-text": ("wildlab.flight.readers.logs.dataflash_text", "ArduPilot DataFlash log as text"),
    "ulog": ("wildlab.flight.readers.logs.ulog", "PX4 ULog"),
    "tlog": ("wildlab.flight.readers.logs.tlog", "MAVLink telemetry log"),
    "ubx": ("wildlab.flight.readers.logs.ubx", "u-blox UBX"),
    "gpx": ("wildlab.flight.readers.logs.gpx", "GPX track"),
    "dji-srt": ("wildlab.flight.readers.logs.dji_srt", "DJI subtitles"),
    "dji-mrk": ("wildlab.flight.readers.logs.dji_mrk", "DJI time stamps of images"),
    "airdata": ("wildlab.flight.readers.logs.airdata", "AirData table"),
    "rtklib-pos": ("wildlab.flight.readers.logs.rtklib_pos", "RTKLIB positions"),
    "nmea": ("wildlab.flight.readers.logs.nmea", "NMEA 0183"),
    "marks-kml": ("wildlab.flight.readers.logs.marks_kml", "KML placemarks"),
    "marks-geojson": ("wildlab.flight.readers.logs.marks_geojson", "GeoJSON points"),
    "marks-csv": ("wildlab.flight.readers.logs.marks_csv", "table of surveyed points"),
    "clicks": ("wildlab.flight.readers.logs.clicks", "clicks or boxes in images"),
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
