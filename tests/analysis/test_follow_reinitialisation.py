"""A target out of sight for long: its track ends when it is too uncertain, and another finds it again.

A track is judged where its target was seen; where it was not is a number of its own.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from tests.analysis.robots import KNOWN, joined, paused, robot_flight, rows_of
from wildlab.analysis.tracks import single_target, tracker
from wildlab.analysis.tracks.noise_model import NoiseModel, SensorInputs, TargetModel
from wildlab.analysis.tracks.scans import Scans, Truth, sensor_of
from wildlab.analysis.tracks.single_target import SensorTrack, ends_of, track_target
from wildlab.analysis.tracks.tracker import TrackingResult, estimates_table, score_tracks, seen_of, used_of
from wildlab.flight.manifest import parse_settings
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.tracking.sensors import SensorMeasurements, merge

CAMERA = Camera(640, 512, 1100.0, 1100.0, 320.0, 256.0)
HEIGHT, TILT, NOISE_PX = 60.0, 0.6, 2.0
TARGETS = TargetModel(0.5, 5.0, 0.99, 10.0, 20.0, 0.1, float("nan"), None)
FILTERS = ("ekf", "ukf", "imm", "coloured")


@cache
def watched(pause_s: float = 200.0) -> tuple[Scans, Truth]:
    """A hovering camera sees an animal that wanders for ten seconds, and again after a pause."""
    rng = np.random.default_rng(0)
    times = np.arange(0.0, 20.0 + pause_s, 0.2)
    middle = np.array([0.0, -HEIGHT * np.tan(TILT)])
    place = middle + np.column_stack([3 * np.sin(times / 5), 2 * np.cos(times / 7)])
    velocity = np.column_stack([0.6 * np.cos(times / 5), -2 / 7 * np.sin(times / 7)])
    n = len(times)
    R_nb = np.tile(euler_to_matrix(TILT, 0.0, 0.0), (n, 1, 1))
    poses = CameraPoses(CAMERA, Mount(), np.tile([0.0, 0.0, -HEIGHT], (n, 1)), R_nb)
    uv = ground_to_pixel(CAMERA, np.column_stack([place, np.zeros(n)]), poses.p_nc, poses.R_nc)
    assert np.isfinite(uv).all()
    uv += rng.normal(0, NOISE_PX, uv.shape)
    uv[(times > 10) & (times < 10 + pause_s)] = np.nan
    labels = np.where(np.isfinite(uv[:, :1]), "deer", "").astype(object)
    ids = np.array([[f"d{k}"] for k in range(n)], object)
    still = np.zeros((n, 2))
    scans = Scans(
        "camera", "pixel", times, uv[:, None], still, still, ("u", "v"), labels, ids,
        drop=np.full(n, HEIGHT), plane_down=np.zeros(n), poses=poses,
    )  # fmt: skip
    return scans, Truth("deer", place, velocity, 0.0)


def beliefs(scans: Scans) -> NoiseModel:
    nan, sd = float("nan"), np.full(2, NOISE_PX)
    return NoiseModel("camera", scans.kind, 0.0, sd, sd, (), 0.0, 1.0, nan, nan, nan, scans.interval_s)


def follow(pause_s: float = 200.0) -> list[SensorTrack]:
    return by_camera(*watched(pause_s))


def by_camera(
    scans: Scans, truth: Truth, filters: tuple[str, ...] = FILTERS, targets: TargetModel = TARGETS
) -> list[SensorTrack]:
    one = SensorInputs(scans, beliefs(scans), [truth])
    return track_target({"camera": one}, "deer", targets, filters)


def off_after(one: SensorTrack) -> float:
    """Root mean square distance where the target is seen again, m."""
    again = seen_of(one) & (one.times > 100)
    return float(np.sqrt(np.mean(np.sum(one.error[again, :2] ** 2, axis=1))))


@pytest.mark.slow
def test_a_track_through_a_long_gap_finds_its_target_again(monkeypatch):
    on_ground = NOISE_PX / CAMERA.fx * HEIGHT / np.cos(TILT) ** 2
    followed = follow()
    for one in followed:
        assert len(one.starts) == 2 and one.times[one.starts[1]] == pytest.approx(210.0)
        assert off_after(one) < 2 * np.sqrt(2) * on_ground
    monkeypatch.setattr(single_target, "ends_of", lambda *given: None)
    without = follow()
    assert len(without[0].starts) == 1
    assert off_after(without[0]) > 10 * off_after(followed[0])


def test_all_filters_are_compared_over_the_same_looks_and_none_is_dropped_silently():
    followed = follow()
    scans, _ = watched()
    sensor = {"camera": scans}, {"camera": beliefs(scans)}
    rows = score_tracks(TrackingResult(followed, *sensor, TARGETS, [], [], True))
    first = followed[0]
    for one in followed:
        assert (np.isfinite(one.estimate) == np.isfinite(first.estimate)).all()
        assert (one.starts == first.starts).all() and (one.detection == first.detection).all()
    for _, row in rows.iterrows():
        assert row["restarts"] == 1 and row["untracked_in_view"] == 0
        assert row["compared"] + row["without"] + row["untracked"] == row["spanned"]
        assert row["compared"] == seen_of(first).sum() == row["used"]
        assert row["detections"] == row["used"] - 2  # the two that tracks were put on
        # The table says which of the two a row is of.
        table = estimates_table([one], sensor[0])
        times = one.times[one.starts]
        right = 1 + (table["time_s"] >= times[1]).to_numpy(int)
        assert (table["track"] == right).all() and set(right) == {1, 2}
    # The track ends within the pause, and not at once.
    ended = first.times[np.flatnonzero(first.without)[0]]
    assert 11.0 < ended < 60.0 and first.without.sum() > 0.7 * 5 * 200


@pytest.mark.parametrize(
    ("share", "gap_s", "right"), [(1.02, 11.0, True), (0.98, 11.0, False), (9.0, 9.0, False)]
)
@pytest.mark.parametrize("where", ["then", "now"])
def test_a_track_ends_where_more_is_left_out_than_stated_and_not_before_a_gap(share, gap_s, right, where):
    """Of a range of 100 m: 3 s^4 / (4 d^2) is left out for a spread s across the line of sight."""
    s, times = 8.0, {"then": 0.0, "now": gap_s}
    sharp = np.sqrt(3 * s**4 / (4 * 100.0**2) / share)
    inputs, seen, parts = {}, {}, []
    for name, time in times.items():
        one, z = np.zeros((1, 2)), np.array([[[100.0, 0.0]]])
        scans = Scans(
            name, "range-bearing", np.array([time]), z, one, one, ("range", "azimuth"), drop=np.zeros(1)
        )
        white, nan = np.array([sharp if name == where else 1e3, 1e3]), float("nan")
        noise = NoiseModel(name, scans.kind, 0.0, white, white, (), 0.0, 1.0, nan, nan, nan, 20 / 3)
        inputs[name], seen[name] = SensorInputs(scans, noise, []), z
        parts.append(SensorMeasurements(scans.times, z, np.eye(2), sensor_of(scans, one)))
    ends = ends_of(inputs, merge(parts), seen)
    P = np.diag([0.0, s**2, 1.0, 1.0])
    assert ends is not None and ends(1, 0, np.array([100.0, 0.0, 0.0, 0.0]), P) is right


@pytest.mark.slow
def test_a_target_at_rest_is_one_track_through_any_gap():
    """By a motion model without acceleration and speed, told or because its truth has no time."""
    scans, truth = watched()
    assert scans.poses is not None
    rng, n = np.random.default_rng(1), len(scans.times)
    place = np.tile(truth.position[0], (n, 1))
    uv = ground_to_pixel(
        CAMERA, np.column_stack([place, np.zeros(n)]), scans.poses.p_nc, scans.poses.R_nc
    ) + rng.normal(0, NOISE_PX, (n, 2))  # fmt: skip
    uv[np.isnan(scans.detections[:, 0, 0])] = np.nan
    scans, still = scans._replace(detections=uv[:, None]), Truth("deer", place, 0 * place, 0.0)
    assert len(by_camera(scans, still)[0].starts) == 2
    rest = TARGETS._replace(density=0.0, start_speed_m_s=0.0)
    told = by_camera(scans, still, ("ekf", "ukf", "coloured", "ekf-smoothed"), rest)
    marked = by_camera(scans, still._replace(fixed=True), ("ekf", "ukf", "coloured", "ekf-smoothed"))
    on_ground = NOISE_PX / CAMERA.fx * HEIGHT / np.cos(TILT) ** 2
    for one, other in zip(told, marked, strict=True):
        assert np.array_equal(one.estimate, other.estimate, equal_nan=True)
        assert len(one.starts) == 1 and not one.estimate[-1, 2:].any()
        assert np.hypot(*one.error[-1, :2]) < on_ground
        # On differences nothing is learnt of an error that stays.
        few = 1 if one.filter == "coloured" else 50
        assert np.sqrt(one.covariance[-1, 0, 0]) < on_ground / np.sqrt(few)


@pytest.mark.slow
def test_sensors_together_start_anew_too_and_a_smoother_stays_within_each_track():
    precise = {"range_sd": 0.1, "bearing_sd_deg": 0.1, "seconds": 180.0}
    flights = (robot_flight(k, sensor=name, **precise) for k, name in enumerate(("radar", "lidar"), 1))
    flight = joined(*(paused(one, 40, 130) for one in flights))
    noise = "".join(f"[sensors.{n}.noise]\nrange_m = 0.1\nazimuth_deg = 0.1\n" for n in ("radar", "lidar"))
    settings = parse_settings(noise + "[targets]\nacceleration_m_s_sqrt_s = 0.5\nstart_speed_m_s = 2.0\n")
    found = tracker.track(flight, settings=settings, filters=["ekf", "ukf", "imm"], smooth=True)
    rows = rows_of(found, "together")
    assert set(rows.index) == {"ekf", "ekf-smoothed", "ukf", "ukf-smoothed", "imm"}
    assert (
        (rows["restarts"] == 1).all()
        and (rows["untracked"] > 0).all()
        and (rows["untracked_in_view"] == 0).all()
    )
    assert (rows["compared"] + rows["without"] + rows["untracked"] == rows["spanned"]).all()
    assert (rows["rmse"] < 0.5).all()
    for mine in (track for track in found.tracks if track.sensor == "together"):
        assert mine.times[mine.starts[1]] > 130


def test_errors_of_a_long_wait_are_not_those_of_the_track_that_is_seen():
    followed = tracker.track(paused(robot_flight(3), 40, 90), settings=parse_settings(KNOWN))
    row = rows_of(followed).loc["ekf"]
    one = next(one for one in followed.tracks if one.filter == "ekf")
    away, used = np.hypot(*one.error[:, :2].T), used_of(one)
    known = np.isfinite(away)
    assert row["rmse"] == pytest.approx(np.sqrt(np.mean(away[used & known] ** 2)))
    assert row["rmse_without"] == pytest.approx(np.sqrt(np.mean(away[~used & known] ** 2)))
    assert row["rmse"] < 1.5 < 3 < row["rmse_without"]
    assert row["nees"] == pytest.approx(np.nanmean(one.nees[used]))
    assert row["compared"] == (used & known).sum()
    # The track ends within the wait: looks without one are counted, and are in neither number.
    assert row["without"] + row["untracked"] == 101 and row["untracked"] > 0 and row["restarts"] == 1


def test_a_track_that_lost_its_target_is_judged_where_the_target_was_seen():
    """What a gate no longer lets in was seen all the same."""
    flight = robot_flight(3, labelled=False)
    flight.tables["detections"].loc[119:, "range_m"] += 6.0  # after a minute
    row = rows_of(tracker.track(flight, settings=parse_settings(KNOWN))).loc["ekf"]
    assert row["compared"] > row["used"]


def test_each_gap_is_asked_about_the_place_before_it(monkeypatch):
    """Seen bent north of zero alone: a track that was last there ends, whatever was asked before."""

    def bend_of(_):
        return lambda row, place: (np.full((2, 2, 2), 100.0 * (place[0] > 0)), np.eye(2))

    monkeypatch.setattr(single_target, "bend_of", bend_of)
    inputs = {"camera": SimpleNamespace(noise=SimpleNamespace(longest_gap_s=1.0))}
    none = np.zeros(9, int)
    merged = SimpleNamespace(times=np.arange(9.0), which=none, rows=np.arange(9))
    ends = single_target.ends_of(inputs, merged, {"camera": np.full((9, 1, 2), np.nan)})
    south, north = np.array([-5.0, 0.0, 0.0, 0.0]), np.array([5.0, 0.0, 0.0, 0.0])
    asked = [(3, 0, south), (4, 0, south), (8, 5, north), (8, 5, south), (6, 5, north)]
    assert [ends(row, last, x, np.eye(4)) for row, last, x in asked] == [False, False, True, False, False]
