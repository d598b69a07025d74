"""Association by Monte Carlo: against filters written out for one run, and where the answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.twins import simulate_twin
from wildlab.studies import gating
from wildlab.studies.gating import (
    GATES,
    IMAGES,
    Outcome,
    Overflight,
    claim_margins,
    draw_scene,
    gate,
    outcomes,
    overflight,
    standard_error,
    streams,
    verdict,
)


@pytest.fixture(scope="module")
def flight() -> Flight:
    return simulate_twin("large-ship", 1)


@pytest.fixture(scope="module")
def over(flight: Flight) -> Overflight:
    return overflight(flight)


def warmed_up(scene: gating.GatingScene, run: int) -> KalmanFilter:
    """Another filter, its motion H (6.1), (6.2) typed from the print."""
    kf, dt = KalmanFilter(dim_x=4, dim_z=2), 0.1
    G = np.array([[dt**2 / 2, 0], [0, dt**2 / 2], [dt, 0], [0, dt]])
    kf.F, kf.Q = np.eye(4) + dt * np.eye(4, k=2), 0.01**2 * G @ G.T
    kf.H, kf.R, kf.P = np.eye(2, 4), 100.0 * np.eye(2), np.diag([100.0, 100.0, 20.0, 20.0])
    kf.x = np.append(scene.start[run], [0.0, 0.0])
    for z in scene.warm_up[run]:
        kf.predict()
        kf.update(z)
    return kf


def test_positions_as_another_filter_gates_them(over):
    runs = streams(7, 4)
    scene, gated = draw_scene(over, runs), gate(over, runs)
    for run in range(4):
        kf = warmed_up(scene, run)
        for t in range(IMAGES):
            kf.predict()
            S = kf.P[:2, :2] + kf.R
            nis = [v @ np.linalg.inv(S) @ v for v in gated.measured[run, t] - kf.x[:2]]
            np.testing.assert_allclose(gated.nis[0, run, t], nis, rtol=1e-8)
            assert gated.right[0, run, t] == (nis[0] < nis[1])
            kf.update(gated.measured[run, t, 0])
            np.testing.assert_allclose(gated.estimate[0, run, t], kf.x[:2], atol=1e-7)


def seen_angles(p_c: Array) -> Array:
    x, y, z = p_c
    return np.array([np.arctan2(y, x), np.arctan(z / np.hypot(x, y))])


@pytest.mark.parametrize("form", ["pixels", "angles", "both"])
def test_pixels_and_angles_as_written_out(over, form):
    """The extended filter of H (6.4)-(6.11) for single runs, its derivatives by differences."""
    runs = streams(11, 2)
    scene, gated = draw_scene(over, runs), gate(over, runs)
    f = over.poses.camera.fx
    middle = np.array([over.poses.camera.cx, over.poses.camera.cy])
    R_uv, R_angles = np.diag([360.0, 160.0]), np.diag(np.radians([6.0, 3.0]) ** 2)

    for run in range(2):
        kf = warmed_up(scene, run)
        x, P = kf.x, kf.P
        for t in range(IMAGES):
            R_cn, p_nc = scene.poses.R_nc[run, t].T, scene.poses.p_nc[run, t]

            def in_camera(position: Array, R_cn: Array = R_cn, p_nc: Array = p_nc) -> Array:
                return np.asarray(R_cn @ (np.append(position, 0.0) - p_nc))

            def pixel(position: Array) -> Array:
                x_c, y_c, z_c = in_camera(position)
                return middle + f / z_c * np.array([x_c, y_c])

            def angles(position: Array) -> Array:
                return seen_angles(in_camera(position))

            def slope(h, position: Array) -> Array:  # type: ignore[no-untyped-def]
                steps = 1e-4 * np.eye(2)
                H = np.array([(h(position + s) - h(position - s)) / 2e-4 for s in steps]).T
                return np.hstack([H, np.zeros((2, 2))])

            x, P = kf.F @ x, kf.F @ P @ kf.F.T + kf.Q
            uv = scene.pixels[run, t]
            measured = np.array([seen_angles(np.append((z - middle) / f, 1.0)) for z in uv])
            H, H_angles = slope(pixel, x[:2]), slope(angles, x[:2])
            gaps, turns = uv - pixel(x[:2]), measured - angles(x[:2])
            turns[:, 0] = np.angle(np.exp(1j * turns[:, 0]))
            S, S_angles = H @ P @ H.T + R_uv, H_angles @ P @ H_angles.T + R_angles
            by_pixels = np.array([v @ np.linalg.inv(S) @ v for v in gaps])
            by_angles = np.array([v @ np.linalg.inv(S_angles) @ v for v in turns])
            nis = {"pixels": by_pixels, "angles": by_angles, "both": by_pixels + by_angles}[form]
            row = GATES.index(form)
            np.testing.assert_allclose(gated.nis[row, run, t], nis, rtol=1e-4)
            assert gated.right[row, run, t] == (nis[0] < nis[1])
            K = P @ H.T @ np.linalg.inv(S)
            x = x + K @ gaps[0]
            P = P - K @ H @ P


def test_what_is_behind_the_lens_or_on_its_axis_is_not_expected():
    camera = Camera(640, 512, 700.0, 700.0, 320.0, 256.0)
    at, p = np.array([[5.0, 5.0], [0.0, 0.0]]), np.array([0.0, 0.0, -100.0])
    down, up = (CameraPoses.at_lens(camera, p, R, np.eye(3)) for R in (np.eye(3), np.diag([1.0, -1.0, -1.0])))
    with np.errstate(divide="ignore", invalid="ignore"):
        for form in ("pixels", "angles"):
            assert np.isnan(gating.expected(form, at, up)[0]).all()
        assert np.isnan(gating.expected("angles", at, down)[0]).any(axis=1).tolist() == [False, True]
    assert np.isfinite(gating.expected("pixels", at, down)[0]).all()


def test_without_noise_and_far_apart_nothing_goes_wrong(over, monkeypatch):
    monkeypatch.setattr(gating, "POSE_SD", np.zeros(8))
    monkeypatch.setattr(gating, "PIXEL_SD", 0.0)
    monkeypatch.setattr(gating, "APART", (0.0, 120.0))
    gated = gate(over, streams(1, 20))
    np.testing.assert_allclose(gated.measured, gated.targets[:, None].repeat(IMAGES, 1), atol=1e-6)
    assert gated.right.all()


def rates_of(over: Overflight, runs: int, seed: int, chunk: int = 500) -> Array:
    return outcomes(over, runs, seed, chunk).rate


def test_a_run_does_not_depend_on_the_others(over):
    many = rates_of(over, 7, 3, chunk=3)
    assert many.shape == (len(GATES), 7)
    np.testing.assert_array_equal(many[:, :4], rates_of(over, 4, 3))
    assert (rates_of(over, 4, 4) != many[:, :4]).any()


def test_mistakes_are_counted_apart_and_together(over):
    gated = gate(over, streams(5, 30))
    found = outcomes(over, 30, 5)
    pixels, angles = ~gated.right[1], ~gated.right[2]
    assert found.mistaken.tolist() == (pixels | angles).any(axis=1).tolist()
    assert found.same_images.tolist() == [bool((p == a).all()) for p, a in zip(pixels, angles, strict=True)]
    # Both gates on the same track: their distances added, and the smaller sum taken.
    np.testing.assert_allclose(gated.nis[3], gated.nis[1] + gated.nis[2])
    np.testing.assert_array_equal(gated.right[3], gated.nis[3][..., 0] < gated.nis[3][..., 1])
    agree = gated.right[1] == gated.right[2]
    np.testing.assert_array_equal(gated.right[3][agree], gated.right[1][agree])


def test_the_noise_is_that_of_the_tables(over):
    scene = draw_scene(over, streams(2, 3000))
    apart = scene.targets[:, 1] - scene.targets[:, 0]
    se = np.sqrt(200 / 3000)
    np.testing.assert_allclose(apart.mean(axis=0), (10, 15), atol=5 * se)
    np.testing.assert_allclose(apart.std(axis=0), np.sqrt(200), rtol=0.07)
    np.testing.assert_allclose((scene.poses.p_nc - over.poses.p_nb).std(axis=(0, 1)), (2, 2, 5), rtol=0.02)
    np.testing.assert_allclose((scene.warm_up - scene.targets[:, :1]).std(axis=(0, 1)), 10, rtol=0.02)
    # The lens: roll and gimbal pan, pitch and gimbal tilt, each by one degree, yaw by two.
    turned = np.swapaxes(over.poses.R_nc, -1, -2) @ scene.poses.R_nc
    about = np.degrees([turned[..., 2, 1].std(), turned[..., 0, 2].std(), turned[..., 1, 0].std()])
    assert np.sqrt((about**2).sum()) == pytest.approx(np.sqrt(1 + 1 + 4 + 1 + 1), rel=0.1)


def test_the_stretch_is_the_nearest_and_the_gimbal_follows(flight, over):
    np.testing.assert_allclose(np.diff(over.time_s), 0.1)
    assert len(over.time_s) == IMAGES
    nav = flight.nav["truth"]
    every = nav.iloc[::5]
    away = np.hypot(every["north_m"], every["east_m"]).to_numpy()
    farthest = np.array([away[i : i + IMAGES].max() for i in range(len(away) - IMAGES + 1)])
    assert np.hypot(*over.poses.p_nb[:, :2].T).max() == pytest.approx(farthest[round(10 * over.time_s[0])])
    # Hardly any stretch is nearer, and what is has the origin out of view at one of its ends.
    assert (farthest < farthest[round(10 * over.time_s[0])]).mean() < 0.02
    camera, p_nc, R_nc = over.poses.camera, over.poses.p_nc, over.poses.R_nc
    uv = ground_to_pixel(camera, np.zeros(3), p_nc, R_nc)
    np.testing.assert_allclose(uv[:, 1], camera.cy, atol=1e-6)
    assert np.all((uv[:, 0] > 0) & (uv[:, 0] < camera.width))


def test_a_flight_without_truth_or_too_short(flight):
    with pytest.raises(WildlabError, match="no true poses"):
        overflight(Flight(flight.manifest, {"autopilot": flight.nav["autopilot"]}, flight.tables))
    with pytest.raises(WildlabError, match="in view for 14 s"):
        overflight(Flight(flight.manifest, {"truth": flight.nav["truth"].head(200)}, flight.tables))
    with pytest.raises(WildlabError, match="in view for 14 s"):
        far = flight.nav["truth"].assign(north_m=lambda nav: nav["north_m"] + 2000)
        overflight(Flight(flight.manifest, {"truth": far}, flight.tables))


def outcome(rates: Array, mistaken: bool = True, same: float = 0.0) -> Outcome:
    """Runs with mistakes or without any, a share of them in the same images."""
    n = rates.shape[1]
    return Outcome(rates, np.full(n, mistaken), np.arange(n) < same * n)


def test_claims_are_decided_run_by_run():
    wobble = np.tile([-5.0, 5.0], 500)
    level = np.array([[96.6], [96.8], [96.0], [96.9]]) + wobble  # what the runs share blurs no difference
    margins = claim_margins(outcome(level, same=0.1))
    assert {name: verdict(margin) for name, margin in margins.items()} == {
        "forms-agree": "holds",
        "angles-least-accurate": "holds",
        "mistakes-on-different-images": "holds",
    }
    np.testing.assert_allclose(margins["forms-agree"].mean(axis=1), [1.2, 0.8, 0.4, 1.6, 0.2, 1.8])
    np.testing.assert_allclose(margins["angles-least-accurate"].mean(axis=1), [0.6, 0.8])
    apart = claim_margins(outcome(level[[2, 1, 0, 3]] * [[0.9], [1], [1], [1]], same=0.9))
    assert {verdict(margin) for margin in apart.values()} == {"does not hold"}


@pytest.mark.parametrize(
    ("margins", "decided"),
    [
        (([1.0, 1.1, 0.9], [1.0, 1.1, 0.9]), "holds"),
        (([1.0, 1.1, 0.9], [-1.0, 1.0, 0.5]), "cannot be decided"),
        (([-1.0, 1.0, 0.5], [-1.0, -1.1, -0.9]), "does not hold"),
        (([np.nan] * 4,), "cannot be decided"),
    ],
)
def test_a_claim_wants_every_margin_and_chance_decides_none(margins, decided):
    assert verdict(np.array(margins)) == decided


def test_a_run_without_mistakes_says_nothing_of_where_they_fall():
    margin = claim_margins(outcome(np.full((4, 6), 100.0), mistaken=False, same=1.0))
    assert np.isnan(margin["mistakes-on-different-images"]).all()


def test_two_targets_in_one_place_are_a_toss_up(over, monkeypatch):
    """Nothing but the noise of the detector tells them apart, and it favours neither."""
    monkeypatch.setattr(gating, "APART", (0.0, 0.0))
    monkeypatch.setattr(gating, "DISPLACED_M", 0.0)
    rates = rates_of(over, 200, 5)
    for form in rates:
        assert abs(form.mean() - 50) < 5 * standard_error(form)
    assert rates.std(axis=1, ddof=1) == pytest.approx(100 * np.sqrt(0.25 / IMAGES), rel=0.3)
