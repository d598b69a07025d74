"""Tables, charts and metrics of the page on boats followed by sensors."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.analysis.tracks.noise_model import SensorTuning
from wildlab.analysis.tracks.single_target import SensorTrack
from wildlab.messages.catalogue import load_texts
from wildlab.reporting.report import Report, open_report
from wildlab.studies import autoferry
from wildlab.studies.autoferry import COMPARED, KEYS, of_use, outcomes, tracks_table

NAMES = load_texts("autoferry").subjects

LIDAR = SensorTuning(
    "lidar", "position", -0.9, -1.1, -0.8, 3.0, 0.9, 20.0, 1.2, 1.5, 0.0, 100, 50, 0.5, 300, (1.0, 1.0)
)
CAMERA = SensorTuning(
    "eo",
    "bearing",
    -1.0,
    -2.0,
    0.5,
    np.radians(2),
    0.8,
    5.0,
    0.0,
    0.0,
    np.radians(1),
    100,
    50,
    0.2,
    9,
    (0.01,),
)


def track(sensor: str, target: str, name: str, error: float, nees: float, seed: int = 0) -> SensorTrack:
    rng = np.random.default_rng(seed)
    n, m = 60, 1 if sensor == "eo" else 2
    estimate = np.column_stack([np.arange(n), np.zeros(n), np.ones(n), np.zeros(n)])
    errors = np.tile([error, 0.0, 0.0, 0.0], (n, 1))
    innovation = rng.normal(size=(n, m))
    nis = np.sum(innovation**2, axis=1)
    values = nees * rng.uniform(0.5, 1.5, n)
    known = np.ones(n, bool)
    return SensorTrack(
        sensor, target, name, np.arange(n) * 0.5, estimate, errors, values, innovation, nis, known, known,
        np.tile(np.eye(4), (n, 1, 1)), np.tile(np.eye(m), (n, 1, 1)),
    )  # fmt: skip


@pytest.fixture
def followed() -> list[SensorTrack]:
    return [
        track("lidar", "a", "kf", 4.0, 30.0, 1),
        track("lidar", "a", "coloured", 4.1, 3.0, 2),
        track("lidar", "a", "schmidt", 9.0, 2.0, 3),
        track("lidar", "b", "kf", 40.0, 2.0, 4),
        track("lidar", "b", "coloured", 41.0, 0.2, 5),
        track("eo", "a", "ekf", 90.0, 900.0, 6),
        track("eo", "a", "schmidt", 95.0, 300.0, 7),
    ]


@pytest.fixture
def tracks(followed: list[SensorTrack]) -> pd.DataFrame:
    return tracks_table(followed, 15.0).assign(case="scenario-3")


@pytest.fixture
def report() -> Report:
    return open_report(study="autoferry", kind="logged", flight="autoferry")


def recorded(report: Report) -> dict[tuple[str, str], float]:
    return {(m["name"], m["subject"]): m["value"] for m in report._metrics}


def test_every_track_has_the_numbers_of_its_kind(report, tracks):
    autoferry.record_tracks(report, tracks)
    found = recorded(report)
    lidar = {name for name, subject in found if subject == "lidar/a/scenario-3/kf"}
    camera = {name for name, subject in found if subject == "eo/a/scenario-3/ekf"}
    assert lidar == camera == {*COMPARED, "detections_used"}
    assert found["rmse", "lidar/a/scenario-3/kf"] == pytest.approx(4.0)
    report.save()


def test_what_was_fitted_is_recorded_with_its_interval(report):
    tunings = {"lidar": LIDAR, "eo": CAMERA}
    autoferry.record_tunings(report, tunings)
    rows = autoferry.tunings_table(tunings, NAMES)
    assert rows["offset"].tolist() == ["−0.90 (−1.1 to −0.8)", "−1.00 (−2.0 to 0.5)"]
    assert rows["sd"].tolist() == ["3.0 m", "2.0°"]
    metric = next(m for m in report._metrics if m["subject"] == "lidar" and m["name"] == "clock_offset")
    assert (metric["low"], metric["value"], metric["high"], metric["n"]) == (-1.1, -0.9, -0.8, 300)
    assert recorded(report)["error_sd", "eo"] == pytest.approx(2.0)


def made(sensor: str, outcome: list[str], *, fixed: str = "schmidt", rmse: float = 3.0) -> pd.DataFrame:
    """Tracks of a sensor with these outcomes, beside white noise: rows as `sensor_tracks.table` has them."""
    bearing = sensor in ("ir", "eo")
    inside = {"gained": (9.0, 2.0), "too dear": (9.0, 2.0), "both inside": (2.0, 2.0)}
    inside |= {"neither inside": (9.0, 9.0), "spoilt": (2.0, 9.0), "lost": (9.0, 2.0)}
    rows = []
    for k, what in enumerate(outcome):
        share = 0.25 if what == "lost" else 1.0
        for name, anees in zip(("ekf" if bearing else "kf", fixed), inside[what], strict=True):
            rows.append(
                {
                    "sensor": sensor, "target": f"boat-{k}", "case": "scenario-3", "filter": name,
                    "kind": "bearing" if bearing else "position", "anees": anees, "nees_low": 1.0,
                    "nees_high": 3.0, "anis": 1.0, "nis_low": 1.5, "nis_high": 2.5,
                    "share_with_target": share, "compared": 50, "detections": 40, "fraction_nees_inside": 0.5,
                    "rmse": rmse * (2.0 if what == "too dear" and name == fixed else 1.0),
                    "lag1_autocorrelation": 0.1,
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


def judged(rows: pd.DataFrame) -> pd.DataFrame:
    return outcomes(rows, KEYS, "schmidt")


FEW = judged(
    pd.concat([made("lidar", ["gained", "spoilt", "spoilt"]), made("radar", ["lost"])], ignore_index=True)
)


def test_outcomes_are_recorded_with_their_denominator(report):
    use = of_use(made("ir", ["lost"] * 5))
    autoferry.record_outcomes(report, FEW, use, "schmidt")
    found = {(m["name"], m["subject"]): (m["value"], m["n"]) for m in report._metrics}
    assert found["tracks_gained", "schmidt/lidar"] == (1, 3)
    assert found["tracks_spoilt", "schmidt/all-sensors"] == (2, 4)
    assert found["tracks_lost", "schmidt/radar"] == (1, 1)
    assert found["tracks_kept_at_best", "ekf/ir"] == (0, 5)
    report.save()


def test_overview_is_of_the_tracks_that_stay(tracks):
    rows = autoferry.overview_table(tracks, NAMES).set_index(["sensor", "filter"])
    assert rows.loc[("Lidar", "white noise"), "kept"] == "1 of 2"
    assert rows.loc[("Lidar", "white noise"), "rmse"] == pytest.approx(4.0)
    assert rows.loc[("Lidar", "white noise"), "inside"] == "0 of 1"
    assert rows.loc[("Lidar", "Schmidt"), "inside"] == "1 of 1"
    assert rows.loc[("Colour camera", "Schmidt"), ["kept", "inside"]].tolist() == ["0 of 1", "—"]
