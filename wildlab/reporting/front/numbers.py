"""The published numbers at once: a row of marks for each study, counts beside, and the same on one sheet."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from datetime import UTC, datetime
from urllib.parse import quote

from wildlab.evaluation.replication import Closeness, Compatibility
from wildlab.reporting.counts import PREDICTED, Counts, counted, groups_table, tally
from wildlab.reporting.front import ratios
from wildlab.reporting.front.cards import verdict_words
from wildlab.reporting.page import page
from wildlab.reporting.status import FIRST_LOOK, Number, StudyStatus
from wildlab.reporting.text import escape

#: The pages beside the front page.
LEDGER, POSTER = "ledger.html", "numbers.html"

STYLE = """.count{display:flex;flex-wrap:wrap;align-items:baseline;gap:.2rem 1.6rem;margin:.7rem 0 0;
padding:0;list-style:none;
max-width:none}
.count li{margin:0}.count b{font-size:1.35rem;margin-right:.3rem;font-variant-numeric:tabular-nums}
.row-of{display:grid;grid-template-columns:14.5rem minmax(0,1fr) 8.5rem;gap:0 1rem;align-items:center;
padding:.12rem 0}
.all .row-of+.row-of{border-top:1px solid var(--line)}.row-of .said{color:var(--dim);font-size:.82rem}
.row-of .name{font-size:.9rem;line-height:1.25}
@media(max-width:46rem){.row-of{grid-template-columns:minmax(0,1fr) auto;padding:.4rem 0}
.row-of .marks,.row-of .ticks{grid-column:1/-1;grid-row:2}}
@media print{.row-of{break-inside:avoid;grid-template-columns:9.5rem minmax(0,1fr) 7.5rem}}"""


def numbers_section(studies: Sequence[StudyStatus]) -> str:
    """The section of the front page."""
    counts = counted(studies)
    head = '<section><h2 id="numbers">The published numbers at once</h2>'
    rows = number_rows(studies)
    if not rows:
        return (
            f'{head}<p class="empty">{counts.all} published numbers are kept here; no study of them was run '
            f"yet.</p></section>"
        )
    shown = [n for one in studies if one.ran for n in one.counted]
    return (
        f"{head}<p>A mark is a number of one of the theses: ours divided by theirs, on one axis for all.</p>"
        f"{count_list(counts)}{ratios.legend(shown)}"
        f'<div class="all">{rows}</div>{groups_table(counts)}{aside(counts)}'
        f'<p><a href="{POSTER}">The same on one sheet, for the wall</a></p></section>'
    )


def number_rows(studies: Sequence[StudyStatus]) -> str:
    """A row of marks for each study that has numbers, and the axis; "" where none has."""
    rows = []
    for one in studies:
        shown = ratios.drawable(one.counted) if one.ran else []
        if not shown:
            continue
        said = _tally(one)
        name = one.study.name.replace("-", " ")
        link = f'<a href="{LEDGER}#{escape(quote(one.study.name))}">{escape(name)}</a>'
        alt = f"{name}: {len(shown)} numbers; {_words(one)}"
        rows.append(
            f'<div class="row-of"><span class="name">{link}</span>'
            f'{ratios.plot(shown, alt=alt, width=480.0, most_levels=7)}<span class="said">{said}</span></div>'
        )
    if not rows:
        return ""
    axis = f'<div class="row-of"><span></span>{ratios.ticks()}<span></span></div>'
    return f"{axis}{''.join(rows)}{axis}"


def _tally(one: StudyStatus) -> str:
    """The answers on a study's numbers in few figures."""
    if one.state == FIRST_LOOK:
        return f"first look: {sum(n.here is not None for n in one.counted)}"
    found = tally(one.counted)
    outside = found.compatible[Compatibility.OUTSIDE]
    close = f"{found.close[Closeness.CLOSE]} of {sum(found.close.values())} close"
    return close + (f", {outside} outside" if outside else "")


