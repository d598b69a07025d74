"""``reports/flights.html``: the flights that somebody evaluated here, apart from the theses' studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple

from wildlab.analysis.verdict import Verdict, evidence_of, verdict_of
from wildlab.reporting.text import PILLS, TAGS, page, render

#: The page, beside the ledger.
PAGE = "flights.html"
#: What the verdict follows from, of the overview.
COUNTS = {"problems": "problems", "worth": "worth_fixing", "troubled": "troubled", "judged": "reports_beside"}


class OwnReport(NamedTuple):
    """One report on a flight.

    Attributes
    ----------
    folder
        Its name.
    about
        ``overview``, ``georeferencing``, ``navigation``, ``tracking``, ``many targets``, or the
        folder's name.
    state
        ``done``, ``failed``, ``broken off`` or ``damaged``.
    finished
        When, as ISO 8601; "" where that is not known.
    numbers
        By name and subject; empty where it is not done.
    lacking
        Of an overview: which others could not be made, and why.
    """

    folder: str
    about: str
    state: str
    finished: str
    numbers: Mapping[tuple[str, str], Mapping[str, Any]]
    lacking: tuple[str, ...]

    def of_leading_filter(self, name: str) -> dict[str, Mapping[str, Any]]:
        """A number of every track of the filter that a report on tracking leads with, by subject."""
        from wildlab.analysis.tracks.tracker import LEADING  # takes a while, and few pages need it

        best = next((subject for other, subject in self.numbers if other == LEADING), "ekf")
        return {
            subject: entry
            for (other, subject), entry in self.numbers.items()
            if other == name and subject.endswith(f"/{best}")
        }


class OwnFlight(NamedTuple):
    """A flight with its reports, the overview first; ``kind`` is ``logged`` or ``twin``.

    ``earlier`` are reports that the newest evaluation did not make again, or that are of other tables.
    """

    name: str
    kind: str
    reports: tuple[OwnReport, ...]
    earlier: tuple[OwnReport, ...] = ()

    def report(self, about: str) -> OwnReport | None:
        """The report on something, where there is one."""
        return next((one for one in self.reports if one.about == about), None)

    def number(self, name: str, subject: str) -> Mapping[str, Any] | None:
        """A number of the first report that has it; None where it is in none, or could not be computed."""
        for one in self.reports:
            entry = one.numbers.get((name, subject))
            if entry is not None and entry["value"] is not None:
                return entry
        return None

    def value(self, name: str, subject: str) -> float | None:
        """Its value alone."""
        entry = self.number(name, subject)
        return None if entry is None else float(entry["value"])

    @property
    def numbers(self) -> dict[tuple[str, str], Mapping[str, Any]]:
        """Those of all its reports; of equal ones that of the first report."""
        return {key: entry for one in reversed(self.reports) for key, entry in one.numbers.items()}

    @property
    def verdict(self) -> Verdict | None:
        """What it comes to; None without an overview that is done."""
        counts = {key: self.value(name, "flight") for key, name in COUNTS.items()}
        # Overviews of before these were computed do not have them.
        counts |= {name: self.value(name, "flight") or 0 for name in ("broken", "alarmed")}
        known = {key: count for key, count in counts.items() if count is not None}
        if len(known) < len(counts):
            return None
        return verdict_of(evidence_of(known, self.numbers))

    @property
    def finished(self) -> str:
        """When the last of its reports was, as ``2026-11-22 10:15 UTC``; "" where that is not known."""
        latest = max((one.finished for one in self.reports), default="")
        return f"{latest[:16].replace('T', ' ')} UTC" if len(latest) >= 16 else ""

    @property
    def length_s(self) -> float:
        """How long it was, s; NaN where that is not known."""
        found = self.value("duration", "flight")
        return float("nan") if found is None else found


def pill_of(flight: OwnFlight) -> tuple[str, str]:
    """The verdict in a word, and the colour that goes with it."""
    word = flight.verdict
    return ("no overview", "") if word is None else (word.value, PILLS[word.colour])


def flights_page(flights: Sequence[OwnFlight], comparison: str = "") -> str:
    """The whole page.

    Parameters
    ----------
    flights
        By name.
    comparison
        Address of the comparison of some of them, where there is one.

    Returns
    -------
    str
        HTML. It names flights and reports, and no place.
    """
    reports = [one for flight in flights for one in (*flight.reports, *flight.earlier)]
    body = render(
        "flights",
        flights=[(one, *pill_of(one), TAGS.get(one.kind, one.kind)) for one in flights],
        judged=sum(one.verdict not in (None, Verdict.UNJUDGED) for one in flights),
        damaged=[one.folder for one in reports if one.state == "damaged"],
        comparison=comparison,
    )
    return page(
        title="Flights evaluated here",
        body=body,
        kicker='<a href="index.html">wildlab</a> › flights',
        footer=f"<p>{datetime.now(UTC):%Y-%m-%d %H:%M} UTC</p>",
    )
