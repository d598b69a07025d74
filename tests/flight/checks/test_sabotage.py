"""Wrong meanings made of good flights: found, and explained by a mistake; `pytest -s` prints the table.

Every twentieth of them is tried, for each takes seconds; WILDLAB_ALL_SABOTAGE=1 tries all.

A wrong meaning whose effect is below 10 % is harmless. The effect of the others is the relative change of
what the flight's report states: the mean error of ground points; with an inertial sensor the attitude and
position error of the filter against the reference; of other sensors the median distance from the nearest
target.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.flight.checks.sabotage import wrong_meanings
from wildlab.errors import WildlabError
from wildlab.flight.checks.check import find
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sense.looks import scans_of
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels
from wildlab.paths import DATA
from wildlab.pipeline.evaluate import score_points
from wildlab.pipeline.georeference import observe
from wildlab.pipeline.navigate import navigate_mekf
from wildlab.pipeline.navigation_errors import comparison_times, errors_against, flown_part, reference_of
from wildlab.simulation.twins import simulate_twin

#: Effects below are harmless, and above may not be missed; share of what is not harmless that is explained.
HARMLESS, GRAVE, EXPLAINED = 0.1, 0.5, 2 / 3
#: Distinct wrong meanings of a flight.
ENOUGH = 60
EVERY = 1 if os.environ.get("WILDLAB_ALL_SABOTAGE") else 20

PUBLIC = {
    "openathena-f1": ("georeferencing", "openathena-f1"),
    "umn-thor75": ("logs", "umn_thor75"),
    "inertialnav-x8": ("logs", "inertialnav_x8"),
    "autoferry-2": ("tracking", "autoferry"),
}
#: One of each kind, in a few seconds.
FEW = re.compile(r"looks the other|attitude: yaw negated|poses: height in feet")


def ground_error(flight: Flight, source: str | None = None) -> np.ndarray:
    """Mean error of the ground points (m), and the share of points that have none."""
    seen = observe(flight, source)
    ground = georeference_pixels(seen.poses, seen.uv, seen.plane_down)
    points = seen.table.assign(**dict(zip(("north_m", "east_m", "down_m"), ground.T, strict=True)))
    points = points.assign(cov_nn=np.nan, cov_ne=np.nan, cov_ee=np.nan)
    error = score_points(flight, points)["error_m"].to_numpy(float)
    return np.array([np.nanmean(error), 1 + np.isnan(error).mean()])


def navigation_error(flight: Flight) -> np.ndarray:
    """Root mean square of attitude (rad) and position (m) against the reference, in the air and settled."""
    reference = reference_of(flight)
    times = comparison_times(flight, reference)
    found = navigate_mekf(flight, times)
    _, begin, end = flown_part(flight, times)
    part = (times >= max(begin, times[0] + 60)) & (times <= end)
    error = errors_against(flight.nav[reference], found.nav, times).error[part]
    return np.sqrt([np.nanmean((error[:, 6:] ** 2).sum(1)), np.nanmean((error[:, :3] ** 2).sum(1))])


def sighting_error(flight: Flight) -> np.ndarray:
    """Median distance of each source's detections from the nearest target, m or rad."""
    found = []
    for s in scans_of(flight):
        away = s.targets - s.own
        if s.places is not None:
            off = np.hypot(*np.moveaxis((s.targets - s.places)[..., :2], -1, 0))
        else:
            off = np.abs(np.angle(np.exp(1j * (s.azimuth - np.arctan2(away[..., 1], away[..., 0])))))
        found.append(np.median(np.nanmin(np.where(np.isfinite(off), off, np.inf), axis=0)))
    return np.array(found)


def effect_of(measure: Callable[[Flight], np.ndarray], before: np.ndarray, flight: Flight) -> float:
    try:
        after = measure(flight)
    except (WildlabError, ValueError):
        return np.inf  # there is no result any more
    if len(after) < len(before) or not np.isfinite(after).all():
        return np.inf
    return float(np.max(np.abs(after - before) / before))


def sabotage(
    flight: Flight,
    measure: Callable[[Flight], np.ndarray],
    few: re.Pattern[str] | None = None,
    every: int = EVERY,
) -> Counter[str]:
    """Every wrong meaning of a flight; prints what was not explained, and fails by the rules above."""
    before = measure(flight)
    counts: Counter[str] = Counter()
    grave = []
    meanings = wrong_meanings(flight)
    chosen = meanings[::every] if few is None else [one for one in meanings if few.search(one.name)]
    for wrong in chosen:
        spoilt = wrong.apply(flight)
        found = alarms(spoilt)
        size = np.nan if found else effect_of(measure, before, spoilt)
        if found:
            outcome = "explained" if any(one.causes for one in found) else "found"
        else:
            outcome = "harmless" if size < HARMLESS else "missed"
        counts[outcome] += 1
        if outcome != "explained":
            print(f"  {outcome:9} {wrong.name}" + ("" if found else f" (effect {100 * size:.0f} %)"))
        if outcome == "missed" and size > GRAVE:
            grave.append(wrong.name)
    print(f"{flight.name}: {dict(counts)} of {counts.total()}, {len(meanings)} in all")
    assert len(meanings) >= ENOUGH or few is not None
    assert grave == []
    assert counts["explained"] >= EXPLAINED * (counts.total() - counts["harmless"])
    return counts


def alarms(flight: Flight) -> list[Finding]:
    return [one for one in find(flight) if one.level != "note"]


@pytest.fixture(scope="module")
def public(
    shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], Flight]:
    def load(name: str) -> Flight:
        folder = tmp_path_factory.mktemp(name) / "flight"
        return import_flight(DATA / "recipes" / f"{name}.toml", shared_data(*PUBLIC[name]), folder)

    return load


MEASURES = {
    "openathena-f1": ground_error,
    "umn-thor75": navigation_error,
    "inertialnav-x8": navigation_error,
    "autoferry-2": sighting_error,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLIC)
def test_public_flights(name: str, public: Callable[[str], Flight]) -> None:
    flight = public(name)
    assert alarms(flight) == []
    sabotage(flight, MEASURES[name])


@pytest.mark.slow
def test_a_few_on_a_twin() -> None:
    flight = simulate_twin("gondola", 1, without=("imu", "gnss"))
    counts = sabotage(flight, lambda f: ground_error(f, "autopilot"), FEW)
    assert counts == {"explained": 3}


@pytest.mark.slow
def test_all_on_a_twin() -> None:
    # A long flight with every sensor: of the same meanings on shorter ones more are tried.
    every = 2 * EVERY if EVERY > 1 else 1
    sabotage(simulate_twin("fast-vessel", 2), lambda f: ground_error(f, "autopilot"), every=every)


@pytest.mark.slow
@pytest.mark.xfail(strict=True, raises=AssertionError)
@pytest.mark.parametrize("unseen", ["attitude: roll negated", "attitude: yaw in degrees read as radians"])
def test_what_passes_unseen_over_hilly_land(unseen: str) -> None:
    """Known gaps: these move the points of this twin by more than half."""
    flight = simulate_twin("uav-search", 2)
    sabotage(flight, lambda f: ground_error(f, "autopilot"), few=re.compile(f"^{unseen}$"))


@pytest.mark.slow
@pytest.mark.parametrize("twin", sorted(path.stem for path in (DATA / "twins").glob("*.toml")))
def test_no_alarm_on_a_good_twin(twin: str) -> None:
    assert alarms(simulate_twin(twin, 3)) == []
