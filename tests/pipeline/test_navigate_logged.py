"""From logs to poses with covariance: recipe, import, filter, against the attitude found on board.

The limits leave room for what the onboard attitudes are worth: they are estimates too.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wildlab.flight.recipe import import_flight
from wildlab.flight.store import load_flight
from wildlab.flight.sync import poses_at
from wildlab.geometry.frames import matrix_to_euler, matrix_to_rotation_vector
from wildlab.paths import DATA
from wildlab.pipeline.navigate import Navigated, navigate_mekf

Logged = Callable[[str, str], tuple[Navigated, np.ndarray, np.ndarray, np.ndarray]]


@pytest.fixture(scope="module")
def logged(shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Logged:
    """Recipe and folder -> what the filter found, and times, its attitudes and the onboard ones."""

    def navigated(recipe: str, folder: str) -> tuple[Navigated, np.ndarray, np.ndarray, np.ndarray]:
        into = tmp_path_factory.mktemp(folder) / "flight"
        import_flight(DATA / "recipes" / f"{recipe}.toml", shared_data("logs", folder), into)
        flight = load_flight(into)
        found = navigate_mekf(flight)
        times = found.nav["time_s"].to_numpy()
        return found, times, poses_at(found.nav, times)[1], poses_at(flight.nav["onboard"], times)[1]

    return navigated


def test_thor(logged: Logged) -> None:
    """Once in the air for a minute; standing on the runway, receiver and onboard filter know no heading."""
    found, times, ours, onboard = logged("umn-thor75", "umn_thor75")
    settled = (times > 272) & (times < 579)
    off = matrix_to_euler(ours[settled]) - matrix_to_euler(onboard[settled])
    rms = np.degrees(np.sqrt((((off + np.pi) % (2 * np.pi) - np.pi) ** 2).mean(axis=0)))
    print(f"roll, pitch, yaw: {rms.round(2)} deg")
    assert (rms < [1.0, 1.0, 2.5]).all()
    assert (found.innovations["verdict"] == 0).mean() < 0.02
    assert set(found.innovations["source"]) == {"position", "velocity"}


def test_x8_through_loops_and_rolls(logged: Logged) -> None:
    _, times, ours, onboard = logged("inertialnav-x8", "inertialnav_x8")
    for begin, end, limit in ((320, 410, 8.0), (410, 515, 12.0)):
        part = (times > begin) & (times < end)
        turned = matrix_to_rotation_vector(np.swapaxes(onboard[part], 1, 2) @ ours[part])
        rms = np.degrees(np.sqrt((turned**2).sum(axis=1).mean()))
        print(f"{begin} to {end} s: {rms:.1f} deg")
        assert rms < limit
