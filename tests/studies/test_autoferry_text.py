"""Tables, words and figures about boats followed by sensors, on a handful of made-up tracks."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.pipeline.sensor_tracks import COLUMNS, SensorTrack, table
from wildlab.pipeline.sensor_tuning import SensorTuning
from wildlab.reporting.published import load_claims
from wildlab.reporting.report import Report, open_report
from wildlab.studies.autoferry import charts as charts
from wildlab.studies.autoferry import text as words
from wildlab.studies.autoferry.comparison import beside_white, gains

LIDAR = SensorTuning("lidar", "position", -0.9, -1.1, -0.8, 3.0, 0.9, 20.0, 1.2, 1.5, 0.0, 100, 50, 0.5, 300)
CAMERA = SensorTuning(
    "eo", "bearing", -1.0, -2.0, 0.5, np.radians(2), 0.8, 5.0, 0.0, 0.0, np.radians(1), 100, 50, 0.2, 9
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
        sensor, target, name, np.arange(n) * 0.5, estimate, errors, values, innovation, nis, known
    )


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
    return table(followed).assign(case="scenario-3")


@pytest.fixture
def report() -> Report:
    return open_report(study="autoferry", kind="logged", flight="autoferry")


def recorded(report: Report) -> dict[tuple[str, str], float]:
    return {(m["name"], m["subject"]): m["value"] for m in report._metrics}


def test_every_track_has_the_numbers_of_its_kind(report: Report, tracks: pd.DataFrame) -> None:
    words.record_tracks(report, tracks)
    found = recorded(report)
    lidar = {name for name, subject in found if subject == "lidar/a/scenario-3/kf"}
    camera = {name for name, subject in found if subject == "eo/a/scenario-3/ekf"}
    assert lidar == {*COLUMNS, "detections_used"} - {"lag1_autocorrelation"}
    assert camera == {*COLUMNS, "detections_used"} - {
        "lag1_autocorrelation_north",
        "lag1_autocorrelation_east",
    }
    assert found["rmse", "lidar/a/scenario-3/kf"] == pytest.approx(4.0)
    report.save()


def test_what_was_fitted_is_recorded_with_its_interval(report: Report) -> None:
    rows = words.record_tunings(report, {"lidar": LIDAR, "eo": CAMERA})
    assert rows["offset"].tolist() == ["−0.90 (−1.1 to −0.8)", "−1.00 (−2.0 to 0.5)"]
    assert rows["sd"].tolist() == ["3.0 m", "2.0°"]
    assert rows["causes"].tolist() == ["position 1.2 m, clock 1.5 s", "heading 1.0°"]
    metric = next(m for m in report._metrics if m["subject"] == "lidar" and m["name"] == "clock_offset")
    assert (metric["low"], metric["value"], metric["high"], metric["n"]) == (-1.1, -0.9, -0.8, 300)
    assert recorded(report)["error_sd", "eo"] == pytest.approx(2.0)


def test_overview_counts_the_tracks_that_came_nearer(tracks: pd.DataFrame) -> None:
    rows = words.overview(tracks).set_index(["sensor", "filter"])
    assert rows.loc[("lidar", "differenced"), "nearer"] == "1 of 2"
    assert rows.loc[("lidar", "white noise"), "nearer"] == ""
    assert rows.loc[("colour camera", "Schmidt"), "nearer"] == "1 of 1"
    assert rows.loc[("lidar", "white noise"), "rmse"] == pytest.approx(22.0)


def test_the_best_filter_in_words(tracks: pd.DataFrame) -> None:
    rows = words.gains_table(gains(tracks, words.KEYS))
    assert rows["sensor"].tolist() == ["lidar", "lidar", "colour camera"]
    # Schmidt's NEES is ideal on a, at more than twice the error.
    assert rows["words"].tolist() == ["differenced", "differenced", "Schmidt"]
    assert rows["gained"].tolist() == [True, False, True]
    alone = words.alone_words(beside_white(tracks, words.KEYS), ["lidar"])
    assert alone == "lidar: differenced 1 of 2, Schmidt 0 of 1"


def test_claims_sensor_by_sensor(tracks: pd.DataFrame) -> None:
    texts = {claim["id"]: claim["text"] for claim in load_claims("autoferry")}
    rows = words.claims_by_sensor(tracks, texts).set_index("claim")
    assert len(rows) == len(texts) == 7
    over = rows.loc[texts["white-noise-overconfident"]]
    assert (over["lidar"], over["colour camera"], over["radar"]) == ("1 of 2", "1 of 1", "—")
    assert rows.loc[texts["differencing-nearer-ideal"], "colour camera"] == "—"


def test_sentences_say_what_the_numbers_say(tracks: pd.DataFrame) -> None:
    gained = {"lidar": pd.Series([True, False]), "eo": pd.Series([True])}
    first, second, third = words.summary_sentences(tracks, gained, {"lidar": "position", "eo": "bearing"})
    assert "22 metres with the lidar" in first
    assert "90 metres with the colour camera" in second
    assert third.startswith("In 2 of 3 tracks") and "in 1 of 2 scenarios with the lidar" in third
    assert words.strays(tracks).endswith("b by lidar in scenario 3 (40 m, 100 % of the time).")
    assert words.strays(tracks[tracks["target"] == "a"]) == ""
    assert words.signed(-0.126) == "−0.13"
    assert "scenario 2 alone" in words.method_text("scenario 2")


def test_nees_over_time_shows_each_filter_and_the_band(
    followed: list[SensorTrack], tracks: pd.DataFrame
) -> None:
    mine = [one for one in followed if (one.sensor, one.target) == ("lidar", "a")]
    rows = tracks[(tracks["sensor"] == "lidar") & (tracks["target"] == "a")]
    figure, name, alt, caption = charts.nees_shown("lidar", mine, rows)
    (ax,) = figure.axes
    assert ax.get_yscale() == "log"
    low, high = chi_square_interval(2)
    assert ax.get_ylim()[0] < low < high < ax.get_ylim()[1]
    labelled = [line for line in ax.get_lines() if not line.get_label().startswith("_")]
    np.testing.assert_array_equal(labelled[0].get_ydata(), mine[0].nees)
    assert [line.get_label() for line in labelled] == ["white noise", "differenced", "Schmidt"]
    assert name == "nees-lidar"
    assert ax.get_title(loc="left") == "Lidar: most often inside is differenced and Schmidt"
    assert "Schmidt 100 %" in caption
    assert "95 percent band" in alt


def test_innovations_beside_the_band_of_white_noise(
    followed: list[SensorTrack], tracks: pd.DataFrame
) -> None:
    mine = [one for one in followed if (one.sensor, one.target) == ("lidar", "a")]
    rows = tracks[(tracks["sensor"] == "lidar") & (tracks["target"] == "a")]
    figure, *_ = charts.innovations_shown("lidar", mine, rows)
    (ax,) = figure.axes
    assert len(ax.get_lines()) == 4
    assert all(line.get_ydata()[0] == pytest.approx(1.0) for line in ax.get_lines())


def test_mean_nees_of_all_tracks(tracks: pd.DataFrame) -> None:
    figure, _, _, _ = charts.mean_nees_shown(tracks)
    (ax,) = figure.axes
    assert ax.get_title(loc="left") == "With white noise, 2 of 3 tracks are overconfident"
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["lidar", "colour\ncamera"]
