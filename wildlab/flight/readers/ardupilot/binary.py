"""ArduPilot DataFlash logs (``.bin``), of all three generations of field names."""

from __future__ import annotations

from pathlib import Path

from wildlab.errors import WildlabError
from wildlab.flight.readers.ardupilot import records as dataflash_records
from wildlab.flight.readers.ardupilot import streams as ardupilot
from wildlab.flight.readers.ardupilot.messages import percent
from wildlab.flight.readers.logs.log import RawLog


def recognise(head: bytes, name: str) -> bool:
    """Whether a file is one: it has a message among its first bytes that defines another.

    Parameters
    ----------
    head
        The first bytes of the file.
    name
        Not looked at.
    """
    mark = dataflash_records.HEAD + bytes([dataflash_records.FMT_KIND])
    at = head.find(mark)
    while at >= 0:
        body = head[at + 3 : at + dataflash_records.FMT_BYTES]
        if len(body) == dataflash_records.FMT_BYTES - 3 and dataflash_records.definition(body) is not None:
            return True
        at = head.find(mark, at + 1)
    return False


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """A DataFlash log.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: its clock is that of the satellites.

    Returns
    -------
    RawLog
        Rows are counted in messages.

    Raises
    ------
    WildlabError
        Where no message of it can be read, or PX4 wrote it.
    """
    records = dataflash_records.read_records(data)
    if not set(records.tables) - {"FMT"}:
        problem = "holds no message of an ArduPilot log that can be read"
        raise WildlabError(problem, "copy it from the card again", file=path)
    lost: tuple[str, ...] = ()
    if records.lost_bytes:
        where = "one place" if records.places == 1 else f"{records.places} places"
        share = percent(records.lost_bytes, len(data))
        what = f"{records.lost_bytes} of {len(data)} bytes ({share}) in {where}"
        lost = (f"{what} belong to no message",)
    return ardupilot.raw_log(path, "dataflash", records.tables, lost, "message")
