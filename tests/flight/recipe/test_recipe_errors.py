"""Whatever is wrong with tables, files or recipe is one sentence with its fix; nothing is written."""

from collections.abc import Callable
from typing import Any

import pytest

from tests.flight.conftest import fault
from wildlab.errors import WildlabError
from wildlab.flight.importing import import_flight

Change = Callable[[Any], None]


def in_table(table: str, old: str, new: str) -> Change:
    return lambda raw: raw.replace(table, old, new)


def in_recipe(dotted: str, value: Any) -> Change:
    return lambda raw: raw.set(dotted, value)


def both(*changes: Change) -> Change:
    def change(raw: Any) -> None:
        for one in changes:
            one(raw)

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda raw: raw.tables.pop("nav.csv"), "nav.csv, poses.log.file: no such file"),
        (
            in_table("clicks.csv", ",what", ",label"),
            "clicks.csv, what (in [detections[0].target]): column is missing",
        ),
        (
            in_table("nav.csv", ",140,1,0,0,0\n2024-06-12T09:30:04Z", ",,1,0,0,0\n2024-06-12T09:30:04Z"),
            "nav.csv, height: line 5: this cell is empty",
        ),
        (in_table("nav.csv", "63.440200", '"63,44"'), "nav.csv, lat: line 4: '63,44' has a decimal comma"),
        (in_table("nav.csv", "63.440200", "63,44"), "nav.csv: line 4 has 9 cells"),
        (in_recipe("camera.fx_px", 0.0), "recipe.toml, camera.fx_px: length is 0"),
        (
            in_table("photos.csv", "09:30:03Z", "09:30:01Z"),
            "photos.csv, time_s (from [frames]): not increasing",
        ),
        (in_recipe("files", {"../secret.txt": ""}), "recipe.toml, files.file: leaves its folder"),
        (in_table("nav.csv", "63.440200,10.4,", "0,0,"), "nav.csv, lat: both 0"),
        (
            in_table(
                "nav.csv", "10.4,140,1,0,0,0\n2024-06-12T09:30:04Z", "10.4,140,1,1,0,0\n2024-06-12T09:30:04Z"
            ),
            "nav.csv, qw, qx, qy, qz: length is 1.414",
        ),
        (
            both(
                in_recipe("camera.file", "buoy.csv"),
                in_recipe("camera.fx_px", "sd"),
                in_table("buoy.csv", "0.02", "0"),
            ),
            "buoy.csv, sd (in [camera.fx_px]): length is 0",
        ),
        (
            in_table("nav.csv", "09:30:03Z", "09:30:01Z"),
            "nav.csv, time_s (from [poses.log]): followed by 1.000 s",
        ),
        (
            in_table("photos.csv", "T09", "T11"),
            "nav.csv, time_s (from [poses.log]): do not overlap",
        ),
        (
            in_table("photos.csv", "2024-06-12T09:30:02.0Z", "noon"),
            "photos.csv, time (in [frames.time]): 'noon' has no time zone",
        ),
        (in_recipe("time.zone", "Europe/Trondheim"), "recipe.toml, time.zone: 'Europe/Trondheim'"),
        (
            in_table("buoy.csv", "63.44,10.401", "10.401,63.44"),
            "buoy.csv, north_m (from [truth]): far from the flight",
        ),
        (
            both(
                in_table("buoy.csv", "63.44,10.401", "10.401,63.44"),
                lambda raw: raw.recipe["truth"].pop(1),
            ),
            "nav.csv, buoy.csv, north_m (from [poses] or [truth]): far from all poses",
        ),
        (in_table("clicks.csv", "\nC,", "\nD,"), "clicks.csv, frame_id (from [detections]): first 'D'"),
        (
            in_recipe("detections.0.ground.height.value", 500.0),
            "clicks.csv, plane_down_m (from [detections]): 3 of 3 ground",
        ),
        (
            lambda raw: raw.recipe["poses"].update({"../x": raw.recipe["poses"].pop("log")}),
            "recipe.toml, poses: '../x' cannot",
        ),
        (
            in_recipe("poses.log.file", "../../etc/passwd"),
            "recipe.toml, poses.log.file: leaves its folder",
        ),
        (
            in_recipe("poses.log.attitude", "roll = {value = 0.0, unit = 'deg'}"),
            "recipe.toml, poses.log.attitude: roll",
        ),
        (
            in_recipe(
                "poses.log.position",
                "".join(f"{one}.value = 0.0\n{one}.unit = 'm'\n" for one in ("north", "east", "down")),
            ),
            "recipe.toml: no origin",
        ),
        (
            in_recipe("vertical", "correction_m = 5.0\ntaken_off = ['poses']"),
            "recipe.toml, vertical: no note says why",
        ),
        (in_table("nav.csv", "2024-06-12T09:30:03Z,", ""), "nav.csv: line 5 has 7"),
        (lambda raw: raw.tables.update({"nav.csv": "time,lat\n"}), "nav.csv: no rows"),
        (
            in_table("nav.csv", ",", ";"),
            "nav.csv, lat: single name",
        ),
    ],
)
def test_one_thing_wrong(raw, change, said):
    change(raw)
    with pytest.raises(WildlabError, match=fault(said)) as caught:
        raw.run()
    assert caught.value.exit_code == 2 and caught.value.fix
    assert "\n" not in str(caught.value)
    assert not raw.into.exists()
    assert sorted(path.name for path in raw.folder.iterdir()) == ["raw", "recipe.toml"]


def test_a_link_out_of_the_source_folder(raw):
    path = raw.write()
    (raw.folder / "secret.csv").write_text(raw.tables["nav.csv"])
    (raw.folder / "raw" / "nav.csv").unlink()
    (raw.folder / "raw" / "nav.csv").symlink_to(raw.folder / "secret.csv")
    with pytest.raises(WildlabError, match="leaves its folder"):
        import_flight(path, raw.folder / "raw", raw.into)
    assert not raw.into.exists()


def test_an_hour_that_is_there_twice(raw):
    raw.set("time.zone", "Europe/Oslo")
    raw.set("time.epoch", None)
    raw.recipe["truth"].pop()
    for name in ("nav.csv", "photos.csv"):
        raw.tables[name] = raw.tables[name].replace("2024-06-12T09", "2024-10-27T02").replace("Z", "")
    with pytest.raises(WildlabError, match="exists twice"):
        raw.run()
    raw.set("time.zone", "+02:00")
    assert str(raw.run().manifest.time.epoch) == "2024-10-27 00:30:00+00:00"
