"""The ledger, ``reports/index.html``: every published number and claim, and what became of it here."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime

from wildlab.reporting.page import TAGS, first_look_notice, page
from wildlab.reporting.spread import MANY, spread_words
from wildlab.reporting.status import (
    DIFFERS,
    FIRST_LOOK,
    MISSING,
    NOT_JUDGED,
    REPRODUCED,
    Claim,
    Number,
    StudyStatus,
)
from wildlab.reporting.text import NOTHING, escape, inline, number, prose

#: A longer table is folded away behind a line that sums it up.
LONGEST_TABLE = 12
EXPLANATION = """
A number counts as **reproduced** when ours lies within the tolerance stated beside the published one (for
exact calculations, about the last digit printed), or when the published one lies in the middle 90 % of our
simulated flights (of fewer than 30: between the lowest and the highest). Where there is neither, only the
difference is shown: ours minus the published one.

A **first look** comes from fewer flights than the study's own. Its numbers are shown and count as nothing
until the full ones are in.

The flights of the theses were never published. A **twin** is a simulated flight built from what the thesis
prints about the real one; a **logged** flight is a real one from a public source.
"""
_PILLS = {
    REPRODUCED: "yes",
    DIFFERS: "no",
    "holds": "yes",
    "does not hold": "no",
    "cannot be decided": "part",
    FIRST_LOOK: "part",
}


def ledger_page(
    studies: Iterable[StudyStatus],
    flights: Iterable[tuple[str, str]] = (),
    *,
    learn: Iterable[tuple[str, str]] = (),
    code: str = "",
) -> str:
    """The whole page.

    Parameters
    ----------
    flights
        Reports besides the studies, as (folder, flight).
    learn
        Tutorials and reference, as (title, address).
    code
        Which code it was put together by, as HTML.
    """
    studies, flights = list(studies), list(flights)
    body = [
        "<header><h1>Ledger</h1>",
        '<p class="sub">Every published number and claim of the two theses, and what became of it here.</p>',
        "</header>",
        _tiles(studies),
        *(_section(one) for one in studies),
    ]
    if flights:
        items = [
            f'<li><a href="{escape(folder)}/report.html">{escape(folder)}</a>'
            + (f' <span class="dim">flight {escape(flight)}</span>' if flight != folder else "")
            + "</li>"
            for folder, flight in flights
        ]
        body.append(f"<h2>Flights evaluated here</h2><ul>{''.join(items)}</ul>")
    links = [f'<li><a href="{escape(page)}">{escape(title)}</a></li>' for title, page in learn]
    if links:
        body.append(f"<h2>Learn</h2><ul>{''.join(links)}</ul>")
    body.append(_explanation())
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    made += f", {code}" if code else ""
    footer = f"<p>Put together {made}. Each report says which code and data it came from.</p>"
    return page(title="wildlab ledger", body="\n".join(body), kicker="wildlab", footer=footer)


def _tiles(studies: list[StudyStatus]) -> str:
    numbers = [one for study in studies for one in study.numbers]
    claims = [one for study in studies for one in study.claims]
    done = [study for study in studies if study.state == "done"]
    failed = sum(study.state == "failed" for study in studies)
    looks = sum(study.state == FIRST_LOOK for study in studies)
    reproduced = sum(study.count(REPRODUCED) for study in done)
    holding = sum(one.verdict == "holds" for study in done for one in study.claims)
    waiting = [study for study in studies if study.state != "done"]
    studied = "studies done" + (f", {looks} at a first look" if looks else "")
    studied += f", {failed} failed" if failed else ""
    tiles = [(f"{len(done)} / {len(studies)}", studied)]
    if numbers:
        words = "published numbers reproduced" + _waiting(sum(len(study.numbers) for study in waiting))
        tiles.append((f"{reproduced} / {len(numbers)}", words))
    if claims:
        words = "claims hold" + _waiting(sum(len(study.claims) for study in waiting))
        tiles.append((f"{holding} / {len(claims)}", words))
    logged = sum(study.study.kind == "logged" for study in done)
    if any(study.study.kind == "logged" for study in studies):
        tiles.append((str(logged), "done on logged flights"))
    return f'<ul class="tiles">{"".join(f"<li><b>{v}</b><span>{t}</span></li>" for v, t in tiles)}</ul>'


def _waiting(count: int) -> str:
    """How many are not decided, because their study has no full numbers yet."""
    return f"; {count} wait for full numbers" if count else ""


def _section(one: StudyStatus) -> str:
    study = one.study
    tag = f'<span class="tag {study.kind}">{escape(_tag(one))}</span>'
    answers = f" · {escape(study.section)}" if study.section else ""
    parts = [
        f'<section><h2 id="{escape(study.name)}">{escape(study.title)}</h2>',
        f'<p class="sub">{tag}<code>{escape(study.name)}</code>{answers}</p>',
        _state(one),
        _numbers(one),
        _claims(one.claims),
    ]
    if one.has_report:
        words = "Open the report" if one.ran else "See what went wrong"
        parts.append(f'<p><a href="{escape(study.name)}/report.html">{words}</a></p>')
    return "\n".join([*(part for part in parts if part), "</section>"])


def _tag(one: StudyStatus) -> str:
    study = one.study
    if study.kind == "twin":
        flights = f", {one.seeds} flights" if one.seeds and one.seeds > 1 else ""
        return f"twin: {study.twin}{flights}"
    if study.kind == "logged":
        return f"logged: {one.flight or study.dataset or study.recipe}"
    return TAGS["computed"]


def _state(one: StudyStatus) -> str:
    run = f"`wildlab run {one.study.name}`"
    if one.state == "failed":
        return f'<p><span class="pill no">failed</span> {inline(one.reason)}</p>'
    if one.state == "broken off":
        return f'<p><span class="pill part">broken off</span> {inline(f"Run it again: {run}")}</p>'
    if one.state == FIRST_LOOK:
        return first_look_notice(one.first_look, f"wildlab run {one.study.name}")
    if one.state == "not run":
        fetch = (
            f"Get its data with `wildlab fetch {one.study.dataset}`, then run it: "
            if one.study.dataset
            else ""
        )
        return f'<p><span class="pill">not run yet</span> {inline(fetch + run)}</p>'
    return ""


def _numbers(one: StudyStatus) -> str:
    if not one.numbers:
        return ""
    spread = any(n.low is not None and n.high is not None for n in one.numbers)
    ran, words = one.ran, _spread_words(one)
    head = ["quantity", "published"]
    if ran:
        head += ["here", "difference"]
    if spread:
        over = f"{one.seeds} flights" if one.seeds and one.seeds > 1 else "spread"
        head.append(
            f'{over} <span class="key"><i class="hollow"></i>published<i class="full"></i>here'
            f'<i class="band"></i>{words}</span>'
        )
    if ran:
        head.append("")
    heads = "".join(
        f'<th scope="col"{_text(i == 0)}>{h}</th>' if h else '<td class="text"></td>'
        for i, h in enumerate(head)
    )
    rows = "".join(_row(n, ran=ran, spread=spread) for n in one.numbers)
    label = escape(f"Published numbers of {one.study.name}")
    table = (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{label}"><table>'
        f"<thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
    )
    summary = _summary(one)
    if not ran or len(one.numbers) > LONGEST_TABLE:
        return f'<details class="plain"><summary>{summary}</summary>{table}</details>'
    return table


def _spread_words(one: StudyStatus) -> str:
    """What the bands of a study's table are called."""
    return spread_words(min((n.over for n in one.numbers if n.over is not None), default=MANY)).key


