"""Twins whose chosen parameters are moved."""

from __future__ import annotations

import pytest

from wildlab.errors import WildlabError
from wildlab.simulation import load_twin, simulate_twin
from wildlab.simulation.parameters import each_parameter, twin_names
from wildlab.simulation.variation import TOLD, apply, groups_of, varied


def parameters(twin):
    return {f"{part}.{name}": parameter for part, name, parameter in each_parameter(twin)}


@pytest.mark.parametrize("name", twin_names())
def test_what_is_published_or_told_is_in_no_group(name):
    twin = load_twin(name)
    there, groups = parameters(twin), groups_of(twin)
    assert groups
    moved = [path for paths in groups.values() for path in paths]
    assert len(moved) == len(set(moved))
    for path in moved:
        assert there[path].status != "published" and path.partition(".")[0] not in TOLD
        assert there[path].number != 0


@pytest.mark.parametrize("name", twin_names())
def test_each_group_is_moved_and_nothing_else(name):
    twin = load_twin(name)
    for paths in groups_of(twin).values():
        try:
            moved = parameters(apply(twin, dict.fromkeys(paths, 1.25)))
        except WildlabError as error:
            assert "not possible" in str(error)
            continue
        for path, before in parameters(twin).items():
            if path in paths:
                assert moved[path].number == pytest.approx(1.25 * before.number)
            else:
                assert moved[path] == before


def test_within_it_every_twin_that_is_loaded_is_moved():
    before = load_twin("fast-vessel").boresight.roll_sd.number
    with varied({"boresight.roll_sd": 0.5}):
        assert load_twin("fast-vessel").boresight.roll_sd.number == before / 2
        with varied({}):
            assert load_twin("fast-vessel").boresight.roll_sd.number == before
    assert load_twin("fast-vessel").boresight.roll_sd.number == before
    with pytest.raises(ZeroDivisionError), varied({"boresight.roll_sd": 0.5}):
        raise ZeroDivisionError
    assert load_twin("fast-vessel").boresight.roll_sd.number == before


def test_a_flight_is_flown_with_what_was_moved():
    paths = groups_of(load_twin("fast-vessel"))["target, gps: errors"]
    plain = simulate_twin("fast-vessel", 1, ("imu", "gnss"))
    with varied(dict.fromkeys(paths, 2.0)):
        moved = simulate_twin("fast-vessel", 1, ("imu", "gnss"))
    assert plain.nav["truth"].equals(moved.nav["truth"])
    assert not plain.table("truth").equals(moved.table("truth"))


def test_what_may_not_be_moved_is_refused():
    twin = load_twin("fast-vessel")
    published = next(path for path, one in parameters(twin).items() if one.status == "published")
    with pytest.raises(WildlabError, match="published"):
        apply(twin, {published: 2.0})
    assert apply(twin, {"no.such": 2.0}) == twin
    with pytest.raises(WildlabError, match="not possible"):
        apply(twin, {"boresight.shortest_period": 1e6})
