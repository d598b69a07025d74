"""Does a flight make sense: every pair that says the same twice, asked in turn."""

from __future__ import annotations

from collections.abc import Iterator

from wildlab.flight.checks.corrections import report_alone
from wildlab.flight.checks.findings import Finding, whole
from wildlab.flight.checks.sense.bounds import bounds
from wildlab.flight.checks.sense.camera import lens
from wildlab.flight.checks.sense.field import field
from wildlab.flight.checks.sense.ground import ground
from wildlab.flight.checks.sense.heading import heading
from wildlab.flight.checks.sense.inertial_checks import forces
from wildlab.flight.checks.sense.leaps import told_from_leaps
from wildlab.flight.checks.sense.motion import motion
from wildlab.flight.checks.sense.origin import origin, together
from wildlab.flight.checks.sense.positions import positions
from wildlab.flight.checks.sense.scans import scans
from wildlab.flight.checks.sense.seen import seen
from wildlab.flight.checks.sense.stamps import stamps
from wildlab.flight.checks.sense.targets import targets
from wildlab.flight.store import Flight

__all__ = ["contradictions", "sense", "sense_sentences"]


def sense(flight: Flight) -> list[Finding]:
    """Everything in which a flight contradicts itself, and the mistake that explains it.

    Parameters
    ----------
    flight
        The flight; nothing in it is changed.

    Returns
    -------
    list of Finding
        In clauses, as from `wildlab.flight.checks.check.find`; of mistakes that explain others, these alone.
    """
    return report_alone(flight, list(contradictions(flight)), lambda one: list(contradictions(one)))


def contradictions(flight: Flight) -> Iterator[Finding]:
    """The same with what follows from another one."""
    yield from bounds(flight)
    apart = [*origin(flight), *together(flight)]
    yield from apart
    late = list(stamps(flight))
    yield from late
    if not apart and not late:
        moving = list(motion(flight))
        yield from moving
        yield from told_from_leaps(positions, flight)
        felt = list(forces(flight))
        yield from felt
        yield from field(flight)
        if not moving and not felt:
            yield from heading(flight)
    yield from lens(flight)
    scanned = list(told_from_leaps(scans, flight))
    yield from scanned
    if not scanned:
        yield from targets(flight)
    found = list(told_from_leaps(seen, flight))
    yield from found
    if not found:
        yield from ground(flight)


def sense_sentences(flight: Flight) -> list[str]:
    """What `sense` finds, in whole sentences with the remedy; notes are left out. For reports and commands.

    Parameters
    ----------
    flight
        The flight.

    Returns
    -------
    list of str
        Problems first; empty where the flight makes sense. They name files of no folder, and no place.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> sense_sentences(simulate_twin("large-ship", 1))
    []
    """
    found = [one for one in sense(flight) if one.level != "note"]
    found.sort(key=lambda one: ("problem", "warning").index(one.level))
    return [f"{one.level}: {one.sentence} {one.fix}" for one in map(whole, found)]
