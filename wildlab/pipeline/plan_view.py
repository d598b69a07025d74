"""What a camera at a fixed tilt sees of flat ground: how wide its strip is, and how large an animal in it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import intersect_plane, pixel_rays
from wildlab.geometry.mount import Mount

#: Rows and columns of the image that are looked at.
SAMPLES = 65
#: Ground that is further away than this many heights is not counted as seen: animals in it are small, and
#: whatever stands hides them (F 8.2).
FURTHEST = 4.0


class View(NamedTuple):
    """What is seen from a height, all in heights: multiply by the height for metres.

    Attributes
    ----------
    width
        Of the strip that is seen across the way.
    ahead
        (2,) nearest and furthest ground that is seen, ahead of the aircraft.
    slant
        From the lens to the middle of the strip.
    """

    width: float
    ahead: tuple[float, float]
    slant: float

    def pixels(self, camera: Camera, length: float, height: float) -> float:
        """Across how many pixels something of a length (m) is seen from a height (m)."""
        return math.sqrt(camera.fx * camera.fy) * length / (self.slant * height)


def mount_at(tilt_deg: float) -> Mount:
    """The mount of a camera that looks ahead and so many degrees below the horizon."""
    return Mount("forward", tilt=-math.radians(tilt_deg))


def look(camera: Camera, tilt_deg: float) -> View:
    """What a camera sees of flat ground.

    Parameters
    ----------
    camera
        Its intrinsic parameters.
    tilt_deg
        Below the horizon; 90 is straight down.

    Returns
    -------
    View
        The width is that of the middle one of the image's rows that see ground no further away than
        `FURTHEST` heights; for a camera that looks down, of the narrowest one.

    Raises
    ------
    WildlabError
        Where no row sees such ground.
    """
    across, down = np.linspace(0, camera.width - 1, SAMPLES), np.linspace(0, camera.height - 1, SAMPLES)
    uv = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    poses = CameraPoses(camera, mount_at(tilt_deg), np.array([0.0, 0.0, -1.0]), np.eye(3))
    rays = pixel_rays(camera, uv, poses.R_nc)
    points = intersect_plane(rays, poses.p_nc, 0.0).reshape(SAMPLES, SAMPLES, 3)
    slant: Array = np.linalg.norm(points - poses.p_nc, axis=-1)
    with np.errstate(invalid="ignore"):
        seen = (slant <= FURTHEST).all(axis=1)
    if not seen.any():
        edge = math.degrees(math.asin(float(np.nanmax(rays[:, 2] / np.linalg.norm(rays, axis=1)))))
        where = (
            f"{-edge:.0f} degrees above the horizon" if edge < 0 else f"{edge:.0f} degrees below the horizon"
        )
        raise WildlabError(
            f"a camera tilted {tilt_deg:g} degrees below the horizon sees no ground near enough: the lowest "
            f"it looks is {where}",
            f"tilt it further down (90 is straight down), so that ground within {FURTHEST:g} heights is seen",
            field="--tilt",
        )
    rows = np.flatnonzero(seen)
    widths = points[rows, :, 1].max(axis=1) - points[rows, :, 1].min(axis=1)
    # With a bent lens an edge is a curve: what lies between its innermost points is surely seen.
    inner = points[rows, -1, 1].min() - points[rows, 0, 1].max()
    middle = rows[len(rows) // 2]
    width = float(inner) if tilt_deg > 80 else float(widths[len(rows) // 2])
    ahead = points[rows, :, 0]
    return View(width, (float(ahead.min()), float(ahead.max())), float(slant[middle, SAMPLES // 2]))
