"""The study of camera and mount: what it computes, and words that turn with their numbers."""

import numpy as np
import pandas as pd
import pytest

from wildlab.geometry.camera import Camera
from wildlab.studies.camera_calibration import mounting, text
from wildlab.studies.camera_calibration.intrinsics import (
    TAU2,
    calibrations,
    ground_shift,
    measure_centres,
    neglected_distortion,
    theoretical,
)
from wildlab.studies.camera_calibration.mounting import Cause


def found(fx_sd=0.3, fy_sd=0.3):
    rng = np.random.default_rng(1)
    return pd.DataFrame({
        "fx": 1159.2 + rng.normal(0, fx_sd, 50), "fy": 1167.8 + rng.normal(0, fy_sd, 50),
        "cx": 313 + rng.normal(0, fx_sd, 50), "cy": 265 + rng.normal(0, fy_sd, 50),
    })  # fmt: skip


def test_the_data_sheet_is_that_of_the_print_but_for_its_last_digit():
    sheet = theoretical()
    assert sheet.fx == pytest.approx(1117.7, abs=0.06) and sheet.fy == pytest.approx(sheet.fx)
    assert (sheet.cx, sheet.cy) == (320, 256)
    assert ground_shift(TAU2, TAU2, (0.0, 0.0)) == 0
    moved = Camera(640, 512, 1000.0, 1000.0, 330.0, 256.0)
    assert ground_shift(Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0), moved, (100.0, 100.0), 100.0) == (
        pytest.approx(1.0)
    )


def test_centres_of_rendered_circles_are_found():
    centres = measure_centres(np.random.default_rng(1), 1)
    assert centres.found == 1 and centres.sd < 0.2 and centres.uv.shape == (49, 2)


def test_calibrations_spread_as_they_state():
    few = calibrations(np.random.default_rng(2), 6, 0.1, images=10)
    assert few["fx"].std() < 4 * few["sd_fx"].mean() and few["sd_fx"].mean() < 4 * few["fx"].std()
    assert abs(few["second_cy"].mean() - TAU2.cy) < 2


def test_the_more_a_lens_bends_the_more_neglecting_it_costs():
    weak, strong = (neglected_distortion(np.random.default_rng(3), k1, images=8) for k1 in (0.01, 0.1))
    assert strong[0] > 5 * weak[0] and strong[1] > 3 * weak[1]


def test_the_room_without_errors_gives_the_printed_angles():
    one, angle = mounting.calibrate_once(np.random.default_rng(4), "clicks", 0.0)
    assert angle < 1e-8
    np.testing.assert_allclose(np.degrees(mounting.printed_angles(one)), mounting.PRINTED_DEG, atol=1e-6)


@pytest.mark.parametrize("cause", mounting.CAUSES)
def test_each_cause_is_sized_to_leave_what_is_printed(cause):
    one = mounting.explain(np.random.default_rng(5), cause, 4)
    assert one.left == pytest.approx(mounting.PRINTED_ERROR, rel=0.5)
    assert one.ground == pytest.approx(350 * np.tan(one.angle))


def test_the_printed_error_at_the_height_of_the_flight():
    found = mounting.error_from_height()
    assert found.estimate == pytest.approx(6.68, abs=0.005)
    # The corners of what 0.0229 m and 1.2 m are rounded from, to first order.
    assert found.low == pytest.approx(0.02285 * 350 / 1.25, abs=0.02)
    assert found.high == pytest.approx(0.02295 * 350 / 1.15, abs=0.02)


def test_aspect_and_offset_turn():
    apart, sd = text.aspect(found(), TAU2)
    assert apart == pytest.approx(8.6) and 0.2 < sd < 0.7
    said = text.aspect_words(8.6, 0.43, 0.05)
    assert "20 times what chance gives here: circles would have to be 0.5 pixels off" in said
    assert "which chance may give" in text.aspect_words(8.6, 5.0, 0.05)
    said = text.offset_words(TAU2, theoretical(), found(), 3.4, 6.3)
    assert "7 and 9 pixels" in said and "times what chance" in said and "3.7 and 4.5 % longer" in said
    assert "no more than chance may give" in text.offset_words(TAU2, theoretical(), found(9, 9), 3.4, 6.3)
    assert "to 0.3 pixels in 1159" in text.focal_words(found(), 30, 0.04)


def test_distortion_turns():
    assert "k1 of 0.1 either way may be" in text.distortion_words({0.1: (0.1, 0.4), -0.3: (1.0, 9.0)})
    both = {-0.1: (0.1, 0.4), 0.1: (0.1, 1.4), 0.01: (0.0, 0.1)}
    assert "k1 of 0.01 either way may be" in text.distortion_words(both)
    assert text.distortion_words({0.1: (0.1, 4.0), -0.3: (1.0, 9.0)}).startswith("Even k1 = 0.1 moves")


def cause(name, ground, unit="deg", size=0.8):
    return Cause(name, unit, size, 0.0229, 0.0, ground / 350, ground)


def test_the_meaning_of_what_is_left_turns():
    def said(*grounds):
        return text.mounting_words([cause("attitude", one) for one in grounds], 0.0229, 6.6)

    assert "less than the 6.6 metres" in said(2.0, 4.0)
    assert "more than the 6.6 metres" in said(7.0, 9.0)
    assert "about the 6.6 metres" in said(4.0, 6.5)
    # What is constant does not count among what images average.
    both = [cause("attitude", 4.0), cause("lens offset", 45.0, "m")]
    assert "4.0 to 4.0" in text.mounting_words(both, 0.0229, 6.6)
    assert text.title(both, 6.6) == "4.0 m or less in flight, 6.6 m in print"
    assert text.cause_words([cause("clicks", 1, "px", 18.2), cause("position", 1, "m", 0.02)]) == (
        "To leave as much as the thesis prints takes 18 px of clicks, or 20 mm of position."
    )


def test_a_trap_is_one_only_where_it_does_not_show():
    assert "passes for a wrong angle" in text.offset_trap_words(0.01, 0.001, 0.4, 2.5, 0.0229)
    assert "passes for" not in text.offset_trap_words(0.01, 0.02, 0.4, 2.5, 0.0229)
    assert "in 40 % of" in text.second_set_words(0.4, 3.0)
