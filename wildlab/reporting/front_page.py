"""``reports/index.html``: what this is, a flight that moves, a card a case; and ``partners.html``.

The flight is a part of a twin, computed once and kept in ``data/front-flight.json``, since simulating it
takes seconds. ``python tools/front_flight.py`` makes it again, and a test compares.
"""

from __future__ import annotations

import base64
import binascii
import html
import json
import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from wildlab.paths import DATA
from wildlab.reporting import published_marks as marks
from wildlab.reporting.animation import (
    PAUSE_STYLE,
    Course,
    Ellipses,
    Outlines,
    ShownFlight,
    animated_flight,
    with_pause,
)
from wildlab.reporting.own_flights import PAGE as FLIGHTS
from wildlab.reporting.own_flights import OwnFlight, pill_of
from wildlab.reporting.page import PILLS, TAGS, page
from wildlab.reporting.published_tables import count_answers
from wildlab.reporting.status import FIRST_LOOK, Case, Number, StudyStatus
from wildlab.reporting.text import read_style, render

Array = NDArray[np.float64]

#: The page beside it that says how to share.
PARTNERS = "partners.html"
#: Cards of own flights at most, the newest first, and bytes that all small pictures may take.
MOST_FLIGHTS, MOST_PICTURES = 4, 1_200_000
#: Bytes that the moving picture may take.
MOST_MOVING = 300_000
FILE = DATA / "front-flight.json"
#: Share of a normal distribution that its ellipses hold.
PROBABILITY = 0.9
_PARTS = ("path", "footprints", "points", "ellipses", "truth")
#: Width of a small picture, pixels; how well it is kept, of 100; most pixels of one that is read.
WIDE, QUALITY, MOST_PIXELS = 440, 60, 40_000_000
_SUMMARY = re.compile(r'<section\b[^>]*\bclass="summary\b[^>]*>(.*?)</section>', re.S)
_BOLD = re.compile(r"<b>(.*?)</b>", re.S)
_PICTURE = re.compile(r'<img\b[^>]*\bsrc="data:image/png;base64,([A-Za-z0-9+/=\s]+)"[^>]*>')
_ALT = re.compile(r'\balt="([^"]*)"')
_HEADING = re.compile(r"<h1\b[^>]*>(.*?)</h1>", re.S)
_TAG = re.compile(r"<[^>]+>")


class FrontFlight(NamedTuple):
    """What is shown, and what it comes to.

    Attributes
    ----------
    shown
        For `wildlab.reporting.animation.animated_flight`.
    twin
        Its name.
    height
        Mean height of the aircraft above the water, m.
    """

    shown: ShownFlight
    twin: str
    height: float

    @property
    def seconds(self) -> float:
        """How long that part of the flight takes, s."""
        return float(self.shown.path.times[-1] - self.shown.path.times[0])

    @property
    def images(self) -> int:
        """Images that show the target in that part of the flight; the file has one more on either side."""
        return int(self._inside.sum())

    @property
    def _inside(self) -> NDArray[np.bool_]:
        times, path = np.zeros(0), self.shown.path.times
        if self.shown.points is not None:
            times = self.shown.points.times
        return np.asarray((times >= path[0]) & (times <= path[-1]))

    @property
    def off(self) -> float:
        """Median distance of the position from one image to where the target was, m."""
        points, (truth,) = self.shown.points, self.shown.truth
        if points is None:
            return float("nan")
        missed = (points.points - _between(truth, points.times))[self._inside]
        return float(np.median(np.hypot(*missed.T)))

    @property
    def held(self) -> float:
        """Share of the instants at which the ellipse holds the target."""
        from wildlab.geometry.covariances import inside_ellipse

        (ellipses,), (truth,) = self.shown.ellipses, self.shown.truth
        missed = _between(truth, ellipses.times) - ellipses.centres
        return float(np.mean(inside_ellipse(missed, ellipses.covariances, PROBABILITY)))


def _between(course: Course, times: Array) -> Array:
    return np.stack([np.interp(times, course.times, course.points[:, axis]) for axis in (0, 1)], axis=1)


def load_front_flight() -> FrontFlight:
    """The kept flight, which ``tools/front_flight.py`` makes."""
    content = json.loads(FILE.read_text(encoding="utf-8"))
    path, outlines, points, ellipses, truth = (
        [np.array(one, float) for one in content[name].values()] for name in _PARTS
    )
    shown = ShownFlight(
        Course(*path), Outlines(*outlines), Course(*points), [Ellipses(*ellipses)], [Course(*truth)]
    )
    return FrontFlight(shown, content["twin"], content["height_m"])


class Glimpse(NamedTuple):
    """Of a report, as plain text: heading, the summary's first sentence, its first picture as a ``data:``
    address and what that shows. What it does not have is ""."""

    title: str = ""
    sentence: str = ""
    picture: str = ""
    alt: str = ""


