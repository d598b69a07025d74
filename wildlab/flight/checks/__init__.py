"""Is a flight usable, for what, and does it make sense? `check_flight` asks all.

A finding is a code with facts; it names a table and a field, in the units and frames of `wildlab.flight`, and
nothing is changed. What is asked stands in the tables of `check`: plain questions, and those about meaning,
where two things that say the same disagree and usual mistakes are tried. The mistakes are rows of
``data/messages/mistakes.toml``, the sentences of ``data/messages/checks.toml``.
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.flight.checks.check import Use, check_flight, usable_for
    from wildlab.flight.checks.findings import Finding
else:
    __getattr__, __dir__ = offer(__name__)

__all__ = [
    "Finding",
    "Use",
    "check_flight",
    "usable_for",
]
