"""Which role each log has: by what it holds, where it was and when."""

from __future__ import annotations

import numpy as np
import pymap3d
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.card.found import Found
from wildlab.flight.card.roles import choose_roles
from wildlab.flight.readers.logs.log import RawLog, make_stream

START = 1.7e9


def log(
    name: str,
    *,
    north: float = 0.0,
    begin: float = 0.0,
    seconds: int = 100,
    attitude: bool = False,
    part: str | None = None,
    up: float = 0.0,
    climb: float = 0.0,
    vehicle: str = "",
    gimbal: bool = False,
) -> Found:
    """A log that moves east at 1 m/s, so far north, from so many seconds on."""
    t = np.arange(seconds, dtype=float)
    lat, lon, _ = pymap3d.ned2geodetic(north + 0 * t, begin + t, 0 * t, 59.0, 10.0, 0.0)
    columns = {
        "time_s": START + begin + t,
        "latitude_deg": lat,
        "longitude_deg": lon,
        "height_sea_m": up + climb * np.sin(t / 9),
    }
    parts = {"gnss": make_stream("gnss", columns)}
    if attitude:
        zeros = {f"{axis}_deg": 0 * t for axis in ("roll", "pitch", "yaw")}
        parts["poses"] = make_stream("poses", {**columns, **zeros})
    if gimbal:
        looks = {f"{axis}_world_deg": 0 * t for axis in ("roll", "pitch", "yaw")}
        parts["gimbal"] = make_stream("gimbal", {"time_s": START + begin + t, **looks})
    if part == "marks":
        parts = {
            "marks": make_stream("marks", {"name": ["a"], "latitude_deg": [59.0], "longitude_deg": [10.0]})
        }
    return Found(name, 1, "gpx", RawLog("gpx", parts, vehicle=vehicle))


def roles(*found: Found, **stated: str) -> dict[str, str]:
    return {one.found.name: one.role for one in choose_roles(found, stated)}


def test_the_log_with_an_attitude_is_the_vehicles_own():
    assert roles(log("boat", north=80.0), log("drone", attitude=True)) == {"boat": "target", "drone": "own"}


def test_a_receiver_that_stays_beside_it_is_on_board():
    assert roles(log("rtk", north=2.0), log("drone", attitude=True))["rtk"] == "receiver"


def test_a_boat_right_below_is_a_target():
    found = choose_roles([log("boat", north=3.0), log("drone", attitude=True, up=60.0)], {})
    assert found[0].role == "target"


def test_a_second_attitude_on_board_rides_on_the_camera():
    found = roles(log("gimbal", north=1.0, attitude=True, seconds=60), log("drone", attitude=True))
    assert found == {"gimbal": "camera", "drone": "own"}


def test_of_two_with_an_attitude_far_apart_the_shorter_is_a_target():
    found = roles(log("drone", attitude=True), log("boat", north=300.0, attitude=True, seconds=50))
    assert found == {"drone": "own", "boat": "target"}


def test_a_log_of_another_time_is_not_used():
    choices = choose_roles([log("drone", attitude=True), log("old", begin=-7300.0)], {})
    assert choices[1].role == "nothing"


def test_points_have_a_role_without_times():
    assert roles(log("marks", part="marks"), log("drone", attitude=True))["marks"] == "marks"


def test_what_is_stated_is_not_argued_with():
    found = roles(log("boat", north=80.0), log("drone", attitude=True), boat="own", drone="target:gull")
    assert found == {"boat": "own", "drone": "target"}
    choices = choose_roles([log("a", north=80.0), log("b", attitude=True)], {"a": "target:gull"})
    assert choices[0].target == "gull"


def test_targets_have_names_of_their_own():
    choices = choose_roles(
        [log("drone", attitude=True), log("x/boat.gpx", north=90.0), log("y/boat.gpx", north=95.0)], {}
    )
    assert [one.target for one in choices[1:]] == ["boat", "boat-2"]


def test_two_vehicles_cannot_both_be_own():
    with pytest.raises(WildlabError, match="own log"):
        choose_roles([log("a"), log("b")], {"a": "own", "b": "own"})


def test_rows_that_cannot_be_used_are_no_track():
    t = np.arange(5.0)
    columns = {"time_s": t, "latitude_deg": t, "longitude_deg": t, "height_sea_m": t}
    stream = make_stream("gnss", columns, unusable={"no fix": np.ones(5, bool)})
    choice = choose_roles([Found("bench", 1, "gpx", RawLog("gpx", {"gnss": stream}))], {})[0]
    assert choice.role == "nothing"


def test_what_flies_is_own_also_where_another_log_is_longer():
    rover = log("rover", attitude=True, seconds=200, vehicle="ArduRover V4.5")
    copter = log("copter", attitude=True, seconds=130, up=80.0, vehicle="ArduCopter V4.5")
    choices = choose_roles([rover, copter], {})
    assert [one.role for one in choices] == ["target", "own"]


def test_what_climbs_is_own_where_no_log_names_its_vehicle():
    choices = choose_roles(
        [log("a", attitude=True, seconds=200, north=50.0), log("b", attitude=True, climb=30.0)], {}
    )
    assert [one.role for one in choices] == ["target", "own"]


def test_a_log_with_a_gimbal_is_own_beside_longer_tracks():
    choices = choose_roles([log("boat", seconds=300), log("DJI_0001", north=40.0, gimbal=True)], {})
    assert [one.role for one in choices] == ["target", "own"]


def test_a_track_of_another_day_is_no_target_of_images():
    photos = make_stream(
        "photos",
        {
            "file": ["a.jpg"],
            "time_log_s": [START],
            "latitude_deg": [59.0],
            "longitude_deg": [10.0],
            "height_sea_m": [80.0],
        },
    )
    images = Found("DCIM", 1, "photos", RawLog("photos", {"photos": photos}))
    choices = choose_roles([images, log("today"), log("yesterday", begin=-30 * 3600.0)], {})
    assert [one.role for one in choices] == ["images", "target", "nothing"]


def test_a_copy_of_a_log_is_not_used_even_where_it_is_cut_shorter():
    whole, copy, part = log("boat", north=80.0), log("boat (1)", north=80.0), log("b", north=80.0, seconds=40)
    choices = choose_roles([part, log("drone", attitude=True), whole, copy], {})
    assert [one.role for one in choices] == ["nothing", "own", "target", "nothing"]
    assert roles(log("drone", attitude=True), log("copy", attitude=True))["copy"] == "nothing"


def test_another_log_of_the_same_place_is_no_copy():
    own = log("drone", attitude=True)
    assert roles(own, log("rtk", north=1e-6))["rtk"] == "receiver"
    assert roles(own, log("copy", north=80.0), log("same", north=80.0), copy="target")["same"] == "target"
