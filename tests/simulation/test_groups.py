"""Groups of parameters that do not go together are named; ship and animals have the printed numbers."""

from __future__ import annotations

import re

import pytest

from tests.simulation.test_parameters import LOITER, complete, load_text
from wildlab.errors import WildlabError
from wildlab.simulation.parameters import each_parameter, load_twin

OWN = 'value = {value}\nunit = "{unit}"\nstatus = "chosen"\nreason = "for this test"\n'


def own(key: str, value: object, unit: str = "") -> str:
    shown = f'"{value}"' if isinstance(value, str) else value
    return f"\n[{key}]\n" + OWN.format(value=shown, unit=unit)


def without(text: str, group: str) -> str:
    """The text without the parameters of a group."""
    return "".join(part for part in re.split(r"(?m)^(?=\[)", text) if not part.startswith(f"[{group}."))


CLIMB = own("climb.altitude", 9.0, "m") + own("climb.start", 1.0, "s") + own("climb.duration", 3.0, "s")
SEGMENTS = own("segments.count", 5, "1") + own("segments.images", 441, "1")
HULL = own("target.outline.length", 9.0, "m") + own("target.outline.beam", 2.0, "m")


@pytest.mark.parametrize(
    ("twin", "leave_out", "add", "found"),
    [
        ("static-antenna", (), CLIMB, "route"),
        ("gondola", (), CLIMB, "cable"),
        ("uav-search", ("enclosures",), "", "survey"),
        ("gondola", ("enclosures",), "", "animals live"),
        ("gondola", ("animals",), "", "targets or for animals"),
        ("gondola", (), SEGMENTS, "go with a target"),
        ("large-ship", ("segments",), "", "needs segments"),
        ("slow-vessel", ("subset",), SEGMENTS, "any other none"),
        ("slow-vessel", (), HULL, "most of it"),
        ("large-ship", ("target.motion", "target.gps"), "", "needs a motion"),
        ("large-ship", (), own("camera.k1", 0.1, "1"), "without k1"),
        ("large-ship", ("onboard_clock",), "", "onboard_clock"),
        ("slow-vessel", ("boresight",), "", "boresight"),
        ("large-ship", (), own("autopilot.imu_roll", 1.0, "deg"), "imu_roll"),
        ("large-ship", (), own("flight.kind", "balloon"), "'balloon'"),
    ],
)
def test_twins_whose_groups_do_not_go_together_are_named(tmp_path, twin, leave_out, add, found):
    text = complete(twin)
    for group in leave_out:
        assert f"[{group}." in text
        text = without(text, group)
    with pytest.raises(WildlabError, match=found):
        load_text(tmp_path, text + add)


@pytest.mark.parametrize(
    ("twin", "old", "new", "found"),
    [
        ("gondola", "[cable.lowest]\nvalue = 3.0", "[cable.lowest]\nvalue = 30.0", "lowest is above highest"),
        ("gondola", "[enclosures.lake.length]\nvalue = 280.0", "[enclosures.lake.length]\nvalue = 80.0",
         r"enclosures\.lake"),
        ("gondola", "[enclosures.lake.", '[enclosures."the lake".', "'the lake'"),
        ("large-ship", "value = 441\n", "value = 400\n", "fewer images"),
    ],
)  # fmt: skip
def test_searchers_and_ships_that_make_no_sense_are_named(tmp_path, twin, old, new, found):
    text = complete(twin)
    assert old in text
    with pytest.raises(WildlabError, match=found):
        load_text(tmp_path, text.replace(old, new))


def test_the_same_pair_of_targets_cannot_have_an_outline(tmp_path):
    text = complete("crossing-vessels").replace("missed at random", "largest")
    with pytest.raises(WildlabError, match="outline"):
        load_text(tmp_path, text + HULL + HULL.replace("[target", "[second_target"))


def test_a_loiter_is_about_a_target_that_stays(tmp_path):
    with pytest.raises(WildlabError, match="never moves"):
        load_text(tmp_path, without(complete("slow-vessel"), "route") + LOITER)


def test_published_numbers_of_the_ship_and_the_animals_are_those_of_the_theses():
    """Typed a second time, from H 4.4.1 and 6.4.1, and F (2.1), 7.1, 7.3, 7.5 and 8.2."""

    def published(name: str) -> dict[str, object]:
        return {
            f"{group}.{key}": p.value
            for group, key, p in each_parameter(load_twin(name))
            if p.status == "published" and not isinstance(p.value, str)
        }

    assert published("large-ship") == {
        "flight.altitude": 100,
        "target.observations": 438,
        "target.outline.length": 70,
        "segments.count": 5,
        "segments.images": 441,
        "camera.frame_rate": 10,
        "autopilot.rate": 10,
    }
    place_and_camera = {
        "place.latitude": 58.662064,
        "place.longitude": 16.433337,
        "camera.fx": 1267,
        "camera.fy": 1117,
        "camera.cx": 356.0,
        "camera.cy": 216.6,
        "camera.k1": 0.446,
    }
    fields = ("plain", "ridge", "meadow", "lake", "wood")
    animals = {f"enclosures.{name}.animals": 5 for name in fields}
    gondola = {"flight.duration": 1800, "flight.airspeed": 1.5, "cable.lowest": 3, "cable.highest": 20}
    place_and_camera |= {"land.step": 2, "land.relief": 51}
    assert published("gondola") == place_and_camera | animals | gondola
    search = {"flight.altitude": 60, "survey.row_distance": 25}
    assert published("uav-search") == place_and_camera | search
