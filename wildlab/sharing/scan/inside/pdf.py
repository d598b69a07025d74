"""PDF: every stream unpacked, letters put together again where they are written apart."""

from __future__ import annotations

import base64
import re
import zlib
from collections.abc import Iterator

from wildlab.sharing.scan.inside.streams import inflate
from wildlab.sharing.scan.parts import Budget, Part

_STREAM = re.compile(rb"(?<!end)stream\r?\n")
_LENGTH = re.compile(rb"/Length\s+(\d+)(?!\s+\d+\s+R)")
_FILTER = re.compile(rb"/Filter\s*(\[[^\]]*\]|/\w+)")
_TEXT_ARRAY = re.compile(rb"\[((?:[^\[\]()\\]|\\.|\((?:[^()\\]|\\.)*\))*)\]\s*TJ", re.DOTALL)
_STRING = re.compile(rb"\(((?:[^()\\]|\\.)*)\)|<([0-9A-Fa-f\s]*)>", re.DOTALL)
_MAP_RANGE = re.compile(rb"<([0-9A-Fa-f]+)>\s*<([0-9A-Fa-f]+)>\s*<([0-9A-Fa-f]+)>")
_MAP_BLOCK = re.compile(rb"begin(bfchar|bfrange)(.*?)end\1", re.DOTALL)
_MAP_ONE = re.compile(rb"<([0-9A-Fa-f]+)>\s*<([0-9A-Fa-f]+)>")
_HEX_TEXT = re.compile(rb"<([0-9A-Fa-f\s]{2,})>")
#: Pictures have readers of their own.
_PICTURES = {b"DCTDecode", b"DCT"}
_KNOWN = {b"FlateDecode", b"Fl", b"ASCII85Decode", b"A85", b"ASCIIHexDecode", b"AHx", *_PICTURES}


def pdf(data: bytes, budget: Budget) -> Iterator[Part]:
    """What stands between the streams, and every stream.

    Parameters
    ----------
    data
        The file.
    budget
        How much may be unpacked.
    """
    if re.search(rb"/Encrypt\s", data):
        yield Part("", trouble="the PDF is encrypted: look through it before it is encrypted")
    around, end, drawings, maps = [], 0, [], {}
    for number, (begin, stop, head) in enumerate(_streams(data)):
        around.append(data[end:begin])
        end = stop
        where = f"stream {number + 1}"
        body, wrong = _unpacked(data[begin:stop], head, budget)
        if wrong:
            yield Part(where, trouble=wrong)
        if b"beginbfchar" in body or b"beginbfrange" in body:
            maps.update(_letters(body))
        if b"/Subtype" in head and b"/Image" in head and b"DCT" not in head:
            continue  # pixels
        drawn = bool(re.search(rb"\s(?:l|c|re|Tj|TJ)\s", body[:200_000])) and b"<x:xmpmeta" not in body[:4000]
        if drawn:
            drawings.append(body)
        else:
            yield Part(where, body)
    around.append(data[end:])
    plain = b"".join(around)
    yield Part("", plain, whole=True)
    yield Part("text in strings", _strings(plain), whole=True)
    # A page has many small drawings, one per letter: all at once.
    yield Part("drawings", b"\n".join(drawings), whole=True, drawn=True)
    yield Part("text in drawings", b"\n".join(_written(body, maps) for body in drawings), whole=True)


