"""Figures of how an aircraft flew, and when its target was tracked."""

# ruff: noqa: F811 - a fixture of another room

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from tests.flight.conftest import make_flight  # noqa: F401 - a fixture
from wildlab.flight.store import Flight
from wildlab.studies import navigation
from wildlab.studies.navigation import Studied


def level_nav(times: np.ndarray) -> pd.DataFrame:
    """North at 20 m/s and 100 m above, rolled by 30 degrees."""
    zero = np.zeros(len(times))
    half = np.radians(15.0)
    return pd.DataFrame(
        {"time_s": times, "north_m": 20 * times, "east_m": zero, "down_m": zero - 100,
         "q_w": zero + np.cos(half), "q_x": zero + np.sin(half), "q_y": zero, "q_z": zero,
         "v_north_m_s": zero + 20, "v_east_m_s": zero, "v_down_m_s": zero}
    )  # fmt: skip


def studied_of(flight: Flight) -> Studied:
    nav = level_nav(np.arange(0.0, 10.0, 0.1))
    flight.nav["autopilot"] = level_nav(np.arange(0.0, 10.0, 0.5))
    found = {"mekf": SimpleNamespace(nav=nav), "observer": SimpleNamespace(nav=nav)}
    return cast("Studied", SimpleNamespace(flight=flight, found=found, filter="mekf", reference="autopilot"))


def show(flight: Flight, figures: int | None) -> dict[str, Figure]:
    studied, window = studied_of(flight), (0.0, 10.0)
    paths = [] if figures is None else navigation.path_figures(studied, window, figures)
    shown = [*paths, *navigation.flight_figures(studied, window, figures)]
    return {one.name or one.text: one.fig for one in shown}


def test_observations_are_images_with_a_named_target(make_flight):
    flight = make_flight()
    assert navigation.observation_times(flight).tolist() == [1.0, 8.0]
    assert navigation.tracking_period(flight) == (1.0, 8.0)
    # The camera's clock moves them, as it moves everything that is seen.
    assert navigation.tracking_period(make_flight(clocks={"camera_offset_s": 0.5})) == (1.5, 8.5)
    flight.detections.loc[:, "target_id"] = ""  # type: ignore[union-attr]
    assert navigation.tracking_period(flight) is None


@pytest.mark.parametrize(("figures", "path"), [(23, "fig-7-22"), (33, "fig-7-32"), (13, "paths")])
def test_counterparts_and_the_period_in_each_of_them(
    make_flight,
    figures,
    path,
):
    shown = show(make_flight(), figures)
    assert list(shown) == [path, *(f"fig-7-{figures + offset}" for offset in (0, 1, 4))]
    for name, one in shown.items():
        if name == path:
            continue
        for ax in one.axes:
            black = [line.get_xdata()[0] for line in ax.lines if line.get_color() == "black"]
            assert black == [1.0, 8.0]
