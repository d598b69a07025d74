"""The study of camera and mount: what it computes."""

import numpy as np
import pytest

from wildlab.studies import camera_calibration
from wildlab.studies.camera_calibration import (
    calibrations,
    measure_centres,
    theoretical,
)
from wildlab.studies.sensitivity import PRINTED_MISALIGNMENT_DEG, TAU2


def test_the_data_sheet_is_that_of_the_print_but_for_its_last_digit():
    sheet = theoretical()
    assert sheet.fx == pytest.approx(1117.7, abs=0.06) and sheet.fy == pytest.approx(sheet.fx)
    assert (sheet.cx, sheet.cy) == (320, 256)


def test_centres_of_rendered_circles_are_found():
    centres = measure_centres(np.random.default_rng(1), 1)
    assert centres.found == 1 and centres.sd < 0.2 and centres.uv.shape == (49, 2)


def test_calibrations_spread_as_they_state():
    few = calibrations(np.random.default_rng(2), 6, 0.1, images=10)
    assert few["fx"].std() < 4 * few["sd_fx"].mean() and few["sd_fx"].mean() < 4 * few["fx"].std()
    assert abs(few["second_cy"].mean() - TAU2.cy) < 2


def test_the_room_without_errors_gives_the_printed_angles():
    one, angle = camera_calibration.calibrate_once(np.random.default_rng(4), "clicks", 0.0)
    assert angle < 1e-8
    np.testing.assert_allclose(
        np.degrees(camera_calibration.printed_angles(one)), PRINTED_MISALIGNMENT_DEG, atol=1e-6
    )


@pytest.mark.parametrize("cause", camera_calibration.CAUSES)
def test_each_cause_is_sized_to_leave_what_is_printed(cause):
    one = camera_calibration.explain(np.random.default_rng(5), cause, 4)
    assert one.left == pytest.approx(camera_calibration.PRINTED_ERROR, rel=0.5)
    assert one.ground == pytest.approx(350 * np.tan(one.angle))


def test_the_printed_error_at_the_height_of_the_flight():
    found = camera_calibration.error_from_height()
    assert found.estimate == pytest.approx(6.68, abs=0.005)
    # The corners of what 0.0229 m and 1.2 m are rounded from, to first order.
    assert found.low == pytest.approx(0.02285 * 350 / 1.25, abs=0.02)
    assert found.high == pytest.approx(0.02295 * 350 / 1.15, abs=0.02)
