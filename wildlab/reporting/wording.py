"""A report in the words of its catalogue: messages, captions and tables, with the numbers recorded so far."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd
from matplotlib import rcParams
from matplotlib.figure import Figure

from wildlab.messages.message import Message
from wildlab.messages.page_texts import PageTexts, fill
from wildlab.reporting.report import Report

_FIGURE = re.compile(r"fig-([0-9a-c])-([0-9]+[a-z]?)")


class Wording:
    """The texts of a page, for its report.

    Parameters
    ----------
    report
        Is added to; its recorded numbers stand for placeholders ``{subject/name}``.
    texts
        Of the page.
    values
        For placeholders without a subject, on the whole page.
    thesis
        Whose figures the figures' names number: "H" or "F".
    """

    def __init__(
        self, report: Report, texts: PageTexts, values: Mapping[str, Any] | None = None, thesis: str = "H"
    ) -> None:
        self.report, self.texts, self.values, self.thesis = report, texts, dict(values or {}), thesis

    def say(self, text: str, values: Mapping[str, Any] | None = None) -> str:
        """A text with its numbers."""
        return fill(text, self.report.recorded, self.values | dict(values or {}))

    def messages(self, messages: Iterable[Message]) -> list[str]:
        """The sentences of the catalogue for some messages.

        Raises
        ------
        KeyError
            If one has no text, or a placeholder no value: a fault of ours.
        """
        return [self.say(self.texts.answers[one.key], one.values) for one in messages]

    def captioned(self, key: str, fig: Figure, name: str = "") -> tuple[Figure, str, str, str]:
        """A figure with its file's name (the key where empty), alt text and caption; its title is set."""
        text, name = self.texts.figures[key], name or key
        if text.title:
            # Over the whole figure: beside long names on an axis there is no room for it above the axes.
            look = {"fontsize": rcParams["axes.titlesize"], "fontweight": rcParams["axes.titleweight"]}
            fig.suptitle(self.say(text.title), x=0.01, ha="left", **look)
        caption = f"{self.say(text.caption)} {counterpart(name, self.thesis)}".strip()
        return fig, name, self.say(text.alt), caption

    def figure(self, key: str, fig: Figure, name: str = "", *, main: bool = False) -> None:
        """Show a figure; ``main`` for the page's own."""
        fig, name, alt, caption = self.captioned(key, fig, name)
        self.report.figure(fig, name=name, alt=alt, caption=caption, main=main)

    def table(self, key: str, frame: pd.DataFrame, values: Mapping[str, Any] | None = None) -> None:
        """Show a table: in sight under its title, or folded away behind it."""
        text = self.texts.tables[key]
        title, caption = self.say(text.title, values), self.say(text.caption, values)
        columns = {name: self.say(heading, values) for name, heading in text.columns.items()} or None
        if text.open:
            self.report.section(title)
        self.report.table(
            frame,
            columns=columns,
            digits=text.digits or None,
            caption=caption,
            fold="" if text.open else title,
        )


def counterpart(name: str, thesis: str) -> str:
    """The figure of a thesis that a file of that name answers to, as the end of a caption.

    Examples
    --------
    >>> counterpart("fig-7-19a", "H"), counterpart("fig-b-02", "F"), counterpart("track-map", "H")
    ('H figure 7.19a.', 'F figure B.2.', '')
    """
    found = _FIGURE.fullmatch(name)
    return f"{thesis} figure {found[1].upper()}.{found[2].lstrip('0')}." if found else ""
