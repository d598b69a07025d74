"""Known positions err too: what is held against a receiver's track is not put down to clicks alone."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.errors import Scatter
from wildlab.evaluation.pose_noise import KINDS, PoseNoise
from wildlab.reporting.georeferencing import noise_table
from wildlab.reporting.georeferencing_left import remaining_parts
from wildlab.reporting.known_positions import EXACT, known_limits, known_positions, offset_sentence

SCATTER = Scatter(0.1, 0.3, 0.6, *(np.array([a, a]) for a in (0.6, 3.0, 1.2)), 4.7)


def flown(kind="logged", **columns):
    truth = pd.DataFrame({"target_id": ["m1", "m2", "walker", "walker"],
                          "time_s": [np.nan, np.nan, 1.0, 2.0], **columns})  # fmt: skip
    return SimpleNamespace(manifest=SimpleNamespace(kind=kind), table=lambda _: truth)


def scored(*names):
    return pd.DataFrame({"truth_id": names})


WALK = known_positions(flown(), scored("walker", "walker", "m1"))
MARKS = known_positions(flown(), scored("m1", "m1", "m2"))


def test_points_are_counted_by_what_they_are_held_against():
    assert WALK[:4] == (1, 2, 1, 1) and MARKS[:4] == (3, 0, 2, 0)
    stated = known_positions(flown(sd_horizontal_m=[0.02, np.nan, 1.4, 1.6]), scored("walker", "m1"))
    assert stated[4:] == (0.02, pytest.approx(1.5))
    assert known_positions(flown("twin"), scored("walker")) == EXACT


def test_marks_and_tracks_are_told_apart():
    stated = known_positions(flown(sd_horizontal_m=[0.02, np.nan, 1.4, 1.6]), scored("walker"))
    for known, numbers in ((WALK, ["2 points", "One point"]), (MARKS, ["3 points"]), (stated, ["1.5 m"])):
        limits = known_limits(known)
        assert [number in one for number, one in zip(numbers, limits, strict=True)] == [True] * len(numbers)
    assert known_limits(EXACT) == []


def test_clicks_and_lens_are_not_blamed_for_the_target_s_receiver():
    noise = PoseNoise(dict.fromkeys(KINDS, 0.1), dict.fromkeys(KINDS, 1.5))
    assumed = dict.fromkeys(("position_horizontal_m", "position_vertical_m", "tilt_deg", "heading_deg"), 1.0)
    for known in (WALK, MARKS, EXACT):
        table = noise_table(noise, {**assumed, "pixel_px": 1.0}, known)
        for text in (" ".join(table["what"]), " ".join(remaining_parts(SCATTER, known))):
            assert ("receiver" in text) == (known is WALK)


def corrected(offset, kind="logged"):
    clocks = SimpleNamespace(camera_offset_s=offset)
    return offset_sentence(SimpleNamespace(manifest=SimpleNamespace(kind=kind, clocks=clocks)))


def test_an_offset_of_the_camera_s_clock_is_parted_from_its_zone():
    assert "+1.58 s" in corrected(-45898.42) and "-12.75 h" in corrected(-45898.42)
    assert "-0.40 s" in corrected(-0.4) and " h" not in corrected(-0.4).partition("s")[0]
    # A zone is read from the hours of the flight, and no point is fitted.
    assert corrected(0.0) == corrected(-45900.0) == corrected(0.4, "twin") == ""
