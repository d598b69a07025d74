"""What a card shows of a report: its first sentence, and its first picture, small."""

from __future__ import annotations

import base64
import binascii
import html
import re
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Width of a small picture, pixels; how well it is kept, of 100; most pixels of one that is read.
WIDE, QUALITY, MOST_PIXELS = 440, 60, 40_000_000

_SUMMARY = re.compile(r'<section\b[^>]*\bclass="summary\b[^>]*>(.*?)</section>', re.S)
_BOLD = re.compile(r"<b>(.*?)</b>", re.S)
_PICTURE = re.compile(r'<img\b[^>]*\bsrc="data:image/png;base64,([A-Za-z0-9+/=\s]+)"[^>]*>')
_ALT = re.compile(r'\balt="([^"]*)"')
_HEADING = re.compile(r"<h1\b[^>]*>(.*?)</h1>", re.S)
_TAG = re.compile(r"<[^>]+>")


class Glimpse(NamedTuple):
    """Of a report, as plain text: heading, the summary's first sentence, its first picture as a ``data:``
    address and what that shows. What it does not have is ""."""

    title: str = ""
    sentence: str = ""
    picture: str = ""
    alt: str = ""


def read_glimpse(report: Path) -> Glimpse:
    """What a card shows of a report; of one that cannot be read, nothing.

    Parameters
    ----------
    report
        ``report.html``.

    Returns
    -------
    Glimpse
    """
    try:
        state = report.stat()
    except OSError:
        return Glimpse()
    return _read(report, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=512)
def _read(report: Path, changed: int, size: int) -> Glimpse:
    """Kept as long as the file is the same: the page is put together after each study of a run."""
    try:
        whole = report.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return Glimpse()
    heading, summary, picture = _HEADING.search(whole), _SUMMARY.search(whole), _PICTURE.search(whole)
    bold = _BOLD.search(summary[1]) if summary else None
    small = smaller(picture[1]) if picture else ""
    alt = _ALT.search(picture[0]) if picture and small else None
    return Glimpse(
        _plain(heading[1]) if heading else "",
        _plain(bold[1]) if bold else "",
        small,
        _plain(alt[1]) if alt else "",
    )


def _plain(text: str) -> str:
    return " ".join(html.unescape(_TAG.sub("", text)).split())


def smaller(png: str) -> str:
    """A PNG, as base64, made as wide as a card, as a ``data:`` address of a WebP; "" where it is none."""
    import cv2  # takes a while, and a page without pictures does not need it

    try:
        content = base64.b64decode(png)
    except (ValueError, binascii.Error):
        return ""
    # How large it says it is stands in its first bytes: it is read before that much memory is asked for.
    if content[:8] != b"\x89PNG\r\n\x1a\n" or len(content) < 24:
        return ""
    width, height = (int.from_bytes(content[at : at + 4], "big") for at in (16, 20))
    if not 0 < width * height <= MOST_PIXELS:
        return ""
    try:
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
        if picture is None or picture.dtype != np.uint8:
            return ""
        tall = max(1, min(round(height * WIDE / width), 2 * WIDE))
        small = cv2.resize(
            _on_white(np.asarray(picture, np.uint8)), (WIDE, tall), interpolation=cv2.INTER_AREA
        )
        written, webp = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
    except cv2.error:
        return ""
    return f"data:image/webp;base64,{base64.b64encode(webp.tobytes()).decode('ascii')}" if written else ""


def _on_white(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Without what it lets through: figures are drawn for white paper."""
    if picture.ndim == 2:
        return np.repeat(picture[:, :, None], 3, axis=2)
    if picture.shape[2] == 3:
        return picture
    opaque = picture[:, :, 3:].astype(np.float32) / 255
    return np.asarray(np.rint(picture[:, :, :3] * opaque + 255 * (1 - opaque)), np.uint8)
