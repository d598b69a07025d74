"""What the tracker is told of the harbour is drawn, ordered by one scenario and judged on the others."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.identities import Moment, compare_identities
from wildlab.flight.files import dump_toml
from wildlab.flight.manifest import parse_settings
from wildlab.reporting.report import open_report
from wildlab.studies import autoferry
from wildlab.studies.autoferry import Tuned, anees_of, draw, order

OFFSETS = {"lidar": -1.0, "radar": -2.0, "ir": -0.5, "eo": 0.0}
ERRORS = {
    name: SimpleNamespace(offset_s=offset, next_correlation=0.9, correlation_time_s=20.0)
    for name, offset in OFFSETS.items()
}


def test_draws_are_those_of_their_seed_and_within_their_ranges():
    one, other = (draw(np.random.default_rng(3), ERRORS) for _ in range(2))
    assert one == other != draw(np.random.default_rng(4), ERRORS)
    for seed in range(50):
        settings = draw(np.random.default_rng(seed), ERRORS)
        many, lidar = settings.targets.many, settings.sensors["lidar"].many
        assert (
            many is not None
            and (many.forgotten or 1) < 0.03 <= (many.birth or 0) <= 0.3
            and many.hits in (3, 4, 5)
        )
        assert lidar.several and 105 <= (lidar.far_m or 0) <= 140
        assert settings.sensors["radar"].clock_offset_s == -2.0
    # As a file they say the same: kinds of hulls too.
    assert parse_settings(dump_toml(one.model_dump(exclude_none=True))) == one


def test_what_it_was_tuned_on_is_in_no_median():
    base = {"rmse": 1.0, "tracked": 90.0, "swaps": 0, "breaks": 1, "anees": 1.0}
    modes = {"radar": (5.0, 9.0, 7.0), "lidar": (3.0, 4.0, 6.0), "both": (4.0, 8.0, 8.0)}
    rows = pd.DataFrame(
        [
            base | {"case": case, "mode": mode, "gospa": value, "gospa_online": value + 1.0}
            for mode, values in modes.items()
            for case, value in zip(("s1", "s2", "s3"), values, strict=True)
        ]
    )
    spread = autoferry.over_scenarios(rows, "s1")
    assert {mode: spread[f"elsewhere/{mode}", "gospa_median"].median() for mode in modes} == {
        "radar": 8.0, "lidar": 5.0, "both": 8.0,
    }  # fmt: skip
    recorded = recorded_of(rows, "s1")
    median = recorded["gospa_median", "elsewhere/radar"]
    # Of two scenarios there is no confidence interval of a median: their range is shown.
    assert [median[name] for name in ("value", "low", "high", "flights")] == [8.0, 7.0, 9.0, 2]
    assert median["centre_low"] is None
    # One break in each of the two scenarios.
    assert recorded["track_changes", "elsewhere/both"]["value"] == 2
    assert recorded["track_changes", "elsewhere/both"]["n"] == 2
    alone = recorded_of(rows[rows["case"] == "s1"], "s1")
    assert alone["tracked_median", "elsewhere/both"]["value"] is None


def recorded_of(rows, first):
    report = open_report(study="autoferry-many", flight="", kind="logged", seed=1, seeds=None, out="")
    autoferry.record_scores(report, rows, first)
    return report.recorded


def test_draws_whose_tracks_are_as_wrong_as_they_say_go_first():
    settings = draw(np.random.default_rng(1), ERRORS)
    drawn = [
        Tuned(1, settings, 3.0, 9.0), Tuned(2, settings, 5.0, 1.9), Tuned(3, settings, 4.0, 0.6),
        Tuned(4, settings, 2.0, float("nan")), Tuned(5, settings, 4.0, 1.0),
    ]  # fmt: skip
    assert [one.number for one in sorted(drawn, key=order)] == [3, 5, 2, 4, 1]


def test_what_is_assumed_of_the_truth_chooses_no_draw():
    one = Moment(
        0.0, np.array([[3.0, 0.0]]), np.eye(2)[None], ["t"], np.zeros((1, 2)), ["a"], [True], [False]
    )
    for sd in (0.0, 2.0):
        lives = compare_identities([one._replace(truth_sd=sd)], 5.0)
        assert anees_of(lives) == 9 / 2


@pytest.mark.slow
def test_scenarios_are_followed_by_what_one_teaches(scenario, tunings, monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setattr(autoferry, "tune_sensor", lambda flight, sensor: tunings[sensor])
    errors = autoferry.errors_of(scenario(2))
    assert -2.5 < errors["radar"].offset_s < -1.5 and -1.5 < errors["lidar"].offset_s < -0.5
    assert all(0.5 < errors[name].next_correlation < 1 for name in ("lidar", "radar"))
    for mode, best in autoferry.tune_modes(scenario(2), draws=2, seed=1).items():
        assert autoferry.follow_mode(scenario(3), mode, best.settings)[0] is not None
