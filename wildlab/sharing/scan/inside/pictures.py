"""Pictures: what stands around their pixels. The pixels themselves are not read."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime

from wildlab.sharing.scan.inside.streams import inflate
from wildlab.sharing.scan.parts import Budget, Part

PNG = b"\x89PNG\r\n\x1a\n"
_ENDS = {0xD8, 0xD9, 0x01, *range(0xD0, 0xD8)}


def png(data: bytes, budget: Budget) -> Iterator[Part]:
    """Every chunk but the pixels; text that is compressed is unpacked; what stands behind the end.

    Parameters
    ----------
    data
        The file.
    budget
        How much may be unpacked.

    Raises
    ------
    ValueError, zlib.error
        Where it is damaged.
    """
    at, ended = len(PNG), False
    while at + 8 <= len(data) and not ended:
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        if len(body) < length or at + 12 + length > len(data):
            raise ValueError("a chunk of the PNG is cut off")
        at += 12 + length
        ended = kind == b"IEND"
        name = kind.decode("latin-1")
        if kind in (b"IDAT", b"fdAT"):
            continue
        if kind in (b"zTXt", b"iCCP"):
            key, _, rest = body.partition(b"\x00")
            yield Part(name, key + b"\n" + inflate(rest[1:], budget)[0])
        elif kind == b"iTXt":
            key, _, rest = body.partition(b"\x00")
            packed, rest = rest[:1], rest[2:]
            language, _, rest = rest.partition(b"\x00")
            other, _, text = rest.partition(b"\x00")
            text = inflate(text, budget)[0] if packed == b"\x01" else text
            yield Part(name, b"\n".join((key, language, other, text)))
        elif kind == b"tIME" and length == 7:
            year, month, day, hour, minute, second = struct.unpack(">H5B", body)
            moment = datetime(year, month, day, hour, minute, min(second, 59), tzinfo=UTC)
            yield Part(name, moments=((moment, "when the picture was last changed"),))
        elif kind == b"tEXt":
            yield Part(name, body.replace(b"\x00", b"\n"))
        else:
            yield Part(name, body)
    if not ended:
        raise ValueError("the PNG is cut off")
    if at < len(data):
        yield Part("behind its end", data[at:])


def jpeg(data: bytes, budget: Budget) -> Iterator[Part]:
    """Every segment but the pixels, EXIF and XMP among them, and what stands behind the end.

    Parameters
    ----------
    data
        The file.
    budget
        Not spent here.

    Raises
    ------
    ValueError
        Where it is damaged.
    """
    at, extended = 2, []
    while True:
        marker = data.find(b"\xff", at)
        if marker < 0 or marker + 1 >= len(data):
            raise ValueError("the JPEG is cut off")
        kind, at = data[marker + 1], marker + 2
        if kind in (0x00, 0xFF) or kind in _ENDS - {0xD9}:
            at = marker + 1 if kind == 0xFF else at
            continue
        if kind == 0xD9:
            break
        length = int.from_bytes(data[at : at + 2], "big")
        body = data[at + 2 : at + length]
        if length < 2 or len(body) < length - 2:
            raise ValueError("a segment of the JPEG is cut off")
        at += length
        if body.startswith(b"http://ns.adobe.com/xmp/extension/\x00"):
            extended.append(body[75:])
        elif body.startswith((b"Exif\x00\x00", b"Exif\x00\xff")):
            yield Part("EXIF", body[6:])
        elif kind >= 0xE0:  # comments and what programs add
            rest = body.partition(b"\x00")[2]
            yield Part(f"segment {kind:#x}", body)
            if rest[:2] in (b"II", b"MM"):
                yield Part(f"segment {kind:#x}", rest)
    if extended:  # XMP too long for one segment
        yield Part("XMP", b"".join(extended))
    if at < len(data):
        yield Part("behind its end", data[at:])


def riff(data: bytes, budget: Budget) -> Iterator[Part]:
    """WebP and its like: every chunk but the pixels.

    Parameters
    ----------
    data
        The file.
    budget
        Not spent here.

    Raises
    ------
    ValueError
        Where it is damaged.
    """
    (size,) = struct.unpack_from("<I", data, 4)
    end, at = 8 + size, 12
    if end > len(data):
        raise ValueError("the WebP is cut off")
    while at + 8 <= end:
        kind, length = struct.unpack_from("<4sI", data, at)
        body = data[at + 8 : at + 8 + length]
        at += 8 + length + length % 2
        if kind in (b"VP8 ", b"VP8L", b"ALPH"):
            continue
        if kind == b"ANMF":  # a picture of several: a head of 16 bytes, then chunks
            continue_ = b"RIFF" + struct.pack("<I", len(body) - 12) + b"WEBP" + body[16:]
            yield from riff(continue_, budget)
            continue
        yield Part(kind.decode("latin-1").strip(), body.removeprefix(b"Exif\x00\x00"))
    if end < len(data):
        yield Part("behind its end", data[end:])


def gif(data: bytes, budget: Budget) -> Iterator[Part]:
    """Every block of a GIF but the pixels: comments, and what programs add.

    Parameters
    ----------
    data
        The file.
    budget
        Not spent here.

    Raises
    ------
    ValueError
        Where it is damaged.
    """
    try:
        at = 13 + (3 << (data[10] & 7) + 1 if data[10] & 128 else 0)
        while data[at] != 0x3B:
            if data[at] == 0x21:
                kind, (body, at) = data[at + 1], _gif_blocks(data, at + 2)
                yield Part(f"block {kind:#x}", body)
            elif data[at] == 0x2C:
                table = data[at + 9]
                at += 10 + (3 << (table & 7) + 1 if table & 128 else 0)
                _, at = _gif_blocks(data, at + 1)
            else:
                raise ValueError("the GIF is damaged")
    except IndexError as error:
        raise ValueError("the GIF is cut off") from error
    if at + 1 < len(data):
        yield Part("behind its end", data[at + 1 :])


def _gif_blocks(data: bytes, at: int) -> tuple[bytes, int]:
    body = []
    while data[at]:
        body.append(data[at + 1 : at + 1 + data[at]])
        at += 1 + data[at]
    return b"".join(body), at + 1


DAMAGED = (ValueError, zlib.error, struct.error)
