"""What a file is, by its first bytes, and everything that is inside of it."""

from __future__ import annotations

import re
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from lzma import LZMAError

import numpy as np

from wildlab.sharing.scan.inside import archives, coded, exif, pdf, pictures, streams, tables
from wildlab.sharing.scan.parts import Budget, Part, TooMuch
from wildlab.sharing.scan.texts import is_text

Reader = Callable[[bytes, Budget], Iterator[Part]]

#: What files begin with, what they are called, and who reads them.
KINDS: tuple[tuple[bytes, str, Reader], ...] = (
    (pictures.PNG, "PNG", pictures.png),
    (b"\xff\xd8\xff", "JPEG", pictures.jpeg),
    (b"GIF8", "GIF", pictures.gif),
    (b"II*\x00", "TIFF", exif.tiff),
    (b"MM\x00*", "TIFF", exif.tiff),
    (b"II+\x00", "TIFF", exif.tiff),
    (b"MM\x00+", "TIFF", exif.tiff),
    (b"%PDF", "PDF", pdf.pdf),
    (b"PK\x03\x04", "zip", archives.zipped),
    (b"PK\x05\x06", "zip", archives.zipped),
    (b"\x1f\x8b\x08", "gzip", streams.gzipped),
    (b"BZh", "bzip2", streams.bzipped),
    (b"\xfd7zXZ\x00", "xz", streams.xzipped),
    (b"\x28\xb5\x2f\xfd", "Zstandard", streams.zstandard),
    (b"\x04\x22\x4d\x18", "LZ4", streams.lz4),
    (b"PAR1", "Parquet", tables.parquet),
    (b"ARROW1", "Arrow", tables.arrow_file),
    (b"\xff\xff\xff\xff", "Arrow", tables.arrow_file),
    (b"SQLite format 3\x00", "SQLite", tables.sqlite),
    (b"RRF", "rerun recording", tables.recording),
)
#: What is known and cannot be looked into here.
CLOSED = (
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"Rar!\x1a\x07", "a RAR archive"),
    (b"age-encryption.org", "a file encrypted with age"),
    (b"-----BEGIN AGE", "a file encrypted with age"),
    (b"-----BEGIN PGP MESSAGE", "an encrypted message"),
    (b"Salted__", "a file encrypted with OpenSSL"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
    (b"wOF2", "a compressed font"),
    (b"LZIP", "an lzip archive"),
    (b"MSCF", "a cabinet archive"),
    (b"\x00\x00\x00\x0cJXL ", "a JPEG XL picture"),
    (b"\x00\x00\x00\x0cjP  ", "a JPEG 2000 picture"),
)
#: What a damaged file of the kinds above makes its reader say.
DAMAGED = (
    *pictures.DAMAGED, *tables.DAMAGED,
    zipfile.BadZipFile, tarfile.TarError, zlib.error, LZMAError, struct.error, EOFError, KeyError, IndexError,
    UnicodeError, OverflowError, NotImplementedError, RuntimeError,
)  # fmt: skip
#: Files inside of files of an unknown kind: signs that hardly come by chance.
_INSIDE = re.compile(
    rb"\x89PNG\r\n\x1a\n|\xff\xd8\xff[\xdb\xe0\xe1\xee]|PK\x03\x04|\x1f\x8b\x08|%PDF-|SQLite format 3\x00"
    rb"|Exif\x00\x00(?:II\*\x00|MM\x00\*)|\x78[\x01\x5e\x9c\xda]"
)
#: More chance than this in its bytes (bits of 8) and it is packed or encrypted, we do not know how.
CHANCE_BITS, CHANCE_FROM = 7.95, 4096


def unpacked(data: bytes, budget: Budget, where: str = "", depth: int = 0) -> Iterator[Part]:
    """Everything in a file, in the end as bytes that nothing more can be unpacked from.

    Parameters
    ----------
    data
        The file.
    budget
        How much may be unpacked.
    where, depth
        What it is inside of itself.

    Returns
    -------
    Iterator
        Parts; those with trouble say what could not be looked into, and come with the bytes as they are.
    """
    name, reader = kind_of(data)
    if reader is None:
        yield Part(where, data, whole=True, trouble=f"it is {name}, which cannot be looked into")
        return
    if depth > budget.deepest:
        yield Part(where, data, whole=True, trouble="it is packed into itself too many times")
        return
    here = " > ".join(filter(None, (where, name)))
    try:
        for part in reader(data, budget):
            there = " > ".join(filter(None, (here, part.where)))
            if part.whole or not part.data:
                yield replace(part, where=there)
                continue
            if part.columns or part.moments or part.boxes or part.trouble:
                yield replace(part, where=there, data=b"", whole=True)
            yield from unpacked(part.data, budget, there, depth + 1)
    except TooMuch:
        yield Part(here, data[:1_000_000], whole=True, trouble="it unpacks to more than can be looked into")
    except DAMAGED as error:
        said = f"{type(error).__name__}: {error}"[:120]
        yield Part(here, data, whole=True, trouble=f"it is damaged or of an unknown make ({said})")


def kind_of(data: bytes) -> tuple[str, Reader | None]:
    """What a file is called (nothing for text), and who reads it; nobody where it cannot be read."""
    for magic, name, reader in KINDS:
        if data.startswith(magic) and len(data) > len(magic) + 3:
            return name, reader
    if data[:4] == b"RIFF" and len(data) > 16:
        return "WebP", pictures.riff
    if data[257:262] == b"ustar":
        return "tar", archives.tarred
    if len(data) > 8 and data[0] == 0x78 and data[1] in (0x01, 0x5E, 0x9C, 0xDA):
        return "zlib", streams.zlibbed
    for magic, name in CLOSED:
        if data.startswith(magic):
            return name, None
    if is_text(data):
        return "", coded.without_coded
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\x00" in data[:64]:
        return "", _binary
    return "", _binary


def _binary(data: bytes, budget: Budget) -> Iterator[Part]:
    """Bytes of an unknown kind: as they are, and every file that can be told to begin in them."""
    if len(data) >= CHANCE_FROM and chance_bits(data) > CHANCE_BITS:
        yield Part("", trouble="its bytes look like chance: packed or encrypted, it is not known how")
    yield Part("", data, whole=True)
    for match in _INSIDE.finditer(data):
        at = match.start()
        if not at and not match[0].startswith(b"Exif"):
            continue  # it is that file, and was not read as one
        inner = data[at + 6 :] if match[0].startswith(b"Exif") else data[at:]
        name, reader = kind_of(inner[:4096])
        if reader is None or not name:
            continue
        try:
            found = list(reader(inner, Budget(budget.most, budget.at_once)))
        except (TooMuch, *DAMAGED):
            continue  # it only looked like one; the bytes themselves are looked at in any case
        for part in found:
            budget.spend(part.data)
            yield replace(part, where=f"{name} at byte {at}" + (f" > {part.where}" if part.where else ""))


def chance_bits(data: bytes) -> float:
    """How much chance is in bytes, in bits per byte: 8 where all are equally likely."""
    counts = np.bincount(np.frombuffer(data, np.uint8), minlength=256)
    shares = counts[counts > 0] / len(data)
    return float(-(shares * np.log2(shares)).sum())
