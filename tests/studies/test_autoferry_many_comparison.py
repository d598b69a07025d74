"""Stone Soup's JPDA is given what our tracker is given, and judged as it is."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.analysis.tracks.many import ManyTracks, score_identities, track_jointly
from wildlab.errors import WildlabError
from wildlab.studies import autoferry_many
from wildlab.studies.autoferry_many import stone_soup, tuning
from wildlab.studies.autoferry_many.stone_soup import Choice, Eye, draw_choice, run_stone_soup
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.many import ManySensorModel, Scan, Shown
from wildlab.tracking.motion import white_acceleration

R = np.full((1, 2, 2), np.nan)  # of a scan: never used, since noise is one of the choices


def choice(**changes: object) -> Choice:
    eyes = {"lidar": Eye(0.8, 1 - 1e-12, 1e-12, 0.0, 500.0), "radar": Eye(3.0, 1 - 1e-12, 1e-12, 0.0, 500.0)}
    base = Choice(
        eyes=eyes, density=0.3, start_speed_m_s=3.0, gate=8.0, hits=2, held_s=10.0, patience_s=10.0,
        lost_m=500.0, moves_m=0.0, over_s=10.0,
    )  # fmt: skip
    return base._replace(**changes)


def one_boat(count: int = 30) -> list[Scan]:
    """One target by two sensors in turn, at uneven times, without clutter."""
    rng = np.random.default_rng(5)
    scans, time = [], 100.0
    for row in range(count):
        time += float(rng.integers(0, 2500)) / 1000  # stamps of Stone Soup are whole microseconds
        sensor = int(rng.integers(2))
        z = np.array([[20 + 2 * (time - 100), 5 - (time - 100)]]) + rng.normal(0, (0.8, 3.0)[sensor], (1, 2))
        scans.append(Scan(time, sensor, np.zeros(2), z, R))
        if row == 10:
            scans.append(Scan(time, 1 - sensor, np.zeros(2), z + 0.5, R))  # two looks at one time
    return scans


def test_one_target_without_clutter_is_kalmans():
    pytest.importorskip("stonesoup")
    scans, given = one_boat(), choice()
    shown = run_stone_soup(scans, ["lidar", "radar"], given)
    noise = [given.eyes[name].noise_m ** 2 * np.eye(2) for name in ("lidar", "radar")]
    x, P = np.array([*scans[0].z[0], 0, 0]), np.diag([0, 0, 9.0, 9.0])
    P[:2, :2] = noise[scans[0].sensor]
    assert len(shown) == len(scans) and not len(shown[0].x)
    for before, scan, found in zip(scans[:-1], scans[1:], shown[1:], strict=True):
        x, P = predict(x, P, *white_acceleration(scan.time - before.time, given.density))
        x, P = update(x, P, scan.z[0], np.eye(2, 4), noise[scan.sensor])[:2]
        assert found.identity.tolist() == [0] and (found.time, found.sensor) == (scan.time, scan.sensor)
        assert np.allclose(found.x[0], x, atol=1e-6) and np.allclose(found.P[0], P, atol=1e-6)


def harbour() -> list[Scan]:
    """Two boats side by side, clutter, and every fifth look empty."""
    rng = np.random.default_rng(2)
    scans = []
    for row in range(40):
        boats = np.array([[30 + row, 10.0], [30 + row, 16.0]]) + rng.normal(0, 0.8, (2, 2))
        z = np.concatenate([boats, rng.uniform(-80, 80, (3, 2))])
        scans.append(Scan(float(row), row % 2, np.zeros(2), np.zeros((0, 2)) if row % 5 == 4 else z, R))
    return scans


def dense() -> Choice:
    eyes = {name: Eye(1.5, 0.8, 1e-4, 0.0, 60.0) for name in ("lidar", "radar")}
    return choice(eyes=eyes, gate=3.0, held_s=3.0, patience_s=4.0, lost_m=20.0)


def test_the_same_draw_gives_the_same_bytes_and_looks_out_no_farther_than_told():
    pytest.importorskip("stonesoup")
    one, other = (run_stone_soup(harbour(), ["lidar", "radar"], dense()) for _ in range(2))
    for a, b in zip(one, other, strict=True):
        assert a.identity.tolist() == b.identity.tolist()
        assert a.x.tobytes() == b.x.tobytes() and a.P.tobytes() == b.P.tobytes()
    assert max(len(look.x) for look in one) >= 2
    assert all(np.linalg.norm(look.x[:, :2], axis=1).max(initial=0) < 60 for look in one)
    # The boats are past 60 m from the 30th look on, and four seconds later nothing is left of them.
    near = [np.abs(look.x[:, 1] - 13).min(initial=np.inf) for look in one]
    assert max(near[8:26]) < 6 and min(near[36:]) > 6


def test_flights_of_empty_looks_have_no_tracks():
    pytest.importorskip("stonesoup")
    empty = [Scan(float(row), 0, np.zeros(2), np.zeros((0, 2)), R[:0]) for row in range(4)]
    assert [len(one.x) for one in run_stone_soup(empty, ["lidar"], dense())] == [0, 0, 0, 0]
    assert run_stone_soup([], ["lidar"], dense()) == []


def test_what_stays_is_shown_only_where_a_draw_asks_for_no_move():
    pytest.importorskip("stonesoup")
    buoy = [Scan(float(row), 0, np.zeros(2), np.array([[20.0, 20.0]]), R) for row in range(20)]
    still, moved = (run_stone_soup(buoy, ["lidar"], choice(moves_m=m)) for m in (0.0, 5.0))
    assert [len(one.x) for one in still[1:]] == [1] * 19 and all(not len(one.x) for one in moved)
    boat = [one._replace(z=one.z + np.array([2 * one.time, 0])) for one in buoy]
    shown = [len(one.x) for one in run_stone_soup(boat, ["lidar"], choice(moves_m=5.0))]
    assert shown[:3] == [0, 0, 0] and shown[6:] == [1] * 14


def followed(scans: list[Scan], shown: list[Shown]) -> ManyTracks:
    truth = {"Havfruen": np.array([[30 + one.time, 10.0] for one in scans])}
    truth["Havfruen"][3] = np.nan
    sensors = [ManySensorModel(name, 0.9, 1e-5, 0, 60, 4, (0,), (0,), (0,)) for name in ("lidar", "radar")]
    return ManyTracks(scans, [frozenset()] * len(scans), shown, {}, sensors, None, truth, [], [])


def test_it_is_judged_at_our_looks_by_our_truths(monkeypatch):
    scans = harbour()
    none = [
        Shown(one.time, one.sensor, np.zeros(0, int), np.zeros((0, 4)), np.zeros((0, 4, 4)), np.zeros(0),
              np.zeros((0, 1)), np.zeros((0, 4, 0)))
        for one in scans
    ]  # fmt: skip
    true = [
        Shown(one.time, one.sensor, np.array([7]), np.array([[30 + one.time, 10.0, 1, 0]]), np.eye(4)[None],
              np.ones(1), np.ones((1, 1)), np.zeros((1, 4, 0)))
        for one in scans
    ]  # fmt: skip
    given = []

    def run(*args: object) -> list[Shown]:
        given.append(args)
        return true

    monkeypatch.setattr(autoferry_many, "run_stone_soup", run)
    ours = followed(scans, none)
    theirs = autoferry_many.replace_tracks(ours, dense())
    assert given == [(scans, ["lidar", "radar"], dense())] and given[0][0] is ours.scans
    assert theirs._replace(shown=ours.shown) == ours
    lives, other = score_identities(ours, {"Havfruen": 55.0}), score_identities(theirs, {"Havfruen": 55.0})
    assert lives is not None and other is not None
    assert len(lives.gospa) == len(other.gospa) == len(scans) - 1
    assert lives.targets["Havfruen"].visible == other.targets["Havfruen"].visible > 0
    assert lives.targets["Havfruen"].tracked == 0 and other.targets["Havfruen"].tracked == 1


def table(values: dict[str, tuple[float, ...]], spread: float = 1.0) -> pd.DataFrame:
    """Four scenarios, two draws; the first is what was tuned on."""
    return pd.DataFrame(
        {
            "case": f"scenario-{n}",
            "mode": mode,
            "rank": rank,
            "draw": rank,
            "gospa": value + spread * (rank - 1),
        }
        for mode, several in values.items()
        for rank in (1, 2)
        for n, value in zip((2, 3, 5, 13), several, strict=True)
    )


def test_its_gospa_stands_after_ours_and_with_its_own_scenario():
    ours, other = table({"radar": (1, 2, 3, 4)}), table({"radar": (5, 6, 7, 8)}).iloc[::-1]
    joined = autoferry_many.scenarios_table(ours, other, {"radar": "Radar"})
    assert joined["theirs"].tolist() == [5, 6, 7, 8] and set(joined["mode"]) == {"Radar"}


def test_draws_are_those_of_their_seed_and_within_their_ranges():
    one, same, other = (draw_choice(np.random.default_rng(n), autoferry_many.FAR_M) for n in (1, 1, 2))
    assert one == same != other
    for seed in range(50):
        drawn = draw_choice(np.random.default_rng(seed), autoferry_many.FAR_M)
        assert 105 <= drawn.eyes["lidar"].far_m <= 140 and drawn.eyes["radar"].far_m == 200
        assert 2 <= drawn.hits <= 6 and (drawn.moves_m == 0 or 4 <= drawn.moves_m <= 12)


def test_without_the_library_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(stone_soup.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(WildlabError, match=r"\[oracles\]"):
        run_stone_soup([], [], dense())
    none = autoferry_many.judge_stone_soup({}, {}, 40, 1)
    ours = table({"radar": (1, 2, 3, 4)})
    assert (
        not len(none)
        and autoferry_many.scenarios_table(ours, none, {"radar": "Radar"})["theirs"].isna().all()
    )
    assert autoferry_many.gospa_chart(ours, none, "scenario-2", {}) is None


@pytest.mark.slow
def test_the_draws_are_ordered_by_the_first_scenario_alone(scenario, tunings, monkeypatch):  # type: ignore[no-untyped-def]
    pytest.importorskip("stonesoup")
    flights = {f"scenario-{n}": scenario(n) for n in (2, 17)}
    monkeypatch.setattr(autoferry_many, "FOR_EACH", 1)
    monkeypatch.setattr(tuning, "tune_sensor", lambda flight, sensor: tunings[sensor])
    settings = tuning.draw(np.random.default_rng(1), tuning.errors_of(scenario(2)))
    rows = autoferry_many.judge_stone_soup(flights, dict.fromkeys(tuning.MODES, settings), 2, 1)
    assert rows["mode"].unique().tolist() == autoferry_many.position_modes() and len(rows) == 2 * 2 * 3
    first = rows[rows["case"] == "scenario-2"]
    assert (first["gospa"] == first["tuned_gospa"]).all()
    for _, own in first.groupby("mode"):
        rule = [(not 0.5 <= one["anees"] <= 2, one["gospa"]) for _, one in own.iterrows()]
        assert rule == sorted(rule) and sorted(own["draw"]) == [1, 2]
    # One of them by hand, from the flight on.
    row = rows[(rows["case"] == "scenario-17") & (rows["mode"] == "radar") & (rows["rank"] == 2)].iloc[0]
    drawn = draw_choice(np.random.default_rng(1).spawn(2)[row["draw"] - 1], autoferry_many.FAR_M)
    given = track_jointly(scenario(17), settings=settings, sensors=["radar"])
    shown = run_stone_soup(given.scans, ["radar"], drawn)
    lives = score_identities(given._replace(shown=shown), tuning.reach_of(scenario(17), "radar"))
    assert tuning.gospa_of(lives) == row["gospa"]


def test_what_is_compared_are_medians_of_the_scenarios_that_nothing_is_tuned_on():
    ours, theirs = table({"radar": (1, 7, 8, 9)}), table({"radar": (9, 9, 9, 8)})
    (found,) = autoferry_many.compared(ours, theirs, "scenario-2").to_dict("records")
    assert (found["ours"], found["theirs"], found["smaller"], found["of"]) == (8.0, 9.0, 2, 3)
    assert (found["ours_least"], found["ours_most"]) == (8.0, 9.0)
    assert autoferry_many.compared(ours, theirs[theirs["case"] == "scenario-2"], "scenario-2").empty
