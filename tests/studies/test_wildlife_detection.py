"""What the study of warm animals computes."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.animal_pictures import CAMERA
from tests.studies.claims import checks_of, said
from wildlab.detection.warm import Warm
from wildlab.reporting.published import load_claims
from wildlab.simulation.scene.flights import CameraResponse, sensor_of
from wildlab.studies import wildlife_detection
from wildlab.studies.wildlife_detection import (
    CLOUDY,
    CONSTANT,
    COUNTS,
    ENHANCED,
    LARGE,
    METHODS,
    NIGHT,
    NOON,
    OVER_MEAN,
    PROPOSED,
    SMALL,
    SUBTRACTED,
    Operator,
)


@pytest.fixture(scope="module")
def numbers():
    """Of one seed, by a small camera."""
    response = CameraResponse()
    sensor = sensor_of(response, (120, 180), np.random.default_rng(1))
    operator = Operator(CAMERA, response, sensor, np.random.default_rng(2))
    return wildlife_detection.numbers_of(operator, wildlife_detection.take_pictures(operator, 4))


def test_a_seed_has_all_numbers(numbers):
    spread = pd.DataFrame([numbers] * 3)
    decided = {claim["id"] for claim in load_claims("wildlife-detection") if "needs" not in claim}
    assert decided == set(checks_of("wildlife-detection", spread))
    for subject in (*METHODS, *PROPOSED):
        at = wildlife_detection.places(CLOUDY)
        assert wildlife_detection.counts_of(spread, subject, at).shape == (9, 3)
    assert not wildlife_detection.counts_of(spread, SMALL, ["never"]).size


def test_the_sun_makes_ground_as_warm_as_animals(numbers):
    at = {
        weather: [numbers["ground", f"as_warm_{one}"] for one in wildlife_detection.places(weather)]
        for weather in (NIGHT, NOON)
    }
    assert np.nanmean(at[NIGHT]) < 0.1 < np.nanmean(at[NOON])
    assert numbers["herd", "mean_rise"] > 0
    assert numbers["ground", "level_after"] > numbers["ground", "level_before"]


def spread_of(numbers, **changes):
    """Twelve seeds alike; everything found and nothing invented, but for what is changed (``__`` for /)."""
    plain = dict(numbers)
    for (subject, name), value in plain.items():
        kind = name.split("_")[0]
        if kind in COUNTS:
            plain[subject, name] = {"found": 4.0, "invented": 0.0, "missed": 0.0}[kind]
        elif kind == "as" or name.startswith("pieces"):
            plain[subject, name] = {"as": 0.0}.get(kind, 1.0)
        else:
            plain[subject, name] = value
    plain["ground", "level_before"], plain["ground", "level_after"] = 60.0, 100.0
    plain["herd", "mean_rise"], plain["herd", "median_rise"] = 20.0, 2.0
    for key, value in changes.items():
        subject, name = key.split("__")
        for one in plain:
            if one[0] == subject.replace("_", "-") and one[1].startswith(name):
                plain[one] = value
    return pd.DataFrame([plain] * 12)


def test_claims_turn(numbers):

    def true(spread):
        found = said("wildlife-detection", checks_of("wildlife-detection", spread))
        return {key: all(flights) for key, flights in found.items()}

    good = true(spread_of(numbers))
    assert not good["constant-fails"] and good["adaptive-copes"]
    assert not good["small-block-splits"] and good["large-block-whole"]
    assert not good["combinations-best"] and good["subtraction-and-constant-good"]
    assert good["herd-biases-mean"] and good["median-rises-less"] and not good["median-finds-more"]
    assert not good["sun-breaks"] and good["night-keeps"]
    assert not good["too-hot"] and not good["size-from-ground"] and not good["block-from-distance"]
    assert not good["enhancement-misses"]
    bad = true(
        spread_of(
            numbers, constant__invented=5.0, adaptive_offset__invented=5.0, constant__invented_before=0.0,
            adaptive_offset__invented_before=0.0, adaptive_51__pieces=2.0, adaptive_251__pieces=2.0,
            mean_constant__found=0.0, mean_constant__missed=4.0, herd__mean=1.0, herd__median=3.0,
            ground__as_warm=4.0, subtracted__invented=3.0, enhanced__missed=2.0, enhanced__background=9.0,
        )
    )  # fmt: skip
    assert bad["constant-fails"] and not bad["adaptive-copes"]
    assert bad["small-block-splits"] and not bad["large-block-whole"]
    assert bad["enhancement-misses"] and bad["enhancement-takes-background"]
    assert not bad["subtraction-and-constant-good"] and not bad["herd-biases-mean"]
    assert not bad["median-rises-less"] and bad["median-finds-more"]
    assert bad["sun-breaks"] and not bad["night-keeps"]
    assert bad["too-hot"] and bad["size-from-ground"] and bad["block-from-distance"]
    clear = true(spread_of(numbers, constant__invented=9.0, adaptive_offset__invented=9.0))
    assert clear["combinations-best"]


def check_of(claim, spread):
    return np.array(said("wildlife-detection", checks_of("wildlife-detection", spread))[claim])


@pytest.mark.parametrize(("claim", "subject"), [("too-hot", "not_hot"), ("size-from-ground", "sized")])
def test_a_filter_has_to_be_worth_what_it_costs(numbers, claim, subject):
    gain = {"subtracted__invented": 3.0}
    assert check_of(claim, spread_of(numbers, **gain)).all()
    # Fewer false alarms, and as many animals lost: 8 / 11 becomes 8 / 12.
    loss = gain | {f"{subject}__missed": 4.0}
    assert not check_of(claim, spread_of(numbers, **loss)).any()
    assert not check_of(claim, spread_of(numbers, **gain, **{f"{subject}__invented": 3.0})).any()


def test_the_threshold_is_higher_than_needed_where_that_without_the_herd_finds_more(numbers):
    claim = "threshold-higher-than-needed"
    assert not check_of(claim, spread_of(numbers)).any()
    assert check_of(claim, spread_of(numbers, mean_constant__missed_herd=4.0)).all()
    # The rise alone does not make it so.
    assert check_of("herd-biases-mean", spread_of(numbers)).all()


def test_a_fall_is_a_part_of_what_was(numbers):
    # From 0.2 to zero is by all of it, and by no more than the threshold of 0.2.
    low = {"adaptive_offset__found": 1.0, "adaptive_offset__missed": 8.0}
    gone = spread_of(numbers, **low, adaptive_offset__found_after=0.0)
    assert not check_of("adaptive-copes", gone).any()
    assert check_of("adaptive-copes", spread_of(numbers, **low)).all()


def test_a_premise_that_is_not_met_decides_nothing(numbers):
    still = spread_of(numbers, ground__level_after=62.0)
    assert not checks_of("wildlife-detection", still)["constant-fails"].premise.any()
    none = spread_of(numbers, adaptive_51__pieces=np.nan)
    assert not checks_of("wildlife-detection", none)["small-block-splits"].premise.any()


def test_printed_settings_are_the_theses():
    assert (METHODS[CONSTANT].level, METHODS[OVER_MEAN].block_px, METHODS[OVER_MEAN].level) == (150, 451, 150)
    assert (METHODS[SMALL].block_px, METHODS[LARGE].block_px) == (51, 251)
    assert (METHODS[SUBTRACTED].background, METHODS[SUBTRACTED].block_px, METHODS[SUBTRACTED].level) == (
        "mean", 251, 65,
    )  # fmt: skip
    assert (METHODS[ENHANCED].background, METHODS[ENHANCED].block_px, METHODS[ENHANCED].level) == (
        "enhance", 251, 160,
    )  # fmt: skip
    assert all(
        isinstance(one, Warm) and one.smallest_px == wildlife_detection.SMALLEST for one in METHODS.values()
    )
