"""Joint association of two that cross: swaps, and shared errors of the pose."""

from types import SimpleNamespace

import pytest

from tests.studies.test_crossing_vessels import INTERVAL, passing
from wildlab.studies.crossing_vessels.trial import (
    BOATS,
    EVERY,
    JOINT,
    density_of,
    joint_numbers,
    joint_of,
    joint_swapped,
)


@pytest.mark.slow
def test_joint_association_of_two_far_apart_is_two_tracks():
    crossing = passing(closest=400, noise=5)
    numbers = joint_numbers(crossing)
    assert len(joint_of(crossing, density_of(INTERVAL)).tracks) == 2
    assert numbers[JOINT, "swaps"] == numbers[JOINT, "swapped"] == 0
    assert numbers[JOINT, "gospa"] < 10


def test_the_density_spreads_velocities_as_the_tuning_does():
    # An acceleration of 0.2 m/s^2 held over each of two images a second, for 50 s.
    assert density_of(0.5) ** 2 * 50 == pytest.approx(100 * (0.2 * 0.5) ** 2)


@pytest.mark.parametrize(
    ("after", "end", "expected"),
    [((1, 2), (1, 2), (False, False)), ((2, 1), (2, 1), (True, True)), ((2, 1), (1, 2), (True, False)),
     ((2, 2), (2, 2), (False, False)), ((None, 1), (None, 1), (False, False))],
)  # fmt: skip
def test_shared_tracks_are_swapped_where_each_has_the_others(after, end, expected):
    crossing = passing(images=1200)
    times = crossing.times[::EVERY]
    told = []
    for time in times:
        pair = (1, 2) if time < 300 else after if time < 460 else end
        told.append({boat: name for boat, name in zip(BOATS, pair, strict=True) if name is not None})
    assert joint_swapped(crossing, SimpleNamespace(followed=told)) == expected
