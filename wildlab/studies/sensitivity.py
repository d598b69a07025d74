"""How far a wrong pose moves a georeferenced point: H 5.3.1, F 2.3.1."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.evaluation.replication import propagate_rounding
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import Mount, camera_pose, helgesen_misalignment
from wildlab.geometry.frames import Array, euler_to_matrix, linear_enu_error
from wildlab.geometry.georeference import pixel_to_plane
from wildlab.reporting.charts.drawing import fields_chart
from wildlab.reporting.figures import BLUE, GREEN, INK, VERMILLION, end_label, new_figure

#: The calibrated FLIR Tau 2 of H (2.3).
TAU2 = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
#: Mounting misalignment of H 5.6.1: roll, tilt, pan as printed, degrees.
PRINTED_MISALIGNMENT_DEG = (-1.7, 3.9, 1.9)
#: Latitude and longitude of F's site, radians, and the radius by which distances become angles, metres.
KOLMARDEN, EARTH_M = (float(np.radians(58.662064)), float(np.radians(16.433337))), 6.371e6
#: How far from the origin F's linear conversion of coordinates is tried, metres.
DISTANCES_M = np.geomspace(100, 20_000, 40)
#: Where the object stands in the image: its middle (H 5.3.1), not the principal point.
IMAGE_CENTRE = (320.0, 256.0)

#: Roll, pitch, yaw (degrees) of the three cases, tables 5.1, 5.2, 5.3.
ATTITUDES_DEG = {"level": (0.0, 0.0, 0.0), "turn": (25.0, 0.0, 0.0), "ascent": (0.0, 20.0, 0.0)}
ALTITUDES_M = (100.0, 400.0)
#: Roll, pitch, yaw (degrees) and north, east, down (metres) of the seven offsets.
OFFSETS = {
    "roll": (3.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "pitch": (0.0, 3.0, 0.0, 0.0, 0.0, 0.0),
    "yaw": (0.0, 0.0, 3.0, 0.0, 0.0, 0.0),
    "north": (0.0, 0.0, 0.0, 10.0, 0.0, 0.0),
    "east": (0.0, 0.0, 0.0, 0.0, 10.0, 0.0),
    "down": (0.0, 0.0, 0.0, 0.0, 0.0, 10.0),
    "roll+pitch": (3.0, 3.0, 0.0, 0.0, 0.0, 0.0),
}


def helgesen_mount() -> Mount:
    """The mount of H 5.6.1: camera straight down with the printed misalignment."""
    return Mount(looks="down", misalignment=helgesen_misalignment(*np.radians(PRINTED_MISALIGNMENT_DEG)))


def displacement(
    camera: Camera,
    mount: Mount,
    uv: ArrayLike,
    euler: ArrayLike,
    p_nb: ArrayLike,
    euler_offset: ArrayLike,
    position_offset: ArrayLike,
    plane_down: float = 0.0,
) -> Array:
    """Shift (N, 2), north-east in metres, of the ground point when the pose is wrong by the offsets.

    Parameters
    ----------
    uv
        (N, 2) or (2,) pixels.
    euler, p_nb
        True roll, pitch, yaw (radians) and position of the airframe: (N, 3) or (3,).
    euler_offset, position_offset
        What is added to them: (N, 3) or (3,).
    """
    uv, euler, p_nb = (np.atleast_2d(np.asarray(a, float)) for a in (uv, euler, p_nb))

    def ground(angles: Array, position: Array) -> Array:
        R_nb = euler_to_matrix(*np.atleast_2d(angles).T)
        return pixel_to_plane(camera, uv, *camera_pose(mount, position, R_nb), plane_down)[:, :2]

    wrong = ground(euler + np.asarray(euler_offset, float), p_nb + np.asarray(position_offset, float))
    return np.asarray(wrong - ground(euler, p_nb))


def helgesen_tables(camera: Camera = TAU2, mount: Mount | None = None) -> dict[str, float]:
    """The 42 numbers of H tables 5.1-5.3: horizontal error (metres) by ``attitude/offset/altitude``."""
    mount = helgesen_mount() if mount is None else mount
    table = {}
    for attitude, euler_deg in ATTITUDES_DEG.items():
        for altitude in ALTITUDES_M:
            for name, offset in OFFSETS.items():
                shift = displacement(
                    camera,
                    mount,
                    IMAGE_CENTRE,
                    np.radians(euler_deg),
                    (0.0, 0.0, -altitude),
                    np.radians(offset[:3]),
                    offset[3:],
                )
                table[f"{attitude}/{name}/{altitude:.0f}m"] = float(np.hypot(*shift[0]))
    return table


def rounded_tables() -> dict[str, tuple[float, float]]:
    """Bounds of each of the 42 numbers over what the printed camera and mounting angles were rounded from.

    Focal lengths have one decimal, the principal point none, the angles one: half of the last digit is open.
    """
    names = list(helgesen_tables())

    def errors(given: Array) -> list[float]:
        camera = Camera(TAU2.width, TAU2.height, *given[:4])
        mount = Mount(looks="down", misalignment=helgesen_misalignment(*np.radians(given[4:])))
        return list(helgesen_tables(camera, mount).values())

    printed = [TAU2.fx, TAU2.fy, TAU2.cx, TAU2.cy, *PRINTED_MISALIGNMENT_DEG]
    low, high = propagate_rounding(errors, printed, [0.05, 0.05, 0.5, 0.5, 0.05, 0.05, 0.05])
    return dict(zip(names, zip(low.tolist(), high.tolist(), strict=True), strict=True))


def errors_over_image() -> tuple[Array, Array, dict[str, Array]]:
    """Columns and rows (33, 41) of pixels, and by attitude the error there (metres) for 3 degrees of roll and
    pitch from the higher altitude."""
    u, v = np.meshgrid(np.linspace(0, TAU2.width, 41), np.linspace(0, TAU2.height, 33))
    uv = np.column_stack([u.ravel(), v.ravel()])
    offset, above = OFFSETS["roll+pitch"], (0.0, 0.0, -ALTITUDES_M[-1])
    errors = {}
    for attitude, euler_deg in ATTITUDES_DEG.items():
        shift = displacement(
            TAU2, helgesen_mount(), uv, np.radians(euler_deg), above, np.radians(offset[:3]), offset[3:]
        )
        errors[attitude] = np.hypot(*shift.T).reshape(u.shape)
    return u, v, errors


def flat_map_errors(latitude: float) -> Array:
    """The largest error over all directions, metres, of F's linear conversion of coordinates (F 2.2, 2.3) at
    `DISTANCES_M` from an origin of that latitude, radians."""
    origin = (latitude, KOLMARDEN[1])
    bearings = np.radians(np.arange(0, 360, 15))[:, None]
    north, east = DISTANCES_M * np.cos(bearings), DISTANCES_M * np.sin(bearings)
    found = linear_enu_error(
        origin[0] + north / EARTH_M, origin[1] + east / (EARTH_M * np.cos(origin[0])), origin
    )
    return np.asarray(found.max(axis=0))


#: Colours by latitude, degrees.
_LATITUDES = {0.0: GREEN, float(np.degrees(KOLMARDEN[0])): BLUE, 75.0: VERMILLION}


def offsets(errors: Mapping[str, float], printed: Mapping[tuple[str, str], float]) -> Figure:
    """Errors of each offset from 400 m by attitude, and the printed ones; by ``attitude/offset/height``."""
    fig, axes = new_figure(5.9, 4.4, columns=3, sharey=True)
    names = list(OFFSETS)[::-1]
    y = np.arange(len(names))
    for ax, attitude in zip(axes, ATTITUDES_DEG, strict=True):
        keys = [f"{attitude}/{name}/400m" for name in names]
        ax.barh(y, [errors[key] for key in keys], color=BLUE, height=0.6)
        ax.plot([printed[key, "horizontal_error"] for key in keys], y, "o", mfc="white", mec=INK, ms=6)
        ax.set_yticks(y, [name + (" 10 m" if any(OFFSETS[name][3:]) else " 3°") for name in names])
        ax.set(title=attitude, xlim=(0, 39), xlabel="error (m)")
        ax.grid(axis="y", visible=False)
    return fig


def over_image() -> Figure:
    """Contours of the error over the image, by attitude."""
    u, v, errors = errors_over_image()
    levels = np.arange(25, max(float(one.max()) for one in errors.values()) + 5, 5)
    return fields_chart(u, v, errors, levels, [30, 40, 50], "%d m", IMAGE_CENTRE, (5.9, 2.7))


def flat_map() -> Figure:
    """Errors of a linear conversion of coordinates over the distance, at three latitudes."""
    fig, ax = new_figure(5.6, 3.3)
    for latitude, color in _LATITUDES.items():
        error = flat_map_errors(np.radians(latitude))
        ax.loglog(DISTANCES_M / 1000, error, color=color)
        end_label(ax, DISTANCES_M[-1] / 1000, error[-1], f"{latitude:.0f}° N", color)
    ax.set(xlabel="distance from the origin (km)", ylabel="largest error (m)")
    return fig