def count_list(counts: Counts) -> str:
    """The headline: what was predicted for flights, in figures."""
    if not counts.of:
        return ""
    items = "".join(f"<li><b>{n}</b>{escape(words)}</li>" for n, words in _headline(counts))
    return f'<ul class="count">{items}</ul>'


def _headline(counts: Counts) -> list[tuple[str, str]]:
    found = counts.groups[PREDICTED]
    flights = f"{counts.flights} flight{'s' * (counts.flights != 1)}"
    return [
        (f"{found.close['close']} of {counts.of}", f"{PREDICTED} for {flights}, are close"),
        (str(found.compatible["within"]), "within 90 % of our flights"),
        (str(found.compatible["outside"]), f"outside; chance alone gives {found.chance:.1f}"),
    ]


def aside(counts: Counts) -> str:
    """What has no answer; as HTML, "" where nothing is to be said."""
    said = _notes(counts)
    return f'<p class="note">{escape(" ".join(said))}</p>' if said else ""


def _notes(counts: Counts) -> list[str]:
    rest = sum(counts.others.values())
    if not rest:
        return []
    reasons = "; ".join(f"{n} {why}" for why, n in counts.others.items())
    return [f"{rest} of the {counts.all} published numbers have no answer: {reasons}."]


#: The sheet, mm: within the margins of A4, portrait; where names end, and where the axis does.
SHEET_WIDE, SHEET_HIGH, NAMES_END, AXIS_END = 190.0, 276.0, 52.0, 148.0
_POSTER_STYLE = """body{max-width:60rem}.sheet{display:block;width:100%;min-width:40rem;height:auto}
.sheet text{font-family:system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif;fill:var(--ink)}
.sheet .small{fill:var(--dim)}.sheet .axis{stroke:var(--line);stroke-width:.2}
.sheet .one{stroke:var(--ink);stroke-width:.3}.sheet .close{fill:var(--good);opacity:.13}
.sheet .far{fill:none;stroke:var(--ink);stroke-width:1.2}.sheet .between{stroke:var(--line);stroke-width:.15}
@page{size:A4 portrait;margin:10mm}
@media print{.kicker,footer{display:none}.sheet{width:190mm;min-width:0;print-color-adjust:exact;
-webkit-print-color-adjust:exact}.scroll{overflow:hidden}}"""


def poster_page(studies: Sequence[StudyStatus]) -> str:
    """``numbers.html``: every published number on one sheet of A4, in lines: it prints as large as wanted.

    Returns
    -------
    str
        HTML; it works with no study run.
    """
    way = '<a href="index.html">wildlab</a> › the published numbers'
    body = f'<h1 class="unseen">The published numbers at once</h1>{_sheet(studies)}'
    style = f"{ratios.STYLE}\n{_POSTER_STYLE}\n.unseen{{position:absolute;left:-99rem}}"
    made = datetime.now(UTC).strftime("%Y-%m-%d")
    footer = f"<p>Put together {made}. Print it on A4, or larger: it is drawn in lines.</p>"
    return page(title="The published numbers at once", body=body, kicker=way, footer=footer, style=style)


