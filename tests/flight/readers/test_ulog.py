"""PX4 logs: values against pyulog on the whole file, both generations of names, damage of all kinds."""

import struct
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from tests.flight.readers.mavlink_logs import START_S, message, ulog
from tests.flight.readers.tracks import Reader, check, near
from wildlab.errors import WildlabError
from wildlab.flight.readers import recognise
from wildlab.flight.readers.telemetry import TOPICS

reader = Reader("ulog")

PATH = Path("flight.ulg")
SAMPLES = [("px4_quad_clean_short", "test.ulg"), ("px4_quad_ekf_failure", "ekf_failure.ulg")]
LAT, LON = 63.4, 10.4

ATTITUDE = "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;"
PLACE = "uint64_t timestamp;double lat;double lon;float alt;float eph;float epv;"
NEW_GPS = (
    "uint64_t timestamp;double latitude_deg;double longitude_deg;double altitude_msl_m;"
    "double altitude_ellipsoid_m;uint64_t time_utc_usec;float eph;float epv;float s_variance_m_s;"
    "float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;uint8_t fix_type;uint8_t satellites_used;"
    "bool vel_ned_valid;"
)
OLD_GPS = (
    "uint64_t time_utc_usec;uint64_t timestamp;int32_t lat;int32_t lon;int32_t alt;int32_t alt_ellipsoid;"
    "float s_variance_m_s;float eph;float epv;float hdop;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
    "int32_t timestamp_time_relative;uint8_t fix_type;bool vel_ned_valid;uint8_t satellites_used;"
)


def us(row: int, step_s: float = 0.1) -> int:
    return round((100 + row * step_s) * 1e6)


def attitude() -> tuple[str, list[tuple[Any, ...]]]:
    half = np.radians(30) / 2
    return ATTITUDE, [(us(k), us(k) - 400, np.cos(half), 0.0, 0.0, np.sin(half)) for k in range(50)]


def place() -> tuple[str, list[tuple[Any, ...]]]:
    return PLACE, [(us(k), LAT + 1e-6 * k, LON, 120.0 + k, 0.5, 0.7) for k in range(50)]


def new_gps(ellipsoid: float = 160.0, valid: bool = True) -> tuple[str, list[tuple[Any, ...]]]:
    rows = []
    for k in range(25):
        utc = round((START_S + k * 0.2) * 1e6)
        where = (LAT + 1e-7 * k, LON, 120.0, ellipsoid, utc, 0.9, 1.5, 0.2)
        rows.append((us(2 * k), *where, 5.0, 0.0, 0.0, 3, 14, valid))
    return NEW_GPS, rows


def read(data: bytes) -> Any:
    log = reader.read(PATH, data)
    check(log)
    return log


def part_of(name: str, **more: Any) -> Any:
    return reader.read(PATH, ulog(flight(**more))).parts[name]


def flight(**more: Any) -> dict[str, Any]:
    return {
        "vehicle_attitude": attitude(),
        "vehicle_global_position": place(),
        "vehicle_gps_position": new_gps(),
        **more,
    }


@pytest.mark.parametrize(("folder", "name"), SAMPLES)
def test_every_value_of_the_samples_is_pyulogs(shared_data, folder, name):
    path = shared_data("logs", folder, name)
    data = path.read_bytes()
    assert recognise(data[:8192]) == "ulog"
    whole = ULog(str(path), TOPICS)
    log = read(data)
    assert log.lost == ()

    def same(part: str, topic: str, factor: float = 1, **fields: str) -> None:
        truth = whole.get_dataset(topic).data
        assert len(log.parts[part]) == len(truth["timestamp"])
        near(log.parts[part].columns, 0, **{ours: truth[one] * factor for ours, one in fields.items()})

    same("gnss", "vehicle_gps_position", latitude_deg="latitude_deg", longitude_deg="longitude_deg",
         height_sea_m="altitude_msl_m", sd_horizontal_m="eph", sd_vertical_m="epv", fix="fix_type",
         sd_velocity_m_s="s_variance_m_s", v_north_m_s="vel_n_m_s", v_east_m_s="vel_e_m_s",
         v_down_m_s="vel_d_m_s", satellites="satellites_used", hdop="hdop")  # fmt: skip
    same("imu", "sensor_combined", f_x_m_s2="accelerometer_m_s2[0]", f_z_m_s2="accelerometer_m_s2[2]",
         w_x_rad_s="gyro_rad[0]", w_z_rad_s="gyro_rad[2]")  # fmt: skip
    field = whole.get_dataset("vehicle_magnetometer").data["magnetometer_ga[1]"]
    near(log.parts["magnetometer"].columns, 0, field_y_ut=field.astype(float) * 100)
    truth = whole.get_dataset("vehicle_attitude").data
    near(log.parts["poses"].columns, 1e-6, **{f"q_{axis}": truth[f"q[{k}]"] for k, axis in enumerate("wxyz")})
    # UTC, to what the receiver's own stamps scatter by.
    gps = whole.get_dataset("vehicle_gps_position").data
    near(log.parts["gnss"].columns, 0.05, time_s=gps["time_utc_usec"] / 1e6)


def test_a_crash_is_read_to_its_end(shared_data):
    log = read(shared_data("logs", *SAMPLES[1]).read_bytes())
    poses = log.parts["poses"].columns
    assert poses["roll_deg"].min() == pytest.approx(-112.8, abs=0.1)
    first = poses["time_log_s"][np.abs(poses["roll_deg"]) > 60][0]
    assert first == pytest.approx(114.7, abs=0.1)
    assert poses["time_log_s"][-1] > 126
    assert log.vehicle == "PX4 v1.15.0 (beta) on NXP_MR_TROPIC"


