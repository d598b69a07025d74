"""The front page and those beside it, put together from what runs left behind."""

from __future__ import annotations

import base64
import json
import re
import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
from bs4 import BeautifulSoup

from tests.runner.test_ledger import a_study, ran
from tools import front_flight
from wildlab.reporting import metrics
from wildlab.reporting import notebook_pages as html
from wildlab.reporting.front_page import FLIGHT, Glimpse, case_cards, front_page
from wildlab.reporting.published import StudyStatus, published_rows
from wildlab.reporting.published_tables import CALCULATIONS, count_answers
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.ledger import build_ledger
from wildlab.runner.status import study_status

PAGES = ("index.html", "ledger.html", "flights.html", "partners.html")
#: A word that would run, were it not only text.
HOSTILE = "<script>alert(1)</script>"


def printed(folder: Path, **values: list[float]) -> Path:
    """Calculated numbers of studies, by study: what each is in print, to a digit behind the point."""
    folder.mkdir(exist_ok=True)
    for study, numbers in values.items():
        entries = "".join(
            f'[[number]]\nstudy = "{study}"\nname = "error"\nsubject = "a/{i}"\nvalue = '
            f'{value:.1f}\nunit = "m"\n'
            'source = "H table 1"\nkind = "calculated"\n'
            for i, value in enumerate(numbers)
        )
        (folder / f"{study}.toml").write_text(entries)
    return folder


def gave(reports: Path, study: str, values: list[float], **more: Any) -> None:
    ran(
        reports,
        *(metrics.metric("error", f"a/{i}", v, "m") for i, v in enumerate(values)),
        study=study,
        **more,
    )


def make_first_look(folder: Path) -> None:
    status = json.loads((folder / "status.json").read_text()) | {"first_look": {"seeds": [5, 200]}}
    (folder / "status.json").write_text(json.dumps(status))


@pytest.fixture
def some(tmp_path: Path) -> list[StudyStatus]:
    """Two studies that are done, one each that failed, was not run, and had a first look."""
    reports = tmp_path / "reports"
    folder = printed(
        tmp_path / "published",
        done=[2.0, 4.0, 1.0, 0.0],
        other=[3.0],
        failed=[1.0, 1.0],
        never=[1.0] * 5,
        looked=[1.0] * 7,
    )
    gave(reports, "done", [2.02, 8.0, 1.04, 0.01])
    gave(reports, "other", [30.0])
    ran(reports, study="failed", state="failed")
    gave(reports, "looked", [1.0] * 7)
    make_first_look(reports / "looked")
    return [study_status(a_study(name=name, section="H 1"), reports, folder)
            for name in ("done", "other", "failed", "never", "looked")]  # fmt: skip


def page_of(studies: list[StudyStatus]) -> str:
    made = case_cards((one, Glimpse()) for one in studies if one.state != "not run")
    return front_page(studies, study_cards=made)


def test_counts_are_those_of_the_files(some, tmp_path):
    """Counted once more from the files alone: a calculated number agrees within half of its last digit."""
    agree = differ = others = 0
    for path in (tmp_path / "published").glob("*.toml"):
        entries = tomllib.loads(path.read_text())["number"]
        recorded = tmp_path / "reports" / path.stem / "metrics.json"
        status = recorded.with_name("status.json")
        known = json.loads(status.read_text()) if status.is_file() else {}
        if known.get("state") != "done" or known.get("first_look"):
            others += len(entries)
            continue
        ours = {one["subject"]: one["value"] for one in json.loads(recorded.read_text())["metrics"]}
        near = [abs(ours[one["subject"]] - one["value"]) <= 0.05 for one in entries]
        agree, differ = agree + sum(near), differ + len(near) - sum(near)
    counts = count_answers(some)
    found = counts[CALCULATIONS]
    assert (found.close["close"], found.close["not close"]) == (agree, differ) == (3, 2)
    assert found.waiting == others == 14 and found.all == 19
    assert set(counts) == {CALCULATIONS}, "a calculation is in no tile of predictions"


@pytest.mark.slow
def test_the_flight_is_that_of_the_twin():
    """The picture and its caption are what the twin gives, computed once more by hand."""
    contents, height = front_flight.simulated()
    (t, p), (te, xe, P), (tt, xt) = (contents[name] for name in ("points", "ellipses", "truth"))
    flown = contents["path"][0]
    part = (t >= flown[0]) & (t <= flown[-1])
    assert 0 < part.sum() < len(t)
    at = [np.stack([np.interp(when, tt, xt[:, k]) for k in (0, 1)], 1) for when in (t[part], te)]
    off = np.median(np.linalg.norm(p[part] - at[0], axis=1))
    missed = at[1] - xe
    held = np.mean(np.einsum("ni,nij,nj->n", missed, np.linalg.inv(P), missed) <= -2 * np.log(0.1))
    kept = json.loads(FLIGHT.read_text())
    assert kept == pytest.approx(front_flight.caption(contents, height), abs=0.01)
    assert [kept[name] for name in ("images", "off_m", "held")] == pytest.approx(
        [part.sum(), off, held], abs=0.01
    )
    words = BeautifulSoup(front_page([]), "html.parser").get_text().replace("\u00a0", " ")
    said = f"{off:.0f} m off", f"one of {part.sum()} images", f"{100 * held:.1f} %"
    assert all(one in words for one in said)
    svg = FLIGHT.with_suffix(".svg").read_text()
    old, new = (re.findall(r"-?\d*\.?\d+", one) for one in (svg, front_flight.drawn(contents)))
    np.testing.assert_allclose(np.array(new, float), np.array(old, float), atol=0.3)
    # By the scale drawn, the aircraft is where it was.
    x0, x1, metres = re.findall(r'd="M([\d.]+) 400v-6v6H([\d.]+)v-6"/>.*?>(\d+) m<', svg)[0]
    line = re.search(r'class="gone" d="M([^"]+)"', svg)
    assert line is not None
    drawn = np.array([one.split() for one in line[1].split("L")], float)
    span = np.ptp(drawn, axis=0) * float(metres) / (float(x1) - float(x0))
    assert span == pytest.approx(np.ptp(contents["path"][1], axis=0)[::-1], rel=0.02)


