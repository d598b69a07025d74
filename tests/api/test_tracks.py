"""`wildlab.navigate`, `track` and `consistency` hand on what they were given, and say what they found."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

import wildlab
from tests.analysis.robots import KNOWN, joined, robot_flight
from wildlab.analysis.georeference import assumed_deviations, assumed_pose_covariance
from wildlab.analysis.navigate import PUBLISHED_LIKE, Navigated
from wildlab.analysis.tracks import tracker
from wildlab.analysis.tracks.pixels import (
    FILTERS,
    CvTuning,
    evaluate_track,
    read_pixels,
    track_schmidt,
    truth_states,
)
from wildlab.analysis.tracks.single_target import TOGETHER
from wildlab.analysis.tracks.tracker import STATE, estimates_table, score_tracks
from wildlab.api import tracks
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.flight.clocks import poses_at
from wildlab.flight.files import check_model
from wildlab.flight.manifest import Settings, parse_settings
from wildlab.flight.store import Flight
from wildlab.geometry.frames import matrix_to_quaternion
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.twins import simulate, simulate_twin

AXES = ("north", "east", "down")
#: What the stand-in for a filter is off by: position (m) and velocity (m/s) in n.
OFF = np.array([2.0, -1.0, 0.5])
SLIP = np.array([0.1, 0.4, -0.3])
COVARIANCE = np.diag([0.01, 0.04, 0.09])


@pytest.fixture(scope="module")
def flight() -> Flight:
    """Twenty seconds in the air with all sensors."""
    twin = load_twin("static-antenna")

    def set_to(group: str, **values: float) -> Any:
        part = getattr(twin, group)
        changed = {
            name: getattr(part, name).model_copy(update={"value": value}) for name, value in values.items()
        }
        return part.model_copy(update=changed)

    short = {
        "flight": set_to("flight", duration=20.0),
        "camera": set_to("camera", images=100, recording_start=1.01),
        "target": set_to("target", observations=0),
    }
    return simulate(twin.model_copy(update=short), 1)


class Stand:
    """In place of a navigation filter: the truth, off by what is known, and what it was asked."""

    def __init__(self) -> None:
        self.asked: dict[str, Any] = {}

    def __call__(self, flight: Flight, times: Any = None, **more: Any) -> Navigated:
        self.asked = {"times": times, **more}
        truth = flight.nav["truth-payload"]
        p, R, _ = poses_at(truth, times)
        v = np.column_stack([np.interp(times, truth["time_s"], truth[f"v_{a}_m_s"]) for a in AXES])
        columns = {"time_s": times}
        columns |= {f"{axis}_m": p[:, i] + OFF[i] for i, axis in enumerate(AXES)}
        columns |= {f"q_{part}": q for part, q in zip("wxyz", matrix_to_quaternion(R).T, strict=True)}
        columns |= {f"v_{axis}_m_s": v[:, i] + SLIP[i] for i, axis in enumerate(AXES)}
        nav = pd.DataFrame(columns).dropna(ignore_index=True)
        nothing = pd.DataFrame({"time_s": nav["time_s"]})
        P = np.tile(COVARIANCE, (len(nav), 1, 1))
        return Navigated(nav, nothing, nothing, P, ("the bias grows", "and grows"))


@pytest.fixture
def filters(monkeypatch: pytest.MonkeyPatch) -> dict[str, Stand]:
    both = {"mekf": Stand(), "observer": Stand()}
    for name, stand in both.items():
        monkeypatch.setattr(tracks, f"navigate_{name}", stand)
    return both


def test_navigation_is_the_reference_minus_what_was_found(flight, filters):
    nav = wildlab.navigate(flight, tuning=PUBLISHED_LIKE)
    assert filters["mekf"].asked["tuning"] is PUBLISHED_LIKE and not filters["observer"].asked
    assert nav.reference == "truth-payload" and nav.errors is not None
    assert nav.errors.error[:, :3] == pytest.approx(np.tile(-OFF, (len(nav.errors.times), 1)), abs=1e-9)
    assert nav.errors.error[:, 3:6] == pytest.approx(np.tile(-SLIP, (len(nav.errors.times), 1)), abs=1e-9)
    square = float(SLIP @ np.linalg.solve(COVARIANCE, SLIP))
    assert nav.errors.nees["velocity"] == pytest.approx(np.full(len(nav.errors.times), square))
    assert nav.flight.nav["mekf"] is nav.found.nav


def test_only_the_truth_judges_and_only_in_the_part_that_counts(flight, filters):
    nav = wildlab.navigate(flight)
    (what, begin, end), errors = nav.part, nav.errors
    assert errors is not None and what == "in the air"
    later = type(nav)(nav.flight, "mekf", nav.found, nav.reference, errors, (what, begin + 5.0, end))
    (series,) = wildlab.consistency(later).series["NEES velocity"]
    assert series.dof == 3 and series.times[0] >= begin + 5.0 > errors.times[0]
    autopilot = type(nav)(nav.flight, "mekf", nav.found, "autopilot", errors, nav.part)
    with pytest.raises(wildlab.WildlabError, match="judge"):
        wildlab.consistency(autopilot)


@pytest.fixture(scope="module")
def ship() -> Flight:
    return simulate_twin("large-ship", 1, without=("imu", "gnss"))


TUNING = CvTuning(acceleration=0.2, position_0=15.0, velocity_0=3.0, measurement=15.0, pixel=6.0)
SETTINGS = {"targets": {"acceleration_m_s_sqrt_s": 0.2}}


def test_a_track_is_the_commands(ship):
    """What `wildlab track` writes is the table of the same function, see tests of that command."""
    found = tracker.track(ship, settings=check_model(Settings, SETTINGS, None))
    table = estimates_table(found.tracks, found.scans)
    one, rows = wildlab.track(ship, settings=SETTINGS), table[table["filter"] == "schmidt"]
    assert one.filter == "schmidt", "there is an uncertainty to consider"
    there = np.isin(one.times, rows["time_s"])
    assert np.allclose(one.estimate[there], rows[list(STATE)], rtol=0, atol=1e-9)
    assert np.allclose(one.covariance[there, 0, 1], rows["p_01"], rtol=1e-9, atol=0)
    assert np.allclose(one.nees[there], rows["nees"], rtol=1e-9, atol=0, equal_nan=True)


@pytest.mark.parametrize("name", ["kf", "ekf", "schmidt"])
def test_a_tuning_is_that_of_the_studies(ship, name):
    one = wildlab.track(ship, source="autopilot", filter=name, tuning=TUNING)
    seen = read_pixels(ship, "autopilot")
    if name == "schmidt":
        P = assumed_pose_covariance(seen.poses.R_nb, assumed_deviations(ship))
        other = track_schmidt(seen, TUNING, P)
    else:
        other = FILTERS[name](seen, TUNING)
    scored = evaluate_track(seen, other)
    assert np.array_equal(one.estimate, other.x[:, :4], equal_nan=True)
    shared = one.numbers.keys() & scored.numbers.keys()
    assert {"mae", "nees", "nis"} <= shared
    assert {key: one.numbers[key] for key in shared} == pytest.approx(
        {key: scored.numbers[key] for key in shared}
    )
    assert one.numbers["rmse"] > one.numbers["mae"] + 0.01


def test_of_several_targets_the_one_asked_for_is_followed(ship):
    seen = ship.table("detections").copy()
    rows = len(seen)
    seen.loc[rows // 3 :, "target_id"] = "another"
    truth = ship.table("truth")
    both = pd.concat([truth, truth.assign(target_id="another")], ignore_index=True)
    two = Flight(ship.manifest, ship.nav, ship.tables | {"detections": seen, "truth": both})
    with pytest.raises(wildlab.WildlabError, match="2 targets"):
        wildlab.track(two, tuning=TUNING, source="autopilot")
    track = wildlab.track(two, "another", source="autopilot", filter="kf", tuning=TUNING)
    assert int(track.used.sum()) == rows - rows // 3
    assert wildlab.track(two, "another").target == "another"


def test_without_a_truth_a_track_is_not_judged_by_it(ship):
    elsewhere = ship.table("truth").assign(time_s=lambda truth: truth["time_s"] + 1e5)
    blind = Flight(ship.manifest, ship.nav, ship.tables | {"truth": elsewhere})
    for told in ({"filter": "kf", "tuning": TUNING, "source": "autopilot"}, {"filter": "ekf"}):
        track = wildlab.track(blind, **told)
        assert np.isnan(track.numbers["mae"]) and "truth" not in repr(track)
        assert list(wildlab.consistency(track).means) == ["NIS"]


def test_consistency_is_over_all_runs_with_two_degrees_of_freedom(ship):
    one, other = (
        wildlab.track(ship, source="autopilot", filter="kf", tuning=TUNING._replace(measurement=metres))
        for metres in (15.0, 40.0)
    )
    found, alone = wildlab.consistency(one, other), wildlab.consistency(one)
    twice = wildlab.consistency(one, one).means["NEES position"]
    nees = alone.means["NEES position"]
    assert nees.mean == pytest.approx(one.numbers["nees"])
    assert 1 <= nees.worth < nees.n / 2  # errors of neighbouring frames are alike
    assert twice.worth == pytest.approx(2 * nees.worth)
    assert nees.low < twice.low < twice.high < nees.high
    for name in ("NEES position", "NIS"):
        runs = found.series[name]
        assert [run.dof for run in runs] == [2, 2] and len(runs[0].times) == len(one.times)
        values = np.concatenate([run.values for run in runs])
        assert found.means[name].mean == pytest.approx(np.nanmean(values))
        assert found.means[name].mean != pytest.approx(alone.means[name].mean, rel=0.01)
        mean = alone.means[name]
        assert (mean.low, mean.high) == chi_square_interval(2, runs=mean.worth)


def test_anybodys_filter_by_its_errors_and_covariances():
    """NEES of white errors is chi-square: the mean of a right filter lies in its interval, of others not."""
    rng = np.random.default_rng(4)
    P = np.tile(np.diag([4.0, 1.0, 9.0]), (8, 400, 1, 1))
    e = rng.multivariate_normal(np.zeros(3), P[0, 0], (8, 400))
    runs = wildlab.consistency(errors=e, covariances=P).means["NEES"]
    assert runs.inside and runs.n == 3200 and runs.mean == pytest.approx(3.0, abs=5 * np.sqrt(6 / 3200))
    one = wildlab.consistency(errors=e[0], covariances=P[0]).means["NEES"]
    assert one.n == 400 and one.mean == pytest.approx(float(np.mean(np.sum(e[0] ** 2 / [4, 1, 9], axis=1))))
    assert not wildlab.consistency(errors=e, covariances=P / 2).means["NEES"].inside
    for wrong in (
        {"errors": e},
        {"errors": e, "covariances": P[0]},
        {"errors": e[0, 0], "covariances": P[0, 0]},
    ):
        with pytest.raises(wildlab.WildlabError) as caught:
            wildlab.consistency(**wrong)
        assert caught.value.field == "covariances"


def test_an_error_that_lasts_is_one_value():
    """Each run an error of its own throughout: an honest filter is inside in 95 of 100 runs, not in 6."""
    rng = np.random.default_rng(3)
    inside, P = [], np.tile(np.eye(2), (400, 1, 1))
    for _ in range(200):
        found = wildlab.consistency(errors=np.repeat(rng.normal(size=(1, 2)), 400, 0), covariances=P).means[
            "NEES"
        ]
        inside.append(found.inside)
        assert found.worth == 1.0
    # 200 draws of 0.95: below 0.88 once in 10 000.
    assert np.mean(inside) > 0.88


def test_a_track_is_judged_as_the_command_judges_it():
    """Radar and bearings together: numbers, degrees of freedom and bands."""
    flight = joined(robot_flight(3), robot_flight(103, kind="bearing", sensor="cam"))
    told = parse_settings(KNOWN + "[sensors.cam.noise]\nazimuth_deg = 0.3\n")
    rows = score_tracks(tracker.track(flight, settings=told, filters=["ekf"])).query("filter == 'ekf'")
    row = rows[rows["kind"] == TOGETHER].iloc[0]
    track = wildlab.track(flight, filter="ekf", settings=told)
    nis, nees = (wildlab.consistency(track).means[name] for name in ("NIS", "NEES position"))
    assert (nis.mean, nis.low, nis.high) == pytest.approx((row["nis"], row["nis_low"], row["nis_high"]))
    assert (nees.mean, nees.low, nees.high) == pytest.approx((row["nees"], row["nees_low"], row["nees_high"]))
    assert track.numbers["rmse"] == pytest.approx(row["rmse"]) and 1 < track.dof < 2
    truth = truth_states(flight, track.target, track.times)
    known = np.isfinite(track.truth[:, 0])
    assert known.any() and np.allclose(track.truth[known, :2], truth[known, :2], atol=1e-6)
    out_of_sight = replace(track, judged=track.judged & (track.times < np.median(track.times)))
    found = wildlab.consistency(out_of_sight).means["NEES position"]
    assert found.mean == pytest.approx(np.nanmean(track.nees[out_of_sight.judged])) != nees.mean
