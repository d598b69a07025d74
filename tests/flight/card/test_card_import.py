"""A card in, a flight out: what is seen where it truly is, by an independent projection."""

from __future__ import annotations

import json
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tests.flight.card.cards import MARKS, TAKEN, geodetic, gpx, write_card, write_photo
from wildlab.api.points import georeference
from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.flight.card.importing import Card, import_card, read_card, recipe_beside
from wildlab.flight.card.proposal import Wishes
from wildlab.flight.manifest_parts import CameraPart
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import load_flight


def read(folder: Path, roles: dict[str, str] | None = None, **wishes: Any) -> Card:
    """The card in a folder, by a clock in UTC unless another zone is given."""
    return read_card([folder / "card"], Wishes("card", **{"zone": "UTC", **wishes}), roles or {})


def test_points_of_a_card_lie_where_they_were_surveyed(tmp_path):
    write_card(tmp_path / "card")
    card = read(tmp_path)
    flight = import_card(card, tmp_path / "flight")
    assert {one.role for one in card.choices} == {"images", "marks", "clicks"}
    assert flight.manifest.vertical.reference == "ellipsoid"
    points = georeference(flight).table
    assert len(points) >= 8
    truth = flight.truth.set_index("target_id").loc[points["target_id"]]
    gap = points[["north_m", "east_m"]].to_numpy() - truth[["north_m", "east_m"]].to_numpy()
    errors = np.hypot(*gap.T)
    # What is left is the Earth's curvature beside a level plane, and the rounding of what was written.
    assert errors.max() < 0.02
    assert set(points["target_id"]) <= set(MARKS)


def test_the_recipe_beside_a_flight_makes_it_again(tmp_path):
    write_card(tmp_path / "card")
    card = read(tmp_path)
    first = import_card(card, tmp_path / "flight")
    again = import_flight(recipe_beside(tmp_path / "flight"), tmp_path / "card", tmp_path / "again")
    for name, table in first.tables.items():
        assert table.equals(again.tables[name]), name
    said = tomllib.loads(recipe_beside(tmp_path / "flight").read_text(encoding="utf-8"))
    assert said["camera"]["fx_px"] == 800.0
    assert said["locations"] == {"sensitivity": "withheld"}


def test_a_track_beside_the_images_is_a_target(tmp_path):
    write_card(tmp_path / "card")
    (tmp_path / "card" / "fox <b>.gpx").write_text(gpx([(i, 0.5 * i, 1.0, 40.0) for i in range(20)]))
    card = read(tmp_path, geoid_m=0.0)
    target = next(one for one in card.choices if one.role == "target")
    assert target.target == "fox-b"
    flight = import_card(card, tmp_path / "flight")
    fox = flight.truth[flight.truth["target_id"] == "fox-b"]
    assert np.allclose(np.diff(fox["north_m"]), 0.5, atol=1e-3)


def test_heights_that_cannot_be_compared_are_refused(tmp_path):
    write_card(tmp_path / "card")
    (tmp_path / "card" / "fox.gpx").write_text(gpx([(i, 0.5 * i, 1.0, 40.0) for i in range(20)]))
    with pytest.raises(WildlabError) as caught:
        read(tmp_path)
    assert "--geoid" in str(caught.value) and "fox.gpx" in str(caught.value)


def test_a_dry_run_writes_nothing_and_gives_a_recipe(tmp_path):
    write_card(tmp_path / "card")
    before = sorted(tmp_path.rglob("*"))
    result = CliRunner().invoke(wildlab, ["import", str(tmp_path / "card"), "--dry-run", "--zone", "UTC"])
    assert result.exit_code == 0, result.output
    assert tomllib.loads(result.stdout)["frames"]["id"] == "stem"
    assert "100MEDIA" in result.stderr
    assert sorted(tmp_path.rglob("*")) == before
    result = CliRunner().invoke(wildlab, ["import", str(tmp_path / "card"), "--dry-run", "--json"])
    told = json.loads(result.stdout)
    assert {one["role"] for one in told["files"]} == {"images", "marks", "clicks"}


