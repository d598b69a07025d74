"""Wrong input never passes in silence."""

import re

import numpy as np
import pytest

from tests.navigation.flights import GRAVITY, LEVERS, NOISE, attitude, begin, fixes, fly, spoil
from wildlab.geometry.frames import flat_earth, matrix_to_quaternion, quaternion_to_matrix
from wildlab.navigation.mekf import run_mekf, signs_of_trouble
from wildlab.navigation.strapdown import ImuSamples

EARTH = flat_earth(GRAVITY)


@pytest.fixture(scope="module")
def flight():
    return fly(200.0)


def signs(flight, change=lambda imu, aiding: (imu, aiding), seed=0, **options):
    rng = np.random.default_rng(seed)
    imu, biases = spoil(flight, rng)
    start, antennas = begin(flight, biases, rng), fixes(flight, rng, **options)
    imu, aiding = change(imu, antennas)
    wanted = imu.times[(imu.times > 60) & (imu.times < 199)][::10]
    return signs_of_trouble(run_mekf(imu, start, NOISE, EARTH, aiding, wanted), aiding)


@pytest.mark.parametrize("seed", range(3))
def test_a_good_flight_raises_no_doubt(flight, seed):
    assert signs(flight, seed=seed) == []


def without(imu, begin_s, end_s):
    keep = (imu.times < begin_s) | (imu.times > end_s)
    return ImuSamples(*(part[keep] for part in imu))


@pytest.mark.parametrize(
    ("change", "about"),
    [
        (lambda imu, a: (imu._replace(specific_force=imu.specific_force / GRAVITY), a), "lost its way"),
        (lambda imu, a: (imu._replace(angular_rate=imu.angular_rate * [1, -1, -1]), a), "lost its way"),
        (lambda imu, a: (imu._replace(angular_rate=imu.angular_rate[:, [1, 0, 2]]), a), "fit"),
        (lambda imu, a: (imu, [x._replace(times=x.times + 0.5) for x in a]), "lost its way"),
        (lambda imu, a: (imu, [x._replace(variance=x.variance / 16) for x in a]), "miss"),
        (lambda imu, a: (imu, [x._replace(times=x.times + 1.4e9) for x in a]), "clock"),
        (lambda imu, a: (without(imu, 100.0, 102.0), a), r"99\.99 to 102\.01 s"),
    ],
)
def test_each_mistake_shows(flight, change, about):
    found = " ".join(signs(flight, change))
    assert re.search(about, found), found


@pytest.mark.parametrize(("axes", "about"), [([1, -1, -1], "back"), ([-1, -1, 1], "tail")])
def test_sensors_built_in_the_wrong_way_round_show(flight, axes, about):
    """All axes turned alike: everything fits, with a start that is turned as well."""
    rng = np.random.default_rng(0)
    imu, biases = spoil(flight, rng)
    start, (first, _) = begin(flight, biases, rng), fixes(flight, rng)
    turned = ImuSamples(imu.times, imu.specific_force * axes, imu.angular_rate * axes)
    R = quaternion_to_matrix(start.state[6:10]) @ np.diag(axes)
    start.state[6:10] = matrix_to_quaternion(R)
    central = first._replace(value=first.value - attitude(first.times) @ LEVERS[0], lever=0 * first.lever)
    wanted = imu.times[(imu.times > 60) & (imu.times < 199)][::10]
    found = run_mekf(turned, start, NOISE, EARTH, [central], wanted)
    (only,) = signs_of_trouble(found, [central])
    assert about in only


def test_an_outage_shows(flight):
    (sentence,) = signs(flight, outage=(100.0, 160.0))
    assert "100 to 160 s" in sentence
