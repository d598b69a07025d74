"""NMEA 0183: sentences of receivers and plotters, joined into epochs by the time that they carry, as `gnss`.

Sentences are found wherever they stand in a line, so that stamps of a logger before them do no harm. Heights
are above sea level, with the undulation that the receiver knows. Days come from RMC and ZDA, and are carried
to the sentences that have none, over midnight too. Damaged fields are no numbers, where `pynmea2` raises; all
checksums are taken at once, which makes the whole hardly faster. Facts of the sentences: NMEA 0183, as
`pynmea2` has it.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import Array, Clock, RawLog, Stream, make_stream
from wildlab.flight.readers.tracks.judging import drop_rare_heights, gaps, judge, plural
from wildlab.flight.readers.tracks.nmea_epochs import POSITIONS, epochs

#: Talker, kind, fields, checksum.
_SENTENCE = re.compile(rb"\$([A-Z][A-Z0-9])([A-Z]{3})(,[^$!*\r\n]{0,400})(?:\*([0-9A-Fa-f]{2}))?")
#: What is made use of; the rest is counted.
_USED = frozenset({*POSITIONS, "VTG", "ZDA", "GST"})


class Sentences(NamedTuple):
    """Sentences of use whose checksum holds.

    Attributes
    ----------
    talker, kind, fields
        Of each; fields as the standard counts them, from 1.
    line
        (N,) counted from 1.
    bad
        How many others had a wrong checksum, or none.
    unread
        How many there are of the kinds that are of no use here.
    """

    talker: list[str]
    kind: list[str]
    fields: list[list[str]]
    line: NDArray[np.int64]
    bad: int
    unread: Counter[str]


def recognise(head: bytes, name: str) -> bool:
    """Whether a file begins with sentences."""
    found = sentences(head)
    return any(kind in _USED for kind in found.kind) or sum(found.unread.values()) >= 3


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """A log of sentences.

    Parameters
    ----------
    path
        Only for messages.
    data
        The whole file.
    zone
        Not needed: sentences have UTC.

    Returns
    -------
    RawLog
        ``gnss``; rows are lines of the file.

    Raises
    ------
    WildlabError
        Where no sentence has a position.
    """
    found = sentences(data)
    made = tracks(found)
    if made is None:
        seen = len(found.kind) + sum(found.unread.values())
        problem = f"{plural(seen, 'sentence')} of NMEA 0183, and none with a position"
        raise WildlabError(problem, "log RMC, GGA, GNS or GLL of the receiver", file=path)
    return made


def tracks(found: Sentences) -> RawLog | None:
    """The log that sentences make, None where none of them has a position."""
    columns, lines, unusable, notes = epochs(found.talker, found.kind, found.fields, found.line)
    if not len(lines):
        return None
    notes += drop_rare_heights(columns)
    stream: Stream = make_stream("gnss", columns, lines, "line", judge(columns, unusable))
    notes += gaps(columns["time_s"], stream.used)
    if found.unread:
        kinds = ", ".join(sorted(found.unread)[:12]) + (" and others" if len(found.unread) > 12 else "")
        notes.append(f"{plural(sum(found.unread.values()), 'sentence')} not needed for a track ({kinds})")
    time = columns["time_s"]
    timed = int(np.isfinite(time).sum())
    if not timed:
        notes.append("no sentence carries a date (RMC, ZDA): times are of a day that is not known")
    lost = (f"{plural(found.bad, 'sentence')} with a wrong or missing checksum",) if found.bad else ()
    clock = Clock("UTC of the log", pairs=timed) if timed else None
    return RawLog("nmea", {"gnss": stream}, clock=clock, lost=lost, notes=tuple(notes))


def sentences(data: bytes) -> Sentences:
    """Every sentence of a file whose checksum holds; all, where none of them has a checksum."""
    raw = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(raw == ord("\n"))
    matches = list(_SENTENCE.finditer(data))
    starts = np.array([match.start() + 1 for match in matches], np.int64)
    lines = np.searchsorted(ends, starts) + 1
    # What stands in a comment is none.
    begins = np.r_[0, ends + 1][lines - 1]
    said_so = raw[begins] != ord("#") if len(begins) else np.zeros(0, bool)
    matches = [match for match, kept in zip(matches, said_so.tolist(), strict=True) if kept]
    starts, lines = starts[said_so], lines[said_so]
    stops = np.array([match.end(3) for match in matches], np.int64)
    said = [match[4] for match in matches]
    checked = np.array([one is not None for one in said], bool)
    good = np.ones(len(matches), bool)
    if checked.any():
        sums = np.array([int(one, 16) if one else 0 for one in said], np.uint8)
        good = checked & (_xor(data, starts, stops) == sums)
    talker: list[str] = []
    kind: list[str] = []
    fields: list[list[str]] = []
    at: list[int] = []
    unread: Counter[str] = Counter()
    for i in np.flatnonzero(good).tolist():
        match = matches[i]
        name = match[2].decode()
        if name in _USED:
            talker.append(match[1].decode())
            kind.append(name)
            fields.append(match[3].decode("latin-1").split(","))
            at.append(i)
        else:
            unread[name] += 1
    line = lines[np.array(at, np.int64)] if at else np.empty(0, np.int64)
    return Sentences(talker, kind, fields, line, int((~good).sum()), unread)


def _xor(data: bytes, starts: NDArray[np.int64], stops: NDArray[np.int64]) -> NDArray[np.uint8]:
    """(N,) exclusive or of the bytes from each start to its stop."""
    if not len(starts):
        return np.empty(0, np.uint8)
    # One more byte, so that a stop at the end of the file is an index, too.
    raw = np.frombuffer(data + b"\x00", np.uint8)
    return np.bitwise_xor.reduceat(raw, np.column_stack([starts, stops]).ravel())[::2]


__all__ = ["Array", "Sentences", "read", "recognise", "sentences", "tracks"]