def _sheet(studies: Sequence[StudyStatus]) -> str:
    counts = counted(studies)
    rows = [(one, ratios.drawable(one.counted)) for one in studies if one.ran]
    rows = [(one, shown) for one, shown in rows if shown]
    if not rows:
        return f"<p>{counts.all} published numbers are kept here; no study of them was run yet.</p>"
    scale = 0.36
    width = (AXIS_END - NAMES_END) / scale
    notes = [line for said in _notes(counts) for line in textwrap.wrap(said, 118)]
    top, bottom = 42.0, SHEET_HIGH - 12 - 3.6 * len(notes)
    ranks = [ratios.levels_for(shown, width, 7) for _, shown in rows]
    levels = [max(one + 0.8, 2.2) for one in ranks]
    unit = min((bottom - top) / sum(levels), 5.2)
    parts = [_text(0, 10, "Published numbers of two theses, and ours", 6.4, weight=650)]
    lead = (
        " · ".join(f"{n} {words}" for n, words in _headline(counts)) if counts.of else "None is judged yet."
    )
    parts.append(_text(0, 18.5, lead, 3.6))
    parts.append(
        _text(
            0,
            25,
            "A mark is one number: ours divided by the published one, on one logarithmic axis.",
            3.4,
            dim=True,
        )
    )
    parts.append(_key([n for _, shown in rows for n in shown]))
    parts += [_tick_words(width, scale, y) for y in (top - 2.2, top + unit * sum(levels) + 4.4)]
    y = top
    for (one, shown), rank, tall in zip(rows, ranks, levels, strict=True):
        high = unit * tall
        middle = y + high / 2
        parts.append(_text(NAMES_END - 3, middle + 1.1, one.study.name.replace("-", " "), 3.1, anchor="end"))
        marks = ratios.arranged(shown, width, rank)
        squeeze = unit / (8.6 * scale)
        drawn = "".join(ratios.mark_svg(mark._replace(y=mark.y * squeeze), 0.0) for mark in marks)
        parts.append(
            f'<g transform="translate({NAMES_END} {y:.2f}) scale({scale})">'
            f"{ratios.backdrop(width, high / scale)}</g>"
            f'<g transform="translate({NAMES_END} {middle:.2f}) scale({scale})">{drawn}</g>'
        )
        parts.append(_text(AXIS_END + 3, middle + 1, verdict_words(one).word, 2.9))
        y += high
        parts.append(f'<path class="between" d="M0 {y:.2f}H{SHEET_WIDE}"/>')
    parts += [_text(0, bottom + 13 + 3.6 * k, line, 2.7, dim=True) for k, line in enumerate(notes)]
    alt = (
        f"A row of marks for each of {len(rows)} studies: ours divided by the published number. {lead} "
        "The same numbers stand in tables on the ledger's page."
    )
    return (
        '<div class="scroll" role="region" tabindex="0" aria-label="The sheet">'
        f'<svg class="sheet" viewBox="0 0 {SHEET_WIDE:g} {SHEET_HIGH:g}" role="img" '
        f'aria-label="{escape(alt)}">'
        f"{''.join(parts)}</svg></div>"
    )


def _words(one: StudyStatus) -> str:
    found = verdict_words(one)
    return f"{found.word}: {found.reason}"


def _key(numbers: Sequence[Number]) -> str:
    """The symbols and their words, in a row."""
    parts, x = [], 1.5
    for drawn, words in ratios.key_of(numbers):
        parts.append(f'<g transform="translate({x} 31.8) scale(.36)">{drawn}</g>')
        parts.append(_text(x + 3, 33, words, 3.0, dim=True))
        x += 7.5 + 1.55 * len(words)
    parts.append(f'<path class="close" d="M{x:.1f} 30h5v3.6h-5z"/>')
    parts.append(_text(x + 7, 33, f"factor {ratios.CLOSE:g}", 3.0, dim=True))
    return "".join(parts)


def _tick_words(width: float, scale: float, y: float) -> str:
    return "".join(
        _text(NAMES_END + ratios.place(ratio, width) * scale, y, words, 2.9, anchor="middle", dim=True)
        for ratio, words in ratios.TICKS.items()
    )


def _text(
    x: float,
    y: float,
    words: str,
    size: float,
    *,
    anchor: str = "start",
    dim: bool = False,
    weight: int = 400,
) -> str:
    small = ' class="small"' if dim else ""
    bold = f' font-weight="{weight}"' if weight != 400 else ""
    return (
        f'<text x="{x:.2f}" y="{y:.2f}" font-size="{size}" text-anchor="{anchor}"{small}{bold}>'
        f"{escape(words)}</text>"
    )
