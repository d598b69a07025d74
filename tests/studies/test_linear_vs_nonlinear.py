"""Claims of H 6.4.2, 7.5.1 and 7.5.2 flight by flight, and filters over detections against every frame."""

from functools import partial

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of
from wildlab.analysis.tracks.pixels import start, track_positions
from wildlab.errors import WildlabError
from wildlab.reporting.published import load_claims
from wildlab.studies import coloured_noise as coloured_noise
from wildlab.studies import linear_vs_nonlinear as linear_vs_nonlinear
from wildlab.tracking.motion import singer
from wildlab.tracking.run import run_filter
from wildlab.tracking.sensors import positions


def flights(*changes: dict[tuple[str, str], float]) -> pd.DataFrame:
    """Flights on which every claim of H 6.4.2 is true, each with its changes."""
    good = {
        ("kf", "mae"): 10.0,
        ("ekf", "mae"): 10.9,
        ("measurements", "detections"): 101.0,
        ("beside", "lag1"): 0.25,
    }
    for who, nees, nis in (("kf", 8.0, 0.5), ("ekf", 9.0, 0.6)):
        good |= {
            (who, "nees"): nees,
            (who, "nis"): nis,
            (who, "nees_band_high"): 4.0,
            (who, "p95_measured"): 9.0,
        }
    good |= {
        ("kf", f"lag1_autocorrelation_{axis}"): value for axis, value in (("north", 0.3), ("east", -0.3))
    }
    good |= {("ekf", f"lag1_autocorrelation_{axis}"): value for axis, value in (("u", 0.3), ("v", 0.4))}
    good |= {("measurements", f"lag1_autocorrelation_{axis}"): 0.9 for axis in ("north", "east")}
    return pd.DataFrame([{**good, **change} for change in changes])


#: What makes each claim of H 6.4.2 untrue.
OPPOSED = {
    "kf-ekf-similar": {("ekf", "mae"): 11.1},
    "kf-more-accurate": {("kf", "mae"): 12.0},
    "too-optimistic": {("kf", "nees"): 3.9},
    "nis-below-mean": {("kf", "nis"): 2.1},
    "ekf-nis-larger": {("ekf", "nis"): 0.4},
    "innovations-coloured": {("kf", "lag1_autocorrelation_east"): -0.1},
    "ten-metres-while-measured": {("ekf", "p95_measured"): 10.1},
    "vertical-pixel-more-correlated": {("kf", "lag1_autocorrelation_north"): 0.5},
    "slow-flight-more-correlated": {("beside", "lag1"): 0.9},
}
THRESHOLDS = {
    claim["id"]: float(claim["threshold"])
    for study in ("linear-vs-nonlinear-fast", "coloured-noise-fast", "coloured-noise-drifting")
    for claim in load_claims(study)
    if "threshold" in claim
}


@pytest.mark.parametrize("claim", OPPOSED)
def test_claims_on_tracks_are_decided_flight_by_flight(claim):
    checks = checks_of("linear-vs-nonlinear", flights({}, OPPOSED[claim]))
    assert set(checks) == set(OPPOSED)
    assert checks[claim].holds(THRESHOLDS.get(claim)).tolist() == [True, False]


def test_flights_without_what_a_claim_is_about_are_not_asked():
    white = {("measurements", "lag1_autocorrelation_east"): 0.1}
    checks = checks_of("linear-vs-nonlinear", flights({}, white, {("ekf", "mae"): 150.0}))
    for claim in ("too-optimistic", "innovations-coloured"):
        assert np.asarray(checks[claim].premise).tolist() == [True, False, True]
    assert checks["kf-more-accurate"].premise is None, "a lost target is what such a claim is about, too"
    alone = flights({}).drop(columns=[("beside", "lag1")])
    assert "slow-flight-more-correlated" not in checks_of("linear-vs-nonlinear", alone)
    unknown = flights({("beside", "lag1"): np.nan})
    assert not checks_of("linear-vs-nonlinear", unknown)["slow-flight-more-correlated"].premise.any()


