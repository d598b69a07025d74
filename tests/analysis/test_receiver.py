"""A flight's receiver noise: what it is found from, what is refused, and logged flights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.conftest import changed, first_seconds
from wildlab.analysis.navigate import (
    REFERENCES,
    flown_part,
    navigate_mekf,
    numbers_of,
    study_navigation,
)
from wildlab.analysis.navigation_inputs import (
    imu_noise,
    inputs_of,
    place_receiver,
    thinned,
    without_gross,
)
from wildlab.flight.manifest import make_manifest
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.schema import LEVER_COLUMNS, SECOND_COLUMNS
from wildlab.flight.store import Flight, load_flight
from wildlab.navigation.receiver import ReceiverNoise
from wildlab.navigation.strapdown import ImuSamples
from wildlab.paths import DATA
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def early() -> Flight:
    """A minute and a half of a twin's sensors, as if they had been logged."""
    whole = simulate_twin("fast-vessel", 1)
    parts = whole.manifest.model_dump(mode="json", exclude_none=True, exclude={"twin", "files"})
    nav = {"onboard": whole.nav["autopilot"]}
    return replace(first_seconds(whole, 90.0), manifest=make_manifest(parts | {"kind": "logged"}), nav=nav)


def jumped(flight: Flight, rows: list[int]) -> Flight:
    gnss = flight.table("gnss").copy()
    gnss.loc[rows, "north_m"] += 1000.0
    return changed(flight, gnss=gnss)


def test_a_fix_a_kilometre_off_is_no_noise(early):
    given = inputs_of(early, noise=imu_noise(early))
    assert [len(one.times) for one in without_gross(early, given).values()] == [
        len(one.times) for one in given.aiding.values()
    ]
    spoilt = jumped(early, [200])
    kept = without_gross(spoilt, inputs_of(spoilt, noise=imu_noise(spoilt)))
    assert len(kept["position"].times) == len(given.aiding["position"].times) - 1
    assert given.aiding["position"].times[200] not in kept["position"].times
    found = navigate_mekf(spoilt, [80.0], receiver=ReceiverNoise())
    as_it_was = navigate_mekf(early, [80.0], receiver=ReceiverNoise())
    assert np.allclose(found.nav["north_m"], as_it_was.nav["north_m"], atol=0.02)


def test_thinned_samples_are_means_of_neighbours():
    t = np.arange(0, 1.0, 0.004)
    imu = ImuSamples(t, np.stack([t, 2 * t, 3 * t], -1), np.stack([t, t, t], -1))
    few = thinned(imu, 50.0)
    assert len(few.times) == 50 + 2
    assert np.allclose(few.times, few.specific_force[:, 0]) and np.allclose(few.times[1], t[:5].mean())
    assert (few.times[0], few.times[-1]) == (t[0], t[-1])
    assert thinned(imu, 250.0) is imu


@pytest.mark.slow
def test_innovations_of_a_logged_flight_are_of_the_right_level_and_white(shared_data, tmp_path):
    """With what is stated they are neither. The attitude found on board has no part in it."""
    import_flight(
        DATA / "recipes" / "umn-thor75.toml", shared_data("logs", "umn_thor75"), tmp_path / "flight"
    )
    studied = study_navigation(load_flight(tmp_path / "flight"))
    assert "mekf-receiver" in studied.found and studied.reference in REFERENCES
    _, begin, end = flown_part(studied.flight, studied.times)
    numbers = numbers_of(studied, begin, end)
    for name in ("position", "velocity"):
        level = numbers["mekf-receiver", f"nis_{name}"] / 3
        assert 0.7 <= level <= 1.4 and abs(numbers["mekf-receiver", f"lag1_{name}"]) < 0.3
    level = numbers["mekf", "nis_position"] / 3
    assert not 0.7 <= level <= 1.4 or abs(numbers["mekf", "lag1_position"]) >= 0.3


@pytest.fixture(scope="module")
def turning() -> Flight:
    """Three minutes of a twin with one antenna, as if they had been logged."""
    flight = first_seconds(simulate_twin("fast-vessel", 1), 180.0)
    gnss = flight.table("gnss")
    arm = gnss[list(LEVER_COLUMNS[:3])].iloc[0].tolist()
    single = gnss.drop(columns=[*SECOND_COLUMNS, *LEVER_COLUMNS])
    return changed(flight, {"gnss": {"lever_arm_m": arm}}, gnss=single)


@pytest.mark.slow
def test_a_late_receiver_and_a_misplaced_antenna_are_found(turning):
    arm = np.array(turning.manifest.gnss.lever_arm_m)
    right = place_receiver(turning, ReceiverNoise())
    found, truth = np.array([right.latency, *right.lever]), np.array([0.0, *arm])
    assert (np.abs(found - truth) < 4 * right.sd).all()
    late = turning.table("gnss").assign(time_s=turning.table("gnss")["time_s"] + 0.12)
    wrong = {"gnss": {"lever_arm_m": (arm + np.array([0.4, -0.3, 0.2])).tolist()}}
    spoilt = place_receiver(changed(turning, wrong, gnss=late), ReceiverNoise())
    assert spoilt.latency - right.latency == pytest.approx(0.12, abs=0.01)
    assert np.allclose(spoilt.lever, right.lever, atol=4 * right.sd[1:].max())