def read_glimpse(report: Path) -> Glimpse:
    """What a card shows of a report; of one that cannot be read, nothing.

    Parameters
    ----------
    report
        ``report.html``.

    Returns
    -------
    Glimpse
    """
    try:
        state = report.stat()
    except OSError:
        return Glimpse()
    return _read(report, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=512)
def _read(report: Path, changed: int, size: int) -> Glimpse:
    """Kept as long as the file is the same: the page is put together after each study of a run."""
    try:
        whole = report.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return Glimpse()
    heading, summary, picture = _HEADING.search(whole), _SUMMARY.search(whole), _PICTURE.search(whole)
    bold = _BOLD.search(summary[1]) if summary else None
    small = smaller(picture[1]) if picture else ""
    alt = _ALT.search(picture[0]) if picture and small else None
    return Glimpse(
        _plain_text(heading[1]) if heading else "",
        _plain_text(bold[1]) if bold else "",
        small,
        _plain_text(alt[1]) if alt else "",
    )


def _plain_text(text: str) -> str:
    return " ".join(html.unescape(_TAG.sub("", text)).split())


def smaller(png: str) -> str:
    """A PNG, as base64, made as wide as a card, as a ``data:`` address of a WebP; "" where it is none."""
    import cv2  # takes a while, and a page without pictures does not need it

    try:
        content = base64.b64decode(png)
    except (ValueError, binascii.Error):
        return ""
    # How large it says it is stands in its first bytes: it is read before that much memory is asked for.
    if content[:8] != b"\x89PNG\r\n\x1a\n" or len(content) < 24:
        return ""
    width, height = (int.from_bytes(content[at : at + 4], "big") for at in (16, 20))
    if not 0 < width * height <= MOST_PIXELS:
        return ""
    try:
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
        if picture is None or picture.dtype != np.uint8:
            return ""
        tall = max(1, min(round(height * WIDE / width), 2 * WIDE))
        small = cv2.resize(
            _on_white(np.asarray(picture, np.uint8)), (WIDE, tall), interpolation=cv2.INTER_AREA
        )
        written, webp = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
    except cv2.error:
        return ""
    return f"data:image/webp;base64,{base64.b64encode(webp.tobytes()).decode('ascii')}" if written else ""


