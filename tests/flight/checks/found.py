"""Findings as lines, as tests of the checks state them."""

from collections.abc import Iterable

from wildlab.flight.checks.findings import Finding


def levels(found: Iterable[Finding], said: str) -> list[str]:
    """Levels of the findings that ``"table field: words"`` fits; words stand in the sentence or its fix."""
    place, _, words = said.partition(": ")
    return [
        one.level
        for one in found
        if place == f"{one.table} {one.field}".strip() and words in f"{one.sentence} {one.fix}"
    ]