def _streams(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Where each stream begins and ends, and the dictionary before it."""
    at = 0
    while match := _STREAM.search(data, at):
        begin = match.end()
        head = data[max(data.rfind(b"obj", 0, match.start()), match.start() - 4000, 0) : match.start()]
        length = _LENGTH.search(head)
        stop = begin + int(length[1]) if length else -1
        if stop < begin or not data[stop : stop + 20].lstrip().startswith(b"endstream"):
            stop = data.find(b"endstream", begin)
            stop = len(data) if stop < 0 else stop
        yield begin, stop, head
        at = stop


def _unpacked(body: bytes, head: bytes, budget: Budget) -> tuple[bytes, str]:
    """A stream without its filters, and why not where it cannot be unpacked."""
    found = _FILTER.search(head)
    for name in re.findall(rb"/(\w+)", found[1]) if found else ():
        if name not in _KNOWN:
            return body, f"a stream of a kind that is not read here ({name.decode('ascii', 'replace')[:40]})"
        try:
            if name in (b"FlateDecode", b"Fl"):
                body = inflate(body, budget)[0]
            elif name in (b"ASCII85Decode", b"A85"):
                body = base64.a85decode(body.strip().removesuffix(b"~>"))
            elif name in (b"ASCIIHexDecode", b"AHx"):
                body = bytes.fromhex(re.sub(rb"[\s>]", b"", body).decode("ascii", "replace"))
        except (zlib.error, ValueError) as error:
            return body, f"a stream that is damaged ({error})"
    return body, ""


def _letters(body: bytes) -> dict[int, str]:
    """Which letters the numbers of glyphs stand for, as a font says it."""
    letters: dict[int, str] = {}
    for kind, block in _MAP_BLOCK.findall(body):
        if kind == b"bfchar":
            for code, text in _MAP_ONE.findall(block):
                letters[int(code, 16)] = _utf16(text)
        else:
            for first, last, text in _MAP_RANGE.findall(block):
                start = _utf16(text)
                for step in range(min(int(last, 16) - int(first, 16) + 1, 65_536)):
                    if start:
                        letters[int(first, 16) + step] = start[:-1] + chr(
                            min(ord(start[-1]) + step, 0x10FFFF)
                        )
    return letters


def _utf16(digits: bytes) -> str:
    return bytes.fromhex(digits.decode("ascii").zfill(len(digits) + len(digits) % 2)).decode(
        "utf-16-be", "replace"
    )


def _written(body: bytes, letters: dict[int, str]) -> bytes:
    """The text of a page: pieces of one line together, glyphs by what they stand for."""
    lines = []
    for array in _TEXT_ARRAY.findall(body):
        lines.append("".join(_string(plain, digits, letters) for plain, digits in _STRING.findall(array)))
    shown = re.sub(_TEXT_ARRAY, b" ", body)
    for plain, digits in re.findall(rb"(?:\(((?:[^()\\]|\\.)*)\)|<([0-9A-Fa-f\s]*)>)\s*(?:Tj|'|\")", shown):
        lines.append(_string(plain, digits, letters))
    # Letters may be set one by one: all of them once more, without anything between.
    return ("\n".join(lines) + "\n\n" + "".join(lines)).encode("utf-8", "replace") if lines else b""


def _string(plain: bytes, digits: bytes, letters: dict[int, str]) -> str:
    if plain or not digits:
        return re.sub(rb"\\(.)", rb"\1", plain, flags=re.DOTALL).decode("latin-1")
    whole = re.sub(rb"\s", b"", digits)
    wide = [int(whole[i : i + 4], 16) for i in range(0, len(whole) - 3, 4)]
    if letters and all(code in letters for code in wide):
        return "".join(letters[code] for code in wide)
    return "".join(
        letters.get(int(whole[i : i + 2], 16), chr(int(whole[i : i + 2], 16)))
        for i in range(0, len(whole) - 1, 2)
    )


def _strings(plain: bytes) -> bytes:
    """Strings that are written in hexadecimal digits or in UTF-16, as text."""
    lines = []
    for digits in _HEX_TEXT.findall(plain):
        whole = re.sub(rb"\s", b"", digits)
        raw = bytes.fromhex((whole + b"0" * (len(whole) % 2)).decode("ascii"))
        lines.append(raw.decode("utf-16") if raw[:2] in (b"\xfe\xff", b"\xff\xfe") else raw.decode("latin-1"))
    for match in re.finditer(rb"\(\xfe\xff((?:[^()\\]|\\.)*)\)", plain, re.DOTALL):
        lines.append(re.sub(rb"\\(.)", rb"\1", match[1], flags=re.DOTALL).decode("utf-16-be", "replace"))
    return "\n".join(lines).encode("utf-8", "replace")
