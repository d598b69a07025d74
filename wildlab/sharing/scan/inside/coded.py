"""Bytes written as letters: base64 (data addresses, notebooks, letters), hexadecimal digits."""

from __future__ import annotations

import base64
import binascii
import re
from collections.abc import Iterator
from urllib.parse import unquote_to_bytes

from wildlab.sharing.scan.parts import Budget, Part, begins_packed
from wildlab.sharing.scan.texts import is_text

#: Lines of base64 as they are broken in letters, in JSON and in addresses.
_BREAK = rb"(?:\\n|\\r|%0[AaDd]|&#1[03];|[\r\n]{1,2}[ \t]{0,8})"
_BASE64 = re.compile(
    rb"(?:[A-Za-z0-9+/_-]|%2[BbFf])(?:[A-Za-z0-9+/_-]|%2[BbFf]){14,}(?:" + _BREAK + rb"[A-Za-z0-9+/_-]{4,})*"
    rb"(?:" + _BREAK + rb"[A-Za-z0-9+/_-]{1,3}(?=[=\"'\\]))?(?:=|%3[Dd]|\\u003[dD]){0,2}"
)
_HEX = re.compile(rb"(?<![0-9A-Za-z])(?:0[xX])?((?:[0-9a-fA-F]{2}[ :]?){8,})(?![0-9A-Za-z])")
_DATA = re.compile(rb"data:([a-zA-Z0-9.+/-]*)((?:;[^,;\"'\s]{0,80})*),([^\"'\s<>)]*)")
#: Of so many letters on, it is base64 and nothing else; shorter, a path or a word may look like it.
SURELY = 400
#: Longer ones are parts of their own.
LARGE = 256


def without_coded(data: bytes, budget: Budget) -> Iterator[Part]:
    """A text: everything in it that is written as letters, decoded; and the text without the long ones of it.

    Parameters
    ----------
    data
        A text, as bytes.
    budget
        How much may be unpacked.
    """
    kept, end, number = [], 0, 0
    small: list[bytes] = []
    for match in _BASE64.finditer(data):
        inner = _decoded(match[0])
        if inner is None:
            continue
        budget.spend(inner)
        if len(inner) >= LARGE or begins_packed(inner):
            number += 1
            yield Part(f"base64 {number}", inner)
        else:
            small.append(inner)
        if len(match[0]) >= SURELY:
            # The last line may be a word of the text that only looks like more of it.
            last = max(match[0].rfind(b"\n"), match[0].rfind(b"\\n"))
            kept += [data[end : match.start()], b" "]
            end = match.end() if last < 0 else match.start() + last
    kept.append(data[end:])
    text = b"".join(kept)
    for match in _HEX.finditer(text):
        inner = bytes.fromhex(re.sub(rb"[ :]", b"", match[1]).decode("ascii"))
        budget.spend(inner)
        if len(inner) >= LARGE or begins_packed(inner):
            number += 1
            yield Part(f"hexadecimal {number}", inner)
        else:
            small.append(inner)
    for match in _DATA.finditer(text):
        if b"base64" not in match[2] and len(match[3]) > 1:
            number += 1
            yield Part(f"data address {number}", budget.spend(unquote_to_bytes(match[3])))
    texts = [inner for inner in small if inner.isascii() and is_text(inner)]
    if texts:
        yield Part("short pieces of base64 or hexadecimal", b"\n".join(texts))
    if len(texts) < len(small):
        others = (inner for inner in small if not (inner.isascii() and is_text(inner)))
        yield Part("short pieces of base64 or hexadecimal", b"\n\n".join(others), whole=True)
    yield Part("", text, whole=True)


def _decoded(run: bytes) -> bytes | None:
    """What a run of letters is as base64; None where it is none."""
    if b"%" in run:
        run = unquote_to_bytes(run)
    run = re.sub(rb"\\u003[dD]", b"=", run)
    run = re.sub(rb"\\[nr]|&#1[03];|\s", b"", run).rstrip(b"=").translate(bytes.maketrans(b"-_", b"+/"))
    if len(run) % 4 == 1:
        run = run[:-1]
    try:
        return base64.b64decode(run + b"=" * (-len(run) % 4), validate=True)
    except binascii.Error:
        return None
