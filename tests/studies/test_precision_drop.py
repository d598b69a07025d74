"""What the study of the precision drop computes."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, turn
from wildlab.detection.colour import Colour
from wildlab.evaluation.shares import decide
from wildlab.geometry.camera import Camera
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.coloured import Ground
from wildlab.simulation.scene.flights import SceneFlight
from wildlab.studies.precision_drop import (
    COUNTS,
    FOUND,
    HORIZON,
    MEAN,
    SINGLE,
    Drop,
    alarms,
    error_of_mean,
    flown,
    horizon_views,
    look_of,
    numbers_of,
    search,
    view_of,
)

CAMERA = Camera(640, 360, 532.0, 532.0, 319.5, 179.5)


@pytest.fixture(scope="module")
def few():
    return flown(1, "precision-drop", 12, 2)


def test_what_is_found_is_the_tarpaulin_and_is_put_beside_the_truth(few):
    drop, errors, numbers = few
    assert len(drop.uv) == len(errors) == 12 and drop.false == 0 and drop.right == drop.should
    assert np.abs(drop.uv - drop.true).max() < 1.0
    # With the autopilot's poses a position is metres off, and with the pixel alone it would be centimetres.
    assert 0.2 < np.hypot(*errors.T).mean() < 15
    assert numbers[MEAN, "error"] == pytest.approx(np.hypot(*errors.mean(axis=0)))
    tens = [np.hypot(*errors[k : k + 10].mean(axis=0)) for k in range(3)]
    assert numbers[MEAN, "after_10"] == pytest.approx(np.median(tens))
    # A mean of one is a single position, and a mean of all is the mean.
    assert numbers[MEAN, "after_1"] == pytest.approx(numbers[SINGLE, "median_error"])
    assert error_of_mean(errors, 12) == pytest.approx(numbers[MEAN, "error"])
    assert np.isnan(numbers[MEAN, "after_75"])


def test_the_printed_limits_find_it_and_others_do_not(few):
    drop = few[0]
    flight = SceneFlight(load_twin("precision-drop"), 1)
    view = view_of(flight, drop.look, int(drop.exposures[0]), 1)
    assert view.share > 0.99
    # Only images with it in the middle rows, for these are few.
    red = search(flight, drop.look, 1, 1, 0, Colour(hue=(170.0, 10.0), border_px=(30.0, 170.0)))
    assert len(red.uv) == 0 and red.right == 0 and red.should > 5


def test_borders_keep_out_a_blue_sky_only_where_it_is_thin():
    look = look_of(1)
    blue = look._replace(ground=replace(look.ground, sky=(10.0, 115.0, 240.0), sky_from=0.01, light=1.0))
    pale = look._replace(ground=Ground(sky=(180.0, 200.0, 250.0)))
    assert alarms(horizon_views(CAMERA, pale, 1, 6)) == (0, 0)
    views = horizon_views(CAMERA, blue, 1, 6)
    kept, every = alarms(views)
    # The middle of a sky that is more than twice 60 px deep lies inside the borders.
    assert every == 6 and kept == sum(view.sky.sum() > 122 * 640 for view in views)


def test_numbers_by_hand():
    one = Drop(
        look_of(1), np.arange(2), np.array([[10.0, 10], [20, 20]]), np.array([[10.0, 13], [20, 16]]),
        np.array([0.5, 0.7]), 5, 4, 2, 1, 3,
    )  # fmt: skip
    found = numbers_of(one, np.array([[3.0, 4], [-3, 2]]), CAMERA, 106.4)
    assert (found[FOUND, "detection_rate"], found[FOUND, "false_alarms_per_image"]) == (0.5, 1 / 8)
    assert (found[FOUND, "pixel_error"], found[FOUND, "off_centre"]) == (3.5, 0.5)
    assert (found[MEAN, "error"], found[MEAN, "after_1"], found[MEAN, "after_2"]) == (
        3.0, pytest.approx((5 + np.sqrt(13)) / 2), 3.0,
    )  # fmt: skip
    assert found[FOUND, "few_pixels"] == pytest.approx(0.6)


def table(**changed):
    """Two flights; ``name=value`` or ``subject_name=value`` changes a number of both."""
    base = {
        (FOUND, "false_alarms_per_image"): 0, (FOUND, "pixel_error"): 0.1, (FOUND, "off_centre"): 0.05,
        (FOUND, "few_pixels"): 0.6, (FOUND, "area_share"): 0.7, (SINGLE, "median_error"): 3.0,
        (MEAN, "error"): 2.0, (HORIZON, "alarms_with_borders"): 0, (HORIZON, "alarms_without_borders"): 0.5,
    }  # fmt: skip
    base |= {(MEAN, f"after_{count}"): 3.0 for count in COUNTS}
    for name, value in changed.items():
        key = next(key for key in base if f"{key[0]}_{key[1]}" == name)
        base[key] = value
    return pd.DataFrame([base, base], dtype=float)


def test_claims_turn_with_the_numbers():
    good, bad = checks_of("precision-drop", table()), checks_of("precision-drop",
        table(
            tarpaulin_false_alarms_per_image=0.1, tarpaulin_off_centre=2, tarpaulin_few_pixels=2,
            mean_error=5, horizon_alarms_with_borders=0.4,
        )
    )  # fmt: skip
    assert turn("precision-drop", good, bad)
    none = checks_of("precision-drop", table(horizon_alarms_without_borders=0))["horizon-near-the-border"]
    assert decide(none.holds(0.1), none.premise).met == 0
