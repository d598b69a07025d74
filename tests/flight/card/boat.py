"""A simulated aircraft that follows a boat of a real log: its telemetry, images and clicks as files.

Everything is written by other people's software or by formulas of its own; nothing of wildlab is used.
"""

from __future__ import annotations

import math
import struct
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pymap3d
import pynmea2
from numpy.typing import NDArray
from PIL import Image
from pymavlink.dialects.v20 import ardupilotmega as mavlink

WIDTH, HEIGHT, FOCAL = 640, 512, 800.0
#: Of the aircraft above the sea, m; so much of the geoid is above the ellipsoid in the boat's log, about.
ABOVE, GEOID = 60.0, 46.0
#: What a hand clicks beside the thing, px.
CLICK_SD = 1.0


def boat_track(log: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """UTC (N,) s since 1970 and latitude, longitude (N, 2) in degrees, by its own GGA sentences.

    Its RMC sentences have, under the same stamp, at times the place of a second earlier.
    """
    rows = []
    day = None
    for line in log.read_text(encoding="ascii", errors="replace").splitlines():
        said = pynmea2.parse(line) if line[3:6] in ("RMC", "GGA") else None
        if line[3:6] == "RMC":
            day = said.datestamp
        elif line[3:6] == "GGA" and day is not None:
            when = datetime.combine(day, said.timestamp.replace(tzinfo=None), UTC)
            rows.append((when.timestamp(), said.latitude, said.longitude))
    every = np.array(rows)
    _, first = np.unique(every[:, 0], return_index=True)
    return every[first, 0], every[first, 1:]


def rotation(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Body to north-east-down, radians."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(z @ y @ x)


def write_flight(folder: Path, boat_log: Path, seed: int = 1) -> int:
    """A tlog, images with stamps in UTC, and clicks on the boat; how many clicks there are."""
    rng = np.random.default_rng(seed)
    times, boat = boat_track(boat_log)
    origin = (boat[0, 0], boat[0, 1], GEOID)
    north, east, _ = pymap3d.geodetic2ned(boat[:, 0], boat[:, 1], np.full(len(boat), GEOID), *origin)
    start = times[0]

    def where(t: float) -> NDArray[np.float64]:
        about = 6.0 * np.array([math.cos(0.2 * (t - start)), math.sin(0.2 * (t - start))])
        return np.array([np.interp(t, times, north), np.interp(t, times, east)]) + about

    def angles(t: float) -> tuple[float, float, float]:
        s = t - start
        return 0.06 * math.sin(0.7 * s), 0.05 * math.cos(0.5 * s), (0.3 + 0.02 * s) % (2 * math.pi)

    packer = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    stream = bytearray()
    for t in np.arange(times[0], times[-1], 0.1):
        boot = round(1000 * (t - start)) + 20_000
        lat, lon, _ = (
            float(one[0])
            for one in pymap3d.ned2geodetic(*(np.array([x]) for x in where(t)), np.array([-ABOVE]), *origin)
        )
        roll, pitch, yaw = angles(t)
        for message in (
            mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3),
            mavlink.MAVLink_attitude_message(boot, roll, pitch, math.remainder(yaw, math.tau), 0, 0, 0),
            mavlink.MAVLink_global_position_int_message(
                boot, round(lat * 1e7), round(lon * 1e7), round(1000 * ABOVE), round(1000 * ABOVE), 0, 0, 0, 0
            ),
        ):
            stream += struct.pack(">Q", round(1e6 * t)) + message.pack(packer)
    (folder / "flight.tlog").write_bytes(stream)

    images = folder / "images"
    images.mkdir()
    picture = Image.new("L", (WIDTH, HEIGHT), 90)
    rows = ["image,name,u,v"]
    for i, t in enumerate(np.arange(times[0] + 2, times[-1] - 2, 1.5)):
        name = f"image-{i:04d}.jpg"
        when = datetime.fromtimestamp(0, UTC) + timedelta(seconds=float(t))
        exif = Image.Exif()
        exif[272] = "thermal"
        inner = exif.get_ifd(0x8769)
        inner[36867] = when.strftime("%Y:%m:%d %H:%M:%S")
        inner[37521] = f"{when.microsecond:06d}"
        inner[36881] = "+00:00"
        picture.save(images / name, exif=exif)
        at = np.array([np.interp(t, times, north), np.interp(t, times, east)]) - where(t)
        b = rotation(*angles(t)).T @ np.array([*at, ABOVE])
        u = (WIDTH - 1) / 2 + FOCAL * b[1] / b[2] + rng.normal(0, CLICK_SD)
        v = (HEIGHT - 1) / 2 - FOCAL * b[0] / b[2] + rng.normal(0, CLICK_SD)
        if 0 <= u < WIDTH and 0 <= v < HEIGHT:
            rows.append(f"{name},boat,{u:.3f},{v:.3f}")
    (folder / "clicks.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "camera.toml").write_text(
        f"""format = 1
[camera]
name = "thermal"
width_px = {WIDTH}
height_px = {HEIGHT}
fx_px = {FOCAL}
fy_px = {FOCAL}
cx_px = {(WIDTH - 1) / 2}
cy_px = {(HEIGHT - 1) / 2}
[board]
pattern = "chessboard"
columns = 9
rows = 6
spacing_m = 0.025
[evidence]
images = 0
views = 0
points = 0
lens = "none"
rms_px = 0.0
covered = 0.0
""",
        encoding="utf-8",
    )
    return len(rows) - 1
