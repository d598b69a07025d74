"""Everything that is looked for in a text, in columns of numbers, and in plain bytes."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from wildlab.sharing.scan.angles import angles_of
from wildlab.sharing.scan.dates import dates_in
from wildlab.sharing.scan.encodings import Encoding, encodings_of
from wildlab.sharing.scan.hits import Hit
from wildlab.sharing.scan.near import Sorted, alone, pairs
from wildlab.sharing.scan.numbers import numbers_of, runs_of
from wildlab.sharing.scan.scalars import scalars_in
from wildlab.sharing.scan.secrets import Secrets
from wildlab.sharing.scan.texts import as_bytes
from wildlab.sharing.scan.words import Words

#: A longer text is looked at in pieces that overlap, so that memory stays bounded.
PIECE, OVERLAP = 8_000_000, 2_000


class Look:
    """What is looked for, prepared once for all files."""

    def __init__(self, secrets: Secrets) -> None:
        self.secrets = secrets
        self.words = Words(secrets.words)
        self.encodings = encodings_of(np.asarray(secrets.places, float).reshape(-1, 3))

    def in_text(self, text: str, *, drawn: bool = False) -> list[Hit]:
        """What is in a text.

        Parameters
        ----------
        text
            One reading of it.
        drawn
            It is mostly the coordinates of lines on paper: of those only what two numbers say together counts.
        """
        hits: list[Hit] = []
        for begin in range(0, max(len(text), 1), PIECE):
            piece = text[begin : begin + PIECE + OVERLAP]
            found = self._in_piece(piece, drawn=drawn)
            hits += [hit._replace(start=hit.start + begin, end=hit.end + begin) for hit in found]
        return list(dict.fromkeys(hits))

    def _in_piece(self, text: str, *, drawn: bool) -> list[Hit]:
        hits = self.words.found_in(text)
        text, data = as_bytes(text)
        runs = runs_of(data)
        if not len(runs.start):
            return hits
        numbers = numbers_of(data, runs)
        hits += dates_in(data, text, runs, numbers, self.secrets)
        if not drawn:
            hits += scalars_in(text, numbers, self.secrets.numbers)
        if not self.encodings:
            return hits
        ordered = Sorted(numbers)
        near_m, cell = self.secrets.near_m, self.secrets.cell_deg
        for encoding in self.encodings:
            own = cell if encoding.name == "decimal degrees" else 0.0
            hits += pairs(ordered, encoding, near_m, own)
            if not drawn:
                hits += alone(ordered, encoding, own)
        for name, angles in angles_of(data, runs, numbers).items():
            if not len(angles.start):
                continue
            ordered = Sorted(angles)
            for encoding in self._degrees():
                spelt = encoding._replace(name=name)
                hits += pairs(ordered, spelt, near_m)
                if not drawn:
                    hits += alone(ordered, spelt)
        return hits

    def _degrees(self) -> Sequence[Encoding]:
        return [encoding for encoding in self.encodings if encoding.name == "decimal degrees"]


def excerpt(text: str, hit: Hit, around: int = 12) -> str:
    """What was found, with a little of what stands around it, on one line."""
    piece = text[max(hit.start - around, 0) : min(hit.end, hit.start + 120) + around]
    return re.sub(r"\s+", " ", piece)
