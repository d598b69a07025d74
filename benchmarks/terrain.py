"""Rays to terrain beside a march in fixed steps, and lines of sight beside rays.

The land is that of F's map in size: 251 by 501 nodes, 2 m apart. The march is compiled, too, and timed on
few rays: in steps of the height that F's map resolves (F 2.1), and of a millimetre, to which it then ends;
the walk ends to rounding, a millionth of that. orthority, which has such a march, takes 131 microseconds a
ray by its own figures on another machine.
"""

from __future__ import annotations

from functools import partial

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import best_of
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import Terrain, intersect_terrain, pixel_rays
from wildlab.geometry.viewsheds import cast_rays, compare_angles, lines_clear
from wildlab.simulation.landscape import synthetic_landscape

RAYS = 1_000_000
#: Steps of the march, metres, with how many rays are timed, and by how much it is to be slower.
STEPS = ((0.01, 500, ""), (0.001, 50, "at least 200"))
#: Above the ground, metres, and off straight down, radians.
HEIGHT, TILT = 60.0, np.radians(30)


@numba.njit(error_model="numpy")
def march(height: NDArray[np.float32], start: NDArray[np.float64], rays: NDArray[np.float64]) -> int:
    """How many rays come to the ground in equal steps; coordinates in columns, rows and metres upwards."""
    met = 0
    for n in range(rays.shape[0]):
        x, y, z = start[0], start[1], start[2]
        while 0 <= x < height.shape[1] - 1 and 0 <= y < height.shape[0] - 1:
            i, j = int(y), int(x)
            u, v = x - j, y - i
            low = (1 - u) * height[i, j] + u * height[i, j + 1]
            high = (1 - u) * height[i + 1, j] + u * height[i + 1, j + 1]
            if z <= (1 - v) * low + v * high:
                met += 1
                break
            x, y, z = x + rays[n, 0], y + rays[n, 1], z + rays[n, 2]
    return met


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio, what is wanted)."""
    land, rng = synthetic_landscape(1), np.random.default_rng(0)
    lens = np.array([0.0, 0.0, -float(land.heights_at([[0.0, 0.0]])[0]) - HEIGHT])
    camera = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    turn = euler_to_matrix(0.0, TILT, 0.0) @ R_MC_DOWN
    rays = pixel_rays(camera, rng.uniform([0, 0], [640, 512], (RAYS, 2)), turn)
    exact = best_of(partial(intersect_terrain, land, rays, lens), repeats=3)
    start = np.array([-land.east / land.step, -land.north / land.step, -lens[2]])
    rows = []
    for step, count, wanted in STEPS:
        some = rays[:count] / np.linalg.norm(rays[:count], axis=1)[:, None] * step
        steps = np.column_stack([some[:, 1] / land.step, some[:, 0] / land.step, -some[:, 2]])
        marched = best_of(partial(march, land.height, start, steps), repeats=3) * RAYS / count
        rows.append((f"a march in steps of {step} m, by {count} rays", marched, marched / exact, wanted))
    rows += [
        ("wildlab, 1,000,000 rays", exact, 1.0, "at most 450 ms on an idle core"),
    ]
    return f"{RAYS:,} rays to terrain, and a map's line of sight", rows + _sight(land, lens)


def _sight(land: Terrain, lens: NDArray[np.float64]) -> list[tuple[str, float, float, str]]:
    nodes = np.argwhere(np.isfinite(land.height))
    there = np.array([land.north, land.east]) + land.step * nodes
    points = np.column_stack([there, -land.height[tuple(nodes.T)].astype(float)])
    calls = {
        f"{len(nodes):,} lines of sight": (
            partial(lines_clear, land, points, lens), "at most 80 ms on an idle core",
        ),
        "F algorithm 1, steps of 1 m": (partial(cast_rays, land, nodes, lens, 1.0, 2.0), ""),
        "F (2.24), in its sense": (partial(compare_angles, land, nodes, lens), ""),
    }  # fmt: skip
    seconds = {what: best_of(call, repeats=5) for what, (call, _) in calls.items()}
    first = next(iter(seconds.values()))
    return [(what, taken, taken / first, calls[what][1]) for what, taken in seconds.items()]
