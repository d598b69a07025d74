"""Tables of the ledger: published numbers beside ours, all on one axis, and claims with their intervals."""

from __future__ import annotations

import math

from wildlab.evaluation.replication import Closeness, Compatibility
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, UNDECIDED
from wildlab.reporting.counts import tally
from wildlab.reporting.published import CALCULATED, SHARE_OF_IMAGES
from wildlab.reporting.spread import MANY, spread_key
from wildlab.reporting.status import FIRST_LOOK, MISSING, Claim, Number, StudyStatus
from wildlab.reporting.text import NOTHING, escape, number

#: A longer table is folded away behind a line that sums it up.
LONGEST_TABLE = 12
#: Answers and verdicts, and the colour of each: for, in part, against; what is not here decides nothing.
PILLS = {
    Closeness.CLOSE: "yes",
    Closeness.NOT_CLOSE: "no",
    Compatibility.WITHIN: "yes",
    Compatibility.OUTSIDE: "no",
    HOLDS: "yes",
    MOSTLY: "part",
    UNDECIDED: "part",
    MOSTLY_NOT: "no",
    FAILS: "no",
    FIRST_LOOK: "part",
}
#: The axis of every strip: ratios to the printed number from 1/8 to 8, logarithmic, and its width in pixels.
WIDEST, WIDTH = 8.0, 160.0
_MARGIN = 8.0


def numbers_table(one: StudyStatus) -> str:
    """The published numbers of a study beside ours; nothing where there are none."""
    if not one.numbers:
        return ""
    ran = one.ran
    head = ["quantity", "published"]
    if ran:
        head += ["here", "ratio, or difference", _strip_heading(one), "flights below", "close? within 90 %?"]
    heads = "".join(
        f'<th scope="col"{_text(i == 0)}>{h}</th>' if h else '<td class="text"></td>'
        for i, h in enumerate(head)
    )
    rows = "".join(_row(n, ran=ran) for n in one.numbers)
    label = escape(f"Published numbers of {one.study.name}")
    table = (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{label}"><table>'
        f"<thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
    )
    if not ran or len(one.numbers) > LONGEST_TABLE:
        return f'<details class="plain"><summary>{summed_up(one)}</summary>{table}</details>'
    return f"<p>{summed_up(one)}</p>{table}"


def summed_up(one: StudyStatus) -> str:
    """The verdicts of a study's numbers in a line."""
    count = len(one.counted)
    numbers = f"{count} published number{'s' * (count > 1)}"
    if one.state == FIRST_LOOK:
        return f"{numbers} beside a first look"
    if one.state != "done":
        return f"{numbers} waiting for it"
    fitted = [n for n in one.counted if n.fitted]
    parts = [tally(n for n in one.counted if not n.fitted).words]
    parts += [f"{len(fitted)} fitted: {tally(fitted).words}"] if fitted else []
    again = len(one.numbers) - count
    parts += [f"{again} more, not counted again"] if again else []
    return f"{numbers}: {'; '.join(part for part in parts if part)}"


def _strip_heading(one: StudyStatus) -> str:
    over = f"{one.seeds} {flights_of(one)}" if one.seeds and one.seeds > 1 else "here"
    fewest = min((n.over for n in one.numbers if n.over is not None), default=MANY)
    band = f'<i class="band"></i>{spread_key(fewest)}' if any(has_band(n) for n in one.numbers) else ""
    return (
        f'{over}, as ratio to the print <span class="key"><i class="full"></i>here{band}'
        '<i class="hollow"></i>print</span>'
    )


def flights_of(one: StudyStatus) -> str:
    """What a study is computed over: simulated flights, or runs that fly nothing."""
    return "runs" if one.study.kind == "computed" else "flights"


def has_band(n: Number) -> bool:
    # Of a share of images the bounds are those of its interval, of a calculation those of rounded inputs.
    return n.low is not None and n.high is not None and n.kind not in (SHARE_OF_IMAGES, CALCULATED)


def _row(n: Number, *, ran: bool) -> str:
    size = ", by size" if n.by_size else ""
    quantity = f"{escape(n.name.replace('_', ' '))}{size}, {escape(n.subject)}"
    unit = f" {escape(n.unit)}" if n.unit else ""
    cells = [
        f'<th scope="row" class="text">{quantity} <span class="dim source">{escape(n.source)}</span></th>',
        f"<td>{number(n.published, n.digits)}{unit}</td>",
    ]
    if ran and n.here is None:
        reason = f" ({escape(n.reason)})" if n.reason else ""
        return f'<tr>{"".join(cells)}<td colspan="5" class="text dim">{MISSING}{reason}</td></tr>'
    if ran:
        below = NOTHING if n.below is None else f"{100 * n.below:.0f} %"
        cells += [
            f"<td>{number(n.here, n.digits + 1)}{unit}</td>",
            f"<td>{_ratio(n, unit)}</td>",
            f"<td>{strip(n)}</td>",
            f"<td>{below}</td>",
            f'<td class="text">{_answers(n)} <span class="dim">{escape(_why(n))}</span></td>',
        ]
    return f"<tr>{''.join(cells)}</tr>"


