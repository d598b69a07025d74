"""MATLAB files as tables of a recipe, and what is said about those that cannot be read."""

import struct
import tomllib
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from wildlab.errors import WildlabError
from wildlab.files import sha256
from wildlab.flight import raw_files as raw
from wildlab.flight.raw_files import read_matlab, table_of
from wildlab.flight.recipes import MatlabTable

HERE = Path("log.mat")


def _cells(*names: str) -> np.ndarray:
    cells = np.empty((len(names), 1), dtype=object)
    cells[:, 0] = names
    return cells


@pytest.fixture
def mat(raw: Any) -> Any:
    """The right recipe, its poses and photos out of a MATLAB file."""
    latitude = 63.44 + 1e-4 * np.arange(5)
    seconds = 1718184600.0 + np.arange(5)
    variables = {
        "log": {
            "nav": {
                "t": seconds,
                "lat": latitude,
                "q": np.array([[1.0, 0, 0, 0]] * 5),
                "odd": np.arange(7.0),
                "complex": np.arange(5) * 1j,
            },
            "name": "thor",
        },
        "POS": np.column_stack([np.full(5, 10.4), np.full(5, 140.0), np.arange(5)]),
        "POS_label": _cells("lon", "height", "n"),
        "photo": _cells("A", "B", "C"),
        "when": np.array([1.5, 2.0, 3.0]),
        "one": np.array([1, 2, 3], dtype=np.int16),
    }
    (raw.folder / "raw").mkdir()
    scipy.io.savemat(raw.folder / "raw" / "log.mat", variables, do_compression=True)
    raw.set("tables", {"photos": {"file": "log.mat", "fields": ["photo", "when", "one"]}})
    raw.set("frames", {"file": "photos", "id": "photo", "time": {"column": "when", "format": "elapsed"}})
    return raw


def test_fields_of_the_file_itself(mat):
    before = sha256(mat.folder / "raw" / "log.mat")
    frames = mat.run().table("frames")
    assert list(frames["frame_id"]) == ["A", "B", "C"]
    np.testing.assert_allclose(frames["time_s"], [1.5, 2.0, 3.0])
    assert sha256(mat.folder / "raw" / "log.mat") == before
    sources = {one["file"]: one["sha256"] for one in _sources(mat)}
    assert sources["log.mat"] == before


def _sources(mat: Any) -> list[dict[str, Any]]:
    return list(tomllib.loads((mat.into / "flight.toml").read_text())["sources"])


def test_a_matrix_with_labels_and_a_struct(mat):
    labelled = table(mat, matrix="POS", labels="POS_label")
    assert list(labelled) == ["lon", "height", "n"]
    np.testing.assert_array_equal(labelled["n"], np.arange(5))
    named = table(mat, struct="log.nav", matrix="q", columns=("w", "x", "y", "z"))
    np.testing.assert_array_equal(named["w"], np.ones(5))
    nav = table(mat, struct="log.nav", fields=("t", "lat"))
    np.testing.assert_array_equal(nav["t"] - nav["t"][0], np.arange(5))


def table(mat: Any, **block: Any) -> dict[str, Any]:
    variables = read_matlab(HERE, (mat.folder / "raw" / "log.mat").read_bytes())
    return dict(table_of(variables, MatlabTable(file="log.mat", **block), HERE, "tables.x"))


def _header() -> bytes:
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def test_a_damaged_file_is_one_sentence(mat):
    good = (mat.folder / "raw" / "log.mat").read_bytes()
    rng = np.random.default_rng(1)
    for _ in range(30):
        bad = bytearray(good[: rng.integers(140, len(good))])
        for at in rng.integers(128, len(bad), 20):
            bad[at] = rng.integers(256)
        try:
            read_matlab(HERE, bytes(bad))
        except WildlabError as error:
            assert "damaged" in str(error) or "unpacked" in str(error)
            assert "\n" not in str(error)


def test_a_small_file_that_unpacks_to_a_huge_one(monkeypatch):
    monkeypatch.setattr(raw, "MOST_BYTES", 1 << 22)
    bomb = zlib.compress(bytes(1 << 24))
    assert len(bomb) < 1 << 15
    with pytest.raises(WildlabError, match="4 MiB"):
        read_matlab(HERE, _header() + struct.pack("<II", 15, len(bomb)) + bomb)


def test_a_variable_that_claims_to_be_huge():
    """A cell array of 2^40 cells in a few bytes."""
    flags = struct.pack("<IIII", 6, 8, 1, 0)
    dims = struct.pack("<IIii", 5, 8, 1 << 20, 1 << 20)
    name = struct.pack("<HH4s", 1, 1, b"x")
    body = flags + dims + name
    with pytest.raises(WildlabError, match="damaged MATLAB file"):
        read_matlab(HERE, _header() + struct.pack("<II", 14, len(body)) + body)
