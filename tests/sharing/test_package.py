"""Zips whose listing says nothing, and files that come whole or not at all."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
import pyzipper

from wildlab.errors import WildlabError
from wildlab.sharing.package import aside, check_password, put, refuse_existing, write_zip

FILES = {"flight.html": b"<p>page</p>" * 50}
WORDS = "correct horse battery"


def test_the_same_files_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_zip(tmp_path / name, FILES)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    with zipfile.ZipFile(tmp_path / "a") as zipped:
        (info,) = zipped.infolist()
        assert (info.filename, info.date_time, info.comment, zipped.comment) == (
            "flight.html", (1980, 1, 1, 0, 0, 0), b"", b"",
        )  # fmt: skip
        assert zipped.read("flight.html") == FILES["flight.html"]


def test_an_encrypted_zip_opens_with_its_password_and_not_without(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    write_zip(path, FILES, WORDS)
    assert b"page" not in path.read_bytes()
    with pyzipper.AESZipFile(path) as zipped:
        assert zipped.namelist() == ["flight.html"]
        with pytest.raises(RuntimeError, match=r"[Pp]assword|encrypted"):
            zipped.read("flight.html")
        with pytest.raises(RuntimeError, match=r"[Pp]assword"):
            zipped.read("flight.html", pwd=b"correct horse staple")
        assert zipped.read("flight.html", pwd=WORDS.encode()) == FILES["flight.html"]


def test_an_encrypted_zip_has_no_checksum_of_what_is_inside(tmp_path: Path) -> None:
    """Whoever guesses what is inside could tell by it."""
    path = tmp_path / "a.zip"
    write_zip(path, FILES, WORDS)
    with zipfile.ZipFile(path) as zipped:
        assert zipped.infolist()[0].CRC == 0


def test_a_password_that_can_be_tried_out_is_refused() -> None:
    check_password("a" * 12)
    with pytest.raises(WildlabError, match="The password has 5 characters"):
        check_password("rhino")


def test_nothing_is_left_of_what_was_broken_off(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "copy.html"
    with pytest.raises(KeyboardInterrupt), aside(target) as work:
        (work / "page.html").write_text("half")
        raise KeyboardInterrupt
    assert not list(target.parent.iterdir())


def test_nothing_is_overwritten_without_being_asked(tmp_path: Path) -> None:
    there, made = tmp_path / "copy.html", tmp_path / "made"
    there.write_text("old")
    made.write_text("new")
    with pytest.raises(WildlabError, match="there already"):
        put(made, there, overwrite=False)
    assert there.read_text() == "old"
    put(made, there, overwrite=True)
    assert there.read_text() == "new" and not made.exists()
    with pytest.raises(WildlabError, match="is a folder, and a copy is one file"):
        refuse_existing(tmp_path, overwrite=True)
