"""The study of the wildlife camera: the inverse, which video it is, and what was assumed zero."""

import numpy as np
import pytest

from wildlab.studies.wildlife_camera import lens

CAMERA = lens.printed_camera(720, 480)


def test_the_inverse_is_exact_in_the_middle_and_misses_by_the_third_order_outside():
    found = lens.inverse_error(CAMERA)
    near = np.hypot(found.u - lens.CX, found.v - lens.CY) < 20
    assert found.error[near].max() < 1e-4
    x, y = (719 - lens.CX) / lens.FX, (479 - lens.CY) / lens.FY
    r2 = x * x + y * y
    # To second order in k1 r^2 the inverse series has 3 k1^2 r^4, the fraction of (2.19) has 2.
    about = lens.K1**2 * r2**2 * np.hypot(x * lens.FX, y * lens.FY)
    assert found.error[-1, -1] == pytest.approx(about, rel=0.4)


def test_the_video_is_told_by_the_ratio_of_focal_lengths():
    best = lens.read_videos()[0]
    assert (best.width, best.height) == (720, 480) and best.off < 1
    square = lens.read_videos(1117.6, 1117.6, 320.0, 256.0)[0]
    assert square.width == 640


def test_the_camera_comes_back_and_what_is_zero_is_found_zero():
    rng = np.random.default_rng(1)
    back = lens.come_back(rng, CAMERA, 0.1, 3, images=10)
    assert len(back) == 3
    back = back.mean()
    assert back["fx"] == pytest.approx(lens.FX, rel=0.005) and back["k1"] == pytest.approx(lens.K1, abs=0.1)
    straight = lens.compare_models(rng, CAMERA, 0.1, 3, images=10)
    bent = lens.compare_models(rng, lens.bent_camera(CAMERA), 0.1, 3, images=10)
    assert bent["few"].median() > 2 * bent["all"].median()
    assert bent["few"].median() > 2 * straight["few"].median()
    assert straight["inside_skew"].mean() > 0.5
