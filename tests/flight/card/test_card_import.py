"""A card in, a flight out: what is seen where it truly is, by an independent projection."""

import json
import re
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from tests.flight.card.cards import MARKS, TAKEN, gpx, write_card, write_photo
from tests.flight.readers.dataflash_logs import Truth, third_generation
from wildlab.api.flights import georeference
from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.flight.card import Proposal, Wishes, import_card, read_card, recipe_beside
from wildlab.flight.importing import import_flight
from wildlab.flight.readers import read_log
from wildlab.flight.store import load_flight


@pytest.fixture
def card(tmp_path: Path) -> Path:
    write_card(tmp_path / "card")
    return tmp_path / "card"


def read(card: Path, roles: dict[str, str] | None = None, **wishes: Any) -> Proposal:
    """The card in a folder, by a clock in UTC unless another zone is given."""
    return read_card([card], Wishes("card", **{"zone": "UTC", **wishes}), roles or {})


def call(*arguments: object) -> Result:
    return CliRunner().invoke(wildlab, ["import", *map(str, arguments)])


def fox(seconds: int = 20) -> str:
    """A track that goes north at half a metre a second."""
    return gpx([(i, 0.5 * i, 1.0, 40.0) for i in range(seconds)])


def test_points_of_a_card_lie_where_they_were_surveyed(card, tmp_path):
    read_in = read(card)
    flight = import_card(read_in, tmp_path / "flight")
    assert {one.role for one in read_in.choices} == {"images", "marks", "clicks"}
    assert flight.manifest.vertical.reference == "ellipsoid"
    points = georeference(flight).table
    assert len(points) >= 8
    truth = flight.truth.set_index("target_id").loc[points["target_id"]]
    gap = points[["north_m", "east_m"]].to_numpy() - truth[["north_m", "east_m"]].to_numpy()
    # What is left is the Earth's curvature beside a level plane, and the rounding of what was written.
    assert np.hypot(*gap.T).max() < 0.02
    assert set(points["target_id"]) <= set(MARKS)


def test_clicks_know_their_images_whatever_folder_and_capitals(card, tmp_path):
    usual = import_card(read(card), tmp_path / "usual").table("detections")
    head, *rows = (card / "clicks.csv").read_text(encoding="utf-8").splitlines()
    for write in (str.swapcase, "C:\\set\\{}".format):
        renamed = [",".join([write(image), *rest]) for image, *rest in (row.split(",") for row in rows)]
        (card / "clicks.csv").write_text("\n".join([head, *renamed]) + "\n", encoding="utf-8")
        proposal = read(card)
        assert not [one for one in proposal.notes if "of no image" in one]
        found = import_card(proposal, tmp_path / "renamed", overwrite=True).table("detections")
        assert len(usual) and found.equals(usual)


def test_the_recipe_beside_a_flight_makes_it_again(card, tmp_path):
    first = import_card(read(card), tmp_path / "flight")
    again = import_flight(recipe_beside(tmp_path / "flight"), card, tmp_path / "again")
    for name, table in first.tables.items():
        assert table.equals(again.tables[name]), name
    said = tomllib.loads(recipe_beside(tmp_path / "flight").read_text(encoding="utf-8"))
    assert said["camera"]["fx_px"] == 800.0
    assert said["locations"] == {"sensitivity": "withheld"}


def test_a_track_beside_the_images_is_a_target_once(card, tmp_path):
    for name, seconds in (("fox <b>.gpx", 40), ("fox <b>2.gpx", 40), ("fox cut.gpx", 25)):
        (card / name).write_text(fox(seconds))
    assert call(card, "--out", tmp_path / "flight", "--zone", "UTC", "--geoid", 0).exit_code == 0
    flight = load_flight(tmp_path / "flight")
    tracks = flight.truth[flight.truth["time_s"].notna()]
    assert set(tracks["target_id"]) == {"fox-b"}
    assert np.allclose(np.diff(tracks["north_m"]), 0.5, atol=1e-3)


