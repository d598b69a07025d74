"""What a report on navigation says first turns with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.studies.navigation import text

FOUND = {"rms_roll": 0.3, "rms_pitch": 0.4, "rms_yaw": 1.2, "mean_sd_roll": 0.6, "mean_sd_pitch": 0.8}


def found(yaw_sd: float = 2.4, **more: float) -> dict[str, float]:
    return FOUND | {"mean_sd_yaw": yaw_sd} | more


def test_the_axes_are_taken_together_and_the_point_moves_by_roll_and_pitch() -> None:
    (first, second, _), verdict, reason = text.summary(found(), "in the air", True)
    assert "1.30 degrees from the truth" in first and "it would be 2.60" in first and "median" not in first
    assert f"by {300 * np.radians(0.5):.1f} metres" in second and verdict.colour == "neutral"
    assert reason == "From the truth it differs by 0.5 times what it states."


@pytest.mark.parametrize("true", [True, False])
@pytest.mark.parametrize("yaw", [2.3, 2.7, 3.9])
def test_the_reason_is_the_ratio(yaw: float, true: bool) -> None:
    errors = {name: value * 2 for name, value in FOUND.items() if name.startswith("rms")}
    _, verdict, reason = text.summary(found() | errors | {"rms_yaw": yaw}, "in the air", true)
    ratio = np.hypot(1.0, yaw) / np.linalg.norm([0.6, 0.8, 2.4])
    assert f"{ratio:.1f} times" in reason and verdict.value == "not judged"


def test_the_noise_as_stated_leads_and_what_was_found_stands_beside() -> None:
    better = found() | {"rms_roll": 0.0, "rms_pitch": 0.0, "rms_yaw": 0.5}
    (first, second, *_), *verdict = text.summary(found(), "in the air", False, receiver=better)
    assert "1.30 degrees" in first and "0.50 degrees" in second
    assert tuple(verdict) == text.summary(found(), "in the air", False)[1:]


@pytest.mark.parametrize("times", [0.2, 5.0])
def test_surer_than_the_difference_allows_only_where_it_is(times: float) -> None:
    sure = {name: value * (1 / times if name.startswith("rms") else 1) for name, value in found().items()}
    (first, _, last), verdict, _ = text.summary(sure, "in the air", False)
    assert ("surer of itself" in last) == (times < 1) == (verdict.value == "look closer")
    assert "found on board" in first and "truth" in last


def test_the_middle_flight_speaks_for_all_of_them() -> None:
    flights = [found(rms_yaw=value) for value in (9.0, 1.2, 1.1)]
    spread = pd.DataFrame([{("mekf", name): value for name, value in one.items()} for one in flights])
    spread["observer", "rms_yaw"] = 50.0
    middle = text.middle_flight(spread)
    assert middle["rms_yaw"] == 1.2 and len(middle) == 6
    (first, *_), verdict, reason = text.summary(middle, "in the air", True, 3)
    assert verdict.colour == "neutral" and not reason
    assert "1.30 degrees" in first and ", median of 3 flights;" in first
    assert text.tiles(middle, True, 3)[2] == (
        "1.20°",
        "RMS yaw error of the filter; it states 2.40°, median of 3 flights",
    )
    assert text.tiles(middle, False)[2] == ("1.2°", "RMS yaw difference of the filter; it states 2.4°")
