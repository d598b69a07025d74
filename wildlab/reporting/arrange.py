"""The one order of a report: what a reader came for first, doubts before details, the method last.

A notebook shows its parts in the order in which it computes them. A page has them in this one: title, answer
and verdict, alerts, the main picture, the numbers to remember, what to do, what the report does not tell,
then the sections with their figures, and how it was computed. Parts say what they are by ``data-part``, which
`wildlab.reporting.report` writes and which is taken off here.
"""

from __future__ import annotations

import re

from bs4 import BeautifulSoup, Tag
from bs4.element import NavigableString, PageElement

#: What a heading or a block may say it is, in the order of the page; "" is a section like any other.
HEAD, SUMMARY, ALERT, MAIN, TILES, OPENING, ADVICE, LIMITS, SECTION, METHOD = (
    "head",
    "summary",
    "alert",
    "main",
    "tiles",
    "opening",
    "advice",
    "limits",
    "",
    "method",
)
ORDER = (HEAD, SUMMARY, ALERT, MAIN, TILES, OPENING, ADVICE, LIMITS, SECTION, METHOD)
#: The verdict is shown when all numbers are there, and read in the summary.
VERDICT = "verdict"
_LEVELS = {"good", "warn", "bad", "neutral"}


def arranged(body: str) -> str:
    """The parts of a report in the order of a page.

    Parameters
    ----------
    body
        HTML as a notebook showed it, one part after the other.

    Returns
    -------
    str
        HTML. Where there is no ``<header>``, nothing is moved: it is no report.
    """
    soup = BeautifulSoup(body, "html.parser")
    if soup.header is None:
        return body
    groups: dict[str, list[PageElement]] = {part: [] for part in ORDER}
    verdicts: list[Tag] = []
    at = HEAD
    for node in list(soup.contents):
        node.extract()
        if not isinstance(node, Tag):
            if not isinstance(node, NavigableString) or node.strip():
                groups[OPENING if at == HEAD else at].append(node)
            continue
        part = _part_of(node)
        if part == VERDICT:
            verdicts.append(node)
        elif part is None:
            groups[OPENING if at == HEAD else at].append(node)
        elif part in (HEAD, SUMMARY, TILES, METHOD) or node.name != "h2":
            groups[part].append(node)
        else:
            at = part
            groups[part].append(node)
    _judge(groups[SUMMARY], verdicts)
    groups[MAIN] = [*groups[MAIN], *_main_picture(groups)]
    whole = BeautifulSoup("", "html.parser")
    for part in ORDER:
        for node in groups[part]:
            whole.append(node)
    for marked in whole.select("[data-part]"):
        del marked["data-part"]
    _drop_bare_headings(whole)
    _number_figures(whole)
    return re.sub(r"\n\s*\n+", "\n", str(whole)).strip()


def _part_of(node: Tag) -> str | None:
    """What a block is; None for one that belongs to the section it stands in."""
    said = node.get("data-part")
    if said is not None:
        return str(said)
    if node.name == "header":
        return HEAD
    classes = _classes(node)
    if "summary" in classes:
        return SUMMARY
    if "look" in classes:
        return ALERT
    if "tiles" in classes:
        return TILES
    return SECTION if node.name == "h2" else None


def _classes(node: Tag) -> list[str]:
    found = node.get("class") or ""
    return found.split() if isinstance(found, str) else list(found)


def _judge(summaries: list[PageElement], verdicts: list[Tag]) -> None:
    """Put the last verdict into the summary, and give its bar the colour that goes with the word."""
    boxes = [one for one in summaries if isinstance(one, Tag)]
    if not boxes or not verdicts:
        return
    box, last = boxes[0], verdicts[-1]
    level = str(last.get("data-level") or "neutral")
    del last["data-level"]
    box["class"] = " ".join([*(name for name in _classes(box) if name not in _LEVELS), level])
    box.append(last)


def _main_picture(groups: dict[str, list[PageElement]]) -> list[Tag]:
    """The figure that stands first: the one marked so, else the first that is not folded away."""
    blocks = [one for part in (OPENING, ADVICE, SECTION) for one in groups[part] if isinstance(one, Tag)]
    figures = [figure for block in blocks for figure in _pictures(block)]
    chosen = next((one for one in figures if one.get("data-main") is not None), None)
    if chosen is None:
        chosen = figures[0] if figures else None
    for figure in figures:
        if figure.get("data-main") is not None:
            del figure["data-main"]
    if chosen is None:
        return []
    row = chosen.parent
    for part in (OPENING, ADVICE, SECTION):
        # A figure alone in its block is the block.
        if any(one is chosen for one in groups[part]):
            groups[part] = [one for one in groups[part] if one is not chosen]
    chosen.extract()
    if isinstance(row, Tag) and row.name == "div" and not row.find("figure"):
        for part in (OPENING, ADVICE, SECTION):
            groups[part] = [one for one in groups[part] if one is not row]
    return [chosen]


def _pictures(block: Tag) -> list[Tag]:
    if block.name == "figure":
        return [block] if block.find("img") else []
    return [one for one in block.find_all("figure") if one.find("img") and not one.find_parent("details")]


def _drop_bare_headings(whole: BeautifulSoup) -> None:
    """Headings of sections whose only figure stands above now, and which say nothing besides."""
    for heading in whole.find_all(["h2", "h3"]):
        after = heading.find_next_sibling()
        closes = after is None or after.name == "h2" or (after.name == "h3" and heading.name == "h3")
        if closes or (after is not None and after.name == "details" and "method" in _classes(after)):
            heading.decompose()


def _number_figures(whole: BeautifulSoup) -> None:
    """Count figures as they now stand; tables keep their numbers, for they keep their order."""
    figures = [one for one in whole.find_all("figure") if one.find("img")]
    for ordinal, figure in enumerate(figures, start=1):
        box = figure.find("div", class_="scroll")
        if isinstance(box, Tag) and str(box.get("aria-label", "")).startswith("Figure "):
            box["aria-label"] = f"Figure {ordinal}"
        label = figure.select_one("figcaption > b")
        if label is not None and re.fullmatch(r"Figure \d+\.", label.get_text()):
            label.string = f"Figure {ordinal}."
