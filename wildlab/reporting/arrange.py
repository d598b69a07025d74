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
ORDER = HEAD, SUMMARY, ALERT, MAIN, TILES, OPENING, ADVICE, LIMITS, SECTION, METHOD = (
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
#: The verdict is shown when all numbers are there, and read in the summary.
VERDICT = "verdict"
_LEVELS = {"good", "warn", "bad", "neutral"}
#: What a block is by its class, where it does not say it.
_BY_CLASS = {"summary": SUMMARY, "look": ALERT, "tiles": TILES}


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
    arrange_parts(soup)
    return re.sub(r"\n\s*\n+", "\n", str(soup)).strip()


def arrange_parts(soup: BeautifulSoup) -> None:
    """Put the parts of a report in the order of a page; see `arranged`."""
    if soup.header is None:
        return
    groups: dict[str, list[PageElement]] = {part: [] for part in (*ORDER, VERDICT)}
    at = OPENING
    for node in list(soup.contents):
        node.extract()
        if isinstance(node, NavigableString) and not node.strip():
            continue
        part = _part_of(node) if isinstance(node, Tag) else None
        if part is not None and isinstance(node, Tag) and node.name == "h2":
            at = part
        groups[at if part is None else part].append(node)
    soup.extend(node for part in ORDER for node in groups[part])
    _put_first(soup, _main_picture([one for part in (OPENING, ADVICE, SECTION) for one in groups[part]]))
    _judge(groups[SUMMARY], groups[VERDICT])
    for marked in soup.select("[data-part], [data-main]"):
        del marked["data-part"], marked["data-main"]
    _drop_bare_headings(soup)
    _number_figures(soup)


def _part_of(node: Tag) -> str | None:
    """What a block is; None for one that belongs to the section it stands in."""
    said = node.get("data-part")
    if said is not None:
        return str(said)
    by_class = [_BY_CLASS[name] for name in node.get_attribute_list("class") if name in _BY_CLASS]
    return HEAD if node.name == "header" else SECTION if node.name == "h2" else next(iter(by_class), None)


def _judge(summaries: list[PageElement], verdicts: list[PageElement]) -> None:
    """Put the last verdict into the summary, and give its bar the colour that goes with the word."""
    box = next((one for one in summaries if isinstance(one, Tag)), None)
    last = verdicts[-1] if verdicts else None
    if box is None or not isinstance(last, Tag):
        return
    level = str(last.attrs.pop("data-level", "neutral"))
    classes = [str(name) for name in box.get_attribute_list("class") if name not in _LEVELS]
    box["class"] = " ".join([*classes, level])
    box.append(last)


def _main_picture(blocks: list[PageElement]) -> Tag | None:
    """The figure that stands first: the one marked so, else the first that is not folded away."""
    figures = [
        one
        for block in blocks
        if isinstance(block, Tag)
        for one in ([block] if block.name == "figure" else block.find_all("figure"))
        if one.find("img") and not one.find_parent("details")
    ]
    marked = [one for one in figures if one.get("data-main") is not None]
    return next(iter(marked or figures), None)


def _put_first(soup: BeautifulSoup, chosen: Tag | None) -> None:
    """Put the main picture below summary and alerts, and take away the row that it alone stood in."""
    if chosen is None:
        return
    row = chosen.parent
    chosen.extract()
    if row is not None and row.name == "div" and not row.find("figure"):
        row.extract()
    above = [one for one in soup.find_all(recursive=False) if _part_of(one) in (HEAD, SUMMARY, ALERT)]
    above[-1].insert_after(chosen)


def _drop_bare_headings(soup: BeautifulSoup) -> None:
    """Headings of sections whose only figure stands above now, and which say nothing besides."""
    for heading in soup.find_all(["h2", "h3"]):
        after = heading.find_next_sibling()
        if (
            after is None
            or after.name == "h2"
            or (after.name == "h3" and heading.name == "h3")
            or (after.name == "details" and "method" in after.get_attribute_list("class"))
        ):
            heading.decompose()


def _number_figures(soup: BeautifulSoup) -> None:
    """Count figures as they now stand; tables keep their numbers, for they keep their order."""
    figures = [one for one in soup.find_all("figure") if one.find("img")]
    for ordinal, figure in enumerate(figures, start=1):
        box = figure.find("div", class_="scroll")
        if isinstance(box, Tag) and str(box.get("aria-label", "")).startswith("Figure "):
            box["aria-label"] = f"Figure {ordinal}"
        label = figure.select_one("figcaption > b")
        if label is not None and re.fullmatch(r"Figure \d+\.", label.get_text()):
            label.string = f"Figure {ordinal}."
