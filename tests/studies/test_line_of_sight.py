"""The study of the line of sight: its trial beside even ground, and claims from opposed numbers."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of
from wildlab.geometry.georeference import Terrain
from wildlab.geometry.viewsheds import field_of_view, in_field_of_view
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import grow_trees, synthetic_landscape
from wildlab.studies.line_of_sight import (
    ANGLES,
    EXACT,
    HEIGHTS,
    INCIDENCES,
    LETTER,
    RAYS,
    TREES,
    VIEW,
    WAYS,
    WHOLE_RAYS,
    camera_of,
    compare,
    furthest_ratio,
    hidden_by_trees,
    look,
    nodes_of,
    time_numbers,
    timed,
    trial,
    width_on_ground,
)

TWIN = "uav-search"


@pytest.fixture(scope="module")
def spread():
    rows = [trial(seed, twin=TWIN, views=1) for seed in (1, 2)]
    return pd.DataFrame(rows, index=[1, 2])


def times_of(rays=1.0, whole=1.0, angles=1.0, view=0.1, lands=3):
    """Times of so many lands, all alike; a tuple is the first and the last height's."""

    def row(value):
        return (
            np.geomspace(*value, len(HEIGHTS)) if isinstance(value, tuple) else np.full(len(HEIGHTS), value)
        )

    given = {RAYS: rays, WHOLE_RAYS: whole, ANGLES: angles, EXACT: 1.0, VIEW: view}
    columns = pd.MultiIndex.from_product([given, HEIGHTS])
    return pd.DataFrame([np.concatenate([row(value) for value in given.values()])] * lands, columns=columns)


def test_every_view_looks_at_the_map_and_holds_what_is_in_its_field_of_view():
    land, camera = synthetic_landscape(4), camera_of(TWIN)
    for k in range(5):
        view = look(land, camera, stream(k, "test"), 60.0, 60.0)
        assert -view.p_nc[2] - land.heights_at(view.p_nc[None, :2])[0] == pytest.approx(60.0)
        assert np.degrees(np.arccos(view.R_nc[2, 2])) == pytest.approx(60.0)
        aim = view.p_nc + 120.0 * view.R_nc[:, 2]
        assert np.isfinite(land.heights_at(aim[None, :2])[0])
        _, points = nodes_of(land)
        inside = in_field_of_view(field_of_view(camera), points, view.p_nc, view.R_nc)
        np.testing.assert_array_equal(points[inside], view.points)
    assert len(view.points) > 100


def test_on_even_ground_all_see_all_but_the_letter():
    flat, camera = Terrain(np.zeros((251, 501), np.float32), -250.0, -500.0, 2.0), camera_of(TWIN)
    views = [look(flat, camera, stream(1, "test"), 40.0, 60.0)]
    found = compare(flat, views)
    assert {found[way, "agreement"] for way in (RAYS, ANGLES)} == {1.0} and found[EXACT, "seen"] == 1.0
    assert found[LETTER, "seen"] == 0.0
    assert found[RAYS, "steps"] < 3 < found[WHOLE_RAYS, "steps"]
    down = look(flat, camera, stream(1, "test"), 40.0, 0.0)
    assert width_on_ground(flat, camera, down) == pytest.approx(80 * field_of_view(camera)[0])


def test_trees_hide_what_stands_below_them_and_more_at_a_slant():
    land = Terrain(np.zeros((251, 501), np.float32), -250.0, -500.0, 2.0)
    none = hidden_by_trees(land, grow_trees(land, 1, share=0.0), stream(1, "test"))
    assert set(none.values()) == {0.0}
    some = hidden_by_trees(land, grow_trees(land, 1, share=0.1), stream(1, "test"))
    assert some[0] == pytest.approx(0.11, abs=0.04)
    assert list(some) == list(INCIDENCES) and some[75] > 1.5 * some[0]
    assert hidden_by_trees(land, grow_trees(land, 1, share=1.0), stream(1, "test"))[0] == 1.0


def test_claims_follow_from_what_was_found(spread):
    checks = checks_of("line-of-sight", spread, time_numbers(times_of()))
    assert checks["letter-hides-everything"].holds().all()
    assert checks["trees-count-with-incidence"].holds().all()
    assert checks["shortening-pays-high-up"].holds().all()
    assert checks["view-grows-linearly"].holds(0.1).all()
    turned = spread.copy()
    turned[TREES, "hidden_30deg"] = 0.0
    turned[LETTER, "seen_20m"] = 0.01
    turned[VIEW, "exponent"] = 2.0
    turned[WHOLE_RAYS, f"steps_{HEIGHTS[-1]}m"] = turned[RAYS, f"steps_{HEIGHTS[-1]}m"]
    for way in (RAYS, ANGLES):
        for height in HEIGHTS:
            turned[way, f"agreement_{height}m"] = 0.8
    checks = checks_of("line-of-sight", turned, time_numbers(times_of()))
    for claim in ("letter-hides-everything", "trees-count-with-incidence", "shortening-pays-high-up"):
        assert not checks[claim].holds().any(), claim
    assert not checks["view-grows-linearly"].holds(0.1).any()
    assert not checks["algorithms-agree"].holds(0.05).any() and checks["algorithms-agree"].holds(0.25).all()


@pytest.mark.parametrize(("rays", "alike"), [(1.4, True), (1.6, False), ((1.0, 0.2), False)])
def test_times_are_alike_where_they_are_at_every_height(spread, rays, alike):
    times = times_of(rays=rays)
    check = checks_of("line-of-sight", spread, time_numbers(times))["run-times-similar"]
    assert check.holds(1.5).all() == alike
    dear = checks_of("line-of-sight", spread, time_numbers(times_of(view=2.0)))["occlusion-costs-more"]
    assert not dear.holds().any() and dear.unit == "µs"


def test_times_are_taken_of_every_way_at_every_height():
    times = timed([3], TWIN)
    assert (times[list(WAYS)].to_numpy() > 0).all() and times.shape == (1, 5 * len(HEIGHTS))
    assert (furthest_ratio(times, RAYS, ANGLES) >= 1).all()
