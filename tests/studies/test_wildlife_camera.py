"""The study of the wildlife camera: the inverse, which video it is, what was assumed zero, and its words."""

import numpy as np
import pandas as pd
import pytest

from wildlab.studies.wildlife_camera import lens, text
from wildlab.studies.wildlife_camera.lens import Video

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


def test_rounds_of_a_fixed_point_grow_with_what_is_asked():
    assert lens.rounds_needed(CAMERA, 1.0) < lens.rounds_needed(CAMERA, 1e-4)


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


def test_words_on_the_inverse_turn():
    assert "nobody will see it" in text.inverse_words(np.full(9, 0.1), 60.0, 1117.0)
    assert "only the rim" in text.inverse_words(np.r_[np.zeros(9), 2.0], 60.0, 1117.0)
    assert "shows all over" in text.inverse_words(np.full(9, 2.0), 60.0, 1117.0)
    assert text.title(np.r_[np.zeros(99), 2.0]).endswith(", 2 px at worst")


def test_words_on_the_video_turn():
    clear = [Video("a", 720, 480, 1257, 1117, 0.5, 20), Video("b", 640, 512, 1117, 1117, 9.0, 40)]
    assert "video of a, which they fit to 0.5 %" in text.video_words(clear, 1267, 1117)
    vague = [clear[0]._replace(off=3.0), clear[1]]
    assert "no usual video" in text.video_words(vague, 1267, 1117)
    close = [clear[0], clear[1]._replace(off=0.7)]
    assert "no usual video" in text.video_words(close, 1267, 1117)
    assert "+13.4 %" in text.sheet_words(1267, 1117, lens.DATA_SHEET)


def test_words_on_what_was_assumed_turn():
    def frame(few, whole):
        return pd.DataFrame({"few": [few] * 3, "all": [whole] * 3, "sd_skew": [0.5] * 3, "sd_k2": [0.1] * 3})

    said = text.assumed_words(frame(0.3, 0.6), frame(2.0, 0.6))
    assert "keeps directions to 0.30 pixels instead of 0.60" in said and "costs 2.0 pixels" in said
    said = text.assumed_words(frame(0.5, 0.5), frame(0.5, 0.5))
    assert "hardly matters" in said and "costs nothing" in said
    assert "skew 1 px, k2 0.2." in text.told_words(frame(1, 1), ["skew", "k2"], 20)