def noisy(*changes: dict[tuple[str, str], float]) -> pd.DataFrame:
    """Flights on which every claim of H 7.5.1 and 7.5.2 is true, each with its changes."""
    good: dict[tuple[str, str], float] = {("measurements", "detections"): 101.0}
    for who, mae, nees, nis, lag in (
        ("cv", 10.0, 12.0, 0.5, 0.4),
        ("singer", 9.6, 11.0, 0.5, 0.4),
        ("coloured", 12.0, 1.5, 0.3, -0.1),
        ("coloured-less-noise", 11.0, 2.5, 0.5, -0.1),
        ("cv-more-acceleration", 11.0, 9.0, 0.5, 0.3),
    ):
        good |= {(who, "mae"): mae, (who, "nees"): nees, (who, "nis"): nis, (who, "error_at_end"): 4.0}
        good |= {(who, "nees_band_low"): 0.5, (who, "nees_band_high"): 4.0}
        good |= {(who, "fraction_nees_inside"): 0.95, (who, "rmse_speed_beginning"): mae / 10}
        good |= {(who, f"lag1_autocorrelation_{axis}"): lag for axis in ("north", "east")}
    good |= {("measurements", f"lag1_autocorrelation_{axis}"): 0.9 for axis in ("north", "east")}
    return pd.DataFrame([{**good, **change} for change in changes])


NOISY_OPPOSED = {
    "neglected-too-optimistic": {("singer", "nees"): 3.9},
    "differencing-inside": {("coloured", "fraction_nees_inside"): 0.85},
    "differencing-consistent": {("coloured", "nees"): 4.1},
    "neglected-coloured": {("singer", "lag1_autocorrelation_east"): 0.1},
    "differencing-less-coloured": {("coloured", "lag1_autocorrelation_north"): -0.5},
    "differencing-white": {("coloured", "lag1_autocorrelation_north"): -0.5},
    "differencing-costs": {("cv", "mae"): 13.0},
    "singer-gains-nothing": {("singer", "mae"): 9.4},
    "nis-below-mean": {("cv", "nis"): 2.1},
    "nis-similar": {("coloured", "nis"): 0.1},
    "nis-smaller-with-differencing": {("coloured", "nis"): 0.6},
    "five-metres-at-end": {("coloured", "error_at_end"): 5.1},
    "differencing-converges-slower": {("cv", "rmse_speed_beginning"): 1.3},
    "less-noise-helps-differencing": {("coloured-less-noise", "mae"): 12.1},
    "more-acceleration-trades": {("cv-more-acceleration", "mae"): 9.9},
}


@pytest.mark.parametrize("claim", NOISY_OPPOSED)
def test_claims_on_correlated_noise_are_decided_flight_by_flight(claim):
    checks = checks_of("coloured-noise", noisy({}, NOISY_OPPOSED[claim]))
    assert set(checks) == set(NOISY_OPPOSED)
    assert checks[claim].holds(THRESHOLDS.get(claim)).tolist() == [True, False]


def test_another_twin_is_refused():
    with pytest.raises(WildlabError, match=r"6\.4\.2"):
        linear_vs_nonlinear.trial(1, twin="static-antenna", beside="")
    with pytest.raises(WildlabError, match=r"7\.5\.1"):
        coloured_noise.trial(1, twin="static-antenna")


@pytest.mark.slow
def test_over_detections_alone_is_over_every_frame():
    """Singer's model and constant velocity taken in frames: to a millimetre what predicting at each gives."""
    _, seen = linear_vs_nonlinear.fly_sighting("slow-vessel-eight", 2, "autopilot")
    tuning = coloured_noise.FAST
    R = np.eye(2) * tuning.cv.measurement**2
    motion = partial(singer, alpha=tuning.singer.alpha, variance=tuning.singer.variance)
    begin = start(seen, tuning.cv, 6, sd_acceleration=tuning.singer.acceleration_0)
    every = run_filter(seen.times, seen.positions, R, positions(), motion, begin)
    alone = coloured_noise.track_by_singer(seen, tuning)
    np.testing.assert_allclose(alone.x, every.x, atol=1e-3)
    np.testing.assert_allclose(alone.P[:, :4, :4], every.P[:, :4, :4], rtol=1e-4, atol=1e-4)
    rows = seen.detected
    cv = run_filter(
        seen.times[rows],
        seen.positions[rows],
        R,
        positions(),
        linear_vs_nonlinear.as_in_frames(seen, tuning.cv.motion),
        linear_vs_nonlinear.start_on_detections(seen, tuning.cv),
        output_times=seen.times,
    )
    compiled = track_positions(seen, tuning.cv)
    np.testing.assert_allclose(cv.x, compiled.x, atol=1e-3)
    np.testing.assert_allclose(cv.P, compiled.P, rtol=1e-4, atol=1e-4)
