"""Ten hours of an inertial sensor at 250 Hz, from CSV files to a checked flight: time and memory.

Each command runs in a process of its own; its memory is the most that was resident at once. A process begins
with the memory of the one that starts it, so the tables are written by another that is gone by then. The
aircraft flies a wide circle, whose forces and rates have a closed form.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.csv

HOURS, RATE = 10.0, 250
RADIUS, SPEED, GRAVITY = 2000.0, 20.0, 9.815
CHECKED_S, CHECKED_GB, IMPORTED_GB = 30.0, 1.5, 3.0

#: The receiver and the autopilot say the same.
MOTION = """position.north = { column = "n", unit = "m" }
position.east = { column = "e", unit = "m" }
position.down = { column = "d", unit = "m" }
velocity.north = { column = "vn", unit = "m/s" }
velocity.east = { column = "ve", unit = "m/s" }
velocity.down = { column = "vd", unit = "m/s" }
"""
RECIPE = """
name = "ten-hours"
[files]
"imu.csv" = "inertial sensor"
"log.csv" = "receiver and autopilot"
[origin]
latitude_deg = 63.4
longitude_deg = 10.4
height_m = 40.0
[platform]
name = "made up"
[time]
kind = "utc"
epoch = 2020-06-01T06:00:00Z
[vertical]
reference = "ellipsoid"
[uncertainty]
position_horizontal_m = 2.0
position_vertical_m = 4.0
velocity_horizontal_m_s = 0.2
velocity_vertical_m_s = 0.4
[imu]
name = "a sensor"
velocity_random_walk_m_s_sqrt_h = 0.06
angle_random_walk_deg_sqrt_h = 0.15
accelerometer_bias_m_s2 = 0.001
accelerometer_bias_time_s = 300.0
gyro_bias_deg_h = 10.0
gyro_bias_time_s = 300.0
file = "imu.csv"
time = { column = "t", format = "elapsed" }
force.x = { column = "fx", unit = "m/s2" }
force.y = { column = "fy", unit = "m/s2" }
force.z = { column = "fz", unit = "m/s2" }
rate.x = { column = "wx", unit = "rad/s" }
rate.y = { column = "wy", unit = "rad/s" }
rate.z = { column = "wz", unit = "rad/s" }
[gnss]
name = "a receiver"
file = "log.csv"
time = { column = "t", format = "elapsed" }
MOTION
[poses.autopilot]
file = "log.csv"
time = { column = "t", format = "elapsed" }
MOTION
attitude.roll = { column = "roll", unit = "rad" }
attitude.pitch = { column = "pitch", unit = "rad" }
attitude.yaw = { column = "yaw", unit = "rad" }
""".replace("MOTION\n", MOTION)


def write_tables(folder: Path, hours: float = HOURS, rate: int = RATE) -> None:
    """``imu.csv``, ``log.csv`` (5 Hz) and the recipe."""
    rng = np.random.default_rng(1)
    turn, bank = SPEED / RADIUS, np.arctan2(SPEED**2 / RADIUS, GRAVITY)
    t = np.arange(0, hours * 3600, 1 / rate)
    constant = {
        "fx": 0.0,
        "fy": 0.0,
        "fz": -np.hypot(GRAVITY, SPEED**2 / RADIUS),
        "wx": 0.0,
        "wy": turn * np.sin(bank),
        "wz": turn * np.cos(bank),
    }
    noise = {"f": 0.02, "w": 0.001}
    columns = {
        name: np.round(value + noise[name[0]] * rng.standard_normal(len(t)), 6)
        for name, value in constant.items()
    }
    pyarrow.csv.write_csv(pyarrow.table({"t": np.round(t, 3), **columns}), folder / "imu.csv")
    t = np.arange(0, hours * 3600, 0.2)
    phase = turn * t
    place = {
        "n": RADIUS * np.sin(phase),
        "e": RADIUS * (1 - np.cos(phase)),
        "d": np.full(len(t), -300.0),
        "vn": SPEED * np.cos(phase),
        "ve": SPEED * np.sin(phase),
        "vd": np.zeros(len(t)),
        "roll": np.full(len(t), bank),
        "pitch": np.zeros(len(t)),
        "yaw": (phase + np.pi) % (2 * np.pi) - np.pi,
    }
    noisy = {
        k: np.round(v + (0.02 if k in "ned" else 0.001) * rng.standard_normal(len(t)), 6)
        for k, v in place.items()
    }
    pyarrow.csv.write_csv(pyarrow.table({"t": np.round(t, 3), **noisy}), folder / "log.csv")
    (folder / "recipe.toml").write_text(RECIPE, encoding="utf-8")


def run_command(*arguments: str) -> tuple[float, float]:
    """Seconds and gigabytes of one wildlab command."""
    start = time.perf_counter()
    process = subprocess.Popen(  # noqa: S603
        [sys.executable, "-m", "wildlab.cli", *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    assert process.stderr is not None
    said = process.stderr.read().decode(errors="replace")
    _, status, used = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) != 0:
        raise RuntimeError(f"wildlab {arguments[0]}: {said}")
    kilobytes = used.ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return time.perf_counter() - start, kilobytes * 1024 / 1e9


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """The commands; a ratio here is what was used to what is allowed."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        writer = multiprocessing.get_context("spawn").Process(target=write_tables, args=(folder, HOURS))
        writer.start()
        writer.join()
        flight = str(folder / "flight")
        import_s, import_gb = run_command("import", str(folder / "recipe.toml"), "--out", flight)
        check_s, check_gb = run_command("check", flight)
    return f"{HOURS:g} hours at {RATE} Hz, from CSV", [
        (f"import, {import_gb:.2f} GB", import_s, import_gb / IMPORTED_GB, f"<= {IMPORTED_GB:g} GB"),
        (f"check, {check_gb:.2f} GB", check_s, check_gb / CHECKED_GB, f"<= {CHECKED_GB:g} GB"),
        ("check, time", check_s, check_s / CHECKED_S, f"<= {CHECKED_S:g} s"),
    ]
