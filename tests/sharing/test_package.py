"""Copies as files: pages that run nothing, zips that list nothing, and which reports can be shared."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import pyzipper
from bs4 import BeautifulSoup

from tests.sharing.canary import canary
from tests.sharing.left import leave_report
from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.flight.store import save_flight
from wildlab.reporting.text import page
from wildlab.runner.evaluate import MANY_NOTEBOOK as NOTEBOOK
from wildlab.runner.status import seal
from wildlab.sharing.allow_list import Chapter, join_chapters, read_part
from wildlab.sharing.recomputation import sources_of
from wildlab.sharing.share import (
    check_password,
    private_folder,
    put,
    refuse_existing,
    zip_bytes,
)

FILES = {"flight.html": b"<p>page</p>" * 50}
WORDS = "correct horse battery"


def test_an_encrypted_zip_opens_with_its_password_and_not_without(tmp_path):
    path = tmp_path / "a.zip"
    path.write_bytes(zip_bytes(FILES, WORDS))
    assert b"page" not in path.read_bytes()
    with pyzipper.AESZipFile(path) as zipped:
        assert zipped.namelist() == ["flight.html"]
        with pytest.raises(RuntimeError, match=r"[Pp]assword|encrypted"):
            zipped.read("flight.html")
        with pytest.raises(RuntimeError, match=r"[Pp]assword"):
            zipped.read("flight.html", pwd=b"correct horse staple")
        assert zipped.read("flight.html", pwd=WORDS.encode()) == FILES["flight.html"]
        # Whoever guesses what is inside could tell by a checksum.
        assert zipped.infolist()[0].CRC == 0


def test_a_password_that_can_be_tried_out_is_refused():
    check_password("a" * 12)
    with pytest.raises(WildlabError, match="The password has 5 characters"):
        check_password("rhino")


def test_a_folder_to_work_in_is_private_and_gone_afterwards(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(KeyboardInterrupt), private_folder() as work:
        assert work.parent == tmp_path and work.stat().st_mode & 0o077 == 0
        (work / "page.html").write_text("half")
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_what_a_machine_left_when_it_stopped_goes_with_the_next_run(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "wildlab-share-before" / "reports").mkdir(parents=True)
    (tmp_path / "wildlab-share-before" / ".wildlab-private").touch()
    (tmp_path / "wildlab-share-results").mkdir()  # somebody's own
    (tmp_path / "wildlab-share-link").symlink_to(tmp_path)
    with private_folder() as work, private_folder() as other:
        assert work.is_dir() and other.is_dir() and not (tmp_path / "wildlab-share-before").exists()
    assert {one.name for one in tmp_path.iterdir()} == {"wildlab-share-link", "wildlab-share-results"}
    out = tmp_path / "out"
    out.mkdir()
    half = out / ".copy.html.x7_kq2ab"
    half.write_text("half of what is for the sender alone")
    os.utime(half, (time.time() - 4000,) * 2)
    (out / ".copy.html.swp").write_text("an editor's")
    (out / ".copy.html.whatever").mkdir()
    put(b"whole", out / "copy.html", overwrite=False, mode=0o600)
    left = {one.name for one in out.iterdir()}
    assert left == {"copy.html", ".copy.html.swp", ".copy.html.whatever"}
    assert (out / "copy.html").stat().st_mode & 0o077 == 0


def test_copies_that_are_written_at_once_leave_each_other_alone(tmp_path):
    there = tmp_path / "copy.html"

    def write(number: int) -> None:
        with private_folder() as work:
            (work / "page.html").write_text("work")
            for _ in range(20):
                put(bytes([number]) * 100_000, there, overwrite=True)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(write, range(8)))
    assert len(set(there.read_bytes())) == 1 and there.stat().st_size == 100_000
    assert [one.name for one in tmp_path.iterdir()] == ["copy.html"]


KILLED = """
import os, signal, sys
from pathlib import Path
from wildlab.sharing import share, recomputation, share as module
def kill(*given, **more):
    print("all pages were made", flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
def evaluate(folder, *, reports, **more):
    page = reports / "flight" / "report.html"
    page.parent.mkdir(parents=True)
    page.write_text(sys.argv[3])
    kill()
os.fsync = kill
recomputation.evaluate_flight = evaluate
tier, flight = ("team", None) if len(sys.argv) < 5 else ("public", Path(sys.argv[4]))
if flight is not None:
    recomputation.save_flight = lambda flight, copy, **more: copy.mkdir()
module.share(Path(sys.argv[1]), tier, flight=flight, out=Path(sys.argv[2]), password="correct horse battery")
"""


@pytest.mark.slow
@pytest.mark.parametrize("generalised", [False, True])
def test_a_killed_run_leaves_no_page_that_can_be_read(generalised, tmp_path):
    """Neither beside the copy nor in the folder where pages are drawn again."""
    said = "nobody may read this"
    flight, report = tmp_path / "flights" / "kifaru-ridge", tmp_path / "reports" / "gating"
    body = f"<header><h1>Report</h1></header><p>{said}</p>"
    if generalised:
        report = tmp_path / "reports" / "kifaru-ridge"
        save_flight(canary(imu=False), flight)
        leave_report(report, flight, body, parameters={"source": "Kestrel-log"})
    else:
        report.mkdir(parents=True)
        (report / "report.html").write_text(page(title="x", body=body), encoding="utf-8")
        write_json(report / "provenance.json", {"flight": None, "parameters": {}})
        seal(report, {"state": "done"}, ("report.html", "provenance.json"))
    out, temporary = tmp_path / "out", tmp_path / "tmp"
    temporary.mkdir()
    command = [sys.executable, "-c", KILLED, str(report), str(out / "copy.zip"), said]
    command += [str(flight)] if generalised else []
    ended = subprocess.run(
        command, env={**os.environ, "TMPDIR": str(temporary)}, capture_output=True, text=True, check=False
    )
    assert ended.returncode == -signal.SIGKILL and "all pages were made" in ended.stdout, ended.stderr
    deadline = time.monotonic() + 5.0
    while list(temporary.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not list(temporary.iterdir())
    left = [one for one in out.rglob("*") if one.is_file()]
    assert not [one for one in left if said.encode() in one.read_bytes()]


def test_nothing_is_overwritten_without_being_asked(tmp_path):
    there = tmp_path / "copy.html"
    there.write_text("old")
    with pytest.raises(WildlabError, match="there already"):
        put(b"new", there, overwrite=False)
    assert there.read_text() == "old"
    put(b"new", there, overwrite=True)
    assert there.read_text() == "new" and len(list(tmp_path.iterdir())) == 1
    with pytest.raises(WildlabError, match="is a folder, and a copy is one file"):
        refuse_existing(tmp_path, overwrite=True)


BODY = """<header><h1>How far off &amp; why?</h1></header>
<h2 id="numbers">Numbers</h2>
<p>See <a href="#numbers">above</a>, <a href="#gone">nowhere</a>, <a href="../index.html">the ledger</a>,
<a href="https://example.org/x?y=1">the net</a>,
<a download="a.csv" href="data:text/csv;base64,bgox">as CSV</a>
and <a href="data:application/geo+json;base64,e30=">as a map</a>.</p>
<!-- by jonas on kestrel -->
<svg viewBox="0 0 9 9" aria-labelledby="t"><path d="M0 0"/></svg><p id="t">An arrow</p>"""
FOOTER = """<p>wildlab 0.1.0 at commit <code>c247ba823b</code> · made 2026-11-23 03:24:15 UTC.</p>
<p>All hashes are in <a href="provenance.json">provenance.json</a> beside this page.</p>
<p>H: H. H. Helgesen, doctoral thesis, 2019.</p>"""


def report(folder: Path, body: str = BODY) -> Path:
    path = folder / "report.html"
    kicker = '<a href="../index.html">wildlab ledger</a> › kifaru-ridge'
    path.write_text(page(title="x", body=body, kicker=kicker, footer=FOOTER), encoding="utf-8")
    return path


def whole(tmp_path: Path, *, exact: bool = False, times: int = 2) -> str:
    path = report(tmp_path)
    parts = tuple(read_part(path, i, exact=exact, generalised=False) for i in range(1, times + 1))
    return join_chapters(
        [Chapter("A flight, for the public", "It was <b>somewhere</b>.", ("And <i>so</i>.",), parts)], ""
    )


def test_ids_are_each_once_and_links_lead_somewhere(tmp_path):
    soup = BeautifulSoup(whole(tmp_path), "html.parser")
    ids = [tag["id"] for tag in soup.find_all(id=True)]
    assert len(ids) == len(set(ids)) and "r1-numbers" in ids and "r2-numbers" in ids
    for link in soup.find_all("a"):
        target = str(link["href"])
        assert target.startswith("data:text/csv") or target.removeprefix("#") in ids, target
    assert soup.find("svg")["aria-labelledby"] == "r1-t"  # type: ignore[index]


def test_nothing_runs_asks_or_lies_beside(tmp_path):
    text = whole(tmp_path)
    assert "default-src 'none'" in text
    for secret in [
        "jonas",
        "kestrel",
        "example.org",
        "geo+json",
        "ledger</a>",
        "kifaru-ridge",
        "provenance.json",
    ]:
        assert secret not in text


def test_the_foot_keeps_the_thesis_and_loses_hashes_and_date(tmp_path):
    text = whole(tmp_path)
    assert "Helgesen" in text
    assert "c247ba823b" not in text and "2026-11-23" not in text
    assert "c247ba823b" in whole(tmp_path, exact=True)


def test_outsiders_are_not_told_what_to_type(tmp_path):
    body = """<header><h1>x</h1></header>
<p>2 of 9 values are <b>assumed.</b> State them in <code>flight.toml</code>, or with <code>--settings</code>.
All else holds.</p>
<ul><li><code>wildlab check</code> on the flight says which.</li></ul>
<p>1 finding. <code>wildlab check</code> says which.</p>
<p>Is 3.5 m much? <a href="#a">See <code>wildlab georeference</code></a></p>
<p>The filter <code>schmidt</code> is one.</p>
<p>Others count. State <code>others = true</code> in [targets.many]. Down <code>down = 0</code> is.
State <code>reach_m = 60</code>.</p>"""
    path = report(tmp_path, body)
    outside, inside = (
        BeautifulSoup(read_part(path, 1, exact=one, generalised=False).body, "html.parser")
        for one in (False, True)
    )
    assert len(inside.find_all("code")) > 5 and "--settings" in inside.get_text()
    assert [" ".join(one.get_text().split()) for one in outside.find_all("p")][:5] == [
        "2 of 9 values are assumed. All else holds.",
        "1 finding.",
        "Is 3.5 m much?",
        "The filter schmidt is one.",
        "Others count. Down down = 0 is.",
    ]
    assert not outside.find_all(["ul", "li"]) and "wildlab" not in outside.get_text()


def done(folder: Path, *, notebook: str = "overview.ipynb", tables: str = "x") -> None:
    """One that is done, on a flight of this name."""
    told = {"source": folder.name}
    leave_report(folder, "kifaru-ridge", parameters=told, notebook=notebook, files={"nav": tables})
    seal(folder, {"state": "done"}, ("provenance.json",))


def test_a_report_on_many_targets_goes_with_the_others_whichever_is_named(tmp_path):
    reports = tmp_path / "reports"
    done(reports / "kifaru-ridge-many", notebook=NOTEBOOK)
    done(reports / "kifaru-ridge-overview")
    for named in ("", "kifaru-ridge-many", "kifaru-ridge-overview"):
        ((source,), left_out) = sources_of(reports / named, {})
        assert [one.name for one in source.folders] == ["kifaru-ridge-overview", "kifaru-ridge-many"]
        assert source.parameters["kifaru-ridge-many"] == {"source": "kifaru-ridge-many"}
        assert source.logged and not left_out
