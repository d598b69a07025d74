"""Which role each log has: by what it holds, where it was and when."""

from typing import Any

import numpy as np
import pymap3d
import pytest

from wildlab.errors import WildlabError
from wildlab.flight import card_items
from wildlab.flight.card_items import CardItem, choose_roles
from wildlab.flight.readers.log import RawLog, make_stream

START = 1.7e9


def log(
    name: str,
    *,
    north: float = 0.0,
    begin: float = 0.0,
    seconds: int = 100,
    attitude: bool = False,
    up: float = 0.0,
    climb: float = 0.0,
    vehicle: str = "",
    gimbal: bool = False,
) -> CardItem:
    """A log that moves east at 1 m/s, so far north, from so many seconds on."""
    t = np.arange(seconds, dtype=float)
    lat, lon, _ = pymap3d.ned2geodetic(north + 0 * t, begin + t, 0 * t, 59.0, 10.0, 0.0)
    place = {"time_s": START + begin + t, "latitude_deg": lat, "longitude_deg": lon}
    place["height_sea_m"] = up + climb * np.sin(t / 9)
    parts = {"gnss": place}
    if attitude:
        parts["poses"] = place | {f"{axis}_deg": 0 * t for axis in ("roll", "pitch", "yaw")}
    if gimbal:
        looks = {f"{axis}_world_deg": 0 * t for axis in ("roll", "pitch", "yaw")}
        parts["gimbal"] = {"time_s": START + begin + t, **looks}
    return holding(name, vehicle, **parts)


def holding(name: str, vehicle: str = "", **parts: dict[str, Any]) -> CardItem:
    streams = {part: make_stream(part, columns) for part, columns in parts.items()}
    return CardItem(name, "gpx", RawLog(streams, vehicle=vehicle))


DRONE = log("drone", attitude=True)
BOAT = log("boat", north=80.0)
TABLE = CardItem("flight.csv", problem=card_items.TABLE)
PLACE: dict[str, Any] = {"latitude_deg": [59.0], "longitude_deg": [10.0]}
MARKS = holding("marks", marks={"name": ["a"], **PLACE})
PHOTOS = holding("DCIM", photos={"file": ["a.jpg"], "time_log_s": [START], "height_sea_m": [80.0], **PLACE})


def photographed(hours: float, up: float) -> CardItem:
    """Images taken every 5 s along the track of `log`, by a wall clock so many hours ahead of UTC."""
    own = log("", seconds=96, up=up).log
    assert own is not None
    c = {key: value[::5] for key, value in own.parts["gnss"].columns.items() if "_" in key}
    wall = c.pop("time_s") + 3600 * hours
    return holding("DCIM", photos={"file": [f"{k}.jpg" for k in range(20)], "time_log_s": wall, **c})


@pytest.mark.parametrize(
    ("logs", "stated", "roles"),
    [
        ([BOAT, DRONE], {}, "target own"),
        # What stays beside it is on board, what stays below it is not.
        ([log("rtk", north=2.0), DRONE], {}, "receiver own"),
        ([log("boat", north=3.0), log("drone", attitude=True, up=60.0)], {}, "target own"),
        # A second attitude on board rides on the camera; one far away is of a target.
        ([log("gimbal", north=1.0, attitude=True, seconds=60), DRONE], {}, "camera own"),
        ([DRONE, log("boat", north=300.0, attitude=True, seconds=50)], {}, "own target"),
        ([DRONE, log("old", begin=-7300.0)], {}, "own nothing"),
        ([MARKS, DRONE], {}, "marks own"),
        ([BOAT, DRONE], {"boat": "own", "drone": "target:gull"}, "own target"),
        # What flies, climbs or has a gimbal is the own one, also where another log is longer.
        (
            [
                log("rover", attitude=True, seconds=200, vehicle="ArduRover V4.5"),
                log("copter", attitude=True, seconds=130, up=80.0, vehicle="ArduCopter V4.5"),
            ],
            {},
            "target own",
        ),
        (
            [log("a", attitude=True, seconds=200, north=50.0), log("b", attitude=True, climb=30.0)],
            {},
            "target own",
        ),
        ([log("boat", seconds=300), log("DJI_0001", north=40.0, gimbal=True)], {}, "target own"),
        # A track of another day is no target of images.
        ([PHOTOS, log("today"), log("yesterday", begin=-30 * 3600.0)], {}, "images target nothing"),
        # A track on the places of the images is the vehicle's own, whatever the zone of the clock; one far
        # below them is not.
        ([photographed(0, 2.0), log("drone")], {}, "images own"),
        ([photographed(3, 2.0), log("drone", north=4.0), BOAT], {}, "images own target"),
        ([photographed(3, 60.0), log("boat")], {}, "images target"),
        # A copy is not used, even where it is cut shorter; a log of nearly the same place is none.
        (
            [log("b", north=80.0, seconds=40), DRONE, BOAT, log("boat (1)", north=80.0)],
            {},
            "nothing own target nothing",
        ),
        # A track beside a table that nobody explained: the table may be of the vehicle.
        ([TABLE, log("phone")], {}, "nothing target"),
        ([TABLE, log("phone")], {"phone": "own"}, "nothing own"),
        ([TABLE, log("plane", vehicle="ArduPlane V4.5")], {}, "nothing own"),
        ([TABLE, DRONE, BOAT], {}, "nothing own target"),
        ([DRONE, log("copy", attitude=True)], {}, "own nothing"),
        ([DRONE, log("rtk", north=1e-6)], {}, "own receiver"),
        ([DRONE, BOAT, log("same", north=80.0)], {"boat": "target"}, "own target target"),
    ],
)
def test_roles(logs, stated, roles):
    assert [one.role for one in choose_roles(logs, stated)] == roles.split()


def test_targets_have_names_of_their_own():
    choices = choose_roles([DRONE, log("x/boat.gpx", north=90.0), log("y/boat.gpx", north=95.0)], {})
    assert [one.target for one in choices[1:]] == ["boat", "boat-2"]
    assert choose_roles([BOAT, DRONE], {"boat": "target:gull"})[0].target == "gull"


def test_two_vehicles_cannot_both_be_own():
    with pytest.raises(WildlabError, match="own log"):
        choose_roles([log("a"), log("b")], {"a": "own", "b": "own"})
