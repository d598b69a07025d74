"""The study of the wildlife camera: the inverse, which video it is, and a calibration."""

import numpy as np
import pytest

from wildlab.studies import wildlife_camera

CAMERA = wildlife_camera.printed_camera(720, 480)


def test_the_inverse_is_exact_in_the_middle_and_misses_by_the_third_order_outside():
    found = wildlife_camera.inverse_error(CAMERA)
    near = np.hypot(found.u - wildlife_camera.CX, found.v - wildlife_camera.CY) < 20
    assert found.error[near].max() < 1e-4
    x, y = (719 - wildlife_camera.CX) / wildlife_camera.FX, (479 - wildlife_camera.CY) / wildlife_camera.FY
    r2 = x * x + y * y
    # To second order in k1 r^2 the inverse series has 3 k1^2 r^4, the fraction of (2.19) has 2.
    about = wildlife_camera.K1**2 * r2**2 * np.hypot(x * wildlife_camera.FX, y * wildlife_camera.FY)
    assert found.error[-1, -1] == pytest.approx(about, rel=0.4)


def test_the_video_is_told_by_the_ratio_of_focal_lengths():
    best = wildlife_camera.read_videos()[0]
    assert (best.width, best.height) == (720, 480) and best.off < 1


def test_the_camera_comes_back():
    rng = np.random.default_rng(1)
    back = wildlife_camera.come_back(rng, CAMERA, 0.1, 3, images=10)
    assert len(back) == 3
    back = back.mean()
    assert back["fx"] == pytest.approx(wildlife_camera.FX, rel=0.005) and back["k1"] == pytest.approx(
        wildlife_camera.K1, abs=0.1
    )
