"""Everything that is looked for, in a text, in columns of numbers, in plain bytes and in times."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from datetime import datetime
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wildlab.sharing.scan.angles import angles_of
from wildlab.sharing.scan.binary import Binary
from wildlab.sharing.scan.codes import Codes
from wildlab.sharing.scan.columns import in_columns
from wildlab.sharing.scan.dates import dates_in, days_of
from wildlab.sharing.scan.derived import derived_numbers
from wildlab.sharing.scan.encodings import Encoding, encodings_of
from wildlab.sharing.scan.hits import Hit
from wildlab.sharing.scan.near import Sorted, alone, pairs, reach, within
from wildlab.sharing.scan.numbers import Numbers, numbers_of, runs_of
from wildlab.sharing.scan.scalars import scalars_in
from wildlab.sharing.scan.secrets import Array, Secrets
from wildlab.sharing.scan.texts import as_bytes
from wildlab.sharing.scan.words import Words

#: A longer text is looked at in pieces that overlap, so that memory stays bounded.
PIECE, OVERLAP = 8_000_000, 2_000


class SoughtPlaces:
    """What is looked for, prepared once for all files."""

    def __init__(self, secrets: Secrets) -> None:
        places = np.asarray(secrets.places, float).reshape(-1, 3)
        self.secrets = secrets
        self.words = Words(secrets.words)
        self.codes = Codes(places, secrets.near_m)
        self.encodings = encodings_of(places)
        self.degrees = [encoding for encoding in self.encodings if encoding.name == "decimal degrees"]
        self.reach = reach(self.encodings, secrets.near_m)
        self.reach_of_angles = reach(self.degrees, secrets.near_m)
        self.numbers = (*secrets.numbers, *derived_numbers(places))
        self.moments = secrets.moments if secrets.may_stay != "all" else ()
        self.days = days_of(self.moments) if secrets.may_stay != "day" else set()

    @cached_property
    def binary(self) -> Binary:
        """What is looked for among bytes: made where there are any."""
        return Binary(self.encodings, self.secrets.near_m, self.numbers, self.moments)

    def in_text(self, text: str, *, drawn: bool = False) -> list[Hit]:
        """What is in a text.

        Parameters
        ----------
        text
            One reading of it.
        drawn
            It is mostly the coordinates of lines on paper: of those only two numbers together count.
        """
        hits: list[Hit] = []
        for begin in range(0, max(len(text), 1), PIECE):
            piece = text[begin : begin + PIECE + OVERLAP]
            found = self._in_piece(piece, drawn=drawn)
            hits += [hit._replace(start=hit.start + begin, end=hit.end + begin) for hit in found]
        return list(dict.fromkeys(hits))

    def _in_piece(self, text: str, *, drawn: bool) -> Iterator[Hit]:
        yield from self.words.found_in(text)
        text, data = as_bytes(text)
        yield from self.codes.found_in(text)
        runs = runs_of(data)
        if not len(runs.start):
            return
        numbers = numbers_of(data, runs, grouped=not drawn)
        yield from dates_in(data, text, runs, numbers, self.secrets)
        if not drawn:
            yield from scalars_in(text, numbers, self.numbers)
        if not self.encodings:
            return
        cell = self.secrets.cell_deg
        ordered = self._reached(numbers, self.reach)
        for encoding in self.encodings:
            own = cell if encoding.name == "decimal degrees" else 0.0
            yield from self._found(ordered, encoding, own, drawn)
        for name, angles in angles_of(data, runs, numbers).items():
            ordered = self._reached(angles, self.reach_of_angles)
            for encoding in self.degrees:
                yield from self._found(ordered, encoding._replace(name=name), 0.0, drawn)

    def _found(self, numbers: Sorted | None, encoding: Encoding, cell: float, drawn: bool) -> Iterator[Hit]:
        if numbers is not None:
            yield from pairs(numbers, encoding, self.secrets.near_m, cell)
            yield from () if drawn else alone(numbers, encoding, cell)

    @staticmethod
    def _reached(numbers: Numbers, ranges: tuple[Array, Array]) -> Sorted | None:
        some = within(numbers.value, *ranges)
        return Sorted(numbers.take(some)) if some.any() else None

    def in_columns(self, columns: Iterable[tuple[str, Array]]) -> list[str]:
        """What is in columns of numbers, in words.

        Parameters
        ----------
        columns
            As a `Part` has them.
        """
        return in_columns(list(columns), self.encodings, self.secrets, self.numbers)

    def in_box(self, box: tuple[float, float, float, float, bool]) -> str:
        """How a map that reaches over a place counts its metres or degrees; nothing where it does not.

        Parameters
        ----------
        box
            As a `Part` has it.
        """
        for encoding in self.encodings:
            first, second = encoding.axes[:2]
            degrees = encoding.name == "decimal degrees"
            if degrees != box[4] or (not degrees and first.name != "easting"):
                continue
            x, y = (second, first) if degrees else (first, second)
            inside = _between(x.values, *box[:2]) & _between(y.values, *box[2:4])
            if inside.any():
                return encoding.name
        return ""

    def in_bytes(self, data: bytes) -> list[Hit]:
        """What is in plain bytes, as binary numbers, and names with letters beyond ASCII.

        Parameters
        ----------
        data
            Any.
        """
        return [*self.binary.found_in(data), *self.words.found_in_bytes(data)]

    def is_secret(self, moment: datetime) -> bool:
        """Whether a time says when it was.

        Parameters
        ----------
        moment
            With a zone.
        """
        return moment.date() in self.days


def _between(values: Array, least: float, greatest: float) -> NDArray[np.bool_]:
    """Whether numbers without their sign may lie between two that have one."""
    low = 0.0 if least <= 0 <= greatest else min(abs(least), abs(greatest))
    return np.asarray((values >= low) & (values <= max(abs(least), abs(greatest))))


def excerpt(text: str, hit: Hit, around: int = 12) -> str:
    """What was found, with a little of what stands around it, on one line.

    Parameters
    ----------
    text, hit
        Where it was found, and what.
    around
        How many characters before and behind it.
    """
    piece = text[max(hit.start - around, 0) : min(hit.end, hit.start + 120) + around]
    return re.sub(r"\s+", " ", piece)
