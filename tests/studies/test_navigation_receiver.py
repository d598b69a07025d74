"""Verdicts and tables on a receiver's noise follow its numbers."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.analysis.navigate import NavigationErrors
from wildlab.analysis.navigation_inputs import Placement, Receiver
from wildlab.navigation.receiver import Candidate, ReceiverNoise, Scale, SourceNoise
from wildlab.studies import navigation as noise

SCALE = Scale(np.array([2.0, 4.0]), np.array([0.2, 0.5]), 1.0, 300.0)
COLOURED = ReceiverNoise(SourceNoise(0.1, 0.2, 3.0, 5.0, 50.0, 2.0), SourceNoise(0.5, 0.5))


def candidate(noise: ReceiverNoise, parameters: int, score: float) -> Candidate:
    sd = np.full(12, np.nan)
    sd[[0, 1]] = 0.05
    return Candidate(noise, sd, parameters, score + 10, score, 7)


def receiver(noise: ReceiverNoise, scale: Scale = SCALE) -> Receiver:
    stated = candidate(ReceiverNoise(), 0, 0.0)
    other = candidate(noise, 8, -5.0 if noise == ReceiverNoise() else 5.0)
    chosen = stated if noise == ReceiverNoise() else other
    return Receiver([stated, other], chosen, 100.0, 400.0, scale, 301)


def test_tables_have_every_number_that_was_found_and_no_other():
    table = noise.parameters_table(receiver(COLOURED)).set_index(["source", "what"])
    assert len(table) == 6 + 2
    white = table.loc[("position", "white noise, height")]
    assert (white["stated"], white["found"]) == (4.0, pytest.approx(0.8))
    assert white["high"] == pytest.approx(0.8 * np.exp(0.1)) and white["low"] == pytest.approx(
        0.8 * np.exp(-0.1)
    )
    assert np.isnan(table.loc[("position", "how long that keeps"), "low"])
    assert table.loc[("velocity", "white noise, level"), "found"] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("scale", "verdict"),
    [(0.5, "nearer"), (2.0, "farther"), (1.0, "same")],
)
def test_the_attitude_is_nearer_only_where_the_flight_says_so(scale, verdict):
    rng = np.random.default_rng(1)
    times = np.arange(0.0, 900.0, 0.5)

    def errors(size: float) -> NavigationErrors:
        e = np.full((len(times), 9), np.nan)
        e[:, 6:] = np.radians(size * rng.standard_normal((len(times), 3)))
        return NavigationErrors(times, e, np.ones_like(e), {})

    assert noise.attitude_change(errors(1.0), errors(scale), 0.0, 900.0) == verdict


def test_a_receiver_that_is_not_where_or_when_it_is_said_to_be_gets_advice():
    sd = np.array([0.002, 0.05, 0.05, 0.05])
    as_stated = Placement(0.223, np.array([0.1, 0.0, -0.1]), sd)
    configured = [0.22, 0.0, 0.0, 0.0]
    assert noise.placement_message(as_stated, configured).key == "placement-confirmed"
    late = noise.placement_message(as_stated._replace(latency=0.25), configured)
    assert late.key == "placement-wrong" and late.values["settings"] == "latency_s = 0.250"
    moved = noise.placement_message(as_stated._replace(lever=np.array([0.1, 0.5, 0.0])), configured)
    assert moved.values["settings"] == "lever_arm_m = [0.10, 0.50, 0.00]"
    unknown = noise.placement_message(as_stated._replace(sd=np.full(4, np.nan)), configured)
    assert unknown.key == "placement-unknown"
