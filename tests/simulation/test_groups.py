"""Groups of parameters, courses and targets that do not go together are named."""

from __future__ import annotations

import re

import pytest

from tests.simulation.test_parameters import LOITER, complete, load_text
from wildlab.errors import WildlabError

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


PAIR = """[pair.both]
value = 349
unit = "1"
status = "published"
source = "H 6.4.4: 349 images had both vessels within the same image"
"""


@pytest.mark.parametrize(
    ("twin", "old", "new", "found"),
    [
        ("slow-vessel", "[target.gps.", "[target.gsp.", r"target\.gsp"),
        ("slow-vessel", "\n[route.shape]", LOITER + "\n[route.shape]", "one course"),
        ("static-antenna", "[loiter.", "[climb.", r"climb\.\w+"),
        ("slow-vessel", 'value = "eight"', 'value = "nine"', "'nine'"),
        ("crossing-vessels", PAIR, "", "two targets need"),
        ("crossing-vessels", "value = 349\n", "value = 900\n", "more than the observations"),
        ("crossing-vessels", 'value = "boat 2"', 'value = "boat 1"', "identifier"),
        ("slow-vessel", "value = 2001\n", "value = 3000\n", "last of 3635"),
        (
            "drifting-vessel",
            "[target.motion.deviation_longest_period]\nvalue = 900.0",
            "[target.motion.deviation_longest_period]\nvalue = 9.0",
            "deviation_shortest_period",
        ),
        ("gondola", "[cable.lowest]\nvalue = 3.0", "[cable.lowest]\nvalue = 30.0", "lowest is above highest"),
        (
            "gondola",
            "[enclosures.lake.length]\nvalue = 280.0",
            "[enclosures.lake.length]\nvalue = 80.0",
            r"enclosures\.lake",
        ),
        ("gondola", "[enclosures.lake.", '[enclosures."the lake".', "'the lake'"),
        ("large-ship", "value = 441\n", "value = 400\n", "fewer images"),
    ],
)
def test_courses_and_targets_that_make_no_sense_are_named(tmp_path, twin, old, new, found):
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
