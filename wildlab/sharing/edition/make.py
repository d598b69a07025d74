"""The page for partners from a folder of reports, as ``wildlab evaluate`` leaves them there."""

from __future__ import annotations

from pathlib import Path

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.messages.catalogue import Language
from wildlab.messages.message import Day
from wildlab.runner.record.own_flights import own_flights
from wildlab.sharing.edition.edition import Place, edition_html
from wildlab.sharing.edition.facts import facts_of
from wildlab.sharing.edition.flight_map import map_of


def make_edition(
    reports: Path,
    name: str,
    *,
    place: Place,
    called: str | None = None,
    day: Day | None = None,
    flight: Flight | None = None,
    source: str | None = None,
    language: str | Path | Language = "en",
) -> str:
    """The page about one flight.

    Parameters
    ----------
    reports
        The folder of all reports.
    name
        Of the flight, as its reports have it.
    place
        How exactly places are shown.
    called
        What the flight is called on the page; left out, its name.
    day
        When it was flown; None where that is not to be said.
    flight
        For the map: as it may be shown, so generalised before. None for a drawing of the numbers.
    source
        Of the flight's poses, which the map shows; None for the best known ones.
    language
        A code, the path of a file of texts, or texts that were loaded.

    Returns
    -------
    str
        HTML of one A4 page.

    Raises
    ------
    WildlabError
        If there is no report on the flight, or the language cannot be used.
    """
    found = {one.name: one for one in own_flights(reports, ())}
    if name not in found:
        known = ", ".join(sorted(found)) or "of none"
        raise WildlabError(
            f"there is no report on a flight {name!r}; there are some {'on ' if found else ''}{known}",
            "evaluate it first: wildlab evaluate",
            file=reports,
        )
    return edition_html(
        facts_of(found[name]),
        name=name if called is None else called,
        place=place,
        day=day,
        picture=None if flight is None else map_of(flight, source),
        language=language,
    )
