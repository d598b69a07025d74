"""Text that is safe to put into a page: everything escaped, three marks allowed.

Names of flights, targets and columns come out of other people's logs. They reach a page through the functions
below and no other way, so that ``<script>`` in a target's name is a strange name and nothing more.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Sequence
from typing import Any

from wildlab.errors import WildlabError
from wildlab.names import visible

#: A number and its sign stay on one line.
_PERCENT = re.compile(r"(\d) %")
_BOLD = re.compile(r"\*\*(.+?)\*\*", re.S)
_CODE = re.compile(r"`([^`\n]+)`")
_MATHS = re.compile(r"(?<!\\)\$\$(.+?)\$\$|(?<!\\)\$([^$\n]+?)\$", re.S)
_MATHML_TAG = re.compile(r"</?m[a-z]+(?: [a-zA-Z:]+=\"[^\"<>]*\")*\s*/?>")

#: A number that is not known, and where one sentence ends and another begins.
_NAN, _SENTENCE = re.compile(r"(?<![\w-])nan(?![\w-])"), re.compile(r"(?<=[.!?])\s+(?=[^a-z])")
#: What a number that could not be computed looks like.
NOTHING = "–"


def escape(text: object) -> str:
    """``text`` with everything HTML gives a meaning to made harmless, quotes included."""
    return html.escape(visible(text), quote=True)


def inline(text: object) -> str:
    """Escaped ``text`` in which ``**bold**`` and a `````code````` span keep their meaning."""
    kept = _PERCENT.sub("\\1\N{NO-BREAK SPACE}%", escape(text))
    return _CODE.sub(_code, _BOLD.sub(r"<b>\1</b>", kept))


def _code(match: re.Match[str]) -> str:
    # A command broken at its hyphens reads wrong; a long one has to break somewhere on a phone.
    short = ' class="short"' if len(match[1]) <= 32 else ""
    return f"<code{short}>{match[1]}</code>"


def maths(latex: str, *, block: bool = False) -> str:
    """One LaTeX formula as MathML.

    Raises
    ------
    WildlabError
        If the formula is not understood: a page must not show half-translated LaTeX.
    """
    from latex2mathml.converter import convert  # few pages have formulas

    try:
        mathml = convert(latex.strip(), display="block" if block else "inline")
    except Exception as error:  # latex2mathml has a dozen exceptions of its own and raises IndexError too
        raise WildlabError(
            f"the formula {latex.strip()!r} cannot be translated ({type(error).__name__})",
            "use simpler LaTeX; check braces and \\left/\\right pairs",
        ) from error
    unknown = re.search(r"<m[a-z]+>(\\[A-Za-z]+)", mathml)
    if unknown:
        raise WildlabError(
            f"{unknown[1]} in the formula {latex.strip()!r} has no translation", "write it another way"
        )
    # The converter does not escape what stands in \\text{}.
    if re.search("[<>]", _MATHML_TAG.sub("", mathml)):
        raise WildlabError(f"the formula {latex.strip()!r} has a bare < or > in text", "use \\lt or \\gt")
    # What may scroll sideways must be reached without a mouse.
    box = 'class="scroll formula" role="group" tabindex="0" aria-label="Formula"'
    return f"<div {box}>{mathml}</div>" if block else mathml


def prose(text: str) -> str:
    """Paragraphs, split at blank lines, with the marks of `inline` and ``$maths$`` or ``$$maths$$``."""
    paragraphs = [part for part in re.split(r"\n\s*\n", text.strip()) if part.strip()]
    return "".join(_paragraph(part) for part in paragraphs)


def _paragraph(text: str) -> str:
    pieces: list[str] = []
    at = 0
    for match in _MATHS.finditer(text):
        pieces.append(inline(text[at : match.start()].replace("\\$", "$")))
        block, within = match.groups()
        # A formula on its own line may not stand inside <p>: close it and open it again.
        pieces.append(f"</p>{maths(block, block=True)}<p>" if block else maths(within))
        at = match.end()
    pieces.append(inline(text[at:].replace("\\$", "$")))
    return re.sub(r"<p>\s*</p>", "", f"<p>{''.join(pieces)}</p>")


def number(value: Any, digits: int | None = None) -> str:
    """A number as a reader wants it: a true minus sign, ``digits`` decimals, three figures if not told."""
    try:
        value = float(value)
    except (TypeError, ValueError):
        return NOTHING
    if math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if digits is None:
        magnitude = abs(value)
        if magnitude != 0 and not 1e-4 <= magnitude < 1e7:
            return f"{value:.2e}".replace("-", "−")
        digits = 0 if magnitude >= 100 else max(0, 2 - math.floor(math.log10(magnitude))) if magnitude else 0
    shown = f"{value:.{max(0, digits)}f}"
    if float(shown) == 0:
        shown = shown.lstrip("-")
    return shown.replace("-", "−")


def percent(share: float, digits: int = 1) -> str:
    """A share in per cent; with more digits where it would be rounded to all or to none.

    Parameters
    ----------
    share
        From 0 to 1; a mean count may be above.
    digits
        Behind the point.

    Returns
    -------
    str
        "nan %" where it is not known; see `known`.

    Examples
    --------
    >>> percent(0.9999), percent(1.0), percent(0.004, 0), percent(0.0004)
    ('99.99 %', '100 %', '0.4 %', '0.04 %')
    """
    if not math.isfinite(share):
        return "nan %"
    least = min(share, 1 - share)
    if least < 1e-9:
        return f"{100 * share:.0f} %"
    digits = max(digits, math.ceil(-math.log10(199 * least)))
    return f"{100 * share:.{digits}f} %"


def percent_between(share: Sequence[float], digits: int = 1) -> str:
    """A share in per cent with its interval, where it has one: estimate, low and high end, from 0 to 1.

    Examples
    --------
    >>> percent_between((0.5, 0.25, 0.75)), percent_between((0.5, math.nan, math.nan))
    ('50.0 % (25.0 % to 75.0 %)', '50.0 %')
    """
    estimate, low, high = (percent(one, digits) for one in share)
    return estimate if math.isnan(share[1]) or low == high else f"{estimate} ({low} to {high})"


def known(text: str) -> str:
    """``text`` without the sentences that give a number which is not known.

    Whatever a page says goes through this: Python writes NaN as "nan", and what has one in it says nothing.

    Examples
    --------
    >>> known("It is 3.0 m off. By 2 flights it is nan m. Two are left.")
    'It is 3.0 m off. Two are left.'
    """
    if not _NAN.search(text):
        return text
    return " ".join(one for one in _SENTENCE.split(text) if not _NAN.search(one))


def slug(text: str) -> str:
    """Letters, digits and hyphens only: for the names of files and the ids of headings."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "part"


def metres(value: float, low: float | None = None, high: float | None = None) -> str:
    """``4.3 m``, or with its interval ``4.3 m (3.9 to 4.8)``."""
    digits = 1 if not abs(value) < 0.95 else 2
    if low is None or high is None or not math.isfinite(low + high):
        return f"{value:.{digits}f} m"
    return f"{value:.{digits}f} m ({low:.{digits}f} to {high:.{digits}f})"
