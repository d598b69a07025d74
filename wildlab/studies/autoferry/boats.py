"""What is known of the boats, apart from the flights: ``data/settings/autoferry.toml``."""

from __future__ import annotations

from wildlab.analysis.following.noise_model import of_targets
from wildlab.analysis.following.sensor_tuning import SensorTuning, tune
from wildlab.flight.following import read_settings
from wildlab.flight.store import Flight
from wildlab.paths import DATA

BOATS, _ = of_targets(read_settings(DATA / "settings" / "autoferry.toml").targets)


def tune_sensor(flight: Flight, sensor: str) -> SensorTuning:
    """Everything of a sensor from one scenario, see `wildlab.analysis.following.sensor_tuning.tune`."""
    return tune(flight, sensor, BOATS.reach)