def test_no_place_is_told(tmp_path):
    write_card(tmp_path / "card")
    result = CliRunner().invoke(wildlab, ["import", str(tmp_path / "card"), "--dry-run", "--zone", "UTC"])
    for part in ("59.05", "10.12", "59.0", "10.1"):
        assert part not in result.output


def test_the_zone_of_a_wall_clock_by_the_flight(tmp_path):
    """The camera runs two hours ahead of UTC, the track on board says when it flew."""
    write_card(tmp_path / "card")
    # A receiver on board: where the images are taken, in UTC two hours before their wall clock.
    track = [(-7200.0 + t, -30.0 + 1.6 * t, -8.0 + 2 * t, 100.0) for t in range(-20, 40)]
    (tmp_path / "card" / "own.gpx").write_text(gpx(track))
    card = read_card([tmp_path / "card"], Wishes("card", geoid_m=0.0), {"own.gpx": "own"})
    flight = import_card(card, tmp_path / "flight")
    assert flight.manifest.clocks.camera_offset_s == -7200.0


def test_overwriting_takes_a_word(tmp_path):
    write_card(tmp_path / "card")
    arguments = ["import", str(tmp_path / "card"), "--into", str(tmp_path / "flight"), "--zone", "UTC"]
    assert CliRunner().invoke(wildlab, arguments).exit_code == 0
    recipe = recipe_beside(tmp_path / "flight").read_text(encoding="utf-8")
    second = CliRunner().invoke(wildlab, arguments)
    assert isinstance(second.exception, WildlabError)
    assert CliRunner().invoke(wildlab, [*arguments, "--overwrite"]).exit_code == 0
    assert recipe_beside(tmp_path / "flight").read_text(encoding="utf-8") == recipe
    assert load_flight(tmp_path / "flight").name == "flight"


def test_marks_without_a_height_are_left_out(tmp_path):
    """As most programs write placemarks: without a word on what their heights count from."""
    card = tmp_path / "card"
    write_card(card)
    (card / "marks.csv").unlink()
    marks = "".join(
        f"<Placemark><name>{name}</name><Point><coordinates>{lon:.9f},{lat:.9f},12.0</coordinates></Point>"
        "</Placemark>"
        for name, (lat, lon) in ((name, geodetic(*where)) for name, where in MARKS.items())
    )
    (card / "marks.kml").write_text(
        f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{marks}</Document></kml>', encoding="utf-8"
    )
    recipe = tomllib.loads(read(tmp_path).recipe)
    assert "truth" not in recipe and len(recipe["detections"]) == 1
    with pytest.raises(WildlabError, match="no points that can be used"):
        read(tmp_path, {"marks.kml": "marks"})


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--role", "marks.csv"], "names no role"),
        (["--role", "marks.csv=boss"], "'boss' is no role"),
        (["--role", "mark.csv=marks"], "nothing called"),
        (["--zone", "Nowhere"], "is not a time zone"),
        (["--start", "yesterday"], "is no time with a zone"),
    ],
)
def test_what_is_stated_wrongly(tmp_path, arguments, said):
    write_card(tmp_path / "card", 1)
    result = CliRunner().invoke(wildlab, ["import", str(tmp_path / "card"), "--dry-run", *arguments])
    assert isinstance(result.exception, WildlabError)
    assert said in str(result.exception)


@pytest.mark.parametrize(
    "arguments",
    [
        ["card"],
        ["card", "--into", "x", "--json"],
        ["card", "--into", "x", "--source", "y"],
        ["r.toml", "--into", "x", "--zone", "UTC"],
    ],
)
def test_options_that_do_not_go_together(arguments):
    assert CliRunner().invoke(wildlab, ["import", *arguments]).exit_code == 2


