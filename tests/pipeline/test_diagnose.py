"""What was put wrong is named, its size recovered, and nothing else is blamed."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.pipeline.survey_twin import Survey, simulate
from wildlab.errors import WildlabError
from wildlab.evaluation.blocks import Neighbours
from wildlab.pipeline.diagnose import diagnose
from wildlab.pipeline.evaluate import score_points
from wildlab.pipeline.georeference import georeference, observe

#: Parameter and correction (degrees, seconds, metres) for what is put wrong.
WRONG = {
    "tilt_deg": ("boresight", "tilt", 5.0, np.radians(-5.0)),
    "clock_s": ("clock", "clock", 0.3, 0.3),
    "down_m": ("height", "down", 8.0, -8.0),
}


def diagnosed(flight, seed=0):
    rng = np.random.default_rng(seed)
    observations = observe(flight)
    return diagnose(flight, observations, score_points(flight, georeference(flight, observations, rng)), rng)


@cache
def untouched():
    return diagnosed(simulate(Survey()))


def test_a_flight_that_is_well_has_no_cause():
    found = untouched()
    assert not found.counts
    assert found.outliers == () and found.inliers.all()


def test_what_wanders_is_seen_once_the_cause_is_taken_off():
    found = untouched()
    assert not found.neighbours().alike and found.neighbours().images == 40
    turn = found.scored["time_s"].to_numpy() / 30.0
    slow = 3.0 * np.column_stack([np.sin(turn), np.cos(turn)])
    models = tuple(replace(one, held=one.held + slow) for one in found.models)
    assert replace(found, models=models).neighbours().alike


@pytest.mark.parametrize(
    "keys",
    [
        ("tilt_deg", "clock_s"),
        *(pytest.param((one,), marks=pytest.mark.slow) for one in WRONG),
        pytest.param(("tilt_deg", "down_m"), marks=pytest.mark.slow),
        pytest.param(("clock_s", "down_m"), marks=pytest.mark.slow),
    ],
)
def test_what_is_wrong_is_named_and_its_size_recovered(keys):
    found = diagnosed(simulate(Survey(**{key: WRONG[key][2] for key in keys})))
    assert set(found.winner.causes) == {WRONG[key][0] for key in keys}
    assert found.counts and not found.rivals
    for key in keys:
        _, name, _, correction = WRONG[key]
        low, high = found.calibration.interval(name)
        assert low <= correction <= high, name
        assert not low <= 0 <= high
    # What was not put wrong is not told from zero.
    for name in {"roll", "pan"} & set(found.calibration.names):
        low, high = found.calibration.interval(name)
        assert low <= 0 <= high
    assert found.winner.gain.with_ <= 1.1 * untouched().winner.gain.with_
    assert found.held_summary().mean == pytest.approx(found.winner.gain.with_)


@pytest.mark.slow
def test_intervals_allow_for_images_that_stay_wrong_alike(monkeypatch):
    flight = simulate(Survey(tilt_deg=3.0))
    found = []
    for correlation in (0.0, 0.8):
        alike = Neighbours(correlation, 40)
        monkeypatch.setattr("wildlab.pipeline.diagnose._neighbours", lambda *_, alike=alike: alike)
        found.append(diagnosed(flight))
    wider = Neighbours(0.8, 40).widening(len(np.unique(found[0].blocks)))
    assert wider > 2
    plain, wide = (one.winner.gain.gain for one in found)
    assert (wide.estimate, wide.high - wide.low) == pytest.approx(
        (plain.estimate, wider * (plain.high - plain.low))
    )
    np.testing.assert_allclose(found[1].calibration.covariance, wider**2 * found[0].calibration.covariance)


def test_a_wrong_focal_length_is_the_lens():
    found = diagnosed(simulate(Survey(focal=0.08)))
    assert found.counts and found.winner.causes == ("focal length",)
    low, high = found.calibration.interval("focal")
    assert low <= -np.log(1.08) <= high


@pytest.mark.slow
def test_a_mark_that_is_off_and_a_photo_that_is_turned_are_named():
    flight = simulate(Survey(tilt_deg=5.0, off={"M44": (20.0, 15.0)}, turned_deg={7: 40.0}))
    found = diagnosed(flight)
    named = {(one.kind, one.mark if one.kind == "mark" else one.photo): one for one in found.outliers}
    assert set(named) == {("mark", "M44"), ("photo", "I007")}
    assert named["mark", "M44"].off_m == pytest.approx(25.0, abs=2.5)
    assert found.winner.causes == ("boresight",)
    low, high = found.calibration.interval("tilt")
    assert low <= np.radians(-5.0) <= high
    clean = found.held_summary(found.inliers)
    assert clean.mean <= 1.1 * untouched().winner.gain.with_ < found.held_summary().mean


@pytest.mark.slow
def test_a_clock_is_found_where_the_targets_move(make_flight):
    """Both move in the time that the clock is off: the camera by 15 m/s, each target by 2 m/s of its own."""
    flight = make_flight(moving=True, clock_s=0.3, pixel_px=1.0, attitude_deg=0.3)
    found = diagnosed(flight)
    assert found.winner.causes == ("clock",) and found.counts
    low, high = found.calibration.interval("clock")
    assert low <= 0.3 <= high and high - low < 0.1


def test_images_without_times_are_not_asked_for_the_clock():
    found = diagnosed(simulate(Survey(timed=False, images=12)))
    assert not any("clock" in model.causes for model in found.models)
    timed = diagnosed(simulate(Survey(images=12)))
    assert any(model.causes == ("clock",) for model in timed.models)


def test_too_few_images_are_refused():
    with pytest.raises(WildlabError, match="known in 5 images") as caught:
        diagnosed(simulate(Survey(images=5)))
    assert "at least 6 images" in caught.value.fix


def with_wrong_clicks(flight, count, seed):
    """The flight with so many clicks 300 pixels off, each in a direction of its own."""
    rng = np.random.default_rng(seed)
    clicks = flight.tables["detections"]
    rows = rng.choice(len(clicks), count, replace=False)
    turn = rng.uniform(0, 2 * np.pi, count)
    clicks.loc[rows, "u_px"] += 300 * np.cos(turn)
    clicks.loc[rows, "v_px"] += 300 * np.sin(turn)
    return flight, set(clicks["detection_id"][rows])


def test_wrong_clicks_are_kept_out_of_the_search_and_counted():
    flight, wrong = with_wrong_clicks(simulate(Survey(images=16, tilt_deg=3.0)), 8, 1)
    found = diagnosed(flight)
    assert wrong <= set(found.scored["detection_id"][~found.inliers])
    assert found.counts and found.winner.causes == ("boresight",)
    assert found.calibration.n_points == found.inliers.sum()
    # What is quoted is the mean over the others, and that of all stands beside.
    off = np.hypot(*found.winner.held.mean(axis=0).T)
    assert found.winner.gain.with_ == pytest.approx(
        np.hypot(found.winner.held[..., 0], found.winner.held[..., 1])[:, found.inliers].mean()
    )
    assert found.winner.gain_of_all.with_ > found.winner.gain.with_ + 0.05 * off[~found.inliers].mean()


def test_nothing_is_certain_where_too_many_clicks_are_wrong():
    found = diagnosed(simulate(Survey(images=8, tilt_deg=5.0)))
    assert found.counts and not found.too_many_out
    many = replace(found, inliers=np.arange(len(found.inliers)) % 3 > 0)
    assert many.too_many_out and not many.counts
    few = replace(found, inliers=found.scored["frame_id"].isin(["I000", "I001"]).to_numpy())
    assert few.too_many_out and few.shown is few.models[0]
