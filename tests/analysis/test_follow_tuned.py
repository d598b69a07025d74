"""Nothing is tuned where it is judged, what was not tuned is not said to be, and a smoother knows no more
than its track: each held against numbers computed here."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from tests.analysis.conftest import changed
from tests.analysis.robots import boat, paused, robot_flight, rows_of, seen_only
from tests.refused import refused
from wildlab.analysis.tracks import tracker, tuning
from wildlab.analysis.tracks.many import track_jointly, with_tuned
from wildlab.analysis.tracks.tracker import _between
from wildlab.analysis.tracks.tuning import read_tuned, refuse_same, tune_flights, tuned_text
from wildlab.evaluation.consistency import nees
from wildlab.flight.manifest import parse_settings
from wildlab.reporting.many_tracks import limits
from wildlab.tracking.motion import white_acceleration


def by_filterpy(z, t, density, sd, x, P):
    """Its filter after the last of positions z, and at each its state, covariance, NIS and log-likelihood."""
    kf = KalmanFilter(4, 2)
    kf.x, kf.P, kf.R, kf.H = x, P, np.diag(sd**2), np.eye(2, 4)
    steps = [(x, P, 0.0, 0.0)]
    for dt, position in zip(np.diff(t), z[1:], strict=True):
        kf.F = np.eye(4) + dt * np.eye(4, k=2)
        kf.Q = density**2 * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(2))
        kf.predict()
        kf.update(position)
        steps.append((kf.x, kf.P, kf.mahalanobis**2, kf.log_likelihood))
    return kf, *(np.array(one) for one in zip(*steps, strict=True))


@pytest.mark.slow
def test_tracks_smoothers_and_their_numbers_are_those_of_another_program():
    """Tuned on one flight, judged on another: filterpy's filter and smoother, and sums written out."""
    flight = robot_flight(1, kind="position", position_sd=1.0, seconds=60.0)
    tuned = tune_flights([flight], ["radar"], None, "innovations")
    flight = robot_flight(2, kind="position", position_sd=1.0, name="judged")
    followed = tracker.track(flight, tuned=tuned, smooth=True, filters=["ekf"])
    track, back = followed.tracks
    scans = followed.scans["radar"]
    z, t, sd = scans.detections[:, 0], scans.times, np.array(tuned.sensors["radar"].own_sds)
    kf, xs, Ps, nis, _ = by_filterpy(z, t, tuned.density, sd, track.estimate[0], track.covariance[0])
    np.testing.assert_allclose(track.estimate, xs, atol=1e-7)
    smoothed, covariance, *_ = kf.rts_smoother(xs, Ps)  # all steps are alike
    np.testing.assert_allclose(back.estimate, smoothed, atol=1e-6)
    np.testing.assert_allclose(back.covariance, covariance, atol=1e-6)
    rows = rows_of(followed)
    for name, x, P in (("ekf", xs, Ps), ("ekf-smoothed", smoothed, covariance)):
        e = boat(t) - x[:, :2]
        shown = rows.loc[name]
        assert shown["rmse"] == pytest.approx(np.sqrt((e**2).sum(axis=1).mean()), rel=1e-3)
        with_truth = P[:, :2, :2] + 0.05**2 * np.eye(2)
        nees = np.einsum("ni,nij,nj->n", e, np.linalg.inv(with_truth), e)
        assert shown["nees"] == pytest.approx(nees.mean(), rel=0.02)
    assert rows.loc["ekf", "nis"] == pytest.approx(nis[1:].mean(), rel=1e-6)
    # A smoother is never fed to NIS or to whiteness.
    assert np.isnan(rows.loc["ekf-smoothed", "nis"]) and rows.loc["ekf-smoothed", "detections"] == 0
    assert np.isnan(back.nis).all() and np.isnan(back.innovation).all() and np.isnan(back.S).all()


def test_innovations_are_likeliest_at_what_was_tuned():
    flight = robot_flight(1, kind="position", position_sd=1.0, seconds=60.0)
    tuned = tune_flights([flight], ["radar"], None, "innovations")
    scans = tracker.track(flight, tuned=tuned).scans["radar"]
    z, t = scans.detections[:, 0], scans.times

    def log_likelihood(density, sd):
        start = np.array([*z[0], 0.0, 0.0]), np.diag([*sd**2, 25.0, 25.0])
        return by_filterpy(z, t, density, sd, *start)[-1].sum()

    assert repr(read_tuned(tuned_text(tuned))) == repr(tuned)
    sd, density = np.array(tuned.sensors["radar"].own_sds), tuned.density
    best = log_likelihood(density, sd)
    for by in (0.7, 1.4):
        assert log_likelihood(by * density, sd) < best + 0.1
        assert log_likelihood(density, by * sd) < best + 0.1


def test_part_of_the_flight_that_is_judged_teaches_nothing():
    flight = robot_flight(1)
    seen = flight.tables["detections"]
    part = changed(flight, detections=seen.iloc[20:90].assign(target_id="x"))
    with refused("70", field="--tune"):
        refuse_same(flight, part)
    with refused("judged"):
        refuse_same(flight, robot_flight(1, name="renamed"))
    refuse_same(flight, robot_flight(2))


