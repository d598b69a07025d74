"""What a report says of a receiver's noise turns with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.navigation.receiver import Candidate, ReceiverNoise, Scale, SourceNoise
from wildlab.pipeline.navigation_errors import Errors
from wildlab.pipeline.receiver import Placement, Receiver
from wildlab.studies.navigation import receiver as words

SCALE = Scale(np.array([2.0, 4.0]), np.array([0.2, 0.5]), 1.0, 300.0)
COLOURED = ReceiverNoise(SourceNoise(0.1, 0.2, 3.0, 5.0, 50.0, 2.0), SourceNoise(0.5, 0.5))


def candidate(noise: ReceiverNoise, parameters: int, score: float) -> Candidate:
    sd = np.full(12, np.nan)
    sd[[0, 1]] = 0.05
    return Candidate(noise, sd, parameters, score + 10, score, 7)


def receiver(noise: ReceiverNoise, gross: int = 0, scale: Scale = SCALE) -> Receiver:
    stated = candidate(ReceiverNoise(), 0, 0.0)
    other = candidate(noise, 8, -5.0 if noise == ReceiverNoise() else 5.0)
    chosen = stated if noise == ReceiverNoise() else other
    return Receiver([stated, other], chosen, 100.0, 400.0, scale, 301, gross)


def innovations(nis: float, lag1: float) -> pd.DataFrame:
    return pd.DataFrame([{"source": "position", "nis": nis, "dof": 3, "lag1": lag1}])


@pytest.mark.parametrize(
    ("ratio", "lag1", "left"),
    [
        (1.0, 0.1, ()),
        (0.69, 0.1, ("level",)),
        (1.41, -0.1, ("level",)),
        (1.0, 0.31, ("colour",)),
        (1.0, -0.31, ("colour",)),
        (0.2, 0.9, ("level", "colour")),
    ],
)
def test_what_is_left_is_level_or_colour_or_both_or_nothing(ratio, lag1, left) -> None:
    assert words.left_over(ratio, lag1) == left
    (sentence,) = words.words_on_innovations(innovations(1.5, 0.95), innovations(3 * ratio, lag1))
    assert (
        "0.50 of its ideal" in sentence and "0.95" in sentence and f"{ratio:.2f} and {lag1:.2f}" in sentence
    )
    assert ("Both are as they should be" in sentence) == (left == ())
    assert ("left is the level" in sentence) == (left == ("level",))
    assert ("left is the colour" in sentence) == (left == ("colour",))
    assert ("Both are left" in sentence) == (len(left) == 2)


def test_without_a_change_what_is_stated_is_judged() -> None:
    (sentence,) = words.words_on_innovations(innovations(3.0, 0.9), None)
    assert "what was found" not in sentence and "left is the colour" in sentence


def test_an_estimate_is_told_by_its_numbers() -> None:
    said = words.words_on_estimate(receiver(COLOURED))
    assert "301 fixes from 100 to 400 s" in said and "of 2 models" in said and "left out" not in said
    assert "Positions have white noise of 0.2 m level and 0.8 m in height" in said
    assert "an error of 3 and 5 m that keeps for 50 s and whose change is smooth over 2 s" in said
    assert (
        "Velocities have white noise of 0.1 m/s level and 0.25 m/s in height, and no error that lasts" in said
    )
    first_order = COLOURED._replace(position=COLOURED.position._replace(rate_time=0.0, time=299.0))
    said = words.words_on_estimate(receiver(first_order, gross=2))
    assert "keeps for all of that time" in said and "smooth" not in said
    assert "2 fixes that no noise explains were left out" in said
    assert "Velocities" not in words.words_on_estimate(
        receiver(COLOURED, scale=SCALE._replace(velocity=None))
    )


def test_where_what_is_stated_is_as_likely_nothing_is_claimed() -> None:
    said = words.words_on_estimate(receiver(ReceiverNoise()))
    assert "nothing was changed" in said and "white noise" not in said
    table = words.models_table(receiver(ReceiverNoise()))
    assert table["chosen"].tolist() == ["chosen", ""] and table["gain"].tolist() == [0.0, -5.0]


def test_tables_have_every_number_that_was_found_and_no_other() -> None:
    table = words.parameters_table(receiver(COLOURED)).set_index(["source", "what"])
    assert len(table) == 6 + 2
    white = table.loc[("position", "white noise, height")]
    assert (white["stated"], white["found"]) == (4.0, pytest.approx(0.8))
    assert white["high"] == pytest.approx(0.8 * np.exp(0.1)) and white["low"] == pytest.approx(
        0.8 * np.exp(-0.1)
    )
    assert np.isnan(table.loc[("position", "how long that keeps"), "low"])
    assert table.loc[("velocity", "white noise, level"), "found"] == pytest.approx(0.1)
    models = words.models_table(receiver(COLOURED))
    assert models["model"].tolist() == [
        "as stated",
        "positions and an error of second order; velocities white",
    ]


@pytest.mark.parametrize(
    ("scale", "verdict"),
    [(0.5, "nearer to it"), (2.0, "farther from it"), (1.0, "neither nearer nor farther")],
)
def test_the_attitude_is_nearer_only_where_the_flight_says_so(scale, verdict) -> None:
    rng = np.random.default_rng(1)
    times = np.arange(0.0, 900.0, 0.5)

    def errors(size: float) -> Errors:
        e = np.full((len(times), 9), np.nan)
        e[:, 6:] = np.radians(size * rng.standard_normal((len(times), 3)))
        return Errors(times, e, np.ones_like(e), {})

    said = words.words_on_attitude(errors(1.0), errors(scale), 0.0, 900.0)
    assert verdict in said
    assert sum(v in said for v in ("nearer to it", "farther from it", "neither nearer")) == 1
    # By construction the square root of three axes of a degree, and that times the scale.
    was = float(said.split("together, and ")[1].split(" with")[0])
    now = float(said.split("is ")[1].split(" degrees")[0])
    assert (was, now) == (pytest.approx(np.sqrt(3), rel=0.03), pytest.approx(scale * np.sqrt(3), rel=0.03))
    short = words.words_on_attitude(errors(1.0), errors(scale), 0.0, 0.4)
    assert "too short a time" in short


def test_parts_in_which_something_is_left_are_named() -> None:
    rows = [
        {"part": "calm", "source": "position", "ratio": 0.2, "left": "level"},
        {"part": "loops", "source": "position", "ratio": 1.1, "left": ""},
    ]
    said = words.words_on_parts(pd.DataFrame(rows))
    assert "0.20 to 1.10" in said and "calm, position: level." in said and "loops" not in said
    assert "does not do" in said
    good = words.words_on_parts(pd.DataFrame(rows[1:]))
    assert "In no part" in good and "does not do" not in good


def test_thirds_are_equal_and_leave_nothing_out() -> None:
    found = words.thirds(10.0, 40.0)
    assert [(begin, end) for _, begin, end in found] == [(10.0, 20.0), (20.0, 30.0), (30.0, 40.0)]


def test_a_receiver_that_is_not_where_or_when_it_is_said_to_be_gets_advice() -> None:
    sd = np.array([0.002, 0.05, 0.05, 0.05])
    as_stated = Placement(0.223, np.array([0.1, 0.0, -0.1]), sd, 0.4)
    said = words.words_on_placement(as_stated, [0.22, 0.0, 0.0, 0.0])
    assert "0.223 s late" in said and "as stated, within 3 SD" in said and "write" not in said
    late = words.words_on_placement(as_stated._replace(latency=0.25), [0.22, 0.0, 0.0, 0.0])
    assert "write latency_s = 0.250 in [gnss]" in late and "lever_arm_m" not in late
    moved = words.words_on_placement(
        as_stated._replace(lever=np.array([0.1, 0.5, 0.0])), [0.22, 0.0, 0.0, 0.0]
    )
    assert "write lever_arm_m = [0.10, 0.50, 0.00] in [gnss]" in moved and "latency_s" not in moved
    two = as_stated._replace(sd=np.array([0.002, np.nan, np.nan, np.nan]))
    assert "antenna" not in words.words_on_placement(two, [0.22, 5.0, 0.0, 0.0])
    nothing = words.words_on_placement(as_stated._replace(sd=np.full(4, np.nan)), [0.22, 0.0, 0.0, 0.0])
    assert "cannot be told" in nothing
