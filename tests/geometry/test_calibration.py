"""Calibration finds what was put in, says how well, and refuses what the data cannot tell."""

from dataclasses import replace

import numpy as np
import pytest

from wildlab.geometry.calibration import Fit, calibrate, with_covariance
from wildlab.geometry.camera_poses import CameraPoses, Mount, mount_rotation
from wildlab.geometry.corrections import (
    BORESIGHT,
    CLOCK_STEP,
    PARAMETERS,
    Calibration,
    apply_calibration,
    calibration_jacobian,
    georeference_calibrated,
)
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.studies.sensitivity import TAU2

PLAIN = Mount("down")
TRUE = Mount("down", misalignment=(0.03, -0.04, 0.02))


class Survey:
    """Images of known points from a flight at 20 m/s, with what is wrong put in.

    ``clock`` seconds must be added to the stamps to get the true time, ``wrong`` metres stand in the logged
    position; every image has an attitude error of its own. ``plain`` flies at one height with level wings.
    """

    def __init__(
        self, seed, headings, attitude_sd=0.0, pixel_sd=0.0, clock=0.0, wrong=(0.0, 0.0, 0.0), plain=False
    ):
        rng = np.random.default_rng(seed)
        n_images, points = 30, 4
        self.time = np.repeat(np.arange(n_images) * 1.0, points)
        self.image = np.repeat(np.arange(n_images), points)
        self.heading = np.repeat(np.resize(headings, n_images), points)
        self.height = np.repeat(np.full(n_images, 100.0) if plain else rng.uniform(50, 200, n_images), points)
        self.bank = np.repeat(np.zeros(n_images) if plain else rng.uniform(-0.2, 0.2, n_images), points)
        self.wave = 0.0 if plain else 0.02
        self.wrong = np.array(wrong)
        p, R = self.truth(clock)
        own = rotation_vector_to_matrix(np.repeat(rng.normal(0, attitude_sd, (n_images, 3)), points, axis=0))
        self.known = np.column_stack([p[:, :2] + rng.uniform(-18, 18, (len(p), 2)), np.zeros(len(p))])
        seen = CameraPoses(TAU2, TRUE, p, R @ own)
        self.uv = ground_to_pixel(TAU2, self.known, seen.p_nc, seen.R_nc)
        self.uv += rng.normal(0, pixel_sd, self.uv.shape)

    def truth(self, offset):
        t = self.time + offset
        course = np.stack([np.cos(self.heading), np.sin(self.heading)], -1)
        p = np.column_stack([20.0 * offset * course, -self.height])
        return p, euler_to_matrix(self.bank, self.wave * np.sin(t), self.heading)

    def poses_at(self, mount=PLAIN):
        def at(offset):
            p, R = self.truth(offset)
            return CameraPoses(TAU2, mount, p + self.wrong, R)

        return at


EVERY_WAY = np.linspace(0, 2 * np.pi, 30, endpoint=False)


def error(calibration, survey):
    ground = georeference_calibrated(calibration, survey.poses_at(), survey.uv, 0.0)
    return np.linalg.norm(ground[:, :2] - survey.known[:, :2], axis=1)


def test_boresight_comes_back_exactly_without_noise():
    survey = Survey(1, EVERY_WAY)
    found = calibrate(survey.poses_at(), survey.uv, survey.known, survey.image)
    assert found.names == BORESIGHT
    assert not found.undetermined
    assert np.allclose(apply_calibration(found, PLAIN).misalignment, TRUE.misalignment, atol=1e-6)
    assert error(found, survey).max() < 1e-4


