"""Telemetry logs: values, clocks against the truth, damage of all kinds."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from tests.flight.readers.mavlink_logs import BOOT_S, START_S, frame, joined, made, telemetry
from tests.flight.readers.tracks import Reader, check, near
from wildlab.flight.readers import recognise
from wildlab.flight.readers.telemetry import walk

tlog = Reader("tlog")

PATH = Path("flight.tlog")


def read(data: bytes) -> Any:
    log = tlog.read(PATH, data)
    check(log)
    return log


def decoded(data: bytes) -> list[tuple[float, Any]]:
    """(receipt, message) of a sound log, by pymavlink."""
    library = ardupilotmega.MAVLink(None)
    at, found = 0, []
    while at < len(data):
        size = data[at + 9] + (8 if data[at + 8] == 0xFE else 12)
        message = library.decode(bytearray(data[at + 8 : at + 8 + size]))
        found.append((int.from_bytes(data[at : at + 8], "big") / 1e6, message))
        at += 8 + size
    return found


def test_sample(shared_data):
    data = shared_data("logs", "cuav2018_sar", "flight.tlog").read_bytes()
    assert recognise(data[:8192]) == "tlog"
    log = read(data)
    sizes = {"poses": 604, "gnss": 732, "imu": 771, "magnetometer": 771}
    assert {name: len(part) for name, part in log.parts.items()} == sizes
    assert (log.lost, log.clock) == ((), "times of receipt")
    # Receipts are never early, and were up to 0.9 s late.
    receipts = {m.time_boot_ms: at for at, m in decoded(data) if m.get_type() == "ATTITUDE"}
    poses = log.parts["poses"].columns
    late = np.array([receipts[round(ms * 1e3)] for ms in poses["time_log_s"]]) - poses["time_s"]
    assert -0.005 < late.min() < 0.01 and 0.8 < late.max() < 1.0
    assert np.median(log.parts["imu"].columns["f_z_m_s2"]) == pytest.approx(-9.8, abs=2.0)


def test_vehicles_own_utc_is_taken_where_it_is_near_the_receipts():
    told = []
    for row in range(30):
        boot, unix = round((BOOT_S + row) * 1e3), round((START_S + row + 3.0) * 1e6)
        text = made("SYSTEM_TIME", time_boot_ms=boot, time_unix_usec=unix)
        told.append((START_S + row + 0.2, frame(text, START_S + row + 0.2)))
    log = read(joined(telemetry(), told))
    assert log.clock == "UTC of the messages SYSTEM_TIME"
    poses = log.parts["poses"].columns
    near(poses, 1e-3, time_s=START_S + 3 + poses["time_log_s"] - BOOT_S)


def test_restart_has_a_clock_of_its_own():
    log = read(joined(telemetry(300), telemetry(100, boot_s=5.0, start_s=START_S + 100, heartbeat=False)))
    poses = log.parts["poses"]
    later = poses.columns["time_log_s"] < BOOT_S
    assert later.sum() == 100
    after = {name: values[later] for name, values in poses.columns.items()}
    near(after, 0.02, time_s=START_S + 100 + after["time_log_s"] - 5.0)
    # No place is made up between the two.
    assert poses.used.sum() == 398


def test_fields_that_old_senders_leave_away_and_new_ones_append():
    sender = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    text = made("GPS_RAW_INT", fix_type=3)
    old = text.unpacker.pack(1, 5, *([0] * 14))[:30]
    plain = frame(text, START_S)[:8] + text._pack(sender, text.crc_extra, old, force_mavlink1=True)
    assert walk(plain).of("GPS_RAW_INT").get("h_acc").tolist() == [0]
    text = made("ATTITUDE", time_boot_ms=1000, yawspeed=2.0)
    body = text.unpacker.pack(1000, 0, 0, 0, 0, 0, 2.0) + b"\x07" * 9
    longer = text._pack(sender, text.crc_extra, body)
    found = walk(plain[:8] + longer).of("ATTITUDE")
    assert found.get("yawspeed").tolist() == [2.0]


def test_signed_frames_and_unknown_messages_are_passed():
    sender = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    sender.signing.secret_key = bytes(32)
    sender.signing.sign_outgoing = True
    sender.signing.link_id = 1
    sender.signing.timestamp = 1
    stamp = plain = frame(made("ATTITUDE", time_boot_ms=4000), START_S)
    signed = stamp[:8] + made("ATTITUDE", time_boot_ms=3000).pack(sender)
    unknown = bytearray(plain)
    unknown[15:18] = (3_000_000).to_bytes(3, "little")
    frames = walk(signed + bytes(unknown) + plain)
    assert frames.of("ATTITUDE").get("time_boot_ms").tolist() == [3000, 4000]
    assert frames.of("ATTITUDE").rows.tolist() == [1, 3]
    assert read(joined(telemetry(20)) + bytes(unknown) + plain).lost


def test_clocks_without_end_take_no_time():
    rows = []
    for row in range(4000):
        at = START_S + row * 0.01
        rows.append((at, frame(made("ATTITUDE", time_boot_ms=1000 + 60_000 * (row % 2) + row * 10), at)))
    began = time.monotonic()
    read(joined(rows))
    assert time.monotonic() - began < 5.0


def with_messages(make: Any, count: int = 50, component: int = 1) -> Any:
    rows = []
    for row in range(count):
        at = START_S + row * 0.2 + 0.02
        rows.append((at, frame(make(row, round((BOOT_S + row * 0.2) * 1e3)), at, 1, component)))
    return read(joined(telemetry(60, jitter_s=0.0), rows))


@pytest.mark.parametrize("name", ["SCALED_IMU", "RAW_IMU", "HIGHRES_IMU"])
def test_inertial_units(name):
    acc, rate, field = (9.80665, 0.5, 0.4) if name == "HIGHRES_IMU" else (1000, 500, 400)

    def make(row: int, ms: int) -> Any:
        stamp = {"time_boot_ms": ms} if name == "SCALED_IMU" else {"time_usec": ms * 1000}
        return made(name, **stamp, zacc=-acc, xgyro=rate, ymag=field)

    parts = with_messages(make).parts
    near(parts["imu"].columns, 1e-5, f_z_m_s2=-9.80665, w_x_rad_s=0.5)
    near(parts["magnetometer"].columns, 1e-4, field_y_ut=40)
    near(parts["imu"].columns, 2e-3, time_s=START_S + np.arange(50) * 0.2)


def test_raw_counts_are_no_inertial_units():
    log = with_messages(lambda row, ms: made("RAW_IMU", time_usec=ms * 1000, zacc=-16384))
    assert "imu" not in log.parts


def test_camera_feedback():
    def make(row: int, ms: int) -> Any:
        where = {"lat": 634_000_000, "lng": 104_000_000} if row else {}
        above = {"alt_msl": 120.0, "alt_rel": 20.0, "yaw": 90.0}
        usec = round((START_S + row * 0.2) * 1e6)
        return made("CAMERA_FEEDBACK", time_usec=usec, img_idx=row, **above, **where)

    part, k = with_messages(make).parts["triggers"], np.arange(50)
    assert part.used.all()
    near(part.columns, 1e-5, number=k, time_s=START_S + k * 0.2)
    near(part.columns, latitude_deg=np.where(k, 63.4, np.nan), height_home_m=np.where(k, 20, np.nan))


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
    wanted = np.arange(50)[used] if turned else 0.0
    assert np.allclose(part.columns["yaw_world_deg"][used], wanted, atol=0.05)


@pytest.mark.parametrize("absolute", [True, False])
def test_mount_orientation(absolute):
    def make(row: int, ms: int) -> Any:
        more = {"yaw_absolute": 33.0} if absolute else {}
        return made("MOUNT_ORIENTATION", time_boot_ms=ms, roll=1.0, pitch=-90.0, yaw=20.0, **more)

    part = with_messages(make).parts["gimbal"]
    used = part.used
    near(part.columns, 0, pitch_world_deg=-90)
    wanted = 33.0 if absolute else np.arange(50)[used] + 20
    assert np.allclose(part.columns["yaw_world_deg"][used], wanted, atol=0.05)
