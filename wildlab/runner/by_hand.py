"""A study's notebook opened by hand: the flight that the runner would have given it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight, load_flight
from wildlab.paths import REPORTS
from wildlab.runner.catalogue import find_study, load_studies
from wildlab.runner.flights import dataset_flight, twin_flight


def flight_for(study: str, flight: str, seed: int) -> Flight:
    """The flight in the folder ``flight``; where that is "", the first of `flights_for`."""
    return flights_for(study, flight, (), seed)[0]


def flights_for(study: str, flight: str, others: Sequence[str], seed: int) -> list[Flight]:
    """The flights of a study, the first one first.

    Parameters
    ----------
    study
        Its name in ``studies.toml``.
    flight, others
        Folders, as the runner gives them. Where ``flight`` is "", the study's own twin is simulated for
        ``seed``, or its own data set is imported; both are kept with those of the runner.

    Raises
    ------
    WildlabError
        If no flight is given and there is no such study, it has no flight, or its data set is not here; says
        how to get it.
    """
    if flight:
        return [load_flight(Path(folder)) for folder in (flight, *others)]
    entry = find_study(study, load_studies())
    if entry.twin is not None:
        return [load_flight(twin_flight(entry.twin, seed, REPORTS))]
    if entry.recipe is None:
        raise WildlabError(
            f"the study {study!r} has no flight of its own", "name a flight's folder", field="flight"
        )
    recipes = (entry.recipe, *entry.beside)
    return [load_flight(dataset_flight(entry.dataset, recipe, REPORTS)) for recipe in recipes]
