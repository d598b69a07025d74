"""What filters are told of sensors and targets: stated, tuned on another flight, assumed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.robots import KNOWN, believed, robot_flight, rows_of
from tests.analysis.survey_twin import Survey, simulate
from wildlab.analysis.tracks.noise_model import (
    ASSUMED,
    ROUGH,
    STATED,
    model_noise,
    model_targets,
    roughness,
    settings_of,
    spread_of,
)
from wildlab.analysis.tracks.scans import predict_scan, scans_of
from wildlab.analysis.tracks.tracker import track
from wildlab.analysis.tracks.tuning import (
    OFFSETS_S,
    Errors,
    Noise,
    _clock,
    fit_noise,
    tune_flights,
    variance_of,
)
from wildlab.flight.manifest import parse_settings
from wildlab.geometry.covariances import pose_covariance
from wildlab.geometry.frames import euler_to_matrix

# --- what is believed ---------------------------------------------------------------------------------------


def test_stated_goes_before_assumed_and_the_page_is_told():
    flight = robot_flight()
    scans = scans_of(flight, "radar")
    beliefs, said = model_noise(flight, scans, settings_of(flight))
    assert beliefs.white == pytest.approx([0.5, np.radians(0.3)], rel=0.3)
    assert all(one.source.startswith((ASSUMED, ROUGH)) for one in said)
    stated = parse_settings(
        KNOWN + "\n[sensors.radar.considered.heading]\nsd_deg = 2.0\ncorrelation_time_s = 60.0\n"
    )
    beliefs, said = model_noise(flight, scans, settings_of(flight, stated))
    np.testing.assert_allclose(beliefs.white, [0.5, np.radians(0.3)])
    (heading,) = beliefs.considered
    assert heading[:3] == ("heading", pytest.approx(np.radians(2.0)), 60.0)
    assert {one.source for one in said} == {STATED}
    targets, said = model_targets(stated.targets)
    assert targets.density == 0.15 and targets.patience_s == 10.0
    assert {one.source for one in said} == {STATED, ASSUMED}


def test_errors_of_a_camera_that_looks_straight_down_are_tilts_and_a_heading():
    """Against rotations of the camera; and all of them make the covariance of the pose."""
    flight = simulate(Survey(images=6, slant_deg=(90.0, 90.0), stated_heading_deg=4.0))
    scans, beliefs = believed(flight, "", "click", "logged")
    assert [one.name for one in beliefs.considered if one.sd == np.radians(0.7)] == ["roll", "pitch"]
    place = scans.platform + np.array([7.0, -5.0])
    still, small = np.zeros_like(place), 1e-5
    H = predict_scan(scans, place, still).H_pose
    R = scans.poses.R_nb
    seen = []
    for turn in (small, -small):
        turned = replace(scans.poses, R_nb=euler_to_matrix(0.0, 0.0, turn) @ R)
        seen.append(predict_scan(scans._replace(poses=turned), place, still).z)
    np.testing.assert_allclose(H[..., 5], (seen[0] - seen[1]) / (2 * small), rtol=1e-4, atol=1e-2)
    assumed = spread_of(scans, beliefs, H)
    P = pose_covariance(0.7, 0.7, np.radians(0.7), np.radians(4.0), R)
    own = scans._replace(poses=replace(scans.poses, covariance=P))
    stated = spread_of(own, beliefs._replace(considered=()), predict_scan(own, place, still).H_pose)
    assert assumed is not None and stated is not None
    np.testing.assert_allclose(assumed, stated, rtol=1e-9)
    across = np.array([scans.poses.camera.fx * np.radians(0.7)]) ** 2
    assert (np.diagonal(assumed, axis1=1, axis2=2) > across).all()


def test_noise_is_found_from_how_rough_detections_are():
    found = [
        roughness(scans_of(robot_flight(seed, range_sd=0.7, bearing_sd_deg=0.5), "radar"))
        for seed in range(5)
    ]
    np.testing.assert_allclose(np.mean(found, axis=0), [0.7, np.radians(0.5)], rtol=0.12)


@pytest.mark.parametrize(("kind", "clutter"), [("range-bearing", 0), ("range-bearing", 4), ("position", 4)])
def test_clutter_that_nobody_tells_from_a_target_makes_nothing_rough(kind, clutter):
    """With as many false detections as four targets have, and no names: as with names and without any."""
    found, known = (
        [roughness(scans_of(robot_flight(seed, kind=kind, **one), "radar")) for seed in range(4)]
        for one in ({"labelled": False, "clutter": clutter}, {})
    )
    np.testing.assert_allclose(np.mean(found, axis=0), np.mean(known, axis=0), rtol=0.2)


@pytest.mark.parametrize("kind", ["range-bearing", "position", "bearing"])
def test_clutter_alone_says_nothing_of_noise(kind):
    for seed in range(5):
        scans = scans_of(robot_flight(seed, kind=kind, labelled=False, clutter=4), "radar")
        nobody = scans._replace(detections=scans.detections[:, 1:], labels=scans.labels[:, 1:])
        assert np.isnan(roughness(nobody)).all()


# --- tuning -------------------------------------------------------------------------------------------------


def drawn_errors(rng, noise: Noise, targets: int = 4, n: int = 300) -> list[Errors]:
    """From one large Gaussian for each target."""
    found = []
    for _ in range(targets):
        times = np.cumsum(rng.uniform(0.1, 2.0, n))
        turn = times / 50 + rng.uniform(0, 6)
        H = np.tile(np.eye(2, 3), (n, 1, 1))
        H[:, :, 2] = 1.5 * np.column_stack([np.cos(turn), np.sin(turn)])
        fade = np.exp(-np.abs(times[:, None] - times) / noise.time_s)
        full = np.einsum("aik,k,bjk->aibj", H, noise.lasting**2, H) * fade[:, None, :, None]
        full = full.reshape(2 * n, 2 * n) + np.diag(np.tile(noise.white**2, n))
        root = np.linalg.cholesky(full)
        found.append(Errors(times, (root @ rng.normal(size=2 * n)).reshape(n, 2), H))
    return found


@pytest.mark.parametrize(
    ("white", "lasting", "time_s"),
    [(0.4, (1.0, 1.0, 0.0), 6.0), (1.0, (0.0, 0.0, 0.7), 20.0), (0.5, (0.6, 0.6, 0.6), 3.0)],
)
def test_noise_is_found_that_one_large_gaussian_was_drawn_with(white, lasting, time_s):
    noise = Noise(np.full(2, white), np.array(lasting), time_s)
    found = [
        fit_noise(drawn_errors(np.random.default_rng(seed), noise), [[0, 1], [2]], ("north", "east"))
        for seed in range(12)
    ]
    mean = [np.mean([getattr(one, name) ** 2 for one in found], axis=0) for name in ("white", "lasting")]
    np.testing.assert_allclose(mean[0], white**2, rtol=0.2)
    np.testing.assert_allclose(mean[1], np.square(lasting), rtol=0.15, atol=0.05)
    assert np.exp(np.mean([np.log(one.time_s) for one in found])) == pytest.approx(time_s, rel=0.3)


def test_units_and_axes_are_a_matter_of_taste_and_gross_errors_of_nobody():
    """As ranges of a robot: one in three hundred is anything."""
    rng = np.random.default_rng(5)
    errors = drawn_errors(rng, Noise(np.full(2, 0.4), np.array([1.0, 1.0, 0.5]), 6.0))
    kinds = [[0, 1], [2]], ("north", "east")
    found = fit_noise(errors, *kinds)
    larger = fit_noise([Errors(t, 7 * e, 7 * H) for t, e, H in errors], *kinds)
    np.testing.assert_allclose(larger.white, 7 * found.white)
    np.testing.assert_allclose(larger.lasting, found.lasting)
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, -s], [s, c]])
    turned = fit_noise([Errors(t, e @ turn.T, turn @ H) for t, e, H in errors], *kinds)
    np.testing.assert_allclose(turned.lasting, found.lasting, rtol=1e-6)
    for _, e, _ in errors:
        e[rng.integers(0, len(e))] += rng.normal(0, 300, 2)
    spoilt = fit_noise(errors, *kinds)
    np.testing.assert_allclose(spoilt.lasting, found.lasting, rtol=0.05)
    assert spoilt.time_s == pytest.approx(found.time_s, rel=0.2)


def test_near_looks_are_not_gross_for_what_a_place_that_is_off_does_to_their_bearing():
    """From 10 m to a kilometre away; the platform is 2 m off, and nothing else lasts."""
    errors = []
    for seed in range(12):
        rng, n = np.random.default_rng(seed), 200
        times, away = np.arange(float(n)), np.exp(rng.uniform(np.log(10.0), np.log(1000.0), n))
        off, H = rng.normal(0, 2.0, (n, 2)), np.zeros((n, 2, 4))
        for row in range(1, n):
            off[row] = np.exp(-1 / 10) * off[row - 1] + np.sqrt(1 - np.exp(-2 / 10)) * off[row]
        azimuth = rng.uniform(-np.pi, np.pi, n)
        H[:, 0, :2] = -np.column_stack([np.cos(azimuth), np.sin(azimuth)])
        H[:, 1, :2] = np.column_stack([np.sin(azimuth), -np.cos(azimuth)]) / away[:, None]
        H[:, 1, 2] = H[:, 0, 3] = 1.0
        white = rng.normal(size=(n, 2)) * [0.3, 0.002]
        errors.append(Errors(times, np.einsum("nij,nj->ni", H[..., :2], off) + white, H))
    found = fit_noise(errors, [[0, 1], [2], [3]], ("range", "azimuth"))
    assert found.lasting[0] == pytest.approx(2.0, rel=0.15) and found.white[1] == pytest.approx(
        0.002, rel=0.3
    )
    assert found.lasting[2] < np.radians(0.2) and found.lasting[3] < 0.7


def test_of_white_errors_little_is_put_down_to_what_lasts():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        H = rng.normal(size=(500, 2, 2)) + 1.0
        found = fit_noise(
            [Errors(np.arange(500.0), rng.normal(0, 0.7, (500, 2)), H)], [[0], [1]], ("north", "east")
        )
        np.testing.assert_allclose(found.white, 0.7, rtol=0.1)
        assert variance_of(H, found).mean() < 0.1 * 0.7**2


def clock_of(best: tuple[float, float], slope: float, at_rest: bool, gone_from: float = np.inf):
    """By errors (300,) of two targets that grow with the distance from each one's own best offset, s; of the
    second half of time the truth is not known from an offset on."""
    rng, t = np.random.default_rng(4), np.arange(300.0)
    noise = rng.normal(0, 1.0, (2, 300, 1))

    def errors_at(offset: float) -> list[Errors]:
        found = [one + slope * (offset - own) for own, one in zip(best, noise, strict=True)]
        for one in found:
            one[(t > 150) & (offset >= gone_from)] = np.nan
        return [Errors(t, one, np.zeros((300, 1, 0))) for one in found]

    return _clock(errors_at, OFFSETS_S, 0.0, at_rest)


def test_a_clock_is_taken_where_it_is_told_and_halves_of_marks_agree():
    assert clock_of((1.0, 1.0), 1.0, False)[0] == pytest.approx(1.0, abs=0.15)
    assert clock_of((1.0, 1.0), 1.0, True)[0] == pytest.approx(1.0, abs=0.15)
    # Of two marks one says a second and the other none.
    offset, low, high = clock_of((1.5, -0.1), 1.0, False)
    assert offset == pytest.approx(0.7, abs=0.2) and low > 0
    offset, low, high = clock_of((1.5, -0.1), 1.0, True)
    assert offset == 0.0 and low <= 0.0 <= high
    # Nothing tells it, and losing the truth of half of the time is no gain.
    for gone_from in (np.inf, 1.0):
        offset, low, high = clock_of((1.0, 1.0), 0.01, False, gone_from)
        assert offset == 0.0 and low <= 0.0 <= high


@pytest.mark.slow
def test_a_heading_that_is_off_teaches_no_clock_and_a_few_gross_errors_teach_nothing():
    (tuned,) = tune_flights([robot_flight(9, heading_off_deg=2.0)], ["radar"]).sensors.values()
    assert abs(tuned.offset_s) < 0.3 and tuned.clock_sd_s < 0.3
    assert 1.0 < np.degrees(tuned.heading_sd_rad) < 3.0
    sound, gross = (robot_flight(9, seconds=400.0) for _ in range(2))
    gross.tables["detections"].loc[[100, 300, 500, 700], "azimuth_rad"] += 2.0
    before, after = (tune_flights([one], ["radar"]).sensors["radar"] for one in (sound, gross))
    assert np.degrees(after.heading_sd_rad) < 0.1
    np.testing.assert_allclose(after.own_sds, before.own_sds, rtol=0.02)


def test_what_is_stated_takes_the_place_of_what_was_tuned_of_it_alone():
    tuned = tune_flights([robot_flight(8, heading_off_deg=2.0)], ["radar"]).sensors["radar"]
    tuned = tuned._replace(heading_sd_rad=0.03, range_bias_sd_m=0.4)
    flight = robot_flight(9)
    stated = parse_settings("[sensors.radar.considered.heading]\nsd_deg = 1.0\n")
    scans = scans_of(flight, "radar")
    model, given = model_noise(flight, scans, settings_of(flight, stated), tuned, "tuned on first")
    sds = {one.name: one.sd for one in model.considered}
    assert sds["heading"] == np.radians(1.0) and sds["range_bias"] == 0.4
    sources = {one.what: one.source for one in given}
    assert sources["considered error: heading"] == "stated"
    assert sources["considered error: range bias"] == "tuned on first"


@pytest.mark.slow
def test_truth_tells_a_heading_and_the_other_flight_is_judged_by_it():
    found = tune_flights([robot_flight(8, name="first", heading_off_deg=2.0)], ["radar"])
    assert found.against == "truth" and found.flight == "first"
    assert np.degrees(found.sensors["radar"].heading_sd_rad) == pytest.approx(2.0, rel=0.4)
    followed = track(robot_flight(9, heading_off_deg=-2.0), tuned=found)
    assert any(one.source == "tuned on first" for one in followed.given)
    rows = rows_of(followed)
    assert rows.loc["schmidt", "nees"] < rows.loc["ekf", "nees"]
