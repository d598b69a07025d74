"""What the scan hands back: where something stands that must not be sent, and how it is written there."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["place", "date", "name", "number", "unreadable"]

#: Of one kind in one part; the rest is counted in one finding.
MOST_OF_A_KIND = 8


@dataclass(frozen=True)
class Finding:
    """Something that must not be in what is sent.

    Attributes
    ----------
    file
        The file, as it was given to :func:`wildlab.sharing.scan.scan.scan`.
    where
        What it is inside of, from the outside in, and how far from its beginning:
        ``"picture in base64 > EXIF, byte 120"``.
    kind
        A place, a date, a name, another number that locates; or ``"unreadable"``: what could not be looked
        into, which is not sent either.
    written
        How: ``"latitude and longitude in decimal degrees"``.
    found
        The bytes themselves, shortened: for the sender's eyes, so it is not shown when printed.
    """

    file: str
    where: str
    kind: Kind
    written: str
    found: str = field(default="", repr=False)

    def __str__(self) -> str:
        return f"{self.file}: {self.where}: {self.kind}: {self.written}"
