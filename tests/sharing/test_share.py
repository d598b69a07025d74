"""Copies, from the report to the file: what is in them, what is refused, and what is left when it ends badly.

Reports are made by a stand-in that shows all that a flight has; one slow test runs the true notebooks.
"""

from __future__ import annotations

import json
import re
import shutil
import stat
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
import pyzipper
from bs4 import BeautifulSoup

from tests.sharing.canary import HASH, canary
from tests.sharing.left import everything, leave_report
from wildlab.errors import RunFailed, WildlabError
from wildlab.files import write_json
from wildlab.flight.manifest import Manifest
from wildlab.flight.store import load_flight, save_flight
from wildlab.reporting.metrics import AGAINST, metric
from wildlab.reporting.published import Number
from wildlab.reporting.published_tables import strip
from wildlab.reporting.text import escape, page
from wildlab.runner.scheduling import Outcome
from wildlab.sharing import recomputation as redrawn
from wildlab.sharing.recomputation import of_a_study, share_apart
from wildlab.sharing.share import share
from wildlab.sharing.tiers import describe
from wildlab.simulation.parameters import load_twin

REPORT = Path("reports/kifaru-ridge")
SECRETS = (
    *("kifaru", "Olifants", "Letaba", "Skukuza", "Jonas", "Kestrel", "Thandi", "873165", "486297", "13.57"),
    *("2023-09-17", HASH[:8], "lat_raw"),
)


