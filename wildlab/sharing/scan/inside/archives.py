"""Zip and tar: what they hold, and what they say of it: names, comments, times, owners."""

from __future__ import annotations

import io
import re
import struct
import tarfile
import zipfile
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

from wildlab.sharing.scan.parts import Budget, Part, TooMuch

_LOCAL = re.compile(rb"PK\x03\x04", re.DOTALL)
#: When a zip without times says it was made.
NO_TIME = datetime(1980, 1, 1, tzinfo=UTC)
WINDOWS_EPOCH = datetime(1601, 1, 1, tzinfo=UTC)


def zipped(data: bytes, budget: Budget) -> Iterator[Part]:
    """A zip file: what stands around its entries, and every entry."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = archive.infolist()
        said = [archive.comment]
        around, end = [], 0
        for entry in sorted(entries, key=lambda one: one.header_offset):
            said += [entry.filename.encode("utf-8", "surrogateescape"), entry.comment, entry.extra]
            begin = _data_begins(data, entry.header_offset)
            around.append(data[end:begin])
            end = max(end, begin + entry.compress_size)
        around.append(data[end:])
        moments = [moment for entry in entries for moment in _times(entry)]
        moments += _local_times(b"".join(around))
        yield Part("names and comments", b"\n".join(said), whole=True, moments=tuple(dict.fromkeys(moments)))
        yield Part("around its entries", b"".join(around), whole=True)
        for entry in entries:
            yield _entry(archive, entry, budget)


def _entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, budget: Budget) -> Part:
    where = f"entry {archive.infolist().index(entry) + 1}"
    if entry.flag_bits & 1:
        return Part(where, trouble="it is encrypted: look through it before it is encrypted")
    if entry.file_size > budget.most:
        raise TooMuch
    try:
        with archive.open(entry) as file:
            inner = file.read(budget.most + 1)
    except (NotImplementedError, RuntimeError) as error:
        return Part(where, trouble=f"it cannot be unpacked ({error})")
    if len(inner) > budget.most:
        raise TooMuch
    return Part(where, budget.spend(inner))


def _data_begins(data: bytes, header: int) -> int:
    """Behind the local header of an entry, its name and its extra fields."""
    if len(data) < header + 30:
        return header
    name, extra = struct.unpack_from("<HH", data, header + 26)
    return int(header + 30 + name + extra)


def _dos(date: int, time: int) -> datetime | None:
    try:
        return datetime(
            (date >> 9) + 1980,
            date >> 5 & 15,
            date & 31,
            time >> 11,
            time >> 5 & 63,
            (time & 31) * 2,
            tzinfo=UTC,
        )
    except ValueError:
        return None


def _local_times(around: bytes) -> Iterator[tuple[datetime, str]]:
    """Those in the headers before the entries, which need not be those of the list at the end."""
    for match in _LOCAL.finditer(around):
        if len(around) >= match.start() + 14:
            time, date = struct.unpack_from("<HH", around, match.start() + 10)
            moment = _dos(date, time)
            if moment is not None and moment != NO_TIME:
                yield moment, "the time of an entry of a zip file"


def _times(entry: zipfile.ZipInfo) -> Iterator[tuple[datetime, str]]:
    year, month, day, hour, minute, second = entry.date_time
    try:
        moment = datetime(year, month, day, hour, minute, min(second, 59), tzinfo=UTC)
    except ValueError:
        moment = NO_TIME
    if moment != NO_TIME:
        yield moment, "the time of an entry of a zip file"
    at, extra = 0, entry.extra
    while at + 4 <= len(extra):
        kind, size = struct.unpack_from("<HH", extra, at)
        body = extra[at + 4 : at + 4 + size]
        at += 4 + size
        if kind == 0x5455:  # seconds since 1970, one to three of them
            for (stamp,) in struct.iter_unpack("<I", body[1 : 1 + (len(body) - 1) // 4 * 4]):
                yield datetime.fromtimestamp(stamp, UTC), "the time of an entry of a zip file"
        if kind == 0x000A and len(body) >= 32:  # tenths of microseconds since 1601
            for stamp in struct.unpack_from("<3Q", body, 8):
                if stamp < 1 << 60:
                    yield (
                        WINDOWS_EPOCH + timedelta(microseconds=stamp // 10),
                        "the time of an entry of a zip file",
                    )


def tarred(data: bytes, budget: Budget) -> Iterator[Part]:
    """A tar file: every file in it, with names, owners and times."""
    with tarfile.open(fileobj=io.BytesIO(data), mode="r:") as archive:
        for number, member in enumerate(archive):
            said = [member.name, member.linkname, member.uname, member.gname, *member.pax_headers.values()]
            moment = datetime.fromtimestamp(max(float(member.mtime), 0.0), UTC)
            yield Part(
                f"entry {number + 1}",
                "\n".join(said).encode("utf-8", "surrogateescape"),
                whole=True,
                moments=((moment, "the time of an entry of a tar file"),),
            )
            file = archive.extractfile(member) if member.isfile() else None
            if file is None:
                continue
            if member.size > budget.most:
                raise TooMuch
            yield Part(f"entry {number + 1}", budget.spend(file.read(budget.most)))
    yield Part("", data, whole=True)
