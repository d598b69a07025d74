"""Is a flight usable, for what, and does it make sense? One file for each kind of finding; `check_flight`
asks all.

A finding names a table and a field, in the units and frames of `wildlab.flight`; nothing is changed. Each
function takes a flight and yields findings: `findings`, `camera`, `axes` and `inertial` have them by subject.
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
