"""`Report`: what a notebook writes its report with.

Each method shows one part of the page as HTML and collects the numbers for ``metrics.json``. What gives a
number that is not known is left out (`wildlab.messages.quantities.known`). All text is escaped; ``**bold**``
and a code span in backquotes are the only marks::

    report = open_report(study=study, kind="twin", flight=flight, seed=seed, out=out)
    report.head("How far off is a position read from one photo?", "29 photos from 55 m")
    report.summary(["Typically 2 metres.", "Over many photos the errors cancel.", "The pose is the limit."])
    report.tiles([("2.9 m", "mean error")])
    report.section("What most limits it")
    report.figure(fig, name="fig-5-04a", alt="Scatter of 103 errors ...", caption="Error of every click.")
    report.metric("horizontal_error_mean", "logged-pose", 2.92, "m", n=103)
    report.save()

Words come out of the page's catalogue by `Wording`, with the numbers recorded so far.
"""

from __future__ import annotations

import base64
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib import rcParams
from matplotlib.figure import Figure

from wildlab.analysis.verdict import VERDICT_LEVEL, Verdict
from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.messages.catalogue import Message, PageTexts, fill
from wildlab.messages.quantities import known
from wildlab.reporting import metrics as schema
from wildlab.reporting.figures import figure_html, png_bytes, save_figure
from wildlab.reporting.notebook_pages import ALERT, LIMITS, METHOD, VERDICT
from wildlab.reporting.published import (
    Standing,
    compared_number,
    judge,
    load_claims,
    published_rows,
    standing,
)
from wildlab.reporting.published_tables import LONGEST, caption_of, claims_table, published_table
from wildlab.reporting.text import PILLS, TAGS, csv_link, escape, inline, prose, slug, table_html

#: What is said where no number is known that anything could be said by.
NOTHING_KNOWN = "Not known: there are too few observations."
#: Points of an alert that are shown at once: what comes below must not leave the screen.
ALERTS_SHOWN = 3
#: Rows in sight of a table that has more than so many; the others are folded.
ROWS_SHOWN, WHOLE = 9, 24
_FILE_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


def open_report(
    *,
    study: str,
    kind: str,
    flight: str = "",
    seed: int | None = None,
    seeds: int | None = None,
    out: str = "",
) -> Report:
    """Begin a report.

    Parameters
    ----------
    study
        Its name.
    kind
        ``analytic``, ``twin`` or ``logged``.
    flight
        The flight's name, or its folder, of which only the last part is shown.
    seed
        Of whatever is drawn at random.
    seeds
        How many simulated flights the numbers come from, where it is more than one.
    out
        Folder for ``metrics.json`` and ``figures/``; "" (a notebook opened by hand) writes nothing.

    Returns
    -------
    Report

    Raises
    ------
    WildlabError
        If there is no such kind.
    """
    if kind not in TAGS:
        raise WildlabError(f"the kind {kind!r} is unknown", f"use one of: {', '.join(TAGS)}", field="kind")
    return Report(
        study=study,
        flight=Path(flight).name if flight else "",
        kind=kind,
        seed=seed,
        seeds=seeds,
        out=Path(out) if out else None,
    )


