"""Bombs, damaged and closed files: what cannot be looked into is a finding, and takes no memory."""

from __future__ import annotations

import gzip
import io
import re
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyzipper

from tests.sharing.scan.packed import figure, parquet, picture, saved, sqlite, zipped
from tests.sharing.scan.spelt import NAME, WHEN, secrets
from wildlab.errors import WildlabError
from wildlab.sharing.scan import Finding, not_searched, scan
from wildlab.sharing.scan.inside.kinds import unpacked
from wildlab.sharing.scan.parts import Budget


def kinds(tmp_path: Path, data: bytes) -> set[str]:
    (tmp_path / "sent.bin").write_bytes(data)
    return {finding.kind for finding in scan([tmp_path / "sent.bin"], secrets())}


def trouble(data: bytes, most: int) -> tuple[list[str], int]:
    parts = list(unpacked(data, Budget(most, most)))
    return [part.trouble for part in parts if part.trouble], sum(len(part.data) for part in parts)


def _nested(data: bytes, times: int) -> bytes:
    for _ in range(times):
        data = gzip.compress(data, mtime=0)
    return data


def _quine_like(times: int) -> bytes:
    data = b"x" * 100
    for _ in range(times):
        data = zipped("a.zip", data)
    return data


def test_bombs_are_stopped():
    zeros = bytes(50_000_000)
    for bomb in (gzip.compress(zeros), zlib.compress(zeros), zipped("a", zeros), _nested(zeros, 3)):
        said, size = trouble(bomb, 5_000_000)
        assert any("more than" in one for one in said)
        assert size < 12_000_000


def test_what_is_packed_too_often_is_a_finding():
    said = [part.trouble for part in unpacked(_quine_like(20), Budget()) if part.trouble]
    assert len(said) == 1 and "too many" in said[0]
    assert not [part for part in unpacked(_quine_like(5), Budget()) if part.trouble]


def _encrypted() -> bytes:
    out = io.BytesIO()
    with pyzipper.AESZipFile(out, "w", encryption=pyzipper.WZ_AES) as archive:
        archive.setpassword(b"word")
        archive.writestr("page.html", b"nothing to see")
    return out.getvalue()


CLOSED: dict[str, Callable[[], bytes]] = {
    "an encrypted zip": _encrypted,
    "7z": lambda: b"7z\xbc\xaf\x27\x1c\x00\x04" + bytes(50),
    "RAR": lambda: b"Rar!\x1a\x07\x01\x00" + bytes(50),
    "age": lambda: b"age-encryption.org/v1\n-> X25519 abc\n",
    "an encrypted PDF": lambda: figure("x", "pdf").replace(b"trailer\n<<", b"trailer\n<< /Encrypt 9 0 R"),
    "bytes of chance": lambda: np.random.default_rng(3).bytes(20_000),
    "half a zip": lambda: zipped("a", b"text" * 999)[:60],
    "half a gzip": lambda: gzip.compress(np.random.default_rng(1).bytes(999))[:300],
    "half a PNG": lambda: saved(picture(), "PNG")[:-30],
    "half a JPEG": lambda: saved(picture(), "JPEG")[:300],
    "half a WebP": lambda: saved(picture(), "WEBP")[:-20],
    "half a Parquet file": lambda: parquet(__import__("pyarrow").table({"a": [1]}))[:-12],
    "a damaged SQLite file": lambda: sqlite("a TEXT", [("x",)])[:90] + b"\xff" * 4000,
    "a PDF with a damaged stream": lambda: re.sub(
        rb"stream\nx.", b"stream\nyy", figure("x", "pdf"), count=1, flags=re.DOTALL
    ),
}


@pytest.mark.parametrize("kind", CLOSED)
def test_what_cannot_be_looked_into_is_a_finding(tmp_path, kind):
    assert "unreadable" in kinds(tmp_path, CLOSED[kind]())


@pytest.mark.parametrize("cut", [10, 100, 400])
@pytest.mark.parametrize(
    "make", [lambda: saved(picture(), "PNG"), lambda: zipped("a", b"b"), lambda: figure("x", "pdf")]
)
def test_nothing_damaged_raises(tmp_path, make, cut):
    data = bytearray(make())
    data[cut % len(data) :: 37] = b"\xff" * len(data[cut % len(data) :: 37])
    (tmp_path / "a").write_bytes(bytes(data))
    assert isinstance(scan([tmp_path / "a"], secrets()), list)


def test_names_of_files_and_folders_are_looked_at(tmp_path):
    folder = tmp_path / "reports" / NAME.replace(" ", "_")
    folder.mkdir(parents=True)
    (folder / "page.html").write_text("nothing")
    (tmp_path / "reports" / "20230517.png").write_bytes(saved(picture(), "PNG"))
    found = {(finding.file, finding.kind) for finding in scan([tmp_path / "reports"], secrets())}
    assert found == {("reports/Vesle_Trollholmen/page.html", "name"), ("reports/20230517.png", "date")}
    # What lies above is not sent.
    assert scan([folder / "page.html"], secrets()) == []


def test_times_of_entries(tmp_path):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr(zipfile.ZipInfo("a", (WHEN.year, WHEN.month, WHEN.day, 1, 2, 4)), b"")
    assert kinds(tmp_path, out.getvalue()) == {"date"}
    assert kinds(tmp_path, gzip.compress(b"a", mtime=int(WHEN.timestamp()))) == {"date"}
    assert kinds(tmp_path, gzip.compress(b"a", mtime=int(WHEN.timestamp()) + 40 * 86_400)) == set()


def test_a_finding_hides_what_it_found():
    finding = Finding("a.html", "line 1", "place", "latitude", "63.4179")
    assert "63.4179" not in repr(finding) and "63.4179" not in str(finding)
    assert "63.4" not in repr(secrets())


def test_what_is_not_looked_for_is_said():
    said = not_searched(secrets().with_words("boat", "no", "12", "/home/kari/flights"))
    assert any("'boat'" in one for one in said) and any("'no'" in one for one in said)
    assert not any("kari" in one for one in said)
    # A list of a thousand lines hides the one that matters; that one comes first.
    numbers = tuple(f"{n:04d}" for n in range(1046))
    many = not_searched(replace(secrets(), words=("boat", *numbers)))
    assert "'boat'" in many[0] and "1046" in many[1] and len(many) < 10
    assert len(not_searched(replace(secrets(), words=numbers[:3]))) == len(many) + 1


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(WildlabError, match="no such"):
        scan([tmp_path / "none"], secrets())


def test_many_small_parts_are_stopped():
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for number in range(300):
            archive.writestr(f"{number}", b"x")
    parts = list(unpacked(out.getvalue(), Budget(parts=100)))
    assert any("more than" in part.trouble for part in parts)
