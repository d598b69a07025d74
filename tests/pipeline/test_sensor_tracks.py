"""Sensors tuned and targets followed on made-up flights whose clocks, noises and correlations are known."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.manifest import make_manifest
from wildlab.flight.store import Flight
from wildlab.pipeline.following.beliefs import from_tuning
from wildlab.pipeline.following.expected import errors_near
from wildlab.pipeline.following.sensor_tracks import SensorTrack, follow_flight, table
from wildlab.pipeline.following.sensor_tuning import SensorTuning
from wildlab.pipeline.following.starts import start_near
from wildlab.pipeline.scans import scans_of, sensors_of, truths_at
from wildlab.studies.autoferry.boats import BOATS, tune_sensor


def boats(t: np.ndarray) -> dict[str, np.ndarray]:
    """Two boats that turn a little, so that an offset of the clock is no offset of the place."""
    one = np.column_stack([-100 + 2.0 * t, 60 + 15 * np.sin(t / 12)])
    two = np.column_stack([150 - 1.5 * t, -80 - 12 * np.cos(t / 9)])
    return {"one": one, "two": two}


def platform(t: np.ndarray) -> np.ndarray:
    return np.column_stack([0.4 * t, 20 * np.sin(t / 30)])


def markov(rng: np.random.Generator, n: int, sd: float, correlation: float, m: int) -> np.ndarray:
    e = np.empty((n, m))
    e[0] = rng.normal(0, sd, m)
    for k in range(1, n):
        e[k] = correlation * e[k - 1] + rng.normal(0, sd * np.sqrt(1 - correlation**2), m)
    return e


def make(
    seed: int = 0,
    *,
    late_s: float = 0.0,
    sd: float = 2.0,
    correlation: float = 0.0,
    truth_until: float = 200.0,
    sees: tuple[str, ...] = ("one", "two"),
    seconds: float = 120.0,
    kind: str = "position",
    pace: float = 1.0,
) -> Flight:
    """A flight with a lidar (2 Hz) whose stamps are ``late_s`` late; every seventh look sees nothing."""
    rng = np.random.default_rng(seed)
    stamps = np.arange(2.0, seconds, 0.5)
    when = stamps - late_s
    own, at_stamp = platform(when), platform(stamps)
    rows = []
    for name in sees:
        size = sd if kind == "position" else np.radians(sd)
        noise = markov(rng, len(when), size, correlation, 2 if kind == "position" else 1)
        offset = boats(pace * when)[name] - own
        for k in range(len(when)):
            if k % 7 == 3:
                continue
            row = {"detection_id": f"{name}-{k}", "frame_id": f"lidar-{k}", "source": "lidar", "kind": kind}
            if kind == "position":
                # What is published is relative to own ship, and its position at the stamp was added.
                north, east = offset[k] + noise[k] + at_stamp[k]
                row |= {"north_m": north, "east_m": east, "down_m": 0.0}
            else:
                row |= {"azimuth_rad": np.arctan2(offset[k, 1], offset[k, 0]) + noise[k, 0]}
            rows.append(row)
    t = np.arange(0.0, seconds + 5, 0.2)
    nav = pd.DataFrame({"time_s": t, "down_m": 0.0, "q_w": 1.0, "q_x": 0.0, "q_y": 0.0, "q_z": 0.0})
    nav[["north_m", "east_m"]] = platform(t)
    truth = []
    for name, path in boats(pace * t).items():
        one = pd.DataFrame({"target_id": name, "time_s": t, "down_m": 0.0, "sd_horizontal_m": 0.1})
        one[["north_m", "east_m"]] = path
        truth.append(one[one["time_s"] <= truth_until])
    manifest = make_manifest(
        {
            "name": "made-up",
            "kind": "logged",
            "origin": {"latitude_deg": 63.0, "longitude_deg": 10.0, "height_m": 0.0},
            "platform": {"name": "ferry"},
            "time": {"kind": "utc", "epoch": "2024-05-04T12:00:00Z"},
        }
    )
    frames = pd.DataFrame(
        {"frame_id": [f"lidar-{k}" for k in range(len(stamps))], "time_s": stamps, "sensor": "lidar"}
    )
    detections = pd.DataFrame(rows)
    tables = {"frames": frames, "detections": detections, "truth": pd.concat(truth, ignore_index=True)}
    return Flight(manifest, {"own": nav}, tables)


def by_filter(followed: list[SensorTrack], target: str = "one") -> pd.DataFrame:
    rows = table(followed)
    return rows[rows["target"] == target].set_index("filter")


# --- scans --------------------------------------------------------------------------------------------------


def test_looks_keep_those_that_saw_nothing():
    flight = make(sd=0.0)
    scans = scans_of(flight, "lidar")
    assert sensors_of(flight) == ["lidar"]
    assert scans.detections.shape == (len(flight.table("frames")), 2, 2)
    empty = np.isnan(scans.detections).all(axis=(1, 2))
    np.testing.assert_array_equal(np.flatnonzero(empty), np.arange(3, len(empty), 7))
    assert scans.interval_s == pytest.approx(0.5)
    np.testing.assert_allclose(scans.platform, platform(scans.times), atol=0.02)
    slope = (platform(scans.times + 1e-3) - platform(scans.times - 1e-3)) / 2e-3
    np.testing.assert_allclose(scans.platform_velocity[2:], slope[2:], atol=0.01)


def test_what_a_late_sensor_saw_stands_where_the_platform_was_then():
    scans = scans_of(make(sd=0.0, late_s=1.5), "lidar", -1.5)
    truth = truths_at(make(), scans.times)[0]
    error, which = errors_near(scans, truth, BOATS.reach_m)
    seen = which >= 0
    assert seen.sum() > 150
    assert np.abs(error[seen]).max() < 0.02
    uncorrected = scans_of(make(sd=0.0, late_s=1.5), "lidar")
    late = errors_near(uncorrected, truths_at(make(), uncorrected.times)[0], BOATS.reach_m)[0]
    assert np.nanmean(np.hypot(*late.T)) > 2


def test_what_cannot_be_followed_is_said():
    flight = make()
    with pytest.raises(WildlabError, match="'radar'"):
        scans_of(flight, "radar")
    seen = flight.tables["detections"]
    seen.loc[seen.index[0], "kind"] = "pixel"
    with pytest.raises(WildlabError, match="one kind"):
        scans_of(flight, "lidar")
    del flight.tables["frames"]["sensor"]
    assert sensors_of(flight) == ["lidar"]  # who detected is who looked
    flight.tables["detections"] = seen.iloc[:0]
    with pytest.raises(WildlabError, match="no detections"):
        sensors_of(flight)


# --- tuning -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_clock_noise_and_correlation_come_back():
    correlation = float(np.exp(-0.5 / 6.0))
    found = [tune_sensor(make(seed, late_s=1.5, correlation=correlation), "lidar") for seed in range(6)]
    assert np.mean([one.offset_s for one in found]) == pytest.approx(-1.5, abs=0.15)
    inside = [one.offset_low_s - 0.05 <= -1.5 <= one.offset_high_s + 0.05 for one in found]
    assert sum(inside) >= 5
    assert np.mean([one.sd for one in found]) == pytest.approx(2.0, rel=0.12)
    assert np.mean([one.correlation_time_s for one in found]) == pytest.approx(6.0, rel=0.4)
    assert np.mean([one.next_correlation for one in found]) == pytest.approx(correlation, abs=0.05)
    assert np.mean([one.driving_sd for one in found]) == pytest.approx(
        2 * np.sqrt(1 - correlation**2), rel=0.15
    )


# --- following ----------------------------------------------------------------------------------------------


def quiet(**changes: float) -> SensorTuning:
    base = SensorTuning("lidar", "position", 0, 0, 0, 2.0, 0.8, 5.0, 1.5, 0.1, 0.01, 100, 50, 0.5, 100)
    return base._replace(**changes)


def test_a_track_does_not_start_on_another_target():
    flight = make(6, sees=("two",), sd=0.1)
    # One is where two is at first, but three metres beside it; only two was seen.
    truth = flight.tables["truth"]
    two = truth[truth["target_id"] == "two"]
    beside = two.assign(target_id="one", north_m=two["north_m"] + 3.0)
    flight.tables["truth"] = pd.concat([beside, two], ignore_index=True)
    scans = scans_of(flight, "lidar")
    one, other = truths_at(flight, scans.times)
    assert start_near(scans, one, from_tuning(quiet()), BOATS) is not None
    assert start_near(scans, one, from_tuning(quiet()), BOATS, [other]) is None
    start = start_near(scans, other, from_tuning(quiet()), BOATS, [one])
    assert start is not None
    np.testing.assert_allclose(start.x[:2], other.position[0], atol=0.5)
    np.testing.assert_allclose(start.P[:2, :2], np.eye(2) * BOATS.reach_m**2)
    rows = by_filter(follow_flight(flight, {"lidar": quiet()}, BOATS))
    assert (rows["share_followed"] == 0).all()
    assert rows["rmse"].isna().all()


def test_a_track_is_with_its_target_where_it_is_near_it_while_that_is_seen():
    n = 40
    estimate, near = np.zeros((n, 4)), np.arange(n) < 30
    error = np.zeros((n, 4))
    error[10:, 0] = BOATS.size_m + 1.0  # it strays
    error[20:] = np.nan  # and ends, while the target is still seen
    nan, known = np.full(n, np.nan), np.ones(n, bool)
    one = SensorTrack(
        "lidar",
        "one",
        "kf",
        np.arange(n) / 2,
        estimate,
        error,
        nan,
        np.full((n, 2), np.nan),
        nan,
        known,
        near,
        np.tile(np.eye(4), (n, 1, 1)),
    )
    (row,) = table([one], BOATS.size_m).to_dict(orient="records")
    assert (row["seen"], row["share_with_target"]) == (30, pytest.approx(1 / 3))
    unseen = table([one._replace(near=np.zeros(n, bool))], BOATS.size_m).iloc[0]
    assert unseen["seen"] == 0 and np.isnan(unseen["share_with_target"])
