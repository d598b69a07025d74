"""What the navigation filters refuse: each error names the field, the row and what was found."""

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.geometry.frames import flat_earth
from wildlab.navigation.aiding import positions
from wildlab.navigation.mekf import InitialState, run_mekf
from wildlab.navigation.observer import run_observer
from wildlab.navigation.strapdown import STIM300, ImuSamples

T = np.arange(0, 1, 0.01)
IMU = ImuSamples(T, np.tile([0, 0, -9.81], (len(T), 1)), np.zeros((len(T), 3)))
LEVEL = np.concatenate([np.zeros(6), [1.0, 0, 0, 0], np.zeros(6)])
START = InitialState(0.0, LEVEL, 0.01 * np.eye(15))
AIDING = [positions([0.5], np.zeros((1, 3)), 1.0)]


def by_mekf(start=START, **options):
    return run_mekf(IMU, start, STIM300, flat_earth(), AIDING, [0.9], **options)


def by_observer(start=START):
    return run_observer(IMU, start, (1.0, 0.2, 0.0), AIDING, [0.9])


@pytest.mark.parametrize("wrong", [0.0, 1e-4 - 1, 2.0, np.nan])
def test_a_gate_is_a_probability(wrong):
    with pytest.raises(WildlabError, match=f"^gate_probability: .*{wrong}"):
        by_mekf(gate_probability=wrong)


def test_the_filter_refuses_what_only_the_observer_takes():
    """Its kernel looks limits up by the kind of a measurement, and would read beyond them."""
    foreign = AIDING[0]._replace(kind=3)
    with pytest.raises(WildlabError, match=r"^aiding\[1\]: .*observer"):
        run_mekf(IMU, START, STIM300, flat_earth(), [AIDING[0], foreign], [0.9])


def spoilt(array, at, value):
    wrong = array.copy()
    wrong[at] = value
    return wrong


@pytest.mark.parametrize("run", [by_mekf, by_observer])
@pytest.mark.parametrize(
    ("start", "message"),
    [
        (START._replace(state=spoilt(LEVEL, 4, np.nan)), r"^start\.state: row 4"),
        (START._replace(covariance=spoilt(np.eye(15), (0, 7), 0.5)), r"^start\.covariance"),
        (START._replace(time=np.nan), "^start: .*nan s"),
    ],
)
def test_an_initial_state_is_finite_and_has_a_covariance(run, start, message):
    with pytest.raises(WildlabError, match=message):
        run(start)


def test_a_wider_gate_lets_more_in():
    """The probability is that of a measurement's being let in, not of its being left out."""
    off = [positions([0.5], np.full((1, 3), 0.28), 0.1)]
    strict, generous = (
        run_mekf(IMU, START, STIM300, flat_earth(), off, [0.9], gate_probability=p).innovations.verdict
        for p in (0.1, 0.9999)
    )
    assert strict.tolist() == [0]
    assert generous.tolist() == [1]
