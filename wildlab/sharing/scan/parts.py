"""Parts of a file, once unpacked, and how much may be unpacked."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from wildlab.sharing.scan.secrets import Array


class TooMuch(Exception):
    """It unpacks to more than may be unpacked."""


#: What archives, compressed streams, pictures and documents begin with.
_PACKED = (
    b"\x1f\x8b", b"PK\x03\x04", b"BZh", b"\xfd7zXZ", b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18", b"\x78\x9c",
    b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"RIFF", b"%PDF", b"II*\x00", b"MM\x00*", b"PAR1", b"ARROW1",
    b"SQLite ",
)  # fmt: skip


def begins_packed(data: bytes) -> bool:
    """Whether bytes, however few, are to be unpacked.

    Parameters
    ----------
    data
        From the beginning.
    """
    return data.startswith(_PACKED)


@dataclass(frozen=True)
class Part:
    """Something out of a file.

    Attributes
    ----------
    where
        What it is inside of, from the outside in; empty for the file itself.
    data
        Bytes, as they are once unpacked.
    whole
        Nothing more can be unpacked from it.
    drawn
        Its numbers are mostly the coordinates of lines on paper.
    columns
        Numbers by the name of their column, (N,) each; those of equal length belong together row by row.
    moments
        Times that stand there in a form of their own, and what they are.
    boxes
        What maps reach over: least and greatest x, least and greatest y, and whether they are degrees.
    trouble
        Why it could not be looked into; empty where it could.
    """

    where: str
    data: bytes = b""
    whole: bool = False
    drawn: bool = False
    columns: tuple[tuple[str, Array], ...] = ()
    moments: tuple[tuple[datetime, str], ...] = ()
    boxes: tuple[tuple[float, float, float, float, bool], ...] = ()
    trouble: str = ""


@dataclass
class Budget:
    """How much one file may unpack to, so that a small file cannot fill the memory.

    Attributes
    ----------
    left
        Bytes that may still be unpacked, all parts together.
    at_once
        Bytes of one part.
    parts
        How many parts may still come.
    deepest
        How many times one may be inside of another.
    """

    left: int = 1_000_000_000
    at_once: int = 256_000_000
    parts: int = 20_000
    deepest: int = 12

    @property
    def most(self) -> int:
        """Bytes that the next part may have."""
        return max(min(self.left, self.at_once), 0)

    def spend(self, data: bytes) -> bytes:
        """What was unpacked, taken off what is left.

        Raises
        ------
        TooMuch
            Where nothing was left for it.
        """
        self.left -= len(data)
        self.parts -= 1
        if self.left < 0 or self.parts < 0:
            raise TooMuch
        return data
