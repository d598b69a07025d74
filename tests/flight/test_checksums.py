"""A byte of a flight that changed by itself is found; a change on purpose is accepted, nothing else."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight
from wildlab.flight.store import (
    Flight,
    accept_changes,
    load_flight,
    manifest_changed,
    save_flight,
    with_checksums,
)
from wildlab.geometry.georeference import Terrain


@pytest.fixture
def folder(make_flight: Callable[..., Flight], tmp_path: Path) -> Path:
    flight = make_flight()
    flight.terrain = Terrain(np.full((4, 4), -9.0, np.float32), -300.0, -300.0, 200.0)
    save_flight(flight, tmp_path / "flight")
    return tmp_path / "flight"


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def test_every_flipped_bit_of_a_table_is_found(folder):
    rng = np.random.default_rng(7)
    tables = [path for path in _files(folder) if path.name != "flight.toml"]
    for _ in range(100):
        path = tables[rng.integers(len(tables))]
        whole = path.read_bytes()
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        with pytest.raises(WildlabError, match="damaged or changed") as caught:
            load_flight(folder)
        assert caught.value.file == str(path)
        path.write_bytes(whole)
    load_flight(folder)


def test_every_flipped_bit_of_the_manifest_is_an_error_or_is_said(folder):
    rng = np.random.default_rng(8)
    path = folder / "flight.toml"
    whole = path.read_bytes()
    for place in rng.choice(len(whole), 100, replace=False):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            findings = check_flight(load_flight(folder))
        except WildlabError as error:
            assert str(folder) in str(error.file)
            continue
        worst = [
            one.level
            for one in findings
            if one.table == "flight.toml" and ("another one" in one.sentence or one.field == "locations")
        ]
        # Blank lines at the seam of the two parts say nothing.
        assert "warning" in worst or bytes(damaged).split() == whole.split(), damaged[place - 20 : place + 20]


def test_a_missing_and_an_added_table_are_named(folder):
    (folder / "nav" / "other.parquet").write_bytes((folder / "nav" / "autopilot.parquet").read_bytes())
    with pytest.raises(WildlabError, match="no checksum"):
        load_flight(folder)
    (folder / "nav" / "other.parquet").unlink()
    (folder / "truth.parquet").unlink()
    with pytest.raises(WildlabError, match="is missing"):
        load_flight(folder)


def test_a_change_on_purpose_is_accepted_and_comments_stay(folder):
    path = folder / "flight.toml"
    text = path.read_text().replace("camera_offset_s = 0.0", "camera_offset_s = 0.25  # by the flash")
    path.write_text(text)
    (folder / "truth.parquet").unlink()
    ran = CliRunner().invoke(wildlab, ["check", "--accept", str(folder)])
    assert "flight.toml, truth.parquet" in ran.stderr
    assert "by the flash" in path.read_text()
    flight = load_flight(folder)
    assert flight.manifest.clocks.camera_offset_s == 0.25 and flight.truth is None
    assert manifest_changed(folder) is False


def test_what_is_stated_of_places_is_no_damage(folder):
    path = folder / "flight.toml"
    whole = path.read_text()
    assert manifest_changed(folder) is False
    path.write_text(whole.replace("[locations]\n", "[locations]\ncategory = 2\n"))
    assert load_flight(folder).manifest.locations.category == 2
    assert manifest_changed(folder) is False
    path.write_text(path.read_text().replace("camera_offset_s = 0.0", "camera_offset_s = 0.5"))
    assert manifest_changed(folder) is True
    start = whole.index("[locations]")
    end = whole.index("\n[", start) + 1
    path.write_text(whole[:start] + whole[end:] + "\n[locations]\ncategory = 3\n")
    assert load_flight(folder).manifest.locations.category == 3
    assert manifest_changed(folder) is False


def test_the_part_may_stand_anywhere_but_in_a_text(folder):
    path = folder / "flight.toml"
    whole, part = path.read_text().split("[checksums]")
    head, rest = whole.split("[locations]")
    path.write_text(f"{head}\n[checksums]{part}\n[locations]{rest}")
    load_flight(folder)
    assert accept_changes(folder) == ["flight.toml"]  # its lines stand in another order
    assert manifest_changed(folder) is False and path.read_text().count("[checksums]") == 1

    quoted = path.read_text().replace('description = ""', 'description = """\n[checksums]\nmine"""')
    assert quoted != path.read_text()
    path.write_text(quoted)
    with pytest.raises(
        WildlabError, match=r"a text in it has a line that reads \[checksums\]|is not valid TOML"
    ):
        accept_changes(folder)
    assert path.read_text() == quoted


def test_writing_them_twice_changes_nothing():
    once = with_checksums('name = "lake"\n', {"frames.parquet": "0" * 64})
    assert with_checksums(once, {"frames.parquet": "0" * 64}) == once