class Report:
    """A report in the making; see the module. Make one with `open_report`."""

    def __init__(
        self, *, study: str, flight: str, kind: str, seed: int | None, seeds: int | None, out: Path | None
    ) -> None:
        self.study, self.flight, self.kind = study, flight, kind
        self.seed, self.seeds, self.out = seed, seeds, out
        #: The HTML of every part shown so far, in order.
        self.parts: list[str] = []
        self._metrics: list[dict[str, Any]] = []
        self._claims: list[dict[str, Any]] = []
        self._figures: set[str] = set()
        self._tables = 0
        self._judged = False
        self._published = {(row["name"], row["subject"]): row for row in published_rows(study)}

    # -- the parts of a page
    # ------------------------------------------------------------------------------------

    def head(self, title: str, subtitle: str = "") -> None:
        """``<h1>``, and below it what is shown: flight, logged or simulated, ``subtitle``."""
        # A flight that is called so, as in copies for others, has no name.
        named = self.flight not in ("", "flight")
        about = f"Flight <b>{escape(self.flight)}</b> " if named else ""
        tag = f'<span class="tag {self.kind}">{TAGS[self.kind]}</span>'
        self._show(
            f"<header><h1>{inline(title)}</h1>", f'<p class="sub">{about}{tag}{inline(subtitle)}</p></header>'
        )

    def summary(
        self, sentences: Sequence[str], level: str = "neutral", verdict: tuple[str, str] | None = None
    ) -> None:
        """The plain-language summary, three sentences at best; the first is set bold.

        Parameters
        ----------
        sentences
            The answer first.
        level
            The colour of the bar: "good", "warn", "bad" or "neutral".
        verdict
            The word that the colour means, and its reason in a sentence. Without one, `save` says how the
            numbers and claims of the study stand to the printed ones.
        """
        first, *others = [inline(one) for one in map(known, sentences) if one] or [NOTHING_KNOWN]
        text = " ".join([f"<b>{first.replace('<b>', '').replace('</b>', '')}</b>", *others])
        self._show(f'<section class="summary {level}" aria-label="Summary"><p>{text}</p></section>')
        self._judged = verdict is not None
        if verdict is not None:
            self._verdict(*verdict, level)

    def alert(self, title: str, points: Sequence[str]) -> None:
        """What must be known before anything else; beyond `ALERTS_SHOWN` points, the others are folded."""
        points = [one for one in map(known, points) if one]
        first, others = points[:ALERTS_SHOWN], points[ALERTS_SHOWN:]
        html = f"<p><b>{inline(title)}</b></p>{_list(first)}"
        if others:
            html += f"<details><summary>{len(others)} more</summary>{_list(others)}</details>"
        label = f'aria-label="{escape(title)}"'
        self._show(f'<section class="alert" data-part="{ALERT}" {label}>{html}</section>')

    def tiles(self, tiles: Sequence[tuple[str, str]]) -> None:
        """The few numbers to remember: ``[("2.9 m", "mean error"), ...]``."""
        items = [
            f"<li><b>{inline(value)}</b><span>{inline(label)}</span></li>"
            for value, label in tiles
            if known(value) and known(label)
        ]
        if items:
            self._show(f'<ul class="tiles">{"".join(items)}</ul>')

    def section(self, title: str, intro: str = "", part: str = "") -> None:
        """``<h2>`` and, if given, a paragraph. ``part`` is one of `wildlab.reporting.notebook_pages.ORDER`:
        what to do (`ADVICE`) stands before all other sections, wherever it was shown."""
        marked = f' data-part="{part}"' if part else ""
        heading = f'<h2 id="{slug(title)}"{marked}>{inline(title)}</h2>'
        intro = known(intro)
        self._show(heading, f"<p>{inline(intro)}</p>" if intro else "")

    def text(self, paragraphs: str) -> None:
        """Paragraphs, split at blank lines, with ``$latex$`` set as maths. Not for text out of data."""
        self._show(prose(known(paragraphs)))

    def points(self, points: Iterable[str], *, ordered: bool = False) -> None:
        """A list."""
        self._show(_list(points, "ol" if ordered else "ul"))

    def figure(self, fig: Figure, *, name: str, alt: str, caption: str = "", main: bool = False) -> None:
        """Show a figure, and write it as ``figures/<name>.pdf`` and ``.png``.

        Parameters
        ----------
        name
            The thesis figure it answers to (``fig-5-04a``), or what it shows.
        alt
            What a reader who cannot see it should know; never empty.
        main
            Whether it is the page's main picture, which stands right below the summary: show it first.
        """
        self._show(self._figure(fig, name, alt, caption, main=main))

    def figures(self, row: Sequence[tuple[Figure, str, str, str]], *, fold: str = "") -> None:
        """Several ``(fig, name, alt, caption)`` side by side, or one below the other on a phone.

        ``fold`` is the one-line summary behind which they are folded away, where they are.
        """
        html = f'<div class="row">{"".join(self._figure(*item) for item in row)}</div>'
        self._show(f"<details><summary>{inline(fold)}</summary>{html}</details>" if fold else html)

    def picture(self, data: bytes, *, alt: str, caption: str, wide: bool = False) -> None:
        """Show a JPEG; ``wide`` where many small things stand side by side, which a phone can move past."""
        encoded = base64.b64encode(data).decode("ascii")
        style = ' style="min-width:44rem"' if wide else ""
        html = f'<img alt="{escape(alt)}"{style} src="data:image/jpeg;base64,{encoded}">'
        if wide:
            html = f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(alt)}">{html}</div>'
        self._show(f"<figure>{html}<figcaption>{escape(caption)}</figcaption></figure>")

    def table(
        self,
        frame: pd.DataFrame,
        *,
        caption: str = "",
        columns: Mapping[str, str] | None = None,
        digits: Mapping[str, int] | int | None = None,
        fold: str = "",
    ) -> None:
        """A table without its index: numbers to the right, text to the left; the first rows of a long one.

        Parameters
        ----------
        columns
            Headings by column name; where given, only these columns are shown, in this order.
        digits
            Decimals by column name, or for all; three figures otherwise.
        fold
            For long tables: the one-line summary behind which the table is folded away.
        """
        if columns is not None:
            missing = [name for name in columns if name not in frame]
            if missing:
                raise WildlabError(
                    f"the table has no column {missing[0]!r}", f"it has: {', '.join(map(str, frame))}"
                )
            frame = frame[list(columns)]
        self._tables += 1
        name, caption = f"Table {self._tables}", known(caption)
        # A table behind a fold is whole.
        shown = len(frame) if fold or len(frame) <= WHOLE else ROWS_SHOWN
        about: tuple[Any, ...] = (columns or {}, digits, caption or fold or name)
        body = str(table_html(frame[:shown], *about))
        if len(frame) > shown:
            rest = f"<summary>{len(frame) - shown} more rows</summary>{table_html(frame[shown:], *about)}"
            body += f'<details class="plain">{rest}</details>'
        label = f"<b>{name}.</b> {inline(caption)}" if caption else ""
        if link := csv_link(frame, f"{self.study}-table-{self._tables}", f"{name} as CSV"):
            label += f' <span class="get">{link}</span>'
        html = f'<figure class="table">{body}'
        html += f"<figcaption>{label}</figcaption></figure>" if label else "</figure>"
        self._show(f"<details><summary>{inline(fold)}</summary>{html}</details>" if fold else html)

    def published(self, title: str, subjects: Mapping[str, str], quantities: Mapping[str, str]) -> None:
        """The section of the published numbers beside those recorded so far; nothing where there are none.

        Parameters
        ----------
        title
            Of the section.
        subjects, quantities
            Words for the numbers' subjects and names.
        """
        recorded = self.recorded
        rows = list(self._published.values())
        numbers = [compared_number(row, recorded, self.seeds, self.kind) for row in rows]
        if not numbers:
            return
        about = f"<figcaption>{inline(caption_of(numbers))}</figcaption>"
        table = published_table(numbers, subjects, quantities)
        html = f'<figure class="table">{table}{about}</figure>'
        self.section(title)
        if len(numbers) > LONGEST:
            summary = f"{len(numbers)} published numbers beside ours"
            html = f'<details class="plain"><summary>{summary}</summary>{html}</details>'
        self._show(html)

    def claims_in_sight(self, title: str, effects: Mapping[str, tuple[str, str]]) -> None:
        """The section of the claims recorded so far, a line each; nothing where there are none.

        Parameters
        ----------
        title
            Of the section.
        effects
            By claim on how much it is true, and by how much what it compares differs, in words.
        """
        if not self._claims:
            return
        typed = {claim["id"]: claim for claim in load_claims(self.study)}
        rows = [
            (one["text"], typed.get(one["id"], {}).get("source", ""), one["verdict"], *effects[one["id"]])
            for one in self._claims
        ]
        self.section(title)
        self._show(f'<figure class="table">{claims_table(rows)}</figure>')

    def limits(self, points: Iterable[str]) -> None:
        """What this report does not tell."""
        self.section("What this does not tell you", part=LIMITS)
        self.points(points)

    def method(self, paragraphs: str) -> None:
        """How it was computed, folded away at the end; ``$latex$`` is set as maths."""
        self._show(
            f'<details class="method" data-part="{METHOD}"><summary>How it was computed</summary>'
            f"{prose(paragraphs)}</details>"
        )

    # -- the numbers
    # --------------------------------------------------------------------------------------------

    def metric(self, name: str, subject: str, value: Any, unit: str, **more: Any) -> None:
        """Record a number; ``more`` as of `metrics.metric`, where ``published`` and ``source`` are looked
        up in ``data/published``.

        Raises
        ------
        WildlabError
            If the name or subject is not allowed, or the unit is not the published one.
        """
        known = self._published.get((name, subject))
        if known is not None:
            if known["unit"] != unit:
                raise WildlabError(
                    f"{name} of {subject} is in {unit!r} here and published in {known['unit']!r}",
                    "convert it",
                )
            given = {key: value for key, value in more.items() if value is not None}
            more = {"published": known["value"], "source": known["source"]} | given
        self._metrics.append(schema.metric(name, subject, value, unit, **more))

    def claim(self, id: str, text: str, verdict: str, **found: Any) -> None:
        """Record a claim and the verdict on it; what else there is to record as `metrics.claim` has it."""
        self._claims.append(schema.claim(id, text, verdict, **found))

    @property
    def claims(self) -> list[dict[str, Any]]:
        """The claims recorded so far."""
        return list(self._claims)

    @property
    def recorded(self) -> dict[tuple[str, str], dict[str, Any]]:
        """The numbers recorded so far, by name and subject."""
        return {(entry["name"], entry["subject"]): entry for entry in self._metrics}

    def printed(self, name: str, subject: str) -> dict[str, Any] | None:
        """What is published for a number: a row of `wildlab.reporting.published.load_published`, or None."""
        return self._published.get((name, subject))

    @property
    def standing(self) -> Standing:
        """How the numbers and claims recorded so far stand to those that are printed."""
        recorded = self.recorded
        rows = [row for row in self._published.values() if not row["again"]]
        # What is a sentence of ours is no word of the thesis.
        own = {claim["id"] for claim in load_claims(self.study) if claim.get("own")}
        claims = [one["verdict"] for one in self._claims if one["id"] not in own]
        return standing([one for row in rows if (one := judge(row, recorded)) is not None], claims)

    def save(self) -> None:
        """Say how the numbers stand, unless the summary did, and write ``metrics.json`` into the report's
        folder; where there is none, only check the numbers."""
        if not self._judged:
            self._verdict(*self.standing)
        content = schema.document(
            study=self.study,
            flight=self.flight,
            kind=self.kind,
            seed=self.seed,
            seeds=self.seeds,
            metrics=self._metrics,
            claims=self._claims,
        )
        if self.out is not None:
            write_json(self.out / "metrics.json", content)

    # -- inside
    # -------------------------------------------------------------------------------------------------

    def _verdict(self, word: str, reason: str, level: str) -> None:
        pill = f'<span class="pill {PILLS[level]}">{inline(word)}</span>'
        marks = f'data-part="{VERDICT}" data-level="{level}"'
        self._show(f'<p class="verdict" {marks}>{pill} {inline(reason)}</p>')

    def _figure(self, fig: Figure, name: str, alt: str, caption: str = "", *, main: bool = False) -> str:
        if not _FILE_NAME.fullmatch(name):
            raise WildlabError(f"the figure name {name!r} is not made of a-z, 0-9 and -", "rename it")
        if name in self._figures:
            raise WildlabError(f"the figure {name!r} is shown twice", "give each figure its own name")
        if not alt.strip():
            raise WildlabError(f"the figure {name!r} has no alt text", "say in words what it shows")
        self._figures.add(name)
        alt, caption = known(alt) or NOTHING_KNOWN, known(caption)
        ordinal = len(self._figures)
        png = save_figure(fig, self.out / "figures", name) if self.out is not None else png_bytes(fig)
        html = figure_html(fig, png, ordinal=ordinal, alt=alt, caption=caption, main=main)
        return html

    def _show(self, *html: str) -> None:
        content = "\n".join(part for part in html if part)
        self.parts.append(content)
        if "IPython" in sys.modules:
            from IPython.core.getipython import get_ipython
            from IPython.display import display

            if get_ipython() is not None:
                plain = re.sub(r"<[^>]+>", " ", content)[:200]
                display({"text/html": content, "text/plain": plain}, raw=True)


def _list(points: Iterable[str], tag: str = "ul") -> str:
    items = [f"<li>{inline(point)}</li>" for point in map(known, points) if point]
    return f"<{tag}>{''.join(items)}</{tag}>" if items else ""


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

    def summary(self, answers: Sequence[Message], verdict: Verdict, reason: Message, about: str = "") -> None:
        """The answer with its verdict and the reason for it, recorded as that ``about`` something."""
        (why,) = self.messages([reason])
        self.report.summary(self.messages(answers), verdict.colour, (verdict.value, why))
        if about:
            self.report.metric(VERDICT_LEVEL, about, verdict.level, "1")

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
        """Show a table that has rows, as far as it has the columns: in sight under its title, or folded away
        behind it."""
        if frame.empty:
            return
        text = self.texts.tables[key]
        title, caption = self.say(text.title, values), self.say(text.caption, values)
        columns = {name: self.say(heading, values) for name, heading in text.columns.items() if name in frame}
        if text.open:
            self.report.section(title)
        self.report.table(
            frame,
            columns=columns or None,
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