@pytest.mark.parametrize("still", ["asked", "stopped", "paper"])
def test_the_picture_stands_still(browser, tmp_path, still):
    (tmp_path / "index.html").write_text(front_page([]), "utf-8")
    more = {"reduced_motion": "reduce"} if still == "asked" else {}
    context = browser.new_context(viewport={"width": 700, "height": 700}, offline=True, **more)
    tab = context.new_page()
    tab.goto((tmp_path / "index.html").as_uri())
    if still == "stopped":
        tab.locator(".halt summary").click()
    if still == "paper":
        tab.emulate_media(media="print")
    picture = tab.locator("svg.flown")

    def moves() -> bool:
        before = picture.screenshot()
        tab.wait_for_timeout(1200)
        return bool(before != picture.screenshot())

    assert not moves() and tab.locator("svg.flown .still").is_visible()
    assert not tab.locator("svg.flown .moves").is_visible()
    if still == "stopped":
        tab.locator(".halt summary").click()
        assert moves()
    context.close()


def overview(reports: Path, folder: str, flight: str, **report: str) -> None:
    """A report on a flight, as ``wildlab evaluate`` leaves it."""
    ran(reports, study=folder)
    (reports / folder / "provenance.json").write_text(
        json.dumps({"flight": {"name": flight, "kind": "logged"}, "parameters": {}})
    )
    noise = np.random.default_rng(len(folder)).integers(0, 255, (500, 800, 3), np.uint8)
    picture = base64.b64encode(cv2.imencode(".png", noise)[1].tobytes()).decode()
    (reports / folder / "report.html").write_text(
        f'<h1>x</h1><section class="summary bad"><p><b>{report.get("sentence", "9 m off.")}</b></p></section>'
        f'<img alt="{report.get("alt", "A map.")}" src="data:image/png;base64,{picture}">',
        encoding="utf-8",
    )


def test_doors_lead_somewhere_before_anything_has_run(tmp_path):
    build_ledger(tmp_path, load_studies())
    soup = BeautifulSoup((tmp_path / "index.html").read_text(encoding="utf-8"), "html.parser")
    assert len(soup.select(".doors a")) == 4
    assert dead_links(tmp_path) == []


def dead_links(reports: Path) -> list[str]:
    """Links of the pages that lead to no file, or to no place in it."""
    dead = []
    for name in PAGES:
        soup = BeautifulSoup((reports / name).read_text(encoding="utf-8"), "html.parser")
        for link in soup.find_all("a"):
            file, _, place = link["href"].partition("#")
            target = reports / unquote(file) if file else reports / name
            if not target.is_file() or (
                place and f'id="{unquote(place)}"' not in target.read_text(encoding="utf-8")
            ):
                dead.append(f"{name}: {link['href']}")
    return dead


def test_names_out_of_logs_are_only_text(tmp_path):
    for k, folder in enumerate(("javascript:alert(1)", "a?b#c", "100%", 'q"uote', "it's `rm`")):
        overview(
            tmp_path, folder, f"{HOSTILE}{k}", sentence=f"Off &lt;script&gt; {k}.", alt="&quot; onerror=x"
        )
    studies = {"s": a_study(title=HOSTILE, section=HOSTILE, dataset="d", recipe="r.toml")}
    build_ledger(tmp_path, studies)
    assert dead_links(tmp_path) == []
    for name in PAGES:
        whole = (tmp_path / name).read_text(encoding="utf-8")
        assert "<script" not in whole and "onerror=x" not in re.sub(r'alt="[^"]*"', "", whole)
        html.examine(whole, name, alone=False)


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    """Pages with everything: studies in every state, an own flight."""
    reports = tmp_path / "reports"
    studies: dict[str, StudyEntry] = {}
    for name in ("sensitivity", "consistency-bounds", "static-point", "slow-vessel"):
        studies[name] = load_studies()[name]
    entries = [
        metrics.metric(one["name"], one["subject"], one["value"] * (1.0 + 0.6 * (k % 2)), one["unit"])
        for k, one in enumerate(published_rows("sensitivity"))
    ]
    ran(reports, *entries, study="sensitivity", kind="computed")
    ran(reports, study="static-point", state="failed")
    overview(reports, "tuesday-overview", "tuesday")
    build_ledger(reports, studies)
    return reports


@pytest.mark.parametrize("name", PAGES)
def test_pages_open_anywhere(whole, name, faults):
    assert faults(whole / name) == []
    html.examine((whole / name).read_text(encoding="utf-8"), name, alone=False)
