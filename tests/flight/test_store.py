"""Flights on disk survive, whole or not at all; hostile folders, and files that are none, stay outside."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rasterio
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

import wildlab.flight.store as store
from tests.flight.conftest import fault
from wildlab.errors import WildlabError
from wildlab.flight import files
from wildlab.flight.files import Strict, check_model, parse_toml, read_regular
from wildlab.flight.schema import TABLES, conform
from wildlab.flight.store import Flight, accept_changes, load_flight, save_flight
from wildlab.geometry.georeference import Terrain


def _same(one: Flight, other: Flight) -> None:
    assert one.manifest == other.manifest
    assert sorted(one.nav) == sorted(other.nav)
    assert sorted(one.tables) == sorted(other.tables)
    for name in one.nav:
        pd.testing.assert_frame_equal(one.nav[name], other.nav[name])
    for name in one.tables:
        pd.testing.assert_frame_equal(one.tables[name], other.tables[name])


def test_round_trip(make_flight, tmp_path):
    flight = make_flight()
    saved = save_flight(flight, tmp_path / "deep" / "flight")
    _same(load_flight(tmp_path / "deep" / "flight"), flight)
    assert saved.folder == tmp_path / "deep" / "flight"
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["flight"]


def test_same_flight_same_bytes(make_flight, tmp_path):
    for name in "ab":
        save_flight(make_flight(), tmp_path / name)
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file())
    assert len(files) == 5
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


names = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)


@given(
    st.lists(
        st.tuples(names, names, st.floats(allow_infinity=True, allow_nan=True), st.integers(-5, 5)),
        max_size=6,
    )
)
def test_table_values_survive(tmp_path_factory, rows):
    truth = pd.DataFrame(rows, columns=["target_id", "remark", "north_m", "east_m"]).assign(
        down_m=0.0, time_s=np.nan
    )
    table = conform(TABLES["truth"], truth, "truth")
    path = tmp_path_factory.mktemp("table") / "truth.parquet"
    store.write_table(table, path)
    back = store._read(path.parent, path.name, TABLES["truth"])
    pd.testing.assert_frame_equal(back, table, check_exact=True)


@pytest.mark.parametrize(
    ("table", "change", "said"),
    [
        ("frames", lambda d: d.drop(columns="time_s"), "time_s: is missing"),
        ("frames", lambda d: d.assign(time_s="soon"), "time_s: numbers are expected"),
        ("frames", lambda d: d.assign(time_s=[True, False, True]), "time_s: bool"),
        ("frames", lambda d: d.assign(frame_id=[1, 2, 3]), "frame_id: holds 1"),
        ("frames", lambda d: d.assign(pan_rad=0.0), "tilt_rad: 'pan_rad'"),
        ("detections", lambda d: d.assign(kind="bearing"), "azimuth_rad: is missing"),
        ("detections", lambda d: d.assign(kind="guess"), "kind: not a kind"),
    ],
)
def test_a_table_that_does_not_fit_is_refused_and_nothing_written(make_flight, tmp_path, table, change, said):
    flight = make_flight()
    flight.tables[table] = change(flight.tables[table])
    with pytest.raises(WildlabError, match=fault(f"{table}, {said}")) as caught:
        save_flight(flight, tmp_path / "flight")
    assert caught.value.fix and list(tmp_path.iterdir()) == []


def test_folder_without_manifest(tmp_path):
    with pytest.raises(WildlabError, match="no such file"):
        load_flight(tmp_path)


def test_broken_parquet(make_flight, tmp_path):
    save_flight(make_flight(), tmp_path / "flight")
    (tmp_path / "flight" / "truth.parquet").write_bytes(b"PAR1 rubbish")
    accept_changes(tmp_path / "flight")
    with pytest.raises(WildlabError, match="not a readable Parquet"):
        load_flight(tmp_path / "flight")


@pytest.mark.parametrize("name", ["truth.parquet", "nav/other.parquet", "terrain.tif", "flight.toml"])
def test_a_link_out_of_the_folder_is_refused(make_flight, tmp_path, name):
    save_flight(make_flight(), tmp_path / "flight")
    outside = tmp_path / "outside"
    outside.write_bytes((tmp_path / "flight" / "truth.parquet").read_bytes())
    inside = tmp_path / "flight" / name
    inside.unlink(missing_ok=True)
    inside.symlink_to(outside)
    with pytest.raises(WildlabError) as caught:
        load_flight(tmp_path / "flight")
    assert "leaves its folder" in str(caught.value)
    assert caught.value.field == name


@pytest.mark.parametrize("source", ["../x", "/x", "a/b", "", ".", "a\\b", "x" * 101])
def test_a_nav_source_cannot_leave_the_folder(make_flight, tmp_path, source):
    flight = make_flight()
    flight.nav[source] = flight.nav["autopilot"]
    with pytest.raises(WildlabError, match="nav source"):
        save_flight(flight, tmp_path / "flight")
    assert list(tmp_path.iterdir()) == []


def test_overwriting_only_when_asked_and_only_flights(make_flight, tmp_path):
    folder = tmp_path / "flight"
    folder.mkdir()
    save_flight(make_flight(), folder)  # an empty folder is as good as none
    changed = make_flight(description="second")
    with pytest.raises(WildlabError, match="already"):
        save_flight(changed, folder)
    save_flight(changed, folder, overwrite=True)
    assert load_flight(folder).manifest.description == "second"
    assert [path.name for path in tmp_path.iterdir()] == ["flight"]

    (folder / "notes.txt").write_text("mine")
    with pytest.raises(WildlabError, match="no part"):
        save_flight(changed, folder, overwrite=True)
    assert (folder / "notes.txt").read_text() == "mine"

    other = tmp_path / "photos"
    other.mkdir()
    (other / "a.jpg").write_bytes(b"")
    with pytest.raises(WildlabError, match="holds other things"):
        save_flight(changed, other, overwrite=True)
    with pytest.raises(WildlabError, match="is a file"):
        save_flight(changed, other / "a.jpg", overwrite=True)


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_an_interrupted_write_leaves_the_old_flight(make_flight, tmp_path, monkeypatch, error):
    save_flight(make_flight(), tmp_path / "flight")

    def fail(*_: Any) -> None:
        raise error

    monkeypatch.setattr(store, "write_table", fail)
    with pytest.raises(error):
        save_flight(make_flight(description="second"), tmp_path / "flight", overwrite=True)
    with pytest.raises(error):
        save_flight(make_flight(), tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["flight"]
    assert load_flight(tmp_path / "flight").manifest.description == ""


def test_terrain_goes_along(make_flight, tmp_path):
    height = np.arange(12, dtype=np.float32).reshape(3, 4)
    height[1, 2] = np.nan
    flight = make_flight()
    flight.terrain = Terrain(height, -10.1, 20.3, 0.7, 0.25)
    first = load_flight(save_flight(flight, tmp_path / "one").folder or "")
    second = load_flight(save_flight(first, tmp_path / "two").folder or "")
    for found in (first.terrain, second.terrain):
        np.testing.assert_array_equal(found.height, height)
        assert (found.north, found.east, found.step, found.sd) == (-10.1, 20.3, 0.7, 0.25)
    assert load_flight(save_flight(make_flight(), tmp_path / "three").folder or "").terrain is None


@pytest.mark.parametrize("damage", ["cut", "text", "other"])
def test_a_terrain_that_is_none_is_refused(make_flight, tmp_path, damage):
    flight = make_flight()
    flight.terrain = Terrain(
        np.random.default_rng(0).normal(0, 9, (300, 300)).astype(np.float32), 0.0, 0.0, 1.0
    )
    save_flight(flight, tmp_path / "one")
    path = tmp_path / "one" / "terrain.tif"
    whole = path.read_bytes()
    if damage == "other":
        with rasterio.open(path, "w", driver="GTiff", width=9, height=9, count=3, dtype="uint8") as data:
            data.write(np.zeros((3, 9, 9), np.uint8))
    else:
        path.write_bytes(whole[: len(whole) // 2] if damage == "cut" else b"II*")
    accept_changes(tmp_path / "one")
    with pytest.raises(WildlabError, match="Lay the terrain"):
        load_flight(tmp_path / "one")


def test_choice_of_pose_source(make_flight):
    flight = make_flight()
    assert flight.pose_source()[0] == "autopilot"
    flight.nav["observer"] = flight.nav["autopilot"]
    assert flight.pose_source("observer")[0] == "observer"
    assert flight.pose_source()[0] == "observer", "the best of them"
    flight.nav["a-tracker"] = flight.nav["autopilot"]
    assert flight.estimated_sources == ["observer", "autopilot", "a-tracker"]
    flight.nav["logged"] = flight.nav["autopilot"]
    assert flight.pose_source()[0] == "logged"
    with pytest.raises(WildlabError, match="no nav source 'mekf'"):
        flight.pose_source("mekf")


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


def test_a_file_that_grows_while_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "log"
    path.write_bytes(b"0123456789")
    monkeypatch.setattr(files, "regular_size", lambda path, limit, field: 5)
    assert "grew while it was read" in _refused(path, 5)


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
