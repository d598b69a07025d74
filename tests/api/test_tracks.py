"""`wildlab.navigate`, `track` and `consistency` hand on what they were given, and say what they found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import wildlab
from wildlab.api import tracks
from wildlab.api.tracks import FEW_INDEPENDENT, Consistency
from wildlab.evaluation.consistency import Average, chi_square_interval
from wildlab.flight.clocks import frame_times, poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import matrix_to_quaternion
from wildlab.pipeline.consistency import Series
from wildlab.pipeline.follow import usual_tuning
from wildlab.pipeline.georeference import assumed_deviations
from wildlab.pipeline.navigate import PUBLISHED_LIKE, Navigated
from wildlab.pipeline.navigation_errors import comparison_times
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


def test_navigation_is_the_reference_minus_what_was_found(flight: Flight, filters: dict[str, Stand]) -> None:
    nav = wildlab.navigate(flight, tuning=PUBLISHED_LIKE)
    assert filters["mekf"].asked["tuning"] is PUBLISHED_LIKE and not filters["observer"].asked
    assert nav.reference == "truth-payload" and nav.errors is not None
    assert nav.errors.error[:, :3] == pytest.approx(np.tile(-OFF, (len(nav.errors.times), 1)), abs=1e-9)
    assert nav.errors.error[:, 3:6] == pytest.approx(np.tile(-SLIP, (len(nav.errors.times), 1)), abs=1e-9)
    square = float(SLIP @ np.linalg.solve(COVARIANCE, SLIP))
    assert nav.errors.nees["velocity"] == pytest.approx(np.full(len(nav.errors.times), square))
    assert nav.flight.nav["mekf"] is nav.found.nav


def test_poses_are_found_at_frames_and_where_they_are_compared(
    flight: Flight, filters: dict[str, Stand]
) -> None:
    wildlab.navigate(flight)
    asked = filters["mekf"].asked["times"]
    frames, compared = frame_times(flight), comparison_times(flight, "truth-payload")
    assert np.isin(frames, asked).all() and np.isin(compared, asked).all()
    assert not np.isin(compared, frames).all() and not np.isin(frames, compared).all()


def test_the_observer_is_another_filter_and_source(flight: Flight, filters: dict[str, Stand]) -> None:
    nav = wildlab.navigate(flight, "observer")
    assert filters["observer"].asked and not filters["mekf"].asked
    assert nav.source == "observer" and "observer" in nav.flight.nav and "mekf" not in nav.flight.nav


def test_only_the_truth_judges_and_only_in_the_part_that_counts(
    flight: Flight, filters: dict[str, Stand]
) -> None:
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
    return simulate_twin("large-ship", 1)


def test_a_track_is_told_what_was_asked_for_and_the_rest_as_usual(ship: Flight) -> None:
    usual = usual_tuning(ship, source="autopilot", acceleration=0.2, velocity=3.0)
    told = wildlab.track(ship, source="autopilot", filter="kf", acceleration=0.2, velocity=3.0).tuning
    assert told == usual and told[:3] == (0.2, usual.measurement, 3.0)
    pixel = wildlab.track(ship, source="autopilot", filter="ekf", pixel=7.5).tuning
    assert pixel == usual_tuning(ship, source="autopilot")._replace(pixel=7.5)
    given = wildlab.track(ship, source="autopilot", filter="ekf", measurement=15.0).tuning
    assert given[1:] == (15.0, 5.0, 15.0, assumed_deviations(ship)["pixel_px"])


def test_of_several_targets_the_one_asked_for_is_followed(ship: Flight) -> None:
    seen = ship.table("detections").copy()
    rows = len(seen)
    seen.loc[rows // 3 :, "target_id"] = "another"
    truth = ship.table("truth")
    both = pd.concat([truth, truth.assign(target_id="another")], ignore_index=True)
    two = Flight(ship.manifest, ship.nav, ship.tables | {"detections": seen, "truth": both})
    with pytest.raises(wildlab.WildlabError, match="2 targets"):
        wildlab.track(two, source="autopilot", filter="kf", measurement=15.0)
    track = wildlab.track(two, "another", source="autopilot", filter="kf", measurement=15.0)
    assert int(track.seen.seen.sum()) == rows - rows // 3


@pytest.mark.parametrize(("filter", "axes"), [("kf", ("north", "east")), ("ekf", ("u", "v"))])
def test_innovations_have_the_axes_of_the_measurement(
    ship: Flight, filter: Any, axes: tuple[str, str]
) -> None:
    track = wildlab.track(ship, source="autopilot", filter=filter, measurement=15.0, pixel=6.0)
    assert track.scored is not None
    found = {name for name in track.scored.numbers if name.startswith("lag1")}
    assert found == {f"lag1_autocorrelation_{axis}" for axis in axes}
    numbers = track.scored.numbers
    assert numbers["rmse"] > numbers["mae"] + 0.01


def test_without_a_truth_a_track_is_not_scored(ship: Flight) -> None:
    elsewhere = ship.table("truth").assign(time_s=lambda truth: truth["time_s"] + 1e5)
    blind = Flight(ship.manifest, ship.nav, ship.tables | {"truth": elsewhere})
    track = wildlab.track(blind, source="autopilot", filter="kf", measurement=15.0)
    assert track.scored is None
    found = wildlab.consistency(track)
    assert list(found.means) == ["NIS"]


def test_consistency_is_over_all_runs_with_two_degrees_of_freedom(ship: Flight) -> None:
    one, other = (
        wildlab.track(ship, source="autopilot", filter="kf", measurement=metres) for metres in (15.0, 40.0)
    )
    found, alone = wildlab.consistency(one, other), wildlab.consistency(one)
    twice = wildlab.consistency(one, one).means["NEES position"]
    nees = alone.means["NEES position"]
    assert one.scored is not None
    assert nees.mean == pytest.approx(one.scored.numbers["nees"])
    assert 1 <= nees.worth < nees.n / 2  # errors of neighbouring frames are alike
    assert twice.worth == pytest.approx(2 * nees.worth)
    assert nees.low < twice.low < twice.high < nees.high
    for name in ("NEES position", "NIS"):
        runs = found.series[name]
        assert [run.dof for run in runs] == [2, 2] and len(runs[0].times) == len(one.seen.times)
        values = np.concatenate([run.values for run in runs])
        assert found.means[name].mean == pytest.approx(np.nanmean(values))
        assert found.means[name].mean != pytest.approx(alone.means[name].mean, rel=0.01)
        mean = alone.means[name]
        assert (mean.low, mean.high) == chi_square_interval(2, runs=mean.worth)


@pytest.mark.parametrize(("worth", "hedged"), [(FEW_INDEPENDENT - 1, True), (FEW_INDEPENDENT + 1, False)])
@pytest.mark.parametrize(("mean", "verdict"), [(9.0, "overconfident"), (0.1, "too cautious")])
def test_a_verdict_on_few_independent_values_says_so(
    worth: float, hedged: bool, mean: float, verdict: str
) -> None:
    low, high = chi_square_interval(2, runs=worth)
    series = Series("NIS", 2, np.arange(2.0), np.full(2, mean))
    average = Average(mean, low, high, 100, worth)
    text = repr(Consistency({"NIS": average}, {"NIS": (series,)}))
    assert verdict in text and ("few" in text) == hedged
