"""What is said, before it is said in a language: a key of the texts and the values that go into it."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import NamedTuple, Union


class Quantity(NamedTuple):
    """A number with what it is of.

    Attributes
    ----------
    kind
        ``length`` (m), ``duration`` (s), ``area`` (m^2), ``share`` (0 to 1), ``angle`` (rad) or ``number``.
    value
        In SI units.
    """

    kind: str
    value: float


class Day(NamedTuple):
    """A date that is shown to the day, or only to the month."""

    date: date
    whole: bool


class Message(NamedTuple):
    """One text of the page.

    Attributes
    ----------
    key
        Of the texts, with dots between its parts: ``verdict.sound``.
    values
        By placeholder.
    n
        What decides between the text for one and for several; None where there is one text for all.
    """

    key: str
    values: Mapping[str, Value] = {}
    n: int | None = None


#: What may stand for a placeholder: a quantity, a date, another text, a list of texts, or text as it is.
Value = Union[Quantity, Day, Message, tuple[Message, ...], str]  # noqa: UP007 - refers to what comes later


def length(metres: float) -> Quantity:
    """Metres."""
    return Quantity("length", metres)


def duration(seconds: float) -> Quantity:
    """Seconds."""
    return Quantity("duration", seconds)


def share(part: float) -> Quantity:
    """A share, from 0 to 1."""
    return Quantity("share", part)


def number(value: float) -> Quantity:
    """A count."""
    return Quantity("number", value)