@pytest.mark.parametrize(("second", "target"), [("deer", None), ("fox", "name")])
def test_names_of_kinds_are_no_targets(card, second, target):
    """Two boxes of one category in an image are two animals, and not one that is there twice."""
    (card / "marks.csv").unlink()
    rows = (card / "clicks.csv").read_text(encoding="utf-8").splitlines()
    image = rows[1].split(",")[0]
    boxes = [f"{image},100,100,deer", f"{image},300,200,{second}"]
    (card / "clicks.csv").write_text("\n".join(["image,u,v,name", *boxes]) + "\n", encoding="utf-8")
    said = tomllib.loads(call(card, "--dry-run", "--zone", "UTC").stdout)
    assert said["detections"][0].get("target") == target


def test_a_dry_run_writes_nothing_gives_a_recipe_and_tells_no_place(card, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    result = call(card, "--dry-run", "--zone", "UTC")
    assert result.exit_code == 0, result.output
    assert tomllib.loads(result.stdout)["frames"]["id"] == "stem"
    assert "100MEDIA" in result.stderr
    assert not any(part in result.output for part in ("59.0", "10.1"))
    assert sorted(tmp_path.rglob("*")) == before
    told = json.loads(call(card, "--dry-run", "--json").stdout)
    assert {one["role"] for one in told["files"]} == {"images", "marks", "clicks"}


def test_the_zone_of_a_wall_clock_by_the_flight(card, tmp_path):
    """The camera runs two hours ahead of UTC, the track on board says when it flew."""
    # A receiver on board: where the images are taken, in UTC two hours before their wall clock.
    track = [(-7200.0 + t, -30.0 + 1.6 * t, -8.0 + 2 * t, 100.0) for t in range(-20, 40)]
    (card / "own.gpx").write_text(gpx(track))
    flight = import_card(read(card, {"own.gpx": "own"}, geoid_m=0.0, zone=None), tmp_path / "flight")
    assert flight.manifest.clocks.camera_offset_s == -7200.0


def test_overwriting_takes_a_word(card, tmp_path):
    arguments = (card, "--out", tmp_path / "flight", "--zone", "UTC")
    assert call(*arguments).exit_code == 0
    recipe = recipe_beside(tmp_path / "flight").read_text(encoding="utf-8")
    assert isinstance(call(*arguments).exception, WildlabError)
    assert call(*arguments, "--overwrite").exit_code == 0
    assert recipe_beside(tmp_path / "flight").read_text(encoding="utf-8") == recipe
    assert load_flight(tmp_path / "flight").name == "flight"
    # What contradicts itself is written, to be looked at, and no script goes on with it.
    beside = recipe_beside(tmp_path / "flight")
    beside.write_text(recipe.replace('looks = "forward"', 'looks = "down"'), encoding="utf-8")
    again = call(beside, "--source", card, "--out", tmp_path / "flight", "--overwrite")
    assert again.exit_code == 2 and load_flight(tmp_path / "flight").manifest.mount.looks == "down"


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--role", "marks.csv", "names no role"),
        ("--role", "marks.csv=boss", "'boss' is no role"),
        ("--role", "mark.csv=marks", "nothing called"),
        ("--role", "DCIM/100MEDIA=images:infra", "'infra'"),
        ("--zone", "Nowhere", "is not a time zone"),
        ("--start", "yesterday", "is no time with a zone"),
    ],
)
def test_what_is_stated_wrongly(card, option, value, said):
    result = call(card, "--dry-run", option, value)
    assert isinstance(result.exception, WildlabError)
    assert said in str(result.exception)


@pytest.mark.parametrize(
    "arguments",
    ["card", "card --out x --json", "card --out x --source y", "r.toml --out x --zone UTC"],
)
def test_options_that_do_not_go_together(arguments):
    assert call(*arguments.split()).exit_code == 2


def test_an_empty_card_and_one_that_says_nothing(tmp_path):
    for name, problem in (("", "nothing in it"), ("notes.bin", "nothing here")):
        (tmp_path / "card").mkdir(exist_ok=True)
        if name:
            (tmp_path / "card" / name).write_bytes(b"\x00" * 100)
        with pytest.raises(WildlabError, match=problem):
            read(tmp_path / "card", zone="")
    with pytest.raises(WildlabError, match="is not there"):
        read(tmp_path / "lost")


