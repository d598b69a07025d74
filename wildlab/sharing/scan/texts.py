"""Bytes as text, in every reading that may be meant: encodings, escapes, tags taken away."""

from __future__ import annotations

import html
import re
from urllib.parse import unquote

import numpy as np

from wildlab.sharing.scan.numbers import Bytes

#: Signs that stand for others in numbers: minus, primes, thin blanks, ordinals for degrees.
_ALIKE = {
    **dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d", "-"),
    **dict.fromkeys("\u2032\u2018\u2019\u02b9\u00b4", "'"),
    **dict.fromkeys("\u2033\u201c\u201d\u02ba", '"'),
    **dict.fromkeys("\u00a0\u2007\u2008\u2009\u200a\u202f\u2060", " "),
    **dict.fromkeys("\u00ba\u02da\u2070", "\u00b0"),
    **dict.fromkeys("\u200b\u200c\u200d\ufeff\u00ad", ""),
    "\u066b": ".", "\u066c": ",", "\uff0e": ".",
}  # fmt: skip
_OTHER_DIGIT = re.compile(r"(?![0-9])\d")
_JSON_ESCAPE = re.compile(r"\\(?:u([0-9a-fA-F]{4})|x([0-9a-fA-F]{2})|([0-7]{3})|([nrtbf/\"'\\()]))")
_PLAIN_ESCAPES = {"n": "\n", "r": "\r", "t": "\t", "b": "\b", "f": "\f"}
_TAG = re.compile(r"<(?:!--|-->|/?[A-Za-z][^<>]{0,2000}>)")
#: What can be read among bytes that are no text; the same with zeros between the letters.
_PRINTED = re.compile(rb"[\t\n\r\x20-\x7e]{5,}")
_WIDE = re.compile(rb"(?:[\x20-\x7e]\x00{1,3}){4,}[\x20-\x7e]?")
_CONTROL = np.zeros(256, bool)
_CONTROL[[code for code in range(32) if code not in b"\t\n\r\f\x1b"]] = True
#: Escapes may stand inside of escapes: a page in a notebook.
DEEPEST = 3
#: Lines of an inline SVG, and when they move, from 0 to 1; wider than `PAPER`, px, no drawing is.
_DRAWN = re.compile(r"""(\s(?:d|points|values)=")([MmLlHhVvZzCcSsQqTtAa0-9.,;\s+-]*)(?=")""")
_TIMED = re.compile(r"""(\s(?:keyTimes|keySplines)=")([01.][0-9.;\s]*)(?=")""")
_DRAWN_NUMBER = re.compile(r"\d+\.?\d*|\.\d+")
PAPER = 2000


def is_text(data: bytes) -> bool:
    """Whether bytes are text: nothing below a blank but line ends and tabs, and UTF-8 or mostly ASCII.

    Parameters
    ----------
    data
        Any.
    """
    head = data[:65_536]
    some = np.frombuffer(head + data[-4096:], np.uint8)
    if not len(some):
        return True
    if float((_CONTROL[some]).mean()) >= 0.002:
        return False
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        # A letter may be cut in two at the end of the piece.
        return error.start >= 65_530 or float((some > 127).mean()) < 0.3
    return True


def texts_of(data: bytes) -> list[str]:
    """The readings of bytes as text.

    Parameters
    ----------
    data
        Any bytes; of what is no text, what can be read in it.

    Returns
    -------
    list
        The first has a character for each byte where the bytes are Latin-1 or ASCII.
    """
    base: list[str] = []
    wide = _wide(data)
    if wide is not None:
        base.append(wide)
    if is_text(data):
        try:
            base.append(data.decode("utf-8-sig"))
        except UnicodeDecodeError:
            base.append(data.decode("latin-1"))
    else:
        base.append("\n".join(run.decode("ascii") for run in _PRINTED.findall(data)))
        if b"\x00" in data:
            base.append("\n".join(run.replace(b"\x00", b"").decode("ascii") for run in _WIDE.findall(data)))
    found: list[str] = []
    for text in base:
        found += _readings(_undrawn(text))
    return list(dict.fromkeys(found))


def _undrawn(text: str) -> str:
    """A text with blanks for the lines of its drawings, each as long as it was.

    Lines of an inline SVG are thousands of numbers in pixels, a tenth of one at the finest, and among so many
    some pair always is somebody's latitude and longitude. No place hides in them: below `PAPER` and with one
    decimal, degrees are known to 10 km. What is finer, or larger, is looked at.
    """

    def blank(match: re.Match[str]) -> str:
        numbers = [number.partition(".") for number in _DRAWN_NUMBER.findall(match[2])]
        paper = all(len(part) <= 1 and int(whole or 0) < PAPER for whole, _, part in numbers)
        return match[1] + " " * len(match[2]) if paper else match[0]

    def untimed(match: re.Match[str]) -> str:
        return match[1] + " " * len(match[2])

    return _TIMED.sub(untimed, _DRAWN.sub(blank, text)) if "<svg" in text else text


def _wide(data: bytes) -> str | None:
    """As UTF-16 or UTF-32, where the zeros or a mark at the beginning say so."""
    for mark, name in (
        (b"\xff\xfe\x00\x00", "utf-32"), (b"\x00\x00\xfe\xff", "utf-32"),
        (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"),
    ):  # fmt: skip
        if data.startswith(mark):
            return data.decode(name, "replace")
    some = np.frombuffer(data[:4096], np.uint8)
    if len(some) < 8:
        return None
    odd, even = float((some[1::2] == 0).mean()), float((some[::2] == 0).mean())
    if max(odd, even) > 0.6 and min(odd, even) < 0.2:
        return data.decode("utf-16-le" if odd > even else "utf-16-be", "replace")
    return None


def _readings(text: str) -> list[str]:
    """A text, without its escapes, and without its tags."""
    found = [text]
    for _ in range(DEEPEST):
        plain = _unescaped(found[-1])
        if plain == found[-1]:
            break
        found.append(plain)
    last = found[-1]
    if "<" in last and _TAG.search(last):
        found += [_TAG.sub("", last), _TAG.sub(" ", last)]
    return found


def _unescaped(text: str) -> str:
    if "\\" in text:
        text = _JSON_ESCAPE.sub(_unescape_one, text)
    if "&" in text:
        text = html.unescape(text)
    if "%" in text and re.search(r"%[0-9a-fA-F]{2}", text):
        text = unquote(text, errors="replace")
    return text


def _unescape_one(match: re.Match[str]) -> str:
    code = match[1] or match[2]
    if code:
        return chr(int(code, 16))
    if match[3]:
        return chr(int(match[3], 8))
    return _PLAIN_ESCAPES.get(match[4], match[4])


def as_bytes(text: str) -> tuple[str, Bytes]:
    """A text with one sign for signs that look alike, and the same as one byte per character.

    Parameters
    ----------
    text
        Any; what is not Latin-1 becomes a question mark, digits of all scripts become ours.
    """
    if not text.isascii():
        for sign in set(text) & _ALIKE.keys():
            text = text.replace(sign, _ALIKE[sign])
        text = _OTHER_DIGIT.sub(lambda digit: str(int(digit[0])) if digit[0].isdecimal() else "?", text)
    return text, np.frombuffer(text.encode("latin-1", "replace"), np.uint8)
