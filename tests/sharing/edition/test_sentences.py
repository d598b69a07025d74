"""Which texts follow from which facts: by the keys of the catalogue, whatever its words are."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.sharing.edition.flights import EMPTY, NAN, WHOLE
from wildlab.analysis.overview import ALARMS, Alarm
from wildlab.analysis.verdict import CAUSES, PARTS, Gain, Verdict
from wildlab.messages.catalogue import Message, languages, length, load_language, say
from wildlab.sharing.edition import _TROUBLES, Facts, Story, tell

LANGUAGES = [load_language(code) for code in languages()]
RADAR = EMPTY._replace(
    verdict="look closer", seen=1832.0, pictured=0.0, tracks=5, track_error=1.345, track_worst=10.83
)
POSSIBLE = Gain("possible", (), 1.0, 4.0, 0.25)


def keys(items: tuple[Message, ...]) -> list[str]:
    return [one.key for one in items]


def test_a_flight_of_which_all_is_known():
    story = tell(WHOLE)
    assert keys(story.measured) == ["measured.error", "measured.track", "measured.things"]
    assert keys(story.advice) == ["do.cause_boresight", "do.images_without_pose", "do.trouble_few_satellites"]
    assert keys(story.wrong) == ["trouble.few_satellites", "lost.images_without_pose"]
    assert story.trusted and story.verdict.key == "verdict.fix" and story.next == story.advice[0]


def test_an_alarm_comes_before_every_gain_and_takes_the_trust():
    story = tell(WHOLE._replace(verdict="went wrong", alarms=(Alarm("jumps", 2, NAN, 12.0, NAN),)))
    assert story.why == Message("alarm.jumps", story.why.values, 2)
    assert keys(story.advice)[:2] == ["do.jumps", "do.cause_boresight"] and not story.trusted


def test_a_part_that_failed_is_not_known_and_asked_for_again():
    story = tell(EMPTY._replace(failed=("overview", "georeferencing")))
    assert keys(story.unknown) == ["unknown.failed_overview", "unknown.failed_georeferencing", "unknown.seen"]
    assert story.advice == (Message("do.failed", {}, 2),) and story.why.key == "why.failed"


def test_without_truth_sightings_are_held_against_each_other():
    story = tell(EMPTY._replace(verdict="sound", scatter=2.0, sightings=30, seen=40.0, placed=38.0))
    assert keys(story.measured) == ["measured.scatter", "measured.seen"]
    # 2 m along each axis is 2.35 m of median distance.
    assert story.measured[0].values["apart"] == length(pytest.approx(2.3548, abs=1e-4))  # type: ignore[arg-type]
    assert "unknown.error" in keys(story.unknown) and story.why.key == "why.sound_unmeasured"


@pytest.mark.parametrize("language", LANGUAGES, ids=languages())
def test_without_a_camera_no_picture_is_spoken_of(language):
    said = " ".join(say(language, one) for one in said_of(tell(RADAR))).lower()
    assert not any(word in said for word in ("image", "picture", "camera", "bild", "kamera"))
    # A look of the camera is a picture all the same where a radar is beside it.
    assert "unknown.hidden" in keys(tell(RADAR._replace(pictured=900.0)).unknown)


@pytest.mark.parametrize(
    ("changes", "wrong", "following"),
    [
        # What the verdict says is not said twice, and does not contradict that nothing is wrong.
        ({"gains": WHOLE.gains[:1], "troubles": ()}, "wrong.above", "do.cause_boresight"),
        ({"verdict": "look closer", "gains": (), "troubles": (), "possible": POSSIBLE},
         "wrong.above", "next.look"),
        ({"verdict": "sound", "gains": (WHOLE.gains[0]._replace(share=0.04),), "troubles": ()},
         "wrong.small", "next.sound_more"),
        ({"verdict": "sound", "gains": (), "troubles": ()}, "wrong.none", "next.sound"),
        ({"verdict": "sound", "gains": ()}, "trouble.few_satellites", "next.sound_more"),
        ({"gains": (Gain("images_without_pose", (), 400.0, 812.0, 0.49), WHOLE.gains[0]), "troubles": ()},
         "lost.cause", "do.images_without_pose"),
    ],
)  # fmt: skip
def test_what_is_wrong_and_what_follows(changes, wrong, following):
    story = tell(WHOLE._replace(**changes))
    assert (keys(story.wrong), story.next.key) == ([wrong], following)


@pytest.mark.parametrize("what", [*_TROUBLES.values(), "sure", "tracking", "navigation"])
def test_what_is_told_to_be_wrong_has_advice(what):
    """Never a list of troubles, and then "fly as before"."""
    calm = WHOLE._replace(gains=(), troubles=(), verdict="look closer")
    changes = {"sure": {"track_sure": 5.0}, "tracking": {"doubted": ("tracking",)},
               "navigation": {"doubted": ("navigation",)}}  # fmt: skip
    story = tell(calm._replace(**changes.get(what, {"troubles": ((what, 700.0),)})))
    assert story.wrong[0].key != "wrong.none" and story.why.key != "why.alarm" and story.advice
    assert not tell(calm).advice


@pytest.mark.parametrize(
    ("verdict", "trusted"),
    [("look closer", False), ("not judged", False), (None, False), ("worth fixing", True), ("sound", True)],
)
def test_only_what_was_judged_is_called_reliable(verdict, trusted):
    told = WHOLE._replace(verdict=verdict)
    assert tell(told).trusted == trusted
    # What is worth fixing elsewhere does not make tracks reliable that are overconfident.
    assert not tell(told._replace(track_sure=5.0)).trusted
    assert not tell(told._replace(doubted=("tracking",))).trusted


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"far_out": 3, "inside": 0.5}, "why.doubt_outliers"),
        ({"inside": 0.7}, "why.doubt_ellipses"),
        ({"inside": 0.88}, "why.doubt_georeferencing"),
    ],
)
def test_a_doubt_has_its_reason(changes, key):
    """Whoever gets the sheet has no report to look at."""
    told = WHOLE._replace(
        verdict="look closer", gains=(), troubles=(), doubted=("georeferencing",), **changes
    )
    assert tell(told).why.key == key and key in keys(tell(told).wrong)


def said_of(story: Story) -> list[Any]:
    return [
        *(story.verdict, story.why, story.next), *story.measured, *story.wrong, *story.advice, *story.unknown,
        *(value for tile in story.tiles for value in tile),
    ]  # fmt: skip


KEYS = [
    "cause", "far_out", "images_without_pose", "images_without_gimbal", "detections_off_ground",
    "detections_without_truth", "inertial_samples", "time_without_poses", "time_without_satellites",
    "time_without_inertial",
]  # fmt: skip
maybe = st.one_of(st.just(NAN), st.floats(0, 1e6))
gains = st.builds(
    Gain, st.sampled_from(KEYS), st.lists(st.sampled_from(list(CAUSES)), unique=True).map(tuple),
    st.one_of(st.just(NAN), st.floats(1, 1e3)), st.floats(1e3, 1e4), st.floats(0.005, 1),
)  # fmt: skip
alarms = st.builds(
    Alarm, st.sampled_from(list(ALARMS)), st.integers(1, 3), st.just(NAN), st.floats(1, 99), st.just(NAN)
)
troubles = st.tuples(st.sampled_from(list(_TROUBLES.values())), st.floats(0, 1e4))
facts = st.builds(
    Facts, twin=st.booleans(), verdict=st.sampled_from([*Verdict, None]), problems=st.integers(0, 3),
    length_s=maybe, height_m=maybe, area_m2=maybe, seen=maybe, things=maybe, placed=maybe, error_median=maybe,
    error_p90=maybe, compared=st.integers(0, 30), scatter=maybe, sightings=st.integers(0, 9),
    tracks=st.integers(0, 3), track_error=maybe, track_sure=maybe,
    alarms=st.lists(alarms, max_size=4).map(tuple), troubles=st.lists(troubles, max_size=3).map(tuple),
    gains=st.lists(gains, max_size=4).map(tuple),
    possible=st.one_of(st.none(), gains.filter(lambda one: one.value == one.value)),
    failed=st.lists(st.sampled_from(["overview", *PARTS]), unique=True).map(tuple),
    doubted=st.lists(st.sampled_from(PARTS), unique=True).map(tuple),
    pictured=st.one_of(maybe, st.just(0.0)), track_worst=maybe,
)  # fmt: skip


@given(facts)
def test_whatever_is_known_every_text_is_there_and_filled(known):
    story = tell(known)
    assert story.measured and story.wrong and len(story.advice) <= 4
    for language in LANGUAGES:
        for said in said_of(story):
            text = say(language, said)
            assert text and "{" not in text and "nan" not in text.lower().split()
