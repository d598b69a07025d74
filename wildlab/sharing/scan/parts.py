"""Parts of a file, once unpacked, and how much may be unpacked."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Part:
    """Bytes out of a file.

    Attributes
    ----------
    where
        What they are inside of, from the outside in; empty for the file itself.
    data
        The bytes, as they are once unpacked.
    drawn
        They are mostly coordinates of lines on paper.
    trouble
        Why they could not be looked into; empty where they could.
    """

    where: str
    data: bytes
    drawn: bool = False
    trouble: str = ""


@dataclass
class Budget:
    """How much one file may unpack to, so that a small file cannot fill the memory."""

    left: int = 1_000_000_000
    most_at_once: int = 256_000_000
    deepest: int = 12