def _ratio(n: Number, unit: str) -> str:
    if n.ratio is not None or n.here is None:
        return number(n.ratio, 2)
    off = n.here - n.published
    return f"{'+' if off > 0 else '−' if off < 0 else ''}{number(abs(off), n.digits + 1)}{unit}"


def _answers(n: Number) -> str:
    """Both answers, or once what a number waits for; what is not asked of it is left out."""
    near, inside = n.answers
    return (
        " ".join(_pill(one) for one in (near, inside) if one != "not judged")
        if near != inside
        else _pill(near)
    )


def _why(n: Number) -> str:
    """What the answers rest on, and whether the number is fitted or counted elsewhere."""
    parts = ["fitted: " + n.fitted if n.fitted else "", n.reason, "counted once" if n.again else ""]
    return "; ".join(part for part in parts if part)


def _pill(verdict: str) -> str:
    return f'<span class="pill {PILLS.get(verdict, "")}">{escape(verdict)}</span>'


def place(ratio: float) -> float:
    """Where a ratio lies on the axis of every strip, pixels; what lies beyond its ends is put at them."""
    share = (math.log(ratio) / math.log(WIDEST) + 1) / 2 if ratio > 0 else 0.0
    return _MARGIN + min(max(share, 0.0), 1.0) * (WIDTH - 2 * _MARGIN)


def strip(n: Number) -> str:
    """Ours as a ratio to the printed number, on the axis that all numbers share: ours filled, the printed
    number hollow and in the middle, the spread over flights a band. An arrow stands for what lies beyond."""
    if n.ratio is None or n.published <= 0:
        return NOTHING
    words = [
        f"published {number(n.published, n.digits)}",
        f"here {number(n.here, n.digits + 1)}",
        f"ratio {n.ratio:.2f}",
    ]
    middle = WIDTH / 2
    parts = [
        f'<line x1="4" x2="{WIDTH - 4:.0f}" y1="9" y2="9" stroke="#dce1e6"/>',
        *(
            f'<line x1="{place(r):.1f}" x2="{place(r):.1f}" y1="6" y2="12" stroke="#b9c2cb"/>'
            for r in (0.25, 0.5, 2, 4)
        ),
    ]
    if has_band(n):
        low, high = n.low / n.published, n.high / n.published  # type: ignore[operator]
        left, right = place(low), place(high)
        parts.append(
            f'<rect x="{left:.1f}" y="6" width="{max(2.0, right - left):.1f}" height="6" rx="3" '
            'fill="#9cc7e0"/>'
        )
        bounds = spread_key(n.over or MANY).replace("%", "percent")
        words.append(f"{bounds} {number(n.low, n.digits + 1)} to {number(n.high, n.digits + 1)}")
    parts.append(
        f'<circle cx="{middle:.1f}" cy="9" r="4.6" fill="none" stroke="#18222d" stroke-width="1.6"/>'
    )
    at = place(n.ratio)
    if 1 / WIDEST <= n.ratio <= WIDEST:
        parts.append(f'<circle cx="{at:.1f}" cy="9" r="4" fill="#0072b2"/>')
    else:
        tip, back = (3.0, 12.0) if n.ratio < 1 else (WIDTH - 3, WIDTH - 12)
        parts.append(f'<path d="M{tip} 9 L{back} 4 V14 Z" fill="#0072b2"/>')
    return (
        f'<svg width="{WIDTH:.0f}" height="18" viewBox="0 0 {WIDTH:.0f} 18" role="img" '
        f'aria-label="{escape(", ".join(words))}">{"".join(parts)}</svg>'
    )


def claims_table(claims: list[Claim], flights: str = "flights", study: str = "") -> str:
    """Claims of a study, the verdict on each, and on how many flights it is true; "" where there are none."""
    if not claims:
        return ""
    label = escape(f"Claims of {study}" if study else "Claims")
    rows = []
    for one in claims:
        source = f' <span class="dim source">{escape(one.source)}</span>' if one.source else ""
        own = ' <span class="dim">(ours, not the thesis\'s)</span>' if one.own else ""
        rows.append(
            # The verdict stands beside the claim: on a phone the last column may be out of sight.
            f'<tr><th scope="row" class="text wide">{escape(one.text)}{own}{source}</th>'
            f'<td class="text">{_pill(one.verdict)}</td><td>{_tested_on(one, flights)}</td></tr>'
        )
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{label}"><table><thead><tr>'
        '<th scope="col" class="text">claim</th><th scope="col" class="text">verdict</th>'
        f'<th scope="col">true on</th></tr></thead><tbody>{"".join(rows)}</tbody></table></div>'
    )


def _tested_on(one: Claim, flights: str) -> str:
    if one.fraction is None:
        return f"{one.met} of {one.seeds} {flights} meet the premise" if one.met is not None else ""
    share = f"{100 * one.fraction:.0f} %"
    if one.low is not None and one.high is not None:
        share += f" ({100 * one.low:.0f} to {100 * one.high:.0f})"
    of = one.seeds if one.met is None else one.met
    if of is None:
        return f"{share} of {flights}"
    beyond = f" that meet the premise, of {one.seeds}" if one.seeds and of < one.seeds else ""
    return f"{share} of {of} {flights}{beyond}"


def _text(yes: bool) -> str:
    return ' class="text"' if yes else ""