def test_a_correction_turns_about_the_axes_of_the_airframe():
    """Not about those of a base that is turned already: a roll leaves the airframe's x where it is."""
    rolled = Calibration(("roll",), np.array([0.1]), np.eye(1), {}, 4, 4)
    turned = Mount("forward", misalignment=(0.0, 0.0, np.pi / 2))
    R_bm = mount_rotation(apply_calibration(rolled, turned))
    assert np.allclose(R_bm @ mount_rotation(turned).T @ [1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    assert np.allclose(R_bm @ [1.0, 0.0, 0.0], [0.0, np.cos(0.1), np.sin(0.1)])


def test_radial_adds_to_k1_of_the_lens():
    """Against r (1 + k1 r^2) written out, and its derivative at zero, from 100 m straight down."""
    xy = np.random.default_rng(3).uniform(-0.25, 0.25, (50, 2))
    r2 = (xy**2).sum(axis=1, keepdims=True)
    own, added = 0.04, 0.1
    lens = replace(TAU2, distortion=(own, 0.0, 0.0, 0.0, 0.0))
    size, middle = [TAU2.fx, TAU2.fy], [TAU2.cx, TAU2.cy]

    def ground(camera, uv, k1):
        radial = Calibration(("radial",), np.array([k1]), np.eye(1), {}, 4, 4)
        level = np.tile([0.0, 0.0, -100.0], (len(uv), 1)), np.tile(np.eye(3), (len(uv), 1, 1))
        return georeference_calibrated(radial, lambda _: CameraPoses(camera, PLAIN, *level), uv, 0.0)[:, :2]

    # Columns count to the right, rows backwards: east and south of a camera that looks down.
    places = 100.0 * xy[:, ::-1] * [-1.0, 1.0]
    assert np.allclose(ground(lens, middle + size * xy * (1 + (own + added) * r2), added), places, atol=1e-9)
    uv = middle + size * xy
    slope = (ground(TAU2, uv, 1e-5) - ground(TAU2, uv, -1e-5)) / 2e-5
    assert np.allclose(slope, -places * r2, atol=1e-6)


def test_clock_and_position_come_back_too():
    survey = Survey(2, EVERY_WAY, clock=0.4, wrong=(1.0, -2.0, 1.5), pixel_sd=0.2)
    asked = (*BORESIGHT, "clock", "north", "east", "down")
    found = calibrate(survey.poses_at(), survey.uv, survey.known, survey.image, asked)
    assert not found.undetermined
    assert abs(found.value("clock") - 0.4) < 0.01
    assert np.allclose([found.value(k) for k in ("north", "east", "down")], [-1.0, 2.0, -1.5], atol=0.1)


def noisy_log(survey, seed, position_sd, attitude_sd, every=0.1):
    """Poses out of a log whose samples have noise of their own, the images in step with the samples."""
    nodes = np.arange(-30, 31)
    sd = np.repeat([position_sd, attitude_sd], 3)
    noise = np.random.default_rng([7, seed]).normal(0, sd, (survey.image[-1] + 1, len(nodes), 6))[
        survey.image
    ]

    def at(offset):
        low = int(np.clip(np.floor(offset / every), -30, 29))
        share = offset / every - low
        between = (1 - share) * noise[:, low + 30] + share * noise[:, low + 31]
        p, R = survey.truth(offset)
        turned = R @ rotation_vector_to_matrix(between[:, 3:])
        return CameraPoses(TAU2, PLAIN, p + survey.wrong + between[:, :3], turned)

    return at


@pytest.mark.slow
def test_noise_of_a_fast_log_does_not_hold_the_clock():
    """Between two samples the slope is noise, and half way the noise is least: a well at each of them."""
    far_off, clocks = [], []
    for seed, clock in enumerate([0.34, -0.55, 0.1] * 4):
        survey = Survey(seed, EVERY_WAY, clock=clock, pixel_sd=1.5)
        log = noisy_log(survey, seed, position_sd=0.5, attitude_sd=0.005)
        found = calibrate(log, survey.uv, survey.known, survey.image, (*BORESIGHT, "clock"))
        off = found.values - [*TRUE.misalignment, clock]
        far_off.append(off / np.sqrt(np.diag(found.covariance)))
        clocks.append(off[-1])
    # Held by the wells, it would be off by tenths of a second, and by ten stated standard deviations.
    assert np.sqrt(np.mean(np.square(clocks))) < 0.05
    assert (np.sqrt(np.mean(np.square(far_off), axis=0)) < 3.0).all()


def test_flying_one_way_cannot_tell_clock_or_position_from_the_angles():
    """Straight and level at one height: tilt, clock and the position along the course look the same."""
    survey = Survey(3, [0.0], pixel_sd=2.0, plain=True)
    asked = (*BORESIGHT, "clock", "north", "east")
    found = calibrate(survey.poses_at(), survey.uv, survey.known, survey.image, asked)
    assert found.names == BORESIGHT
    assert "tilt" in found.undetermined["clock"]
    assert {"tilt", "clock"} & set(found.undetermined["north"])
    assert "roll" in found.undetermined["east"]
    assert np.isnan(found.sd("clock"))
    assert found.value("clock") == 0.0


def test_the_stated_standard_deviation_is_the_scatter_over_flights():
    """Each image has an attitude error of its own, shared by its points."""
    estimates, stated = [], []
    for seed in range(25):
        survey = Survey(seed, EVERY_WAY, attitude_sd=0.01, pixel_sd=1.0)
        found = calibrate(survey.poses_at(), survey.uv, survey.known, survey.image)
        estimates.append(found.values)
        stated.append([found.sd(name) for name in found.names])
    ratio = np.mean(stated, axis=0) / np.std(estimates, axis=0, ddof=1)
    # The scatter of 25 flights is known to 1 / sqrt(2 * 24), 14 %.
    assert (ratio > 0.7).all() and (ratio < 1.4).all(), ratio


def test_one_wrong_click_does_not_decide():
    survey = Survey(5, EVERY_WAY, pixel_sd=0.5)
    survey.known[7, :2] += 60.0
    found = calibrate(survey.poses_at(), survey.uv, survey.known, survey.image)
    assert np.allclose(apply_calibration(found, PLAIN).misalignment, TRUE.misalignment, atol=np.radians(0.1))


def test_draws_that_wander_together_make_an_estimate_less_sure():
    """The mean of errors that last for some draws: it is as far off as its standard deviation says."""
    rng, error, sd = np.random.default_rng(5), [], []
    draw = np.repeat(np.arange(20), 6)
    for _ in range(150):
        wander = np.zeros(20)
        for k in range(20):
            wander[k] = 0.6 * (wander[k - 1] if k else rng.normal() / 0.8) + rng.normal()
        r = np.stack([wander[draw] + 0.3 * rng.normal(size=len(draw)), rng.normal(size=len(draw))], axis=1)
        J = np.zeros((len(draw), 2, 1))
        J[:, 0, 0] = -1.0
        fit = Fit(("roll",), np.array([r[:, 0].mean()]), {}, np.ones(len(draw), bool), J, r - r[:, :1].mean())
        error.append(fit.values[0])
        sd.append(with_covariance(fit, draw, draw).sd("roll"))
    # 2.0 without what neighbours have in common.
    assert 0.75 < np.sqrt(np.mean(np.square(error)) / np.mean(np.square(sd))) < 1.3


@pytest.mark.parametrize("looks", ["down", "forward"])
def test_derivatives_are_those_of_georeferencing(looks):
    """Against central differences, about a large correction of a lens that distorts."""
    survey = Survey(7, EVERY_WAY)
    mount = Mount(looks, pan=0.2, tilt=-1.2 if looks == "forward" else 0.1, misalignment=(0.1, 0.2, -0.1))
    mount = replace(mount, lever_arm=(0.5, -0.3, 0.2))
    camera = replace(TAU2, distortion=(-0.2, 0.05, 0.001, -0.002, 0.01), skew=3.0)

    def poses_at(offset):
        return replace(survey.poses_at(mount)(offset), camera=camera)

    names = tuple(PARAMETERS)
    sizes = np.random.default_rng(5).uniform(-1, 1, len(names))
    uv = np.random.default_rng(6).uniform([100, 100], [540, 412], survey.uv.shape)

    def ground(sizes):
        return georeference_calibrated(Calibration.in_sizes(names, sizes), poses_at, uv, 0.0)[:, :2]

    J = calibration_jacobian(Calibration.in_sizes(names, sizes), poses_at, uv, 0.0)
    seen = np.isfinite(J).all(axis=(1, 2))
    assert seen.sum() > 60
    for i, (name, size) in enumerate(PARAMETERS.items()):
        step = np.eye(len(names))[i] * (CLOCK_STEP / size if name == "clock" else 1e-6)
        slope = (ground(sizes + step) - ground(sizes - step)) / (2 * step[i] * size)
        assert np.allclose(J[seen, :, i], slope[seen], rtol=1e-6, atol=1e-6 * np.abs(slope[seen]).max()), name
