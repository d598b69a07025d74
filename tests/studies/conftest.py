"""What several studies share: the small flight of the tests of analysis, and a ferry's logged scenarios."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tests.analysis.conftest import make_flight
from wildlab.analysis.tracks.noise_model import SensorTuning
from wildlab.flight.importing import import_flight
from wildlab.flight.store import Flight
from wildlab.paths import DATA
from wildlab.studies.autoferry import tune_sensor

__all__ = ["make_flight"]


@pytest.fixture(scope="session")
def scenario(
    shared_data: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[int], Flight]:
    """``scenario(2)`` imports one of the logged scenarios, once."""
    source, into = shared_data("tracking", "autoferry"), tmp_path_factory.mktemp("autoferry")

    @cache
    def imported(number: int) -> Flight:
        return import_flight(DATA / "recipes" / f"autoferry-{number}.toml", source, into / str(number))

    return imported


@pytest.fixture(scope="session")
def tunings(scenario: Callable[[int], Flight]) -> dict[str, SensorTuning]:
    """What the second scenario teaches of each sensor."""
    return {sensor: tune_sensor(scenario(2), sensor) for sensor in ("lidar", "radar", "ir", "eo")}