def _summary(one: StudyStatus) -> str:
    count = len(one.numbers)
    if one.state == FIRST_LOOK:
        return f"{count} published number{'s' * (count > 1)} beside a first look"
    if one.state != "done":
        return f"{count} published number{'s' * (count > 1)} waiting for it"
    tolerances = {(n.within, n.unit) for n in one.numbers}
    if len(tolerances) == 1 and (within := one.numbers[0].within) is not None:
        near = sum(n.here is not None and abs(n.here - n.published) <= within + 1e-9 for n in one.numbers)
        return f"{near} of {count} within {within:g} {escape(one.numbers[0].unit)}".strip()
    parts = [f"{one.count(REPRODUCED)} of {count} reproduced"]
    parts += [
        f"{one.count(verdict)} {words}"
        for verdict, words in (
            (DIFFERS, "differ"),
            (NOT_JUDGED, "not judged"),
            (MISSING, "not reproduced yet"),
        )
        if one.count(verdict)
    ]
    return ", ".join(parts)


def _row(n: Number, *, ran: bool, spread: bool) -> str:
    quantity = f"{escape(n.name.replace('_', ' '))}, {escape(n.subject)}"
    unit = f" {escape(n.unit)}" if n.unit else ""
    cells = [
        f'<th scope="row" class="text">{quantity} <span class="dim source">{escape(n.source)}</span></th>',
        f"<td>{number(n.published, n.digits)}{unit}</td>",
    ]
    if ran and n.here is None:
        reason = f" ({escape(n.reason)})" if n.reason else ""
        span = 3 + spread
        return f'<tr>{"".join(cells)}<td colspan="{span}" class="text dim">{MISSING}{reason}</td></tr>'
    if ran:
        cells += [f"<td>{number(n.here, n.digits + 1)}{unit}</td>", f"<td>{_signed(n)}</td>"]
    if spread:
        cells.append(f"<td>{strip(n)}</td>")
    if ran:
        pill = f'<span class="pill {_PILLS[n.verdict]}">{n.verdict}</span>' if n.verdict in _PILLS else ""
        cells.append(f'<td class="text">{pill or NOTHING}</td>')
    return f"<tr>{''.join(cells)}</tr>"