def test_an_empty_card_and_one_that_says_nothing(tmp_path):
    (tmp_path / "card").mkdir()
    with pytest.raises(WildlabError, match="nothing in it"):
        read(tmp_path, zone="")
    (tmp_path / "card" / "notes.bin").write_bytes(b"\x00" * 100)
    with pytest.raises(WildlabError, match="nothing here"):
        read(tmp_path, zone="")
    with pytest.raises(WildlabError, match="no such file"):
        read_card([tmp_path / "lost"], Wishes("card"), {})


def test_several_folders_of_images_are_one_series(tmp_path):
    write_card(tmp_path / "card")
    second = tmp_path / "card" / "DCIM" / "101MEDIA"
    second.mkdir()
    (tmp_path / "card" / "DCIM" / "100MEDIA" / "DJI_0004.JPG").rename(second / "DJI_0004.JPG")
    flight = import_card(read(tmp_path), tmp_path / "flight")
    assert flight.table("frames")["frame_id"].tolist() == ["DJI_0001", "DJI_0002", "DJI_0003", "DJI_0004"]
    assert len(flight.nav["camera"]) == 4


def test_of_two_cameras_the_thermal_one_is_taken_and_the_other_can_be(tmp_path):
    write_card(tmp_path / "card")
    pictures = tmp_path / "card" / "DCIM" / "100MEDIA"
    for path in sorted(pictures.glob("*.JPG")):
        path.rename(path.with_name(path.stem + "_W.JPG"))
    for i in range(3):
        when = datetime.fromtimestamp(TAKEN.timestamp() + i, UTC)
        angles = (0.0, -70.0, 0.0)
        write_photo(pictures / f"DJI_{i + 1:04d}_T.JPG", (0.0, i, 60.0), angles, when, (320, 256), 400.0)
    (tmp_path / "card" / "clicks.csv").unlink()
    card = read(tmp_path)
    flight = import_card(card, tmp_path / "flight")
    assert (flight.manifest.camera.width_px, flight.manifest.camera.fx_px) == (320, 400.0)
    assert len(flight.table("frames")) == 3
    roles = {"DCIM/100MEDIA": "images:wide"}
    wide = import_card(read_card([tmp_path / "card"], Wishes("wide", zone="UTC"), roles), tmp_path / "wide")
    assert len(wide.table("frames")) == 4
    with pytest.raises(WildlabError, match="'infra'"):
        read_card([tmp_path / "card"], Wishes("x", zone="UTC"), {"DCIM/100MEDIA": "images:infra"})


def test_a_stated_camera_of_another_size_is_not_laid_on_images(tmp_path):
    write_card(tmp_path / "card", 1)
    camera = CameraPart(name="c", width_px=1000, height_px=750, fx_px=900, fy_px=900, cx_px=500, cy_px=375)
    with pytest.raises(WildlabError, match="1000 x 750 px"):
        read(tmp_path, camera=camera)


def test_the_planes_uncertainty_is_that_of_the_surveyed_heights(tmp_path):
    write_card(tmp_path / "card")
    marks = tmp_path / "card" / "marks.csv"
    lines = marks.read_text(encoding="utf-8").splitlines()
    raised = [line.replace("40.000", f"{40 + 3 * i:.3f}") for i, line in enumerate(lines)]
    marks.write_text("\n".join(raised), encoding="utf-8")
    flight = import_card(read(tmp_path), tmp_path / "flight")
    assert flight.manifest.uncertainty.plane_height_m == pytest.approx(3.0)


def test_a_track_copied_twice_is_one_target(tmp_path):
    card = tmp_path / "card"
    write_card(card)
    track = [(i, 0.5 * i, 1.0, 40.0) for i in range(40)]
    for name, part in (("fox.gpx", track), ("fox (1).gpx", track), ("fox cut.gpx", track[:25])):
        (card / name).write_text(gpx(part))
    arguments = ["import", str(card), "--into", str(tmp_path / "flight"), "--zone", "UTC", "--geoid", "0"]
    result = CliRunner().invoke(wildlab, arguments)
    assert result.exit_code == 0, result.output
    truth = load_flight(tmp_path / "flight").table("truth")
    assert truth.loc[truth["time_s"].notna(), "target_id"].nunique() == 1
