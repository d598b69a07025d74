"""Zips whose listing says nothing, and files that come whole or not at all."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest
import pyzipper

from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.reporting.page import page
from wildlab.runner.record.digests import seal
from wildlab.sharing.package import (
    check_password,
    private_folder,
    put,
    refuse_existing,
    sweep_beside,
    zip_bytes,
)

FILES = {"flight.html": b"<p>page</p>" * 50}
WORDS = "correct horse battery"


def test_the_same_files_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).write_bytes(zip_bytes(FILES))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    with zipfile.ZipFile(tmp_path / "a") as zipped:
        (info,) = zipped.infolist()
        assert (info.filename, info.date_time, info.comment, zipped.comment) == (
            "flight.html", (1980, 1, 1, 0, 0, 0), b"", b"",
        )  # fmt: skip
        assert zipped.read("flight.html") == FILES["flight.html"]


def test_an_encrypted_zip_opens_with_its_password_and_not_without(tmp_path: Path) -> None:
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


def test_a_password_that_can_be_tried_out_is_refused() -> None:
    check_password("a" * 12)
    with pytest.raises(WildlabError, match="The password has 5 characters"):
        check_password("rhino")


def test_a_folder_to_work_in_is_private_and_gone_afterwards(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(KeyboardInterrupt), private_folder() as work:
        assert work.parent == tmp_path and work.stat().st_mode & 0o077 == 0
        (work / "page.html").write_text("half")
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())
    # Of a process that was killed: no process has a number this high.
    (tmp_path / "wildlab-share-4194999-x").mkdir()
    (tmp_path / f"wildlab-share-{os.getpid()}-other").mkdir()
    with private_folder():
        pass
    assert [one.name for one in tmp_path.iterdir()] == [f"wildlab-share-{os.getpid()}-other"]


def test_what_a_killed_run_left_beside_a_copy_is_swept(tmp_path: Path) -> None:
    (tmp_path / ".share.abc.part" / "pages").mkdir(parents=True)
    (tmp_path / ".share.abc.part" / "pages" / "flight.html").write_text("rhino")
    (tmp_path / ".copy.zip.abcd1234").write_text("half")
    (tmp_path / "other.zip").write_text("mine")
    sweep_beside(tmp_path / "copy.zip")
    assert [one.name for one in tmp_path.iterdir()] == ["other.zip"]


KILLED = """
import os, signal, sys
from pathlib import Path
from wildlab.sharing import package, share as module
def kill(*given, **more):
    print("all pages were made", flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
os.fsync = kill
module.share(Path(sys.argv[1]), "team", out=Path(sys.argv[2]), password="correct horse battery")
"""


@pytest.mark.slow
def test_a_killed_run_leaves_no_page_that_can_be_read(tmp_path: Path) -> None:
    report = tmp_path / "reports" / "gating"
    report.mkdir(parents=True)
    said = "nobody may read this"
    body = page(title="x", body=f"<header><h1>Report</h1></header><p>{said}</p>")
    (report / "report.html").write_text(body, encoding="utf-8")
    write_json(report / "provenance.json", {"flight": None, "parameters": {}})
    seal(report, {"state": "done"}, ("report.html", "provenance.json"))
    out, temporary = tmp_path / "out", tmp_path / "tmp"
    temporary.mkdir()
    command = [sys.executable, "-c", KILLED, str(report), str(out / "copy.zip")]
    ended = subprocess.run(
        command, env={**os.environ, "TMPDIR": str(temporary)}, capture_output=True, text=True, check=False
    )
    assert ended.returncode == -signal.SIGKILL and "all pages were made" in ended.stdout, ended.stderr
    left = [one for folder in (out, temporary) for one in folder.rglob("*") if one.is_file()]
    assert not [one for one in left if said.encode() in one.read_bytes()]


def test_nothing_is_overwritten_without_being_asked(tmp_path: Path) -> None:
    there = tmp_path / "copy.html"
    there.write_text("old")
    with pytest.raises(WildlabError, match="there already"):
        put(b"new", there, overwrite=False)
    assert there.read_text() == "old"
    put(b"new", there, overwrite=True)
    assert there.read_text() == "new" and len(list(tmp_path.iterdir())) == 1
    with pytest.raises(WildlabError, match="is a folder, and a copy is one file"):
        refuse_existing(tmp_path, overwrite=True)
