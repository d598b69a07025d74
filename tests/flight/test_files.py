"""Whatever a path leads to, it is opened only where it is a regular file of a sensible size."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from click.testing import CliRunner
from pydantic import Field

from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.flight import files
from wildlab.flight.files import Strict, check_model, parse_toml, read_regular, read_toml, regular_size
from wildlab.flight.store import load_flight, save_flight


def _refused(path: Path, limit: int = 100) -> str:
    with pytest.raises(WildlabError) as caught:
        read_regular(path, limit)
    assert caught.value.file == str(path) and caught.value.fix
    return str(caught.value)


def test_what_is_no_regular_file_is_named_and_never_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zeros").symlink_to("/dev/zero")
    assert "is a named pipe" in _refused(tmp_path / "pipe")
    assert "is a device" in _refused(tmp_path / "zeros")
    assert "is a folder" in _refused(tmp_path)


def test_sizes_are_stated_and_kept(tmp_path):
    path = tmp_path / "log"
    path.write_bytes(b"0123456789")
    assert read_regular(path, 10) == b"0123456789" and regular_size(path) == 10
    assert "has 10 bytes, and 9 are the most" in _refused(path, 9)
    with path.open("wb") as stream:
        stream.truncate(files.TOML_LIMIT + 1)  # takes no room on the disk
    with pytest.raises(WildlabError, match="4,000,001 bytes"):
        read_toml(path, "a recipe")


def test_a_file_that_grows_while_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "log"
    path.write_bytes(b"0123456789")
    monkeypatch.setattr(files, "regular_size", lambda path, limit, field: 5)
    assert "grew while it was read" in _refused(path, 5)


@pytest.mark.parametrize("name", ["frames.parquet", "nav/other.parquet", "flight.toml", "terrain.tif"])
def test_a_pipe_in_a_flight_stops_nothing(make_flight, tmp_path, name):
    folder = tmp_path / "flight"
    save_flight(make_flight(), folder)
    path = folder / name
    path.unlink(missing_ok=True)
    os.mkfifo(path)
    with pytest.raises(WildlabError) as caught:
        load_flight(folder)
    assert path.name in str(caught.value)


@pytest.mark.parametrize("minutes", ["nan", "inf", "0", "-3", "soon", "1e9"])
def test_minutes_that_are_none_are_refused(tmp_path, minutes):
    for command in (["run", "sensitivity"], ["evaluate", str(tmp_path)]):
        ran = CliRunner().invoke(wildlab, [*command, "--timeout", minutes])
        assert ran.exit_code == 2 and "is not a number of minutes" in ran.output


class Inner(Strict):
    on: bool = False
    size: float = 1.0


class Outer(Strict):
    number: float | None = None
    count: int = 1
    name: str | bool = ""
    rows: tuple[tuple[float, ...], ...] = ()
    by_name: dict[str, float] = Field(default_factory=dict)
    parts: dict[str, Inner] = Field(default_factory=dict)
    several: tuple[Inner, ...] = ()
    maybe: bool | None = None


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("number = true", "number"),
        ("count = false", "count"),
        ("rows = [[1, 0], [true, 1]]", "rows"),
        ("by_name = {x = 1.0, y = true}", "by_name"),
        ("parts = {a = {size = true}}", "parts.a.size"),
        ("several = [{size = 1.0}, {size = true}]", "several[1].size"),
    ],
)
def test_true_is_no_number_wherever_it_stands(text, field):
    with pytest.raises(WildlabError, match=r"(true|false) is no value for this key") as caught:
        check_model(Outer, parse_toml(text, Path("a.toml")), None)
    assert caught.value.field == field


@pytest.mark.parametrize("text", ['maybe = "yes"', "maybe = 1", "parts = {a = {on = 0}}"])
def test_what_is_true_or_false_is_written_so(text):
    with pytest.raises(WildlabError, match="neither true"):
        check_model(Outer, parse_toml(text, Path("a.toml")), None)
    right = "name = true\nmaybe = false\nparts = {a = {on = true}}\nseveral = [{on = true}]\ncount = 2\n"
    made = check_model(Outer, parse_toml(right, Path("a.toml")), None)
    assert made.name is True and made.parts["a"].on and made.several[0].on and made.maybe is False
