"""Claims of H 6.4.2, 7.5.1 and 7.5.2 flight by flight, and filters over detections against every frame."""

from functools import partial

import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.pipeline.track import follow_positions, start
from wildlab.studies.coloured_noise import trial as coloured_noise
from wildlab.studies.linear_vs_nonlinear import trial as linear_vs_nonlinear
from wildlab.tracking.measurement import positions
from wildlab.tracking.motion import singer
from wildlab.tracking.run import run_filter


def test_claims_on_the_two_forms_are_decided_flight_by_flight() -> None:
    """Three flights: every claim is true on the first and false on the second; the third differs by one."""
    lags = {
        ("kf", "lag1_autocorrelation_north"): 0.3,
        ("kf", "lag1_autocorrelation_east"): -0.3,
        ("ekf", "lag1_autocorrelation_u"): 0.3,
        ("ekf", "lag1_autocorrelation_v"): 0.3,
    }
    good = {
        ("kf", "mae"): 10.0,
        ("ekf", "mae"): 10.9,
        ("kf", "nees"): 8.0,
        ("ekf", "nees"): 9.0,
        ("kf", "nis"): 0.5,
        ("ekf", "nis"): 0.6,
        ("measurements", "detections"): 101.0,
        **lags,
    }
    bad = {
        **good,
        ("kf", "mae"): 12.0,
        ("kf", "nees"): 7.0,
        ("kf", "nis"): 2.1,
        ("ekf", "lag1_autocorrelation_v"): 0.1,
    }
    checks = linear_vs_nonlinear.check_claims(pd.DataFrame([good, bad, {**good, ("ekf", "mae"): 11.1}]))
    assert len(checks) == 6
    assert list(checks.pop("kf-ekf-similar")) == [True, False, False]
    assert all(list(true) == [True, False, True] for true in checks.values())


def test_claims_on_correlated_noise_are_decided_flight_by_flight() -> None:
    good: dict[tuple[str, str], float] = {("measurements", "detections"): 101.0}
    for who, mae, nees, nis, lag in (
        ("cv", 10.0, 12.0, 0.5, 0.4),
        ("singer", 9.6, 11.0, 0.5, 0.4),
        ("coloured", 12.0, 1.5, 0.2, -0.1),
    ):
        good |= {(who, "mae"): mae, (who, "nees"): nees, (who, "nis"): nis}
        good |= {(who, f"lag1_autocorrelation_{axis}"): lag for axis in ("north", "east")}
    bad = {
        **good,
        ("cv", "mae"): 13.0,
        ("singer", "nees"): 7.0,
        ("coloured", "nees"): 7.5,
        ("cv", "nis"): 2.1,
        ("singer", "lag1_autocorrelation_east"): 0.1,
        ("coloured", "lag1_autocorrelation_north"): -0.5,
    }
    checks = coloured_noise.check_claims(pd.DataFrame([good, bad]))
    assert len(checks) == 8
    for claim, true in checks.items():
        assert list(true) == [True, False], claim


def test_another_twin_is_refused() -> None:
    with pytest.raises(WildlabError, match=r"none of the flights of H 6\.4\.2"):
        linear_vs_nonlinear.trial(1, twin="static-antenna")
    with pytest.raises(WildlabError, match=r"none of the flights of H 7.5.1 and 7.5.2"):
        coloured_noise.trial(1, twin="static-antenna")


@pytest.mark.slow
def test_over_detections_alone_is_over_every_frame() -> None:
    """Singer's model and constant velocity taken in frames: to a millimetre what predicting at each gives."""
    _, seen = linear_vs_nonlinear.fly_sighting("slow-vessel-eight", 2, "autopilot")
    tuning = coloured_noise.FAST
    R = np.eye(2) * tuning.cv.measurement**2
    motion = partial(singer, alpha=tuning.singer.alpha, variance=tuning.singer.variance)
    begin = start(seen, tuning.cv, 6, sd_acceleration=tuning.singer.acceleration_0)
    every = run_filter(seen.times, seen.positions, R, positions(), motion, begin)
    alone = coloured_noise.follow_singer(seen, tuning)
    np.testing.assert_allclose(alone.x, every.x, atol=1e-3)
    np.testing.assert_allclose(alone.P[:, :4, :4], every.P[:, :4, :4], rtol=1e-4, atol=1e-4)
    rows = seen.seen
    cv = run_filter(
        seen.times[rows],
        seen.positions[rows],
        R,
        positions(),
        linear_vs_nonlinear.as_in_frames(seen, tuning.cv.motion),
        linear_vs_nonlinear.start_on_detections(seen, tuning.cv),
        output_times=seen.times,
    )
    compiled = follow_positions(seen, tuning.cv)
    np.testing.assert_allclose(cv.x, compiled.x, atol=1e-3)
    np.testing.assert_allclose(cv.P, compiled.P, rtol=1e-4, atol=1e-4)


@pytest.mark.slow
def test_on_three_flights_neglected_noise_makes_filters_too_sure() -> None:
    flights = [coloured_noise.trial(seed, twin="fast-vessel") for seed in (1, 2, 3)]
    checks = coloured_noise.check_claims(pd.DataFrame(flights))
    assert checks["nis-below-mean"].all()
    assert all(one["coloured", "nees"] < one["cv", "nees"] for one in flights)
