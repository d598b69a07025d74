"""``reports/flights.html``: the flights that somebody evaluated here, apart from the theses' studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple
from urllib.parse import quote

from wildlab.analysis.overviews.verdict import Verdict, evidence_of, verdict_of
from wildlab.reporting.page import PILLS, TAGS, page
from wildlab.reporting.quantities import duration
from wildlab.reporting.text import NOTHING, escape

#: The page, beside the ledger.
PAGE = "flights.html"
#: How to begin, where there is none yet.
BEGIN = (
    "None was evaluated here yet. <code>wildlab import CARD --into flights/tuesday</code> makes a flight of "
    "what the aircraft logged, <code>wildlab simulate slow-vessel --into flights/trial</code> makes one up; "
    "<code>wildlab evaluate flights/tuesday</code> writes its reports, and they are shown here."
)
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


def address(folder: str) -> str:
    """Of the report in a folder, for a link: a folder may be called ``javascript:x`` or ``a?b``."""
    return f"{escape(quote(folder, safe=''))}/report.html"


def verdict_pill(flight: OwnFlight) -> str:
    """The verdict as HTML."""
    word = flight.verdict
    if word is None:
        return '<span class="pill">no overview</span>'
    return f'<span class="pill {PILLS[word.colour]}">{escape(word)}</span>'


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
    rows = "".join(_row(flight) for flight in flights)
    head = "".join(
        f'<th scope="col" class="text">{title}</th>'
        for title in ("flight", "verdict", "kind", "length", "reports", "evaluated")
    )
    judged = sum(flight.verdict not in (None, Verdict.UNJUDGED) for flight in flights)
    parts = [
        "<header><h1>Flights evaluated here</h1>",
        f'<p class="sub">{len(flights)} flight{"s" * (len(flights) != 1)}, {judged} of them judged. '
        '<a href="ledger.html">The ledger of the theses</a> is another page.</p></header>',
    ]
    if flights:
        parts.append(
            '<div class="scroll" role="region" tabindex="0" aria-label="Flights"><table>'
            f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        )
    else:
        parts.append(f"<p>{BEGIN}</p>")
    if comparison:
        parts.append(f'<p><a href="{escape(comparison)}">Flights compared on one page</a></p>')
    damaged = [
        one.folder
        for flight in flights
        for one in (*flight.reports, *flight.earlier)
        if one.state == "damaged"
    ]
    if damaged:
        parts.append(
            f"<p>{len(damaged)} report{'s' * (len(damaged) != 1)} not as written, and not used: "
            f"{escape(', '.join(damaged))}. What does not fit: <code>wildlab verify</code>.</p>"
        )
    meanings = {
        Verdict.ALARM: "its position jumps, or it leans as nobody flies on purpose",
        Verdict.MEND: "something in its tables cannot be used or contradicts itself",
        Verdict.FIX: "a gain was measured that is worth it",
        Verdict.LOOK: "something is wrong, and what mending it gains was not measured for certain",
        Verdict.SOUND: "it was judged, and none of these is so",
        Verdict.UNJUDGED: "no report could judge its errors",
    }
    legend = "; ".join(f"<b>{word}</b>: {meaning}" for word, meaning in meanings.items())
    parts.append(f'<p class="note">{legend}.</p>')
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return page(
        title="Flights evaluated here",
        body="\n".join(parts),
        kicker='<a href="index.html">wildlab</a> › flights',
        footer=f"<p>Put together {made}.</p>",
    )


def _row(flight: OwnFlight) -> str:
    links = ", ".join(
        f'<a href="{address(one.folder)}">{escape(one.about)}</a>'
        + ("" if one.state == "done" else f" ({escape(one.state)})")
        for one in flight.reports
    )
    old = ", ".join(f'<a href="{address(one.folder)}">{escape(one.about)}</a>' for one in flight.earlier)
    links += f'<br><span class="dim">of an earlier evaluation: {old}</span>' if old else ""
    length = duration(flight.length_s) if flight.length_s == flight.length_s else NOTHING
    cells = (
        verdict_pill(flight),
        escape(TAGS.get(flight.kind, flight.kind)),
        escape(length),
        links,
        escape(flight.finished or NOTHING),
    )
    return (
        f'<tr><th scope="row" class="text">{escape(flight.name)}</th>'
        + "".join(f'<td class="text">{cell}</td>' for cell in cells)
        + "</tr>"
    )