def strip(n: Number) -> str:
    """The spread over flights as a small picture: published hollow, ours filled, the spread a band."""
    known = [value for value in (n.published, n.here, n.low, n.high) if value is not None]
    if n.low is None or n.high is None or n.here is None:
        return NOTHING
    least, most = min(known), max(known)
    scale = 144 / (most - least) if most > least else 0.0

    def x(value: float) -> str:
        return f"{8 + (value - least) * scale:.1f}"

    width = max(2.0, (n.high - n.low) * scale)
    bounds = spread_words(n.over or MANY).key.replace("%", "percent")
    words = (
        f"published {number(n.published, n.digits)}, here {number(n.here, n.digits + 1)}, "
        f"{bounds} {number(n.low, n.digits + 1)} to {number(n.high, n.digits + 1)}"
    )
    return (
        f'<svg width="160" height="18" viewBox="0 0 160 18" role="img" aria-label="{escape(words)}">'
        '<line x1="4" x2="156" y1="9" y2="9" stroke="#dce1e6"/>'
        f'<rect x="{x(n.low)}" y="6" width="{width:.1f}" height="6" rx="3" fill="#9cc7e0"/>'
        f'<circle cx="{x(n.here)}" cy="9" r="4" fill="#0072b2"/>'
        f'<circle cx="{x(n.published)}" cy="9" r="4.6" fill="none" stroke="#18222d" stroke-width="1.6"/>'
        "</svg>"
    )


def _claims(claims: list[Claim]) -> str:
    if not claims:
        return ""
    rows = []
    for one in claims:
        on = ""
        if one.fraction is not None:
            on = f"{100 * one.fraction:.0f} %" + (f" of {one.seeds} flights" if one.seeds else " of flights")
        elif one.seeds:
            on = f"over {one.seeds} runs"
        source = f' <span class="dim source">{escape(one.source)}</span>' if one.source else ""
        pill = f'<span class="pill {_PILLS.get(one.verdict, "")}">{escape(one.verdict)}</span>'
        rows.append(
            # The verdict stands beside the claim: on a phone the last column may be out of sight.
            f'<tr><th scope="row" class="text wide">{escape(one.text)}{source}</th>'
            f'<td class="text">{pill}</td><td>{on}</td></tr>'
        )
    return (
        '<div class="scroll" role="region" tabindex="0" aria-label="Claims"><table><thead><tr>'
        '<th scope="col" class="text">claim</th><th scope="col" class="text">verdict</th>'
        f'<th scope="col">tested on</th></tr></thead><tbody>{"".join(rows)}</tbody></table></div>'
    )


def _explanation() -> str:
    return f"<details><summary>How to read this</summary>{prose(EXPLANATION)}</details>"


def _signed(n: Number) -> str:
    shown = number(n.difference, n.digits + 1)
    return f"+{shown}" if shown[0].isdigit() and float(shown) > 0 else shown


def _text(yes: bool) -> str:
    return ' class="text"' if yes else ""
