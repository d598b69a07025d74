"""Polygons: what is refused, and what lies inside."""

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.planning.patterns import (
    check_area,
    contains,
    rectangle,
)

SQUARE = [[0.0, 0.0], [0.0, 10.0], [10.0, 10.0], [10.0, 0.0]]


@pytest.mark.parametrize(
    ("corners", "problem"),
    [
        ([[0, 0], [1, 1]], "2 different"),
        ([[0, 0], [10, 0], [20, 0]], "0 m2"),
        ([[0, 0], [np.nan, 10], [10, 10]], "corner 2"),
        ([[0, 0, 0], [1, 1, 1], [2, 0, 0]], "shape"),
    ],
)
def test_what_is_no_area_is_refused_by_name(corners, problem):
    with pytest.raises(WildlabError, match="field") as caught:
        check_area(corners, "field")
    assert problem in caught.value.problem


def test_either_sense_and_a_closed_ring_give_the_same_area():
    one, other = check_area(SQUARE), check_area([*SQUARE[::-1], SQUARE[-1]])
    assert {tuple(p) for p in one} == {tuple(p) for p in other}
    for fence in (one, other):
        p, q = fence - fence[0], np.roll(fence - fence[0], -1, axis=0)
        assert (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() > 0


def test_what_lies_inside_is_what_winds_round():
    """Against the winding number, whose sum of angles is another way to count."""
    rng = np.random.default_rng(2)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
    star = rng.uniform(20, 60, (9, 1)) * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    points = rng.uniform(-70, 70, (500, 2))
    to = star[None] - points[:, None]
    bearing = np.arctan2(to[..., 1], to[..., 0])
    turned = np.angle(np.exp(1j * (np.roll(bearing, -1, axis=1) - bearing))).sum(axis=1)
    assert (contains(star, points) == (np.abs(turned) > np.pi)).all()
    assert not contains(star, [[np.nan, 0.0]]).any()


def test_a_rectangle_has_its_sides_and_its_course():
    corners = rectangle(3.0, 4.0, 20.0, 10.0, 0.3)
    assert np.allclose(corners.mean(axis=0), [3.0, 4.0])
    along = np.array([np.cos(0.3), np.sin(0.3)])
    assert np.ptp(corners @ along) == pytest.approx(20.0)
