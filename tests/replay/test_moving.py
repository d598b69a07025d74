"""The small moving picture of a flight in its report: its arrays are the flight's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from wildlab.analysis.tracks.scores import COLUMNS, LEADING
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.replay.scene import MOST_BYTES, moving_flight, scene_of, show_moving
from wildlab.reporting.report import open_report
from wildlab.simulation.twins import simulate_twin


@pytest.fixture(scope="module")
def ship() -> Flight:
    return simulate_twin("large-ship", 1)


def report_of(flight: Flight, out: str = "", leading: str = "") -> str:
    report = open_report(study="overview", kind="twin", flight=flight.name, out=out)
    if leading:
        report.metric(LEADING, leading, 1, "1")
    show_moving(report, flight)
    return "".join(report.parts)


def test_the_arrays_are_those_of_the_flight(ship):
    scene = scene_of(ship, ellipses=False)
    shown = moving_flight(scene)
    nav = ship.nav["autopilot"]
    t = np.asarray(shown.path.times) + nav["time_s"].iloc[0]
    assert np.allclose(np.asarray(shown.path.points)[:, 0], np.interp(t, nav["time_s"], nav["north_m"]))
    assert shown.points is not None and scene.points is not None and shown.footprints is not None
    assert np.asarray(shown.footprints.corners).shape[1:] == (4, 2)
    # Without covariances the places are the same.
    whole = scene_of(ship).points
    assert whole is not None
    assert np.allclose(shown.points.points, whole.places[:, :2]) and np.isfinite(whole.covariance).any()
    assert np.isnan(scene.points.covariance).all()


def test_it_is_in_the_report_without_a_script_and_not_too_large(ship):
    page = report_of(ship)
    assert "<svg" in page and "<script" not in page and len(page.encode()) < MOST_BYTES + 10_000
    assert "prefers-reduced-motion" in page
    nav = ship.nav["autopilot"].iloc[::5]  # ten a second: what shakes within half a second is no way
    way = np.linalg.norm(np.diff(nav[["north_m", "east_m"]].to_numpy(), axis=0), axis=1).sum()
    assert f"{way:.0f} m" in page


def test_a_table_of_tracks_gives_ellipses_of_one_filter(ship, tmp_path):
    rows = {name: [0.5, 1.5, 2.5] * 2 for name in COLUMNS}
    rows |= {"target": ["ship"] * 6, "sensor": ["camera"] * 6, "filter": ["ekf"] * 3 + ["schmidt"] * 3}
    rows |= {"p_00": [4.0] * 6, "p_01": [0.0] * 6, "p_11": [4.0] * 6}
    pd.DataFrame(rows).to_parquet(tmp_path / "estimates.parquet")
    assert "filter schmidt" in report_of(ship, str(tmp_path))
    assert "filter ekf" in report_of(ship, str(tmp_path), leading="ekf")
    scene = scene_of(ship, estimates=pd.DataFrame(rows), ellipses=False)
    assert len(moving_flight(scene).ellipses) == 1
    pd.DataFrame(rows).drop(columns="nees").to_parquet(tmp_path / "estimates.parquet")
    with pytest.raises(WildlabError, match="column"):
        report_of(ship, str(tmp_path))
    (tmp_path / "estimates.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(WildlabError, match="not a readable"):
        report_of(ship, str(tmp_path))


def test_a_flight_without_a_path_or_times_gets_no_picture(ship):
    assert report_of(replace(ship, nav={})) == ""
    assert report_of(replace(ship, nav={}, tables={})) == ""
    scene = replace(scene_of(ship, ellipses=False), timed=False)
    with pytest.raises(WildlabError, match="no path"):
        moving_flight(scene)
