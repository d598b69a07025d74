"""What the study of planning by information computes."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, turn
from wildlab.analysis.search import rows_at
from wildlab.evaluation.shares import FAILS, HOLDS, decide, decide_check
from wildlab.planning.patterns import contains
from wildlab.studies.information_planning import (
    AHEAD,
    BUDGET_S,
    GREEDY,
    INFORMATION,
    ROWS,
    SEARCHERS,
    STATIONS,
    SURVEY,
    draw_scene,
    draw_situation,
    numbers_of,
    search_all,
)


@pytest.fixture(scope="module")
def one():
    return search_all(2, "uav-search", (INFORMATION, ROWS))


def row(**changed: float) -> dict[tuple[str, str], float]:
    base = {
        (who, name): value
        for who in SEARCHERS
        for name, value in {"half_found": 100.0, "all_found": 300.0, "share_found": 1.0}.items()
    }
    base |= {(who, f"share_{n + 1}"): min(1.0, n / 10) for who in SEARCHERS for n in range(STATIONS)}
    base |= {(who, "tour_time"): 100.0 for who in (GREEDY, AHEAD)}
    base[SURVEY, "lost_by_covariance"] = 0.5
    base |= {(who, "broken_off"): 0.0 for who in (GREEDY, AHEAD)}
    for key, value in changed.items():
        who, _, name = key.partition("__")
        base[who.replace("_", "-"), name] = value
    return base


GOOD = {
    "information__all_found": 200.0, "information__half_found": 60.0, "information_down__all_found": 250.0,
    "greedy__tour_time": 120.0, "greedy__broken_off": 2.0,
}  # fmt: skip
BAD = {
    "information__all_found": 400.0, "information__half_found": 160.0, "information_down__all_found": 350.0,
    "search_and_revisit__lost_by_covariance": 0.0,
}  # fmt: skip


def table(worlds: int = 40, **changed: float) -> pd.DataFrame:
    return pd.DataFrame([row(**changed)] * worlds)


def test_a_world_is_the_twins_kind_and_the_same_for_its_seed():
    scene, again = draw_scene(5, "uav-search"), draw_scene(5, "uav-search")
    assert (scene.world.animals == again.world.animals).all() and (scene.grid == again.grid).all()
    assert scene.flying.height == 60 and scene.flying.speed == 5
    assert scene.sensor.halves[0] == pytest.approx(360 / 1267)
    for number, area in enumerate(scene.world.areas):
        inside = scene.world.animals[:, scene.world.area_of == number, :2]
        low, high = area.min(axis=0) - 1e-6, area.max(axis=0) + 1e-6
        assert ((inside >= low) & (inside <= high)).all()
        assert contains(area, inside[0]).all()
    steps = np.diff(scene.world.animals[..., :2], axis=0)
    assert steps.std() == pytest.approx(0.5, rel=0.05)
    assert not (draw_scene(6, "uav-search").grid[:3] == scene.grid[:3]).all()


def test_planners_find_animals_where_they_are(one):
    scene, found = one
    for searched in found.values():
        assert np.isfinite(searched.found).all()
        for animal, time in enumerate(searched.found):
            image = int(np.flatnonzero(searched.at == time)[0])
            row = int(rows_at(np.array([time]), 1.0)[0])
            away = scene.world.animals[row, animal] - searched.p_nc[image]
            assert scene.world.chance[row, animal] < np.exp(-(away @ away) / 100.0**2)
            assert searched.counts[image]
    # Turns cost all of them time, as much as the twin says, and images are a second apart without.
    assert scene.flying.turn_time == 4.0
    for searched in found.values():
        waits = np.diff(searched.at, prepend=0.0) - 1
        assert waits.min() > -1e-9 and waits.sum() > 5 and waits.max() <= 4 + 1e-9
    # Nobody is faster than the platform, and all keep its height above the ground.
    for searched in found.values():
        steps = np.linalg.norm(np.diff(searched.p_nc[:, :2], axis=0), axis=1)
        assert steps.max() <= 5 + 1e-9
        above = -searched.p_nc[:, 2] - scene.world.terrain.heights_at(searched.p_nc[:, :2])
        assert above == pytest.approx(60, abs=1e-6)


def test_the_numbers_of_a_search(one):
    _, found = one
    numbers = numbers_of(found[ROWS])
    times = np.sort(found[ROWS].found)
    assert numbers["half_found"] == times[4] and numbers["all_found"] == times[-1]
    shares = [numbers[f"share_{n + 1}"] for n in range(STATIONS)]
    assert shares == sorted(shares) and shares[-1] == 1
    late = found[ROWS]._replace(found=np.append(times[:-1], np.inf))
    assert numbers_of(late)["all_found"] == BUDGET_S and numbers_of(late)["share_found"] == 0.9


def test_a_greedy_choice_is_never_quicker_than_the_shortest_order():
    for seed in range(3):
        situation = draw_situation(seed, draw_scene(seed, "uav-search"))
        assert situation.ahead.time <= situation.greedy.time < 3600
        assert len(situation.ahead.order) == len(situation.positions) + 1


def test_claims_turn_with_the_numbers():
    good, bad = (
        checks_of("information-planning", table(**kind), {"loads": np.full(10, load)})
        for kind, load in ((GOOD, 0.6), (BAD, 0.01))
    )
    assert turn("information-planning", good, bad)
    for load, verdict in ((0.6, HOLDS), (1e-3, FAILS)):
        checks = checks_of("information-planning", table(), {"loads": np.full(40, load)})
        check = checks["computationally-expensive"]
        assert decide_check(check, 0.1).verdict == verdict
    assert decide(good["lower-search-time"].holds()).met == 40
