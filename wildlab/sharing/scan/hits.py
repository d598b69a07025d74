"""What a look at one text, one table or one run of bytes brings to light, before it has a place in a file."""

from __future__ import annotations

from typing import NamedTuple

from wildlab.sharing.scan.findings import Kind


class Hit(NamedTuple):
    """Something found. ``start``, ``end``: characters of the text or bytes."""

    start: int
    end: int
    kind: Kind
    written: str
