"""A million pixels to a plane: ours, the shortest numpy that does the same, and cameratransform.

cameratransform takes one pose for all pixels, so that is timed; the last row gives every pixel a pose of its
own, which is what a flight needs and what cameratransform cannot do.
"""

from __future__ import annotations

import numpy as np

from benchmarks.timing import best_of
from wildlab.geometry.camera_poses import Mount, camera_pose
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import pixel_to_plane
from wildlab.studies.sensitivity import TAU2

N = 1_000_000


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to plain numpy, what is wanted)."""
    rng = np.random.default_rng(0)
    uv = rng.uniform([0, 0], [640, 512], (N, 2))
    p_nc, R_nc = camera_pose(
        Mount("forward"), np.array([10.0, -5.0, -120.0]), euler_to_matrix(0.02, -0.9, 1.0)
    )

    def plain() -> np.ndarray:
        """One pose: three columns of the rotation, a division, a line."""
        x, y = (uv[:, 0] - TAU2.cx) / TAU2.fx, (uv[:, 1] - TAU2.cy) / TAU2.fy
        rays = np.stack([x, y, np.ones(N)], axis=1) @ R_nc.T
        ground = p_nc + (-p_nc[2] / rays[:, 2])[:, None] * rays
        ground[rays[:, 2] <= 0] = np.nan
        return ground

    def ours() -> np.ndarray:
        return pixel_to_plane(TAU2, uv, p_nc, R_nc, 0.0)

    baseline = best_of(plain)
    rows = [
        ("plain numpy, one pose", baseline, 1.0, ""),
        ("wildlab, one pose", (own := best_of(ours)), own / baseline, "at most 1.5"),
    ]
    try:
        import cameratransform
    except ImportError:
        pass
    else:
        peer = cameratransform.Camera(
            cameratransform.RectilinearProjection(
                focallength_x_px=TAU2.fx,
                focallength_y_px=TAU2.fy,
                center_x_px=TAU2.cx,
                center_y_px=TAU2.cy,
                image=(640, 512),
            ),
            cameratransform.SpatialOrientation(elevation_m=120.0, tilt_deg=38.0, heading_deg=57.0),
        )
        seconds = best_of(lambda: peer.spaceFromImage(uv, Z=0.0), repeats=3)
        rows.append(("cameratransform, one pose", seconds, seconds / baseline, "not below wildlab's"))

    poses = camera_pose(
        Mount("forward"),
        rng.uniform([-50, -50, -150], [50, 50, -80], (N, 3)),
        euler_to_matrix(rng.normal(0, 0.05, N), rng.uniform(-1.4, -0.6, N), rng.uniform(-3, 3, N)),
    )

    def plain_poses() -> np.ndarray:
        x, y = (uv[:, 0] - TAU2.cx) / TAU2.fx, (uv[:, 1] - TAU2.cy) / TAU2.fy
        rays = np.einsum("nij,nj->ni", poses[1], np.stack([x, y, np.ones(N)], axis=1))
        ground = poses[0] + (-poses[0][:, 2] / rays[:, 2])[:, None] * rays
        ground[rays[:, 2] <= 0] = np.nan
        return ground

    each = best_of(plain_poses)
    own = best_of(lambda: pixel_to_plane(TAU2, uv, *poses, 0.0))
    rows += [
        ("plain numpy, a pose per pixel", each, 1.0, ""),
        ("wildlab, a pose per pixel", own, own / each, "at most 1.5"),
    ]
    return f"{N:,} pixels to a plane", rows