@pytest.mark.slow
def test_a_clock_that_nothing_tells_of_is_not_said_to_be_tuned():
    flight, other = robot_flight(1, seconds=60.0), robot_flight(2, name="other", seconds=60.0)
    by_truth = tune_flights([flight], ["radar"])
    by_innovations = tune_flights([flight], ["radar"], None, "innovations")
    assert by_truth.sensors["radar"].clock_tuned
    for tuned, said in ((by_truth, True), (by_innovations, False)):
        told = tracker.track(other, tuned=read_tuned(tuned_text(tuned))).given
        assert any(one.what == "to be added to its stamps" for one in told) is said


def test_a_smoother_knows_nothing_of_what_its_filter_took_behind_the_end_of_the_track():
    whole, short = (robot_flight(3, kind="position", labelled=False, truth=False) for _ in range(2))
    torn, short = paused(whole, 50, 90), seen_only(short, short.tables["frames"]["time_s"] < 50)
    settings = parse_settings(
        "[sensors.radar.noise]\nposition_m = 1.0\n[targets]\npatience_s = 10.0\ngate_probability = 0.9999\n"
    )
    followed = [tracker.track(f, settings=settings, smooth=True, filters=["ekf"]) for f in (torn, short)]
    one, two = (each.tracks[1] for each in followed)
    assert one.filter == "ekf-smoothed" and np.isfinite(one.estimate[:, 0]).sum() > 60
    known = np.isfinite(two.estimate[:, 0])
    np.testing.assert_allclose(one.estimate[: len(known)][known], two.estimate[known])


def test_a_track_carried_to_the_looks_of_another_sensor_is_the_less_certain():
    track = tracker.track(robot_flight(1, kind="position"), filters=["ekf"]).tracks[0]
    for dt in (0.0, 0.3):
        P = _between(track, track.times[20:21] + dt, 0.7)[1][0]
        F, Q = white_acceleration(dt, 0.7)
        np.testing.assert_allclose(P, (F @ track.covariance[20] @ F.T + Q)[:2, :2], rtol=1e-9)


@pytest.mark.slow
def test_several_flights_teach_together_and_one_more_does_not_move_what_is_alike():
    """Twice the same one teaches the same; of two clocks there is one between them."""
    one, other = (robot_flight(seed, kind="position", seconds=200.0, correlation=0.9) for seed in (1, 2))
    alone, doubled, both = (
        tune_flights(flights, ["radar"]).sensors["radar"] for flights in ([one], [one, one], [one, other])
    )
    assert doubled.n == 2 * alone.n and doubled.sd == pytest.approx(alone.sd, rel=1e-9)
    assert doubled.correlation_time_s == alone.correlation_time_s
    each = [tune_flights([flight], ["radar"]).sensors["radar"] for flight in (one, other)]
    assert min(x.sd for x in each) <= both.sd <= max(x.sd for x in each)
    late = [robot_flight(seed, seconds=200.0, late_s=s) for seed, s in ((1, 0.4), (2, 1.2))]
    assert -1.2 < tune_flights(late, ["radar"]).sensors["radar"].offset_s < -0.4


@pytest.mark.slow
def test_what_lasts_is_tuned_for_many_targets_too():
    """Errors that last taken for white make tracks of many targets too sure of themselves."""
    teachers = [robot_flight(seed, kind="position", seconds=400.0, correlation=0.9) for seed in (1, 2)]
    tuned = tune_flights(teachers, ["radar"])
    squares = {}
    for told in (None, tuned):
        off = []
        for seed in range(3, 9):
            flight = robot_flight(seed, kind="position", seconds=200.0, correlation=0.9, labelled=False)
            found = track_jointly(flight, tuned=told)
            way = found.truth["boat"]
            for row, shown in enumerate(found.shown):
                if len(shown.x):
                    off.append(nees(shown.x[:1, :2] - way[row], shown.P[:1, :2, :2])[0])
        squares[told is None] = float(np.mean(off))
    (sensor,) = found.sensors
    one = tuned.sensors["radar"]
    assert (sensor.correlation, sensor.lasting_s) == (one.next_correlation, one.correlation_time_s)
    assert not found.unknown_correlation
    assert 1.5 < squares[False] < 2.7 and squares[True] > 10.0


def test_what_was_tuned_as_each_target_s_own_is_not_the_platform_s_too():
    flight = robot_flight(3, heading_sd_deg=2.0, labelled=False, seconds=60.0)
    tuned = tune_flights([robot_flight(1, heading_off_deg=2.0, seconds=200.0)], ["radar"])
    assert track_jointly(flight).lasting_s and tuned.sensors["radar"].next_correlation > 0
    found = track_jointly(flight, tuned=tuned)
    assert not found.lasting_s
    # The page says which errors are in no covariance: these are in it, and are not where nobody says so.
    plain = track_jointly(robot_flight(3, labelled=False, seconds=60.0))
    assert ["limit-bare" in [one.key for one in limits(many)] for many in (plain, found)] == [True, False]
    # What is stated of how long errors last goes first.
    stated = parse_settings("[sensors.radar]\ncorrelation = 0.3\n")
    assert with_tuned(stated, tuned) == (stated, {}) != with_tuned(parse_settings(""), tuned)


def test_flights_that_teach_lie_further_apart_than_anything_lasts(monkeypatch):
    given = []

    def clock(errors_at, *_):
        given.extend(errors_at(0.0))
        return 0.0, 0.0, 0.0

    monkeypatch.setattr(tuning, "_clock", clock)
    tune_flights([robot_flight(1, seconds=60.0), robot_flight(2, seconds=60.0)], ["radar"])
    assert given[1].times.min() - given[0].times.max() > 100 * tuning.LAGS_S[-1]
