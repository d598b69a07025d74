"""Inertial sensors, cameras and gimbals of telemetry logs, in made-up ones."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.flight.readers.mavlink_logs import BOOT_S, START_S, frame, joined, made, telemetry
from tests.flight.readers.tracks import check, near
from wildlab.flight.readers.mavlink import telemetry as tlog

PATH = Path("flight.tlog")


def read(data: bytes) -> Any:
    return tlog.read(PATH, data)


def with_messages(make: Any, count: int = 50, component: int = 1) -> Any:
    rows = [
        (
            START_S + row * 0.2 + 0.02,
            frame(make(row, round((BOOT_S + row * 0.2) * 1e3)), START_S + row * 0.2 + 0.02, 1, component),
        )
        for row in range(count)
    ]
    return read(joined(telemetry(60, jitter_s=0.0), rows))


@pytest.mark.parametrize("name", ["SCALED_IMU", "RAW_IMU", "HIGHRES_IMU"])
def test_inertial_units(name):
    si = name == "HIGHRES_IMU"

    def make(row: int, ms: int) -> Any:
        stamp = {"time_boot_ms": ms} if name == "SCALED_IMU" else {"time_usec": ms * 1000}
        acc = 9.80665 if si else 1000
        rate, field = (0.5, 0.4) if si else (500, 400)
        return made(name, **stamp, zacc=-acc, xgyro=rate, ymag=field)

    log = with_messages(make)
    check(log)
    near(log.parts["imu"].columns, 1e-05, f_z_m_s2=-9.80665)
    near(log.parts["imu"].columns, w_x_rad_s=0.5)
    near(log.parts["magnetometer"].columns, 0.0001, field_y_ut=40)
    near(log.parts["imu"].columns, 0.002, time_s=START_S + np.arange(50) * 0.2)


def test_raw_counts_are_no_inertial_units():
    log = with_messages(lambda row, ms: made("RAW_IMU", time_usec=ms * 1000, zacc=-16384))
    assert "imu" not in log.parts


def test_camera_feedback():
    def make(row: int, ms: int) -> Any:
        where = {"lat": 634_000_000, "lng": 104_000_000} if row else {}
        return made(
            "CAMERA_FEEDBACK",
            time_usec=round((START_S + row * 0.2) * 1e6),
            img_idx=row,
            alt_msl=120.0,
            alt_rel=20.0,
            yaw=90.0,
            **where,
        )

    part = with_messages(make).parts["triggers"]
    assert part.used.all()
    near(part.columns, 0, number=np.arange(50))
    near(part.columns, time_s=START_S + np.arange(50) * 0.2)
    assert np.isnan(part.columns["latitude_deg"][0])
    assert np.allclose(part.columns["latitude_deg"][1:], 63.4)
    assert (part.columns["height_home_m"][1:] == 20).all()


def test_camera_trigger_since_start():
    part = with_messages(lambda row, ms: made("CAMERA_TRIGGER", time_usec=ms * 1000, seq=row)).parts[
        "triggers"
    ]
    near(part.columns, 0.002, time_s=START_S + np.arange(50) * 0.2)


def yaw_of_vehicle(count: int) -> Any:
    return np.arange(count) % 90


@pytest.mark.parametrize(
    ("flags", "turned"), [(0, True), (32, True), (64, False), (16, False), (16 | 32, True)]
)
def test_gimbal_device(flags, turned):
    q = [np.cos(np.pi / 4), 0.0, -np.sin(np.pi / 4) * 0.9, 0.0]
    q = [one / np.linalg.norm(q) for one in q]
    pitch = -2 * np.degrees(np.arccos(q[0]))
    log = with_messages(
        lambda row, ms: made("GIMBAL_DEVICE_ATTITUDE_STATUS", time_boot_ms=ms, q=q, flags=flags),
        component=154,
    )
    part = log.parts["gimbal"]
    used = part.used
    assert used.sum() >= 48
    assert np.allclose(part.columns["pitch_world_deg"][used], pitch, atol=1e-3)
    wanted = yaw_of_vehicle(50)[used] if turned else 0.0
    assert np.allclose(part.columns["yaw_world_deg"][used], wanted, atol=0.05)


@pytest.mark.parametrize("absolute", [True, False])
def test_mount_orientation(absolute):
    def make(row: int, ms: int) -> Any:
        more = {"yaw_absolute": 33.0} if absolute else {}
        return made("MOUNT_ORIENTATION", time_boot_ms=ms, roll=1.0, pitch=-90.0, yaw=20.0, **more)

    part = with_messages(make).parts["gimbal"]
    used = part.used
    near(part.columns, 0, pitch_world_deg=-90)
    wanted = 33.0 if absolute else yaw_of_vehicle(50)[used] + 20
    assert np.allclose(part.columns["yaw_world_deg"][used], wanted, atol=0.05)


def test_mount_status_says_what_it_leaves_open():
    log = with_messages(lambda row, ms: made("MOUNT_STATUS", pointing_a=-4500, pointing_b=100))
    part = log.parts["gimbal"]
    near(part.columns, 0, pitch_world_deg=-45, roll_world_deg=1)
