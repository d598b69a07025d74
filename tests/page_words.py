"""How many words of a page are in sight: tables, formulas and what is folded away left out."""

from __future__ import annotations

from pathlib import Path

from bs4 import BeautifulSoup

#: A page in sight, and its answer box.
MOST_WORDS, MOST_IN_ANSWER = 700, 75
_OUT = ("head", "script", "style", "svg", "math", "table", "details")


def words_in_sight(page: Path) -> tuple[int, int]:
    """Words of the page, and of its answer with verdict."""
    soup = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser")
    for left_out in soup.find_all(_OUT):
        left_out.decompose()
    answer = soup.find("section", class_="summary")
    return len(soup.get_text(" ").split()), 0 if answer is None else len(answer.get_text(" ").split())
