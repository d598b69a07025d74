"""What is named as a cause, and what else a known position and a clock bring into the errors."""

from dataclasses import replace

import numpy as np
import pytest

from tests.reporting.test_georeferencing_cause import diagnosis, model
from wildlab.geometry.calibration import Calibration
from wildlab.pipeline.overviews.worth_fixing import CAUSES, causes_told
from wildlab.reporting import georeferencing_cause as cause


def told(names, values):
    return Calibration(tuple(names), np.array(values), 0.01 * np.eye(len(names)), {}, 40, 20, 10)


BOTH = model(["height", "boresight", "clock"], with_=1.3)
SURE = replace(diagnosis(BOTH), calibration=told(("down", "tilt", "clock"), (0.1, 1.0, -1.0)))


def test_what_is_notnonzero_is_not_blamed():
    assert cause.causes_told(SURE) == ("boresight", "clock")
    said = cause.cause_sentence(SURE)
    blamed, rest = said.split(": ", 1)
    assert "the boresight" in blamed and "camera's clock" in blamed and "height" not in blamed
    assert "fitted with it, the height could not be told from zero" in rest
    every = replace(SURE, calibration=told(("down", "tilt", "clock"), (1.0, 1.0, -1.0)))
    assert "of the height, the boresight" in cause.cause_sentence(every)
    assert "could not be told" not in cause.cause_sentence(every)
    none = replace(SURE, calibration=told(("down", "tilt", "clock"), (0.1, 0.1, -0.1)))
    assert cause.causes_told(none) == none.winner.causes


def test_a_rival_that_holds_all_that_is_named_is_no_other_explanation():
    same, other = (
        model(["position", "boresight", "clock"], with_=1.2),
        model(["position", "clock"], with_=1.3),
    )
    found = diagnosis(BOTH, same, other, rivals=(same,))
    found = replace(found, calibration=SURE.calibration)
    assert "explaining it as well" not in cause.cause_sentence(found)
    found = replace(diagnosis(BOTH, same, other, rivals=(other,)), calibration=SURE.calibration)
    assert "explaining it as well, of the position" in cause.cause_sentence(found)
    assert "which of these it is" in cause.advice(found, True)


@pytest.mark.parametrize("high", [0.5, -0.1])
def test_numbers_alone_name_the_same(high):
    """The overview, the front page and the copies for others read the recorded numbers."""
    numbers = {("down_offset", "calibration"): {"value": -1.1, "low": -2.7, "high": high},
               ("clock_offset", "calibration"): {"value": 1.6, "low": 1.5, "high": 1.7}}  # fmt: skip
    assert causes_told(numbers) == ("height", "camera's clock")[high > 0 :]
    assert set(causes_told(numbers)) <= set(CAUSES)