def _on_white(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Without what it lets through: figures are drawn for white paper."""
    if picture.ndim == 2:
        return np.repeat(picture[:, :, None], 3, axis=2)
    if picture.shape[2] == 3:
        return picture
    opaque = picture[:, :, 3:].astype(np.float32) / 255
    return np.asarray(np.rint(picture[:, :, :3] * opaque + 255 * (1 - opaque)), np.uint8)


class Answer(NamedTuple):
    """What became of one study or flight: what it is called on its card, its report's folder ("" where there
    is none), the verdict and its colour, and what it is of where that is not all."""

    name: str
    folder: str
    word: str
    pill: str
    note: str = ""


class Card(NamedTuple):
    """One card.

    Attributes
    ----------
    title, sentence, tag
        Plain text: what is asked, what was found ("" where that is not known), and on what.
    answers
        One for each report that it opens.
    numbers
        Published ones that the strip shows.
    picture, alt
        A ``data:`` address and what it shows, or "".
    """

    title: str
    sentence: str
    tag: str
    answers: Sequence[Answer]
    numbers: Sequence[Number] = ()
    picture: str = ""
    alt: str = ""

    @property
    def strip(self) -> Markup:
        """Its numbers as marks on the axis."""
        if not self.numbers:
            return Markup()
        ratios = sorted(one.ratio for one in self.numbers if one.ratio is not None)
        return marks.plot(self.numbers, alt=render("strip-alt", ratios=ratios)) + marks.ticks()


def case_cards(studies: Iterable[tuple[StudyStatus, Glimpse]], cases: Sequence[Case] = ()) -> list[Card]:
    """A card for each case: the studies of one case, on different twins, share it.

    Parameters
    ----------
    studies
        Those that were run or tried, each with what its report shows.
    cases
        Of the theses.
    """
    shows = {case.id: case.shows for case in cases}
    by_case: dict[str, list[tuple[StudyStatus, Glimpse]]] = {}
    for one, glimpse in studies:
        by_case.setdefault(one.study.case or one.study.name, []).append((one, glimpse))
    return [_case_card(shows.get(case, ""), some) for case, some in by_case.items()]


def _case_card(shows: str, some: Sequence[tuple[StudyStatus, Glimpse]]) -> Card:
    first, alone = some[0][0], len(some) == 1
    seen = [glimpse for one, glimpse in some if one.ran]
    pictured = next((glimpse for glimpse in seen if glimpse.picture), Glimpse())
    answer = seen[0].sentence if seen else first.reason
    return Card(
        title=first.study.title if alone or not shows else shows,
        sentence=answer if alone else "",
        tag="; ".join(dict.fromkeys(study_tag(one) for one, _ in some)),
        answers=[_answer(one, alone=alone) for one, _ in some],
        numbers=marks.drawable(n for one, _ in some if one.ran for n in one.counted),
        picture=pictured.picture,
        alt=pictured.alt,
    )


def _answer(one: StudyStatus, *, alone: bool) -> Answer:
    study = one.study
    name = "report" if alone else (study.twin or study.dataset or study.name).replace("-", " ")
    folder = study.name if one.has_report else ""
    if not one.ran:
        return Answer(name, folder, one.state, "no")
    found = marks.study_verdict(one)
    return Answer(name, folder, found.word, PILLS[found.level], one.first_look)


def study_tag(one: StudyStatus) -> str:
    """What a study was run on, in few words."""
    kind = one.study.kind
    if kind == "twin":
        return f"{one.seeds} simulated flights" if one.seeds and one.seeds > 1 else "simulated flight"
    return "logged flight" if kind == "logged" else TAGS["computed"]


def flight_card(flight: OwnFlight, glimpse: Glimpse) -> Card:
    """The card of a flight that somebody evaluated; the first report bears its verdict."""
    first, (word, pill) = flight.reports[0], pill_of(flight)
    return Card(
        title=flight.name,
        sentence=glimpse.sentence if first.state == "done" else f"{first.about}: {first.state}",
        tag=TAGS.get(flight.kind, flight.kind),
        answers=[
            Answer(
                one.about,
                one.folder,
                word if one is first else "",
                pill,
                "" if one.state == "done" else one.state,
            )
            for one in flight.reports
        ],
        picture=glimpse.picture if first.state != "damaged" else "",
        alt=glimpse.alt,
    )


class Learn(NamedTuple):
    """Something to learn from: its title, and its address, "" where its page is not there yet."""

    title: str
    address: str


def front_page(
    studies: Sequence[StudyStatus],
    flight: FrontFlight,
    *,
    study_cards: Sequence[Card] = (),
    flight_cards: Sequence[Card] = (),
    flights: int = 0,
    cases: int = 0,
    learn: Sequence[Learn] = (),
    checkout: bool = True,
    code: str = "",
) -> str:
    """The whole page.

    Parameters
    ----------
    studies
        All of them, run or not.
    flight
        What moves beside the heading.
    study_cards, flight_cards
        Of cases that were run or tried; of own flights, the newest first.
    flights
        How many own flights there are.
    cases
        How many cases the theses have; 0 where that is not known.
    learn
        Tutorials and reference, whether their pages are there or not.
    checkout
        Whether this is a checkout, whose ``make`` writes these pages.
    code
        Which code it was put together by, as HTML.
    """
    counts, states = count_answers(studies), [one.state for one in studies]
    alt = render("front-alt", flight=flight)
    moving = animated_flight(flight.shown, alt=alt, probability=PROBABILITY, most_bytes=MOST_MOVING)
    body = render(
        "front",
        moving=Markup(with_pause(moving)),  # noqa: S704 - HTML
        flight=flight,
        probability=PROBABILITY,
        done=states.count("done"),
        looks=states.count(FIRST_LOOK),
        damaged=states.count("damaged"),
        studies=len(studies),
        cases=cases,
        flights=flights,
        flight_cards=flight_cards[:MOST_FLIGHTS],
        study_cards=_affordable(study_cards, flight_cards),
        waiting=[one.study for one in studies if one.state == "not run"],
        learn=learn,
        checkout=checkout,
        close=marks.CLOSE,
        legend=marks.legend(n for one in study_cards for n in one.numbers),
        headline=marks.headline(counts),
        counts=counts,
        pages={"flights": FLIGHTS, "partners": PARTNERS, "ledger": marks.LEDGER},
    )
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC") + (f", {code}" if code else "")
    style = "\n".join((read_style("front"), marks.STYLE, PAUSE_STYLE))
    footer = f"<p>{made}. No part of this page asks the network for anything.</p>"
    return page(title="wildlab", body=body, kicker="wildlab", footer=footer, style=style)


def _affordable(study_cards: Sequence[Card], flight_cards: Sequence[Card]) -> list[Card]:
    """The studies' cards, pictures left out once all of them would take too much."""
    left = MOST_PICTURES - sum(len(one.picture) for one in flight_cards[:MOST_FLIGHTS])
    kept = []
    for one in study_cards:
        left -= len(one.picture)
        kept.append(one if left >= 0 else one._replace(picture=""))
    return kept


def partners_page(reports: Sequence[str]) -> str:
    """``reports/partners.html``: how a partner gets a report that gives no place away.

    Parameters
    ----------
    reports
        Folders of the reports that are there to be shared; may be empty.
    """
    # A name may hold what would end a span of code.
    example = (reports[0] if reports else "tuesday-overview").replace("`", "")
    way = '<a href="index.html">wildlab</a> › for partners'
    body = render("partners", reports=reports, example=example)
    return page(title="A copy that is safe to send", body=body, kicker=way)
