"""Known positions err too: what is held against a receiver's track is not put down to clicks alone."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.blocks import Neighbours
from wildlab.evaluation.errors import Scatter, summarise
from wildlab.evaluation.pose_noise import KINDS, PoseNoise
from wildlab.evaluation.runs import Interval
from wildlab.reporting import georeferencing as words
from wildlab.reporting import georeferencing_left as left
from wildlab.reporting.georeferencing_sections import summary_section
from wildlab.reporting.known_positions import EXACT, known_positions, offset_sentence

SCATTER = Scatter(0.1, 0.3, 0.6, *(np.array([a, a]) for a in (0.6, 3.0, 1.2)), 4.7)


def flown(kind="logged", **columns):
    truth = pd.DataFrame({"target_id": ["m1", "m2", "walker", "walker"],
                          "time_s": [np.nan, np.nan, 1.0, 2.0], **columns})  # fmt: skip
    return SimpleNamespace(manifest=SimpleNamespace(kind=kind), table=lambda _: truth)


def scored(*names):
    return pd.DataFrame({"truth_id": names})


def limits(known):
    points = pd.DataFrame({"north_m": [1.0]})
    return " ".join(
        words.limits_of(points, [30.0], [80.0], labelled=True, timed=True, enough=True, known=known)
    )


WALK = known_positions(flown(), scored("walker", "walker", "m1"))
MARKS = known_positions(flown(), scored("m1", "m1", "m2"))


def test_points_are_counted_by_what_they_are_held_against():
    assert WALK[:4] == (1, 2, 1, 1) and MARKS[:4] == (3, 0, 2, 0)
    stated = known_positions(flown(sd_horizontal_m=[0.02, np.nan, 1.4, 1.6]), scored("walker", "m1"))
    assert stated[4:] == (0.02, pytest.approx(1.5))
    assert known_positions(flown("twin"), scored("walker")) == EXACT


def test_what_known_positions_err_by_is_said_of_marks_and_tracks_apart():
    said = limits(WALK)
    assert "2 points are held against the track of a receiver at a target" in said
    assert "One point is held against a surveyed mark" in said and "which nothing states" in said
    assert "survey of the marks and the receiver's track" in said
    stated = known_positions(flown(sd_horizontal_m=[0.02, np.nan, 1.4, 1.6]), scored("walker"))
    assert "stated as 1.5 m" in limits(stated) and "the receiver's track of each target" in limits(stated)
    assert "surveyed" not in limits(stated) and "survey of each" not in limits(stated)
    assert "3 points are held against 2 surveyed marks" in limits(MARKS)
    assert "receiver" not in limits(MARKS) and "held against" not in limits(EXACT)


def test_clicks_and_lens_are_not_blamed_for_the_target_s_receiver():
    noise = PoseNoise(dict.fromkeys(KINDS, 0.1), dict.fromkeys(KINDS, 1.5))
    assumed = dict.fromkeys(("position_horizontal_m", "position_vertical_m", "tilt_deg", "heading_deg"), 1.0)
    for known in (WALK, MARKS, EXACT):
        table = words.noise_table(noise, {**assumed, "pixel_px": 1.0}, known)
        parts = " ".join(left.remaining_parts(SCATTER, known))
        for text in (" ".join(table["what"]), parts):
            assert ("the target's own receiver" in text) == (known is WALK)


@pytest.mark.parametrize(
    ("neighbours", "there", "not_there"),
    [
        (Neighbours(0.5, 30), "in part the next image too (correlation 0.50)", "does not"),
        (Neighbours(0.1, 30), "and the next image does not", "in part"),
        (Neighbours(float("nan"), 3), "that all points of an image share.", "next image"),
        (None, "that all points of an image share.", "next image"),
    ],
)
def test_whether_the_next_image_shares_an_error_is_what_was_measured(neighbours, there, not_there):
    said = " ".join(left.remaining_parts(SCATTER, EXACT, neighbours))
    assert there in said and not_there not in said


def corrected(offset, kind="logged"):
    clocks = SimpleNamespace(camera_offset_s=offset)
    return offset_sentence(SimpleNamespace(manifest=SimpleNamespace(kind=kind, clocks=clocks)))


def test_an_offset_of_the_camera_s_clock_is_said_to_flatter():
    assert "corrected by +1.58 s beside a zone of -12.75 h" in corrected(-45898.42)
    assert "corrected by -0.40 s, and flight.toml" in corrected(-0.4) and "flatter" in corrected(-0.4)
    # A zone is read from the hours of the flight, and no point is fitted.
    assert corrected(0.0) == corrected(-45900.0) == corrected(0.4, "twin") == ""


@pytest.mark.parametrize("clock", ["The clock was corrected.", ""])
def test_the_first_sentences_have_the_offset(clock):
    found = SimpleNamespace(
        summary=summarise(np.ones((20, 2))), scored=range(20), diagnosis=None, lost=0,
        ellipses=SimpleNamespace(word="honest", factor=Interval(1.0, 0.9, 1.1)),
    )  # fmt: skip
    said = []
    report = SimpleNamespace(
        summary=lambda sentences, **_: said.extend(sentences), metric=lambda *_, **__: None
    )
    summary_section(report, found, clock=clock)
    assert said[1:] == [one for one in [clock] if one]
