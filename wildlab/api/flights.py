"""Flights for a notebook: simulated, and looked over."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from wildlab.flight.checks import Finding, Use, check_flight, usable_for
from wildlab.flight.store import Flight
from wildlab.simulation.twins import simulate_twin
from wildlab.summary_table import Brief, Summary


def simulate(twin: str | Path, seed: int = 1, without: Collection[str] = ()) -> Flight:
    """Simulate a twin. The same seed gives the same flight, to the last bit.

    Parameters
    ----------
    twin
        A twin that comes with wildlab (``"fast-vessel"``), or a file like those in ``data/twins``.
    seed
        A whole number from 0.
    without
        Tables to leave out, to save time: any of ``"imu"`` and ``"gnss"``.

    Returns
    -------
    Flight
        In memory; `save_flight` writes it.

    Raises
    ------
    WildlabError
        Where the twin or one of its parameters is unusable, or the seed is negative.

    Examples
    --------
    >>> import wildlab
    >>> flight = wildlab.simulate("large-ship", seed=1)
    >>> flight.name
    'large-ship-1'
    """
    return simulate_twin(twin, seed, without)


@dataclass(frozen=True, repr=False)
class Checked(Brief):
    """What is to be known about a flight before it is used.

    Attributes
    ----------
    findings
        Worst first, in whole sentences.
    uses
        What the flight can be used for, and why not.
    """

    findings: tuple[Finding, ...]
    uses: tuple[Use, ...]

    @property
    def problems(self) -> tuple[Finding, ...]:
        """The findings that keep something from being used."""
        return tuple(one for one in self.findings if one.level == "problem")

    def brief(self) -> Summary:
        """A row for each finding, and one for each use."""
        rows: list[tuple[str, str]] = [(one.level, one.sentence) for one in self.findings]
        rows += [(one.purpose, f"{'yes' if one.usable else 'no'}, {one.why}") for one in self.uses]
        n = len(self.problems)
        return Summary(f"{n or 'No'} problem{'' if n == 1 else 's'}", rows)


def check(flight: Flight) -> Checked:
    """Whether a flight is usable, for what, and whether its numbers make sense.

    Parameters
    ----------
    flight
        The flight; nothing in it is changed.

    Returns
    -------
    Checked

    Examples
    --------
    >>> import wildlab
    >>> checked = wildlab.check(wildlab.simulate("large-ship"))
    >>> checked.problems
    ()
    >>> [use.purpose for use in checked.uses if use.usable]
    ['georeferencing accuracy', 'tracking']
    """
    return Checked(tuple(check_flight(flight)), tuple(usable_for(flight)))