def untimed(folder: Path, more: int) -> Path:
    """An autopilot's log, and images without a tag: as many as records of triggers and so many more."""
    data = third_generation(Truth(2025), 40.0).binary()
    count = len(read_log(Path("x.bin"), data, "dataflash").parts["triggers"])
    folder.mkdir()
    (folder / "flight.bin").write_bytes(data)
    for number in range(count + more):
        Image.new("L", (64, 48), number).save(folder / f"img_{number + 1}.png")
    return folder


def test_images_without_any_time_have_those_of_as_many_triggers(tmp_path):
    flight = import_card(read(untimed(tmp_path / "card", 0), focal_px=80.0), tmp_path / "flight")
    times = flight.table("frames")["time_s"].to_numpy()
    assert flight.table("frames")["frame_id"].tolist() == [f"img_{i + 1}" for i in range(len(times))]
    assert len(times) > 3 and (np.diff(times) > 0).all() and flight.manifest.time.kind == "utc"


def test_others_are_left_out_with_what_to_do(tmp_path):
    card = read(untimed(tmp_path / "card", 1), focal_px=80.0)
    assert any("as many images as there are records" in one for one in card.notes)
    assert import_card(card, tmp_path / "flight").frames is None


def test_plain_tables_are_told_that_they_take_a_recipe(tmp_path):
    (tmp_path / "log.csv").write_text("t,roll,pitch\n0,1,2\n1,1,2\n")
    with pytest.raises(WildlabError, match="a recipe says what its columns are"):
        read(tmp_path)
    called = CliRunner().invoke(wildlab, ["check", str(tmp_path)])
    assert called.exit_code and "wildlab import" in str(called.exception)


def test_several_folders_of_images_are_one_series(card, tmp_path):
    second = card / "DCIM" / "101MEDIA"
    second.mkdir()
    (card / "DCIM" / "100MEDIA" / "DJI_0004.JPG").rename(second / "DJI_0004.JPG")
    flight = import_card(read(card), tmp_path / "flight")
    assert flight.table("frames")["frame_id"].tolist() == [f"DJI_000{i}" for i in range(1, 5)]
    assert len(flight.nav["camera"]) == 4


def test_of_two_cameras_the_thermal_one_is_taken_and_the_other_can_be(card, tmp_path):
    pictures = card / "DCIM" / "100MEDIA"
    for path in sorted(pictures.glob("*.JPG")):
        path.rename(path.with_name(path.stem + "_W.JPG"))
    for i in range(3):
        when = datetime.fromtimestamp(TAKEN.timestamp() + i, UTC)
        path = pictures / f"DJI_{i + 1:04d}_T.JPG"
        write_photo(path, (0.0, i, 60.0), (0.0, -70.0, 0.0), when, (320, 256), 400.0)
    (card / "clicks.csv").unlink()
    flight = import_card(read(card), tmp_path / "flight")
    assert (flight.manifest.camera.width_px, flight.manifest.camera.fx_px) == (320, 400.0)
    assert len(flight.table("frames")) == 3
    wide = import_card(read(card, {"DCIM/100MEDIA": "images:wide"}), tmp_path / "wide")
    assert len(wide.table("frames")) == 4


@pytest.mark.parametrize(("lacking", "remedy"), [("Gimbal", "--role"), ("CalibratedFocalLength", "--camera")])
def test_what_images_lack_is_what_is_asked_for(lacking, remedy, card):
    """Places without angles want a log; angles without a focal length want a camera."""
    for path in card.rglob("*.JPG"):
        content = path.read_bytes()
        for found in re.findall(rb'drone-dji:\w*="[^"]*"', content):
            if lacking.encode() in found:
                content = content.replace(found, b" " * len(found))
        path.write_bytes(content)
    with pytest.raises(WildlabError) as refused:
        read(card)
    assert remedy in refused.value.fix