def leave(folder: Path, flight: Path, body: str = "") -> None:
    numbers = [metric(name="error", subject="logged-pose", value=3.25, unit="m")]
    leave_report(folder, flight, body, metrics=numbers, parameters={"source": "Kestrel-log"})


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a flight and a report on it."""
    folder = tmp_path_factory.mktemp("kept")
    flight = folder / "flights" / "kifaru-ridge"
    save_flight(canary(locations={"category": 2}, imu=False), flight)
    leave(folder / "reports" / "kifaru-ridge", flight, everything(flight))
    return folder


@pytest.fixture
def made(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same for each test; reports on copies are made by a stand-in."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(kept, tmp_path, dirs_exist_ok=True)

    def evaluate(folder: Path, *, source: str | None, reports: Path, **_: Any) -> list[Outcome]:
        name = load_flight(folder).name
        assert source in load_flight(folder).nav
        leave(reports / name, folder, everything(folder))
        return [Outcome(name, "done", 1.0, "", reports / name)]

    monkeypatch.setattr(redrawn, "evaluate_flight", evaluate)
    return tmp_path


def page_of(*given: Any, **options: Any) -> str:
    """A copy that is shared, as text."""
    return share(*given, **options).file.read_text(encoding="utf-8")


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def assert_no_copy(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == ["flights", "reports"]


def then(monkeypatch: pytest.MonkeyPatch, change: Callable[[Path, Path], Iterable[Outcome] | None]) -> None:
    """Have something done to the flight and the folder of reports that the stand-in was given."""
    clean = redrawn.evaluate_flight

    def evaluate(folder: Path, *, reports: Path, **more: Any) -> list[Outcome]:
        return [*clean(folder, reports=reports, **more), *(change(folder, reports) or ())]

    monkeypatch.setattr(redrawn, "evaluate_flight", evaluate)


def test_a_canary_is_in_no_copy_but_that_of_the_team(made):
    for tier in ("public", "partner"):
        copy = share(REPORT, tier)  # type: ignore[arg-type]
        assert copy.file.name == f"flight-{tier}.html"
        text = copy.file.read_text(encoding="utf-8")
        for secret in SECRETS:
            assert secret not in text, (tier, secret)
        assert "24.9° S" in text and "dataGeneralizations" in text and "September 2023" in text
        assert "All 1 numbers" in text
    team = share(REPORT, "team")
    text = team.file.read_text(encoding="utf-8")
    assert team.file.name == "kifaru-ridge-team.html"
    assert "Olifants" in text and "873165" in text


def test_the_sender_is_told_in_a_file_that_others_cannot_read(made):
    copy = share(REPORT)
    told = copy.told.read_text(encoding="utf-8")
    for secret in ("kifaru-ridge", "-24.873165", "Thandi", "Kestrel of Olifants camp"):
        assert secret in told
    assert stat.S_IMODE(copy.told.stat().st_mode) == 0o600
    assert "\n".join(copy.lines) in told
    assert sorted(path.name for path in made.iterdir()) == [
        "flight-public.html", "flight-public.html.for-the-sender.txt", "flights", "reports",
    ]  # fmt: skip


def test_a_zip_is_encrypted_and_lists_neutral_names(made):
    words = "four words that differ"
    copy = share(REPORT, password=words)
    assert copy.file.name == "flight-public.zip"
    with pyzipper.AESZipFile(copy.file) as zipped:
        assert zipped.namelist() == ["flight.html"]
        with pytest.raises(RuntimeError):
            zipped.read("flight.html")
        assert b"September 2023" in zipped.read("flight.html", pwd=words.encode())
    assert words not in copy.told.read_text(encoding="utf-8")


@pytest.mark.parametrize("secret", ["-24.873165, 31.486297", "Thandi", "2023-09-17"])
def test_what_slips_through_is_found_and_no_copy_is_left(secret, made, monkeypatch):
    then(
        monkeypatch,
        lambda _, reports: edit(reports / "flight/report.html", "</main>", f"<p>{escape(secret)}</p></main>"),
    )
    with pytest.raises(RunFailed, match="no copy"):
        share(REPORT)
    assert_no_copy(made)


def test_a_name_of_the_file_that_gives_the_place_away_is_refused(made):
    # That of its folder, by which reports are called, is a secret beside the one that it states.
    flight, mopani = made / "flights" / "mopani", made / "reports" / "mopani"
    shutil.copytree(made / "flights" / "kifaru-ridge", flight)
    leave(mopani, flight)
    for report, name in ((REPORT, "kifaru-ridge.html"), (REPORT, "olifants.zip"), (mopani, "mopani.html")):
        with pytest.raises(RunFailed, match="the name of the file"):
            share(report, out=made / name, zipped=name.endswith("zip"))
    assert_no_copy(made)


@pytest.mark.parametrize(
    ("stand_in", "error", "said"),
    [
        (Mock(side_effect=KeyboardInterrupt), KeyboardInterrupt, None),
        (Mock(return_value=[Outcome("flight", "failed", 1.0, "no rays.")]), RunFailed, "no rays"),
    ],
)
def test_nothing_is_left_of_what_was_broken_off_or_failed(stand_in, error, said, made, monkeypatch):
    monkeypatch.setattr(redrawn, "evaluate_flight", stand_in)
    with pytest.raises(error, match=said):
        share(REPORT)
    assert_no_copy(made)


def test_a_report_that_is_not_done_here_need_not_be_in_the_copy(made, monkeypatch):
    """It fails there as it did here: the copy says that there is none, and not why."""

    def fail(folder: Path, reports: Path) -> list[Outcome]:
        leave(reports / "flight-navigation", folder, "<h2>half a report</h2>")
        return [Outcome("flight-navigation", "failed", 1.0, "lost near Letaba.")]

    then(monkeypatch, fail)
    copy = share(REPORT)
    text = copy.file.read_text(encoding="utf-8")
    assert "no report on navigation" in text and "no report on navigation" in "\n".join(copy.lines)
    assert "half a report" not in text and "Letaba" not in text
    leave(made / "reports" / "kifaru-ridge-navigation", made / "flights" / "kifaru-ridge")
    with pytest.raises(RunFailed, match="flight-navigation"):
        share(REPORT, overwrite=True)


def test_without_its_flight_a_report_is_refused(made):
    (made / "flights").rename(made / "elsewhere")
    (made / "stranger").mkdir()
    (made / "stranger" / "flight.toml").write_text("a = " + "[" * 5000)  # a neighbour's, and no crash
    with pytest.raises(WildlabError, match="--flight FOLDER"):
        share(REPORT)
    assert share(REPORT, flight=made / "elsewhere" / "kifaru-ridge").file.is_file()
    other = made / "other"
    save_flight(canary((10.0, 20.0, 30.0), corner=(0.0, 0.0, 0.0), imu=False), other)
    with pytest.raises(WildlabError, match="not the flight"):
        share(REPORT, flight=other, overwrite=True)
    with pytest.raises(WildlabError, match="no flight in"):
        share(REPORT, flight=made, overwrite=True)


def test_a_category_that_was_stated_later_counts(made):
    """`flight.toml` may change without another evaluation; tables may not."""
    edit(made / "flights" / "kifaru-ridge" / "flight.toml", "category = 2", "category = 1")
    text = page_of(REPORT)
    assert "informationWithheld" in text and "° S" not in text


def test_numbers_that_differ_are_said(made):
    path = REPORT / "metrics.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    content["metrics"][0]["value"] = 3.25 * 1.02
    write_json(path, content)
    copy = share(REPORT)
    assert "Of 1 numbers, 0" in copy.file.read_text(encoding="utf-8")
    assert any("3.315" in line and "3.25" in line for line in copy.lines)
    assert share_apart(3.315, 3.25) == share_apart(3.25, 3.315) == pytest.approx(0.02 / 1.02)


@pytest.mark.parametrize(
    ("original", "against", "said"),
    [
        ("too sure of itself", "truth-payload", "too sure of itself"),
        ("sound", "onboard", "onboard"),
        ("sound", "truth-payload", ""),
    ],
)
def test_a_copy_that_says_otherwise_says_so_at_its_top(original, against, said, made, monkeypatch):
    def judged(folder: Path, word: str, reference: str) -> None:
        pill = f'<p class="verdict"><span class="pill">{word}</span></p>'
        edit(folder / "report.html", "</h1>", f"</h1>{pill}")
        content = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
        content["metrics"].append(metric(name=AGAINST, subject=reference, value=10, unit="1"))
        write_json(folder / "metrics.json", content)

    then(monkeypatch, lambda _, reports: judged(reports / "flight", "sound", "truth-payload"))
    judged(REPORT, original, against)
    copy = share(REPORT)
    top = BeautifulSoup(copy.file.read_text(encoding="utf-8"), "html.parser").select_one("header .sub")
    assert top is not None and said in top.get_text() and (describe("beware") in top.get_text()) == bool(said)
    if said:
        assert any(said in line for line in copy.lines)
        with pytest.raises(RunFailed, match="would not say"):
            share(REPORT, "partner", edition="en")
    else:
        assert share(REPORT, "partner", edition="en").file.is_file()


def test_a_study_is_copied_as_it_is(made):
    """Simulated: it has no place to be hidden. Links, and what the machine is called, go."""
    folder = made / "reports" / "static-point"
    twin = {"name": "static-antenna-1", "kind": "twin", "files": {}, "sources": []}
    folder.mkdir()
    drawn = strip(Number("rmse", "boat", "m", "H 6.2", 4.0, 1, 5.0, 4.5, 6.0, None, ratio=1.25))
    body = f'<h1>Study</h1><p>63.6 N <a href="../index.html">back</a></p>{drawn}'
    foot = "<p>data <code>c0ffee42</code> · made 2026-11-22 10:15 UTC</p>"
    (folder / "report.html").write_text(page(title="x", body=body, footer=foot), encoding="utf-8")
    write_json(folder / "provenance.json", {"flight": twin, "parameters": {}})
    write_json(folder / "status.json", {"state": "done"})
    copy = share(folder)
    assert copy.file.name == "static-point-public.html"
    text = copy.file.read_text(encoding="utf-8")
    assert "63.6 N" in text and "index.html" not in text and 'class="range"' in text
    assert "c0ffee42" not in text and "10:15" not in text
    assert "c0ffee42" in page_of(folder, "team")
    both = share(made / "reports", zipped=True)
    with zipfile.ZipFile(both.file) as zipped:
        assert sorted(zipped.namelist()) == ["flight.html", "static-point.html"]


def test_a_twin_that_does_not_come_with_wildlab_is_hidden_like_a_flight(made):
    own = canary(locations={"category": 2}, imu=False)
    data = own.manifest.model_dump() | {"kind": "twin", "twin": {"name": "Olifants-patrol", "seed": 873165}}
    save_flight(
        replace(own, manifest=Manifest.model_validate(data)),
        made / "flights" / "kifaru-ridge",
        overwrite=True,
    )
    leave(made / "more" / "kifaru-ridge", made / "flights" / "kifaru-ridge")
    text = page_of(made / "more" / "kifaru-ridge")
    assert all(secret not in text for secret in SECRETS) and "24.9° S" in text


def test_a_twin_is_not_taken_for_a_study_of_its_name(made):
    """It is compared with where the packaged one is."""
    place = load_twin("static-antenna").place
    study = {"name": "static-antenna-1", "kind": "twin"}
    reports = made / "reports"
    assert of_a_study(study, reports)
    assert not of_a_study(study | {"name": "Olifants-1"}, reports)
    assert not of_a_study(study | {"kind": "logged"}, reports)
    for latitude, packaged in ((place.latitude.number, True), (place.latitude.number + 0.01, False)):
        own = canary(imu=False)
        origin = {"latitude_deg": latitude, "longitude_deg": place.longitude.number, "height_m": 0.0}
        data = own.manifest.model_dump() | {"name": "static-antenna-1", "origin": origin}
        manifest = Manifest.model_validate(data)
        save_flight(replace(own, manifest=manifest), made / "flights" / "other", overwrite=True)
        assert of_a_study(study, reports) == packaged


def test_a_copy_with_this_machines_folders_in_it_is_refused_even_for_the_team(made):
    edit(REPORT / "report.html", "</main>", f"<p>{Path.cwd()}</p></main>")
    with pytest.raises(RunFailed, match="there is no copy"):
        share(REPORT, "team")


def test_one_sheet_stands_alone_or_beside_the_reports(made):
    text = page_of(REPORT, "partner", edition="en")
    assert text.count("<h1>") == 1 and "<h1>Report</h1>" not in text
    assert all(secret not in text for secret in SECRETS)
    copy = share(REPORT, "partner", edition="sv", zipped=True)
    with zipfile.ZipFile(copy.file) as zipped:
        assert zipped.namelist() == ["flight.html", "flight-one-sheet.html"]
        assert b'<html lang="sv">' in zipped.read("flight-one-sheet.html")


@pytest.mark.slow
def test_the_true_reports_of_a_canary(tmp_path, monkeypatch):
    """Through the notebooks, twice: the numbers of the sender's own report, no secret, the same bytes."""
    monkeypatch.chdir(tmp_path)
    flight = canary(locations={"category": 3}, imu=False)
    save_flight(flight, tmp_path / "flights" / "kifaru-ridge")
    redrawn.evaluate_flight(tmp_path / "flights" / "kifaru-ridge", reports=tmp_path / "reports")
    one = share(tmp_path / "reports" / "kifaru-ridge", out=tmp_path / "a.html")
    other = share(tmp_path / "reports" / "kifaru-ridge", out=tmp_path / "b.html")
    text = one.file.read_text(encoding="utf-8")
    assert one.file.read_bytes() == other.file.read_bytes()
    for secret in SECRETS:
        assert secret not in text, secret
    assert "coordinates rounded to 0.01 degrees" in text
    found = re.search(r"(All|Of) \d{2,} numbers[^<]*", text)
    assert found is not None and found[1] == "All", found
