"""What was put wrong is named, its size recovered, and nothing else is blamed; with truth and without."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tests.analysis.conftest import build, score
from tests.analysis.survey_twin import CAMERA, Survey, simulate
from tests.sound_flights import simulate_sound_flight
from wildlab.analysis.accuracy import compare_sightings, judge_repeats, learn_from
from wildlab.analysis.diagnose import diagnose, find_implausible
from wildlab.analysis.georeference import covariances_of, errors_of, observe, score_points
from wildlab.evaluation.outliers import find_outliers
from wildlab.geometry.corrections import BOUNDS, Calibration

#: Parameter and correction (degrees, seconds, metres) for what is put wrong.
WRONG = {
    "tilt_deg": ("boresight", "tilt", 5.0, np.radians(-5.0)),
    "clock_s": ("clock", "clock", 0.3, 0.3),
    "down_m": ("height", "down", 8.0, -8.0),
}


def diagnosed(flight):
    return diagnose(observe(flight), score(flight))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["fixed wing", "nadir", "multirotor"])
def test_a_sound_flight_whose_poses_wander_has_no_certain_cause(kind):
    """Attitudes that wander for 15 to 50 s and positions for minutes: in two minutes they look constant."""
    flight = simulate_sound_flight(kind, 1)
    source = "camera" if "camera" in flight.nav else None
    observations = observe(flight, source)
    found = diagnose(observations, score(flight, observations))
    assert not found.counts, found.winner.name
    assert found.noise.share > 0.5


@pytest.mark.parametrize("share", [pytest.param(0.2, marks=pytest.mark.slow), 0.6])
def test_targets_that_the_border_cuts_make_no_correction_certain(share):
    """The centre of what is seen of them is not theirs: that looks like a turned camera, and is none."""
    flight = simulate(Survey(down_m=8.0))
    table = flight.table("detections")
    cut = np.arange(len(table)) % 10 < 10 * share
    tables = {**flight.tables, "detections": table.assign(touches_border=cut.astype(float))}
    assert diagnosed(replace(flight, tables=tables)).counts == (share < 0.25)


@pytest.mark.parametrize(("most", "certain"), [pytest.param(3.0, True, marks=pytest.mark.slow), (0.3, False)])
def test_no_cause_is_certain_where_the_noise_does_not_explain_what_is_left(monkeypatch, most, certain):
    """Of a deviance for each residual of about one."""
    monkeypatch.setattr("wildlab.analysis.diagnose.MISFIT", most)
    found = diagnosed(simulate(Survey(down_m=8.0)))
    assert found.counts == certain and found.misfit != certain


@cache
def untouched():
    return diagnosed(simulate(Survey()))


def test_a_flight_that_is_well_has_no_cause():
    found = untouched()
    assert not found.counts
    assert found.outliers == () and found.inliers.all()


@pytest.mark.parametrize(
    "keys",
    [
        pytest.param(("tilt_deg", "clock_s"), marks=pytest.mark.slow),
        ("down_m",),
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
    # What was not put wrong is near zero: one of a dozen is beyond four errors once in a thousand times.
    for name in {"roll", "pan"} & set(found.calibration.names):
        assert abs(found.calibration.value(name)) < 4 * found.calibration.sd(name), name
    assert found.winner.gain.with_ <= 1.1 * untouched().winner.gain.with_
    assert found.held_summary().mean == pytest.approx(found.winner.gain.with_)


def with_distortion(flight, k1):
    """The flight with clicks of a lens with a k1 that the manifest does not state."""
    clicks = flight.tables["detections"]
    x, y = (clicks["u_px"] - CAMERA.cx) / CAMERA.fx, (clicks["v_px"] - CAMERA.cy) / CAMERA.fy
    stretch = 1 + k1 * (x**2 + y**2)
    clicks["u_px"], clicks["v_px"] = CAMERA.cx + CAMERA.fx * x * stretch, CAMERA.cy + CAMERA.fy * y * stretch
    return flight


@pytest.mark.parametrize(
    ("made", "cause", "name", "true", "width"),
    [
        (lambda: simulate(Survey(focal=0.08)), "focal length", "focal", -np.log(1.08), np.inf),
        (lambda: with_distortion(simulate(Survey(seed=1)), 0.1), "distortion", "radial", 0.1, 0.02),
        pytest.param(
            lambda: with_distortion(simulate(Survey(seed=1)), -0.1),
            "distortion",
            "radial",
            -0.1,
            0.02,
            marks=pytest.mark.slow,
        ),
        # Where targets move both do in the time that the clock is off: the camera by 15 m/s, each by 2 m/s.
        pytest.param(
            lambda: build(moving=True, clock_s=0.3, pixel_px=1.0, attitude_deg=0.3),
            "clock",
            "clock",
            0.3,
            0.1,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_lens_or_a_clock_that_is_wrong_is_named_alone(made, cause, name, true, width):
    found = diagnosed(made())
    assert found.counts and found.winner.causes == (cause,)
    low, high = found.calibration.interval(name)
    assert low <= true <= high and high - low < width


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [{}, {"focal": 0.10}])
def test_height_and_focal_length_from_one_height_are_inseparable(wrong):
    """Straight down from one height either makes the image larger, and neither is offered."""
    level = {"slant_deg": (89.0, 90.0), "level_m": 0.1, "mark_m": 8.0, "every_s": 2.0}
    found = diagnosed(simulate(Survey(wanders_s=20.0, **level, **wrong)))
    assert not found.counts
    if wrong:
        assert {"height", "focal length"} <= set(found.inseparable)


@pytest.mark.slow
def test_what_would_take_more_than_is_plausible_is_not_offered():
    found = diagnosed(simulate(Survey(tilt_deg=20.0, images=20)))
    assert any("boresight" in one.causes for one in found.implausible) and not found.counts
    fits = [Calibration(m.fit.names, m.fit.values, m.covariance, {}, 1, 1) for m in found.models]
    assert all(abs(one.value(name)) <= BOUNDS[name] for one in fits for name in one.names)


@pytest.mark.parametrize(
    ("lens", "lens_and_height", "blocks"),
    [(90.0, None, True), (90.0, 90.0, True), (90.0, 84.0, True), (90.0, 60.0, False), (199.0, None, False)],
)
def test_a_lens_that_no_camera_has_blocks_a_height_that_it_makes_needless(lens, lens_and_height, blocks):
    """By the deviances of both: with the height put right beside it, it has to explain clearly more."""

    def model(deviance, *names):
        return SimpleNamespace(deviance=deviance, fit=SimpleNamespace(names=names))

    height, odd = model(200.0, "down"), [model(lens, "focal", "aspect")]
    if lens_and_height is not None:
        odd.append(model(lens_and_height, "down", "focal", "aspect"))
    assert find_implausible(height, [model(300.0), height], odd, 29) == tuple(odd[:1] if blocks else ())


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


def with_wrong_clicks(flight, count, seed):
    """The flight with so many clicks 400 pixels off, beyond the limit of few photos, each its own way."""
    rng = np.random.default_rng(seed)
    clicks = flight.tables["detections"]
    rows = rng.choice(len(clicks), count, replace=False)
    turn = rng.uniform(0, 2 * np.pi, count)
    clicks.loc[rows, "u_px"] += 400 * np.cos(turn)
    clicks.loc[rows, "v_px"] += 400 * np.sin(turn)
    return flight, set(clicks["detection_id"][rows])


@pytest.mark.slow
def test_wrong_clicks_are_kept_out_of_the_search_and_counted():
    flight, wrong = with_wrong_clicks(simulate(Survey(images=16, tilt_deg=3.0)), 8, 1)
    found = diagnosed(flight)
    assert wrong <= set(found.scored["detection_id"][~found.inliers])
    assert found.counts and found.winner.causes == ("boresight",)
    assert found.calibration.n_points == found.inliers.sum()
    # What is quoted is the mean over the others.
    off = np.hypot(*found.winner.held.T)
    assert found.winner.gain.with_ == pytest.approx(off[found.inliers].mean())


def test_nothing_is_certain_where_too_many_clicks_are_wrong():
    found = diagnosed(simulate(Survey(images=8, tilt_deg=5.0)))
    assert found.counts and not found.too_many_out
    many = replace(found, inliers=np.arange(len(found.inliers)) % 3 > 0)
    assert many.too_many_out and not many.counts
    few = replace(found, inliers=found.scored["frame_id"].isin(["I000", "I001"]).to_numpy())
    assert few.too_many_out and few.shown is few.models[0]


@pytest.mark.parametrize(
    "views",
    [
        {"slant_deg": (90.0, 90.0)},
        {"slant_deg": (85.0, 90.0), "heading_deg": 3.0, "stated_heading_deg": 3.0},
        {"slant_deg": (35.0, 80.0)},
    ],
)
def test_sound_flights_have_no_outliers(views):
    """However steep the view: what is stated of the attitude, a tilt and a heading, explains the errors."""
    inside, out = [], 0
    for seed in range(20):
        scored = score(simulate(Survey(seed=seed, images=20, **views)), seed=seed)
        whiten = np.linalg.inv(np.linalg.cholesky(covariances_of(scored)))
        errors = errors_of(scored)
        whitened = np.einsum("nij,nj->ni", whiten, errors)
        out += len(find_outliers(whitened, errors, scored["frame_id"], scored["truth_id"])[0])
        inside.append(scored["inside_90"].mean())
    assert out == 0
    assert 0.87 < np.mean(inside) < 0.93


# --- without truth: the scatter of sightings is found, and nothing is claimed that takes truth


def judged(flight):
    full = flight.tables.pop("truth")
    found = judge_repeats(observe(flight), np.random.default_rng(0))
    flight.tables["truth"] = full
    return found


@pytest.mark.slow
def test_the_scatter_is_that_of_the_errors_that_images_do_not_share():
    flight = simulate(Survey())
    found = judged(flight)
    errors = score_points(flight, found.points)[["error_north_m", "error_east_m"]].to_numpy()
    assert found.spread.sd == pytest.approx(errors.std(), rel=0.2)
    assert 0.8 < found.spread.consistent < 1.2
    assert found.lost == 0
    assert found.things["sightings"].sum() == len(errors)
    # What all images share does not show.
    shifted = judged(simulate(Survey(north_m=30.0)))
    assert shifted.spread.sd == pytest.approx(found.spread.sd, rel=1e-3)


@cache
def unknown(clock_s):
    """A flight without truth, its observations, and what sightings say of it."""
    flight = simulate(Survey(images=24, clock_s=clock_s))
    del flight.tables["truth"]
    seen = observe(flight)
    return flight, seen, judge_repeats(seen, np.random.default_rng(0))


@pytest.mark.slow
def test_a_clock_shows_without_a_known_place():
    """Leaving its image out, a sighting comes as near to the others as on a flight whose clock is right."""
    late, right = (unknown(wrong)[2].diagnosis for wrong in (0.3, 0.0))
    assert late.counts and late.winner.causes == ("clock",) and not late.places_known
    low, high = late.calibration.interval("clock")
    assert low <= 0.3 <= high and high - low < 0.1
    logged = right.models[0].gain.without
    assert late.winner.gain.without > 1.5 * logged and late.winner.gain.with_ < 1.1 * logged
    assert not right.counts
    # What moves all sightings alike does not show, and is not tried.
    assert not any("position" in one.causes for one in late.models)


@pytest.mark.slow
def test_a_calibration_has_what_sightings_say():
    _, seen, found = unknown(0.3)
    learnt = learn_from(seen, found.diagnosis)
    assert [one.name for one in learnt.parameter] == ["clock"]
    assert learnt.parameter[0].low <= 0.3 <= learnt.parameter[0].high


def test_a_sighting_is_held_against_those_of_other_images():
    points = pd.DataFrame(
        {
            "target_id": ["a", "a", "a", "b", ""],
            "frame_id": ["1", "1", "2", "1", "2"],
            "north_m": [0.0, 2.0, 5.0, 1.0, 1.0],
            "east_m": 0.0,
        }
    )
    found = compare_sightings(points)
    np.testing.assert_allclose(found["error_north_m"], [-5.0, -3.0, 4.0, np.nan])


@pytest.mark.slow
def test_the_error_of_a_logged_truth_is_not_taken_for_that_of_pixels_and_poses():
    """Receivers on what walks, 3 m off for about a minute; clicks are 1.5 px off, 0.1 m on the ground."""
    flight, rng = simulate_sound_flight("multirotor", 1), np.random.default_rng(1)
    truth = flight.truth.copy()
    for _, own in truth.groupby("target_id"):
        off = rng.normal(0, 3.0, (len(own), 2))
        keep = np.exp(-np.diff(own["time_s"]) / 60.0)
        for i, rho in enumerate(keep, 1):
            off[i] = rho * off[i - 1] + np.sqrt(1 - rho**2) * off[i]
        truth.loc[own.index, ["north_m", "east_m"]] += off
    for stated, low, high in ((np.hypot(3.0, 0.5), 0.7, 3.0), (np.nan, 6.0, 30.0)):
        noisy = replace(flight, tables={**flight.tables, "truth": truth.assign(sd_horizontal_m=stated)})
        seen = observe(noisy, "camera" if "camera" in flight.nav else None)
        assert low < diagnose(seen, score(noisy, seen)).noise.sd["pixel"] < high


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 5, 7])
def test_a_heading_that_wanders_for_a_third_of_the_flight_is_no_constant_beside_the_tilt(seed):
    wander = {"wanders_s": 60.0, "heading_deg": 1.5, "stated_heading_deg": 1.5}
    found = diagnosed(simulate(Survey(seed=seed, images=30, tilt_deg=4.0, **wander)))
    low, high = found.calibration.interval("tilt")
    assert found.counts and found.calibration.names == ("tilt",)
    assert low <= np.radians(-4.0) <= high
