"""What the page on many targets says turns with its numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wildlab.evaluation.identities import Identities, TargetLife, TrackLife
from wildlab.evaluation.sets import gospa
from wildlab.pipeline.following.beliefs import Said
from wildlab.pipeline.many.errors import OF_COVARIANCE, Errors
from wildlab.reporting import many_tracks as words
from wildlab.reporting.many_sections import pose_limits
from wildlab.tracking.many import POINT, Hull, Shown
from wildlab.tracking.predictions import POSE


def followed(tracks: int = 2, looks: int = 61) -> Any:
    shown = [
        Shown(
            float(t), 0, np.arange(tracks), np.zeros((tracks, 4)), np.tile(np.eye(4), (tracks, 1, 1)),
            np.ones(tracks), np.ones((tracks, 1)), np.zeros((tracks, 4, 0)),
        )
        for t in range(looks)
    ]  # fmt: skip
    scans = [SimpleNamespace(time=float(t)) for t in range(looks)]
    return SimpleNamespace(
        shown=shown,
        scans=scans,
        minutes=(looks - 1) / 60,
        targets=SimpleNamespace(hulls=(POINT,)),
        cutoff_m=20.0,
        others=False,
    )


def lives(**changes: Any) -> Identities:
    """Two targets at 61 looks, tracks 3 m off."""
    each = gospa([[0.0, 0.0], [50.0, 0.0]], [[3.0, 0.0], [50.0, 3.0]], 20.0)
    base: dict[str, Any] = {
        "gospa": [each] * 61,
        "followed": [{"a": 0, "b": 1}] * 61,
        "swaps": 0,
        "breaks": 0,
        "false_tracks_per_minute": 0.0,
        "targets": {"a": TargetLife(61, 1.0, 0.0, 0, 0), "b": TargetLife(61, 0.95, 2.0, 0, 0)},
        "tracks": {0: TrackLife(61, 61, 2.0, False, 61), 1: TrackLife(61, 61, 2.2, False, 61)},
    }
    return Identities(**(base | changes))


def said(one: Any, two: Any) -> tuple[str, str, tuple[str, str]]:
    sentences, level = words.summary(one, two)
    return " ".join(sentences), level, words.verdict_of(one, two, level)


def test_all_followed_by_one_track_each_is_sound() -> None:
    text, level, verdict = said(followed(), lives())
    assert level == "good" and verdict[0] == "sound"
    assert (
        "Of 2 targets in reach, b has a track at the fewest looks, at 95 % of those" in text
        and "off by 3.0 m (RMS of those within 20 m)" in text
    )
    assert "no target got a new track, and 0 of 2 tracks (0.00 a minute) are mostly on nothing" in text
    assert "a track is on nothing at 0 % of the looks" in text


FALSE = {0: TrackLife(9, 9, 2.0, False, 9), 1: TrackLife(9, 0, np.nan, True)}
SHORT, NEVER = TargetLife(61, 0.7, 0.0, 0, 0), TargetLife(61, 0.0, np.nan, 0, 0)


@pytest.mark.parametrize(
    ("changes", "level", "word", "reason"),
    [
        ({"swaps": 2}, "bad", "mixed up", "Tracks went over to other targets: 2"),
        ({"breaks": 1}, "warn", "look closer", "Targets got new tracks: 1"),
        (
            {"false_tracks_per_minute": 1.0, "tracks": FALSE},
            "warn",
            "look closer",
            "Tracks mostly on nothing: 1 of 2",
        ),
        (
            {"tracks": {0: TrackLife(9, 9, 9.0, False, 9)}},
            "warn",
            "look closer",
            "Tracks farther off than they say: 1 of 1",
        ),
        (
            {"tracks": {0: TrackLife(9, 9, 0.5, False, 9)}},
            "warn",
            "look closer",
            "Tracks nearer than they say: 1 of 1",
        ),
        (
            {"tracks": {0: TrackLife(9, 4, 9.0, False, 4), 1: TrackLife(9, 9, np.nan, False, 0)}},
            "warn",
            "look closer",
            "No track was on a target at 5 looks: its covariance is not judged",
        ),
        ({"targets": {"a": SHORT}}, "warn", "look closer", "Targets without a track at more than a tenth"),
        ({"targets": {"a": NEVER}}, "bad", "targets lost", "Targets never followed: 1 of 1"),
    ],
)
def test_what_is_amiss_is_the_reason(changes: dict[str, Any], level: str, word: str, reason: str) -> None:
    _, found, verdict = said(followed(), lives(**changes))
    assert found == level and verdict[0] == word and verdict[1].startswith(reason)


def test_one_target_that_was_never_followed() -> None:
    none = gospa([[0.0, 0.0]], np.empty((0, 2)), 20.0)
    text, *_ = said(
        followed(),
        lives(gospa=[none] * 61, targets={"a": TargetLife(61, 0.0, np.nan, 0, 0)}, breaks=3, swaps=1),
    )
    assert text.startswith("The target in reach has a track at 0 % of those at which it can be seen.")
    assert "1 track went over to another target, 3 times a target got a new track" in text
    assert text.endswith("Never followed: a.")


def test_without_truth_nothing_is_judged() -> None:
    text, level, verdict = said(followed(), None)
    assert level == "neutral" and verdict[0] == "not judged"
    assert text.startswith(
        "2 tracks in 61 looks over 1.0 min, 2.0 at a time in the mean; when there are most, 2 at once (90 %"
    )
    out = {"a": TargetLife(0, np.nan, np.nan, 0, 0)}
    assert said(followed(), lives(targets=out))[2][0] == "not judged"
    assert said(followed(0), lives())[1:] == (
        "bad", ("no track", "Nothing met all that the tracker was told a target is.")
    )  # fmt: skip


def test_parts_of_gospa_add_up() -> None:
    far = gospa([[0.0, 0.0], [50.0, 0.0]], [[3.0, 0.0], [99.0, 3.0]], 20.0)
    table = words.parts_table([far])
    assert table["metres"].iloc[1:].pow(2).sum() == pytest.approx(table["metres"].iloc[0] ** 2)
    assert table["share"].iloc[1:].sum() == pytest.approx(100)


def test_a_track_that_goes_on_without_its_target_is_seen() -> None:
    """On a target for most of its looks, and on nothing at 40 of 100: no sound page."""
    on = gospa([[0.0, 0.0]], [[1.0, 0.0]], 20.0)
    off = gospa(np.empty((0, 2)), [[1.0, 0.0]], 20.0)
    gone = lives(
        gospa=[on] * 60 + [off] * 40,
        targets={"a": TargetLife(60, 1.0, 0.0, 0, 0)},
        tracks={0: TrackLife(100, 60, 2.0, False, 60)},
    )
    text, level, verdict = said(followed(looks=100), gone)
    assert level == "warn" and verdict[1] == "A track is on nothing at 40 % of the looks."
    assert "a track is on nothing at 40 % of the looks" in text


def test_looks_without_truth_and_no_time_at_all_are_told() -> None:
    text, *_ = said(followed(looks=99), lives())
    assert "Judged are 61 of 99 looks: a true place is known there." in text and "not every" not in text
    text, *_ = said(followed(), lives(incomplete=5))
    assert "At 5 of the judged looks not every target's true place is known" in text
    text, *_ = said(followed(), lives(false_tracks_per_minute=float("nan")))
    assert "nan" not in text and "0 of 2 tracks are mostly on nothing" in text


def test_names_are_only_text() -> None:
    said_of = [
        Said("targets", "kinds by size", "**bold** `code`", "stated"),
        Said("radar", "x", "1", "stated"),
    ]
    table = words.told_table([said_of[1], said_of[0], said_of[1]])
    assert table["of"].tolist() == ["radar", "radar", "targets"]
    assert not set("*`") & set(table["value"].iloc[2])
    text, *_ = said(followed(), lives(targets={"**x**": TargetLife(61, 0.0, np.nan, 0, 0)}))
    assert "**" not in text


def test_tracks_that_may_be_farther_off_than_what_counts_are_told() -> None:
    """Honest tracks may be beyond the cut-off where it is no three of their standard deviations."""
    one = followed()
    assert not any("may be" in said for said in words.summary(one, lives())[0])
    for look in one.shown:
        look.P[:, 0, 0] = 7.0**2
    said = " ".join(words.summary(one, lives())[0])
    assert "State `reach_m = 21` in [targets]." in said
    assert "Tracks say that they may be 7" in said and "farther than 20 m counts as on nothing" in said
    one.cutoff_m = 22.0
    assert not any("may be" in said for said in words.summary(one, lives())[0])


def test_a_hull_longer_than_what_counts_as_on_it_is_told_with_what_to_state() -> None:
    one = followed()
    assert "longest kind" not in said(one, lives())[0]
    one.targets = SimpleNamespace(hulls=(POINT, Hull("ferry", 60.5, 12.0)))
    text, _, _ = said(one, lives())
    assert "The longest kind of target has 60 m" in text and "`reach_m = 61` in [targets]" in text
    one.cutoff_m = 61.0
    assert "longest kind" not in said(one, lives())[0]


def test_where_others_are_about_no_track_is_praised_for_being_on_nothing() -> None:
    one = followed()
    assert "on nothing" in said(one, lives())[0]
    one.others = True
    assert "on nothing" not in said(one, lives())[0]


@pytest.mark.parametrize(
    ("camera", "radar", "twice", "advice", "bare"),
    [
        (POSE, ("heading",), False, False, ""),
        (tuple(f"eye: {name}" for name in POSE), ("heading",), True, True, ""),
        (OF_COVARIANCE, ("heading",), True, False, ""),
        (OF_COVARIANCE, (), False, False, "radar"),
        (POSE, ("radar: range_bias",), False, False, "radar"),
        (tuple(f"eye: {name}" for name in POSE), ("radar: heading",), False, False, ""),
    ],
)
def test_what_is_said_of_the_platforms_errors_follows_from_their_names(
    camera: tuple[str, ...], radar: tuple[str, ...], twice: bool, advice: bool, bare: str
) -> None:
    of: Any = {
        name: SimpleNamespace(kind=kind, errors=Errors(names, (0.0,) * len(names)))
        for name, kind, names in (("eye", "pixel", camera), ("radar", "range-bearing", radar))
    }
    followed: Any = SimpleNamespace(places=of)
    told = " ".join(pose_limits(followed))
    assert ("that eye and radar share are taken for two" in told) is twice
    assert ("stated in [sensors.eye]" in told) is advice
    assert (f"are in no covariance of {bare}." in told) if bare else ("no covariance" not in told)