def used(log: Any, part: str) -> dict[str, Any]:
    """The columns of the rows of use."""
    return {name: values[log.parts[part].used] for name, values in log.parts[part].columns.items()}


def test_poses():
    log = read(ulog(flight(), {"sys_name": "PX4", "ver_hw": "BOARD", "ver_sw_release": 0x010E02FF}))
    assert log.vehicle == "PX4 v1.14.2 on BOARD"
    columns, rows = used(log, "poses"), np.arange(1, 50)  # the first sample is older than the first place
    # Attitudes are of 0.4 ms before their stamps.
    near(columns, time_log_s=100 + 0.1 * rows - 4e-4)
    near(columns, 1e-5, time_s=START_S + 0.1 * rows - 4e-4)
    near(columns, 1e-10, latitude_deg=LAT + 1e-6 * (rows - 4e-3))
    near(columns, 1e-4, yaw_deg=30, height_sea_m=120 + rows - 4e-3)
    near(columns, 1e-7, sd_horizontal_m=0.5, sd_vertical_m=0.7)


def test_old_names_and_integers():
    rows = []
    for k in range(25):
        utc = round((START_S + 0.2 * k - 0.05) * 1e6)
        where = (round(LAT * 1e7), round(LON * 1e7), 120_500, 161_000)
        rows.append((utc, us(2 * k), *where, 0.2, 0.9, 1.5, 0.8, 5.0, 1.0, 0.0, -50_000, 3, True, 14))
    log = read(ulog(flight(vehicle_gps_position=(OLD_GPS, rows))))
    columns = log.parts["gnss"].columns
    near(columns, latitude_deg=LAT, height_sea_m=120.5, height_ellipsoid_m=161.0, v_east_m_s=1.0)
    # UTC is of 50 ms before the message.
    near(columns, 1e-5, time_s=START_S + 0.2 * np.arange(25))
    assert log.clock == "UTC of the receiver"


def test_values_that_are_not_valid_or_not_known_are_none():
    assert "v_north_m_s" not in part_of("gnss", vehicle_gps_position=new_gps(valid=False)).columns
    assert "height_ellipsoid_m" not in part_of("gnss", vehicle_gps_position=new_gps(ellipsoid=0.0)).columns


def test_triggers():
    form = (
        "uint64_t timestamp;uint64_t timestamp_utc;uint32_t seq;double lat;double lon;float alt;float[4] q;"
    )
    k = np.arange(10)
    rows = [(us(i), 0, i, LAT if i else 0.0, LON if i else 0.0, 130.0, 1.0, 0.0, 0.0, 0.0) for i in range(10)]
    part = part_of("triggers", camera_capture=(form, rows))
    assert part.used.all() and np.isnan(part.columns["latitude_deg"][0])
    near(part.columns, number=k, height_sea_m=[np.nan] + [130.0] * 9)
    form = "uint64_t timestamp;uint32_t seq;bool feedback;"
    part = part_of("triggers", camera_trigger=(form, [(us(i), i, False) for i in range(10)]))
    near(part.columns, 1e-5, time_s=START_S + 0.1 * k)


@pytest.mark.parametrize(("flags", "yaw"), [(0, 30.0), (32, 30.0), (64, 0.0), (16, 0.0), (None, 40.0)])
def test_gimbal(flags, yaw):
    """By its quaternion, whose flags say what the yaw counts from, or by angles (None)."""
    half = np.radians(-45) / 2
    form, topic = "uint64_t timestamp;float[4] q;uint16_t device_flags;", "gimbal_device_attitude_status"
    rows: list[Any] = [(us(k), np.cos(half), 0.0, np.sin(half), 0.0, flags) for k in range(2, 40)]
    if flags is None:
        form, topic = "uint64_t timestamp;float[3] attitude_euler_angle;", "mount_orientation"
        rows = [(us(k), 0.0, np.radians(-45), np.radians(10)) for k in range(2, 40)]
    part = part_of("gimbal", **{topic: (form, rows)})
    assert part.used.all()
    near(part.columns, 1e-3, pitch_world_deg=-45, yaw_world_deg=yaw)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "does not begin"),
        (b"ULog\x01\x12\x36" + bytes(100), "does not begin"),
        (
            ulog({"battery_status": ("uint64_t timestamp;float voltage_v;", [(us(1), 12.0)])}),
            "holds no message",
        ),
        (ulog(flight(), flags=bytes(8) + b"\x04" + bytes(31)), "cannot be read"),
    ],
)
def test_what_cannot_be_read_is_refused(data, words):
    with pytest.raises(WildlabError, match=words):
        read(data)


def claims(form: str, before: bytes = b"") -> Any:
    topics, name = flight(), b"vehicle_attitude"
    del topics["vehicle_attitude"]
    claimed = message("F", name + f":{form}".encode()) + message("A", struct.pack("<BH", 0, 77) + name)
    return read(ulog(topics, before=before, after=claimed + message("D", struct.pack("<H", 77) + bytes(100))))


def test_many_definitions_take_little_time_and_memory():
    """Within each other, and as many instances of one that is wide."""
    nested = [message("F", f"n{k}:{f'n{k + 1}' if k < 6 else 'float'}[60000] x;".encode()) for k in range(7)]
    wide = message("F", b"sensor_mag:uint64_t timestamp;uint8_t[2000] x;")
    many = [message("A", struct.pack("<BH", 0, number) + b"sensor_mag") for number in range(100, 20_100)]
    began = time.monotonic()
    assert "poses" not in claims("uint64_t timestamp;n0 q;", before=b"".join(nested)).parts
    with pytest.raises(WildlabError, match="no message"):
        read(ulog(flight(), before=wide + b"".join(many)))
    assert time.monotonic() - began < 7.0
