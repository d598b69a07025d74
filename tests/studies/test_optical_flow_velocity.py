"""What the study of velocity from flow computes."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, said
from wildlab.errors import WildlabError
from wildlab.studies import optical_flow_velocity as study
from wildlab.studies.optical_flow_velocity import (
    IMAGES,
    LOGGED,
    READINGS,
    STILL,
    SYNCHRONISED,
    TRUE,
    look,
    numbers_of,
    readings,
    stretches,
    velocity_numbers,
)
from wildlab.studies.rules import load_rules

TWIN = "gimballed-ship"


@pytest.fixture(scope="module")
def looked():
    return look(TWIN, 2, 8)


@pytest.fixture(scope="module")
def tables(looked):
    return readings(looked)


def test_pairs_are_looked_at_in_stretches_over_the_whole_flight():
    usable = np.zeros(600, bool)
    usable[:170], usable[350:540] = True, True
    chosen = stretches(usable, 60)
    assert usable[chosen].all() and len(chosen) == 60
    assert (np.diff(chosen) == 1).sum() == 58
    assert chosen[0] < 170 and chosen[-1] > 350
    assert np.array_equal(stretches(usable, 360), np.flatnonzero(usable))
    assert len(stretches(np.zeros(5, bool), 3)) == 0


def test_the_ship_is_in_view_when_the_thesis_says(looked):
    """Out of view from 20 s to 50 s and from 72 s to 80 s, H 5.6.3; to a few seconds."""
    times, seen = looked.scene.times, looked.shares > 0
    assert seen[times < 20].all()
    assert not seen[(times > 25) & (times < 45)].any()
    assert seen[(times > 50) & (times < 62)].all()
    assert not seen[times > 75].any()
    assert 280 < seen.sum() < 400


def test_with_exact_poses_the_images_give_the_velocity_of_the_ship(looked, tables):
    """The ship is at rest but for what it moves on its anchor, some centimetres a second."""
    v = tables[TRUE][["v_north_m_s", "v_east_m_s"]].to_numpy()
    assert len(v) == len(looked.pairs) >= 5
    assert np.abs(v.mean(axis=0)).max() < 1.0
    assert v.std(axis=0).max() < 1.0
    logged = tables[LOGGED][["v_north_m_s", "v_east_m_s"]].to_numpy()
    assert logged.std() > 2 * v.std()
    flow = tables[TRUE]
    assert np.allclose(flow["flow_u"], flow["camera_u"], atol=6)
    assert np.abs(flow["flow_v"]).max() > 10


def test_a_flight_gives_a_number_for_everything_that_is_recorded(looked, tables):
    numbers = numbers_of(looked, tables)
    assert all(load_rules("optical-flow-velocity").unit_of(name) for _, name in numbers)
    assert numbers[IMAGES, "in_view_share"] > numbers[IMAGES, "whole_share"] > 0
    assert numbers[LOGGED, "pairs"] == len(looked.pairs)
    shares = looked.shares
    expected = len(looked.pairs) / looked.tried * ((shares[:-1] > 0) & (shares[1:] > 0)).mean() * 599 / 600
    assert numbers[IMAGES, "feature_rate"] == pytest.approx(expected)


def test_means_deviations_and_intervals_are_those_of_the_table():
    table = pd.DataFrame(
        {
            "v_north_m_s": [1.0, 3.0, np.nan], "v_east_m_s": [-1.0, 1.0, np.nan],
            "cov_nn": [1.0, 1.0, np.nan], "cov_ee": [1.0, 0.01, np.nan],
        }
    )  # fmt: skip
    found = velocity_numbers(table)
    assert (found["pairs"], found["mean_north"], found["mean_east"]) == (2, 2, 0)
    assert found["sd_north"] == pytest.approx(np.sqrt(2))
    assert found["interval_share_95"] == 0.5
    assert np.isnan(velocity_numbers(table.iloc[2:])["mean_north"])


def test_a_flight_without_features_says_so(monkeypatch, looked):
    monkeypatch.setattr(study, "simulate_twin", lambda name, seed: looked.flight)
    monkeypatch.setattr(study, "match_features", lambda *images: ())
    with pytest.raises(WildlabError, match="0 of 2 pairs"):
        look(TWIN, 2, 2)


def spread_of(count=40, **changes):
    numbers = {(IMAGES, name): 0.5 for name in ("in_view_share", "whole_share", "feature_rate")}
    for subject in READINGS:
        values = {
            "mean_north": 0.2, "mean_east": -0.3, "sd_north": 6.0, "sd_east": 5.0, "pairs": 50.0,
            "interval_share_95": 0.95,
        }  # fmt: skip
        numbers |= {(subject, name): value for name, value in values.items()}
    for one, sd in ((SYNCHRONISED, 2.5), (STILL, 3.0), (TRUE, 0.5)):
        numbers[one, "sd_north"] = numbers[one, "sd_east"] = sd
    numbers[LOGGED, "correlation_u"], numbers[LOGGED, "correlation_v"] = 0.9, 0.8
    for key, value in changes.items():
        subject, name = key.split("__")
        numbers[subject.replace("_", "-"), name] = value
    return pd.DataFrame([numbers] * count)


@pytest.mark.parametrize(
    ("claim", "changes"),
    [
        ("mean-within-one", {"logged__mean_east": -1.1}),
        ("very-large-variance", {"logged__sd_east": 0.5}),
        ("flows-correlate", {"logged__correlation_v": 0.3}),
        ("better-synchronised", {"synchronised__sd_north": 4.0, "synchronised__sd_east": 4.0}),
        ("better-with-a-still-gimbal", {"still_gimbal__sd_north": 9.0}),
        ("own-motion-dominates", {"true_poses__sd_east": 9.0}),
    ],
)
def test_each_claim_turns_with_its_numbers(claim, changes):
    checks = (
        said("optical-flow-velocity", checks_of("optical-flow-velocity", spread_of())),
        said("optical-flow-velocity", checks_of("optical-flow-velocity", spread_of(**changes))),
    )
    assert all(checks[0][claim]) and not any(checks[1][claim])
