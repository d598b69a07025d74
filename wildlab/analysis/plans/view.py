"""What a camera sees of flat ground: how wide its strip is, how far ahead, and how large an animal in it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import intersect_plane, pixel_rays
from wildlab.planning.gimbal import GimbalAngles, camera_attitudes

#: Rows and columns of the image that are looked at; angles of a swing.
SAMPLES = 65
#: Ground that is further away than this many heights is not counted as seen: animals in it are small, and
#: whatever stands hides them (F 8.2).
FURTHEST = 4.0
#: Where the camera starts: one height above the ground.
_LENS = np.array([0.0, 0.0, -1.0])


class GroundView(NamedTuple):
    """What is seen from a height, all in heights: multiply by the height for metres.

    Attributes
    ----------
    width
        Of the strip that is seen across the way, with all swings.
    ahead
        (2,) nearest and furthest ground that one image shows, ahead of the aircraft.
    slant
        From the lens to the ground in the middle of one image.
    middle
        That ground, ahead of the aircraft.
    """

    width: float
    ahead: tuple[float, float]
    slant: float
    middle: float

    @property
    def length(self) -> float:
        """Of the ground in one image, along the way."""
        return self.ahead[1] - self.ahead[0]

    def pixels(self, camera: Camera, length: float, height: float) -> float:
        """Across how many pixels something of a length (m) is seen from a height (m)."""
        return math.sqrt(camera.fx * camera.fy) * length / (self.slant * height)


def look(camera: Camera, tilt_deg: float, gimbal: str = "fixed", swing_deg: float = 0.0) -> GroundView:
    """What a camera sees of flat ground.

    Parameters
    ----------
    camera
        Its intrinsic parameters.
    tilt_deg
        Below the horizon; 90 is straight down.
    gimbal, swing_deg
        As for `wildlab.analysis.plan_wanted.Wanted`.

    Returns
    -------
    View
        Without a swing the width is that of the middle one of the image's rows that see ground no further
        away than `FURTHEST` heights, for a camera that looks down of the narrowest one. A swing adds what
        that row sees at its ends.

    Raises
    ------
    WildlabError
        Where no row sees such ground, or it does not at the end of a swing.
    """
    across, down = np.linspace(0, camera.width - 1, SAMPLES), np.linspace(0, camera.height - 1, SAMPLES)
    uv = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    rays = pixel_rays(camera, uv, _attitude(tilt_deg))
    points = intersect_plane(rays, _LENS, 0.0).reshape(SAMPLES, SAMPLES, 3)
    slant: Array = np.linalg.norm(points - _LENS, axis=-1)
    with np.errstate(invalid="ignore"):
        seen = (slant <= FURTHEST).all(axis=1)
    if not seen.any():
        edge = math.degrees(math.asin(float(np.nanmax(rays[:, 2] / np.linalg.norm(rays, axis=1)))))
        where = f"{abs(edge):.0f} degrees {'above' if edge < 0 else 'below'} the horizon"
        raise WildlabError(
            f"a camera tilted {tilt_deg:g} degrees below the horizon sees no ground near enough: the lowest "
            f"it looks is {where}",
            f"tilt it further down (90 is straight down), so that ground within {FURTHEST:g} heights is seen",
            field="--tilt",
        )
    rows = np.flatnonzero(seen)
    middle = int(rows[len(rows) // 2])
    if gimbal != "fixed":
        width = _swept(camera, tilt_deg, gimbal, swing_deg, float(down[middle]))
    elif tilt_deg > 80:
        # With a bent lens an edge is a curve: what lies between its innermost points is surely seen.
        width = float(points[rows, -1, 1].min() - points[rows, 0, 1].max())
    else:
        width = float(np.ptp(points[middle, :, 1]))
    ahead = points[rows, :, 0]
    centre = points[middle, SAMPLES // 2]
    return GroundView(
        width,
        (float(ahead.min()), float(ahead.max())),
        float(slant[middle, SAMPLES // 2]),
        float(centre[0]),
    )


def _attitude(tilt_deg: float, roll: Array | float = 0.0, yaw: Array | float = 0.0) -> Array:
    """``R_nc`` of a camera on an aircraft that flies level to the north; (3, 3) or (N, 3, 3)."""
    turned = np.broadcast_arrays(np.atleast_1d(roll), np.atleast_1d(yaw), -math.radians(tilt_deg))
    angles = GimbalAngles(np.zeros(len(turned[0])), turned[0], turned[2], turned[1])
    found = camera_attitudes(np.zeros(len(turned[0])), angles)
    return found[0] if np.ndim(roll) == np.ndim(yaw) == 0 else found


def _swept(camera: Camera, tilt_deg: float, gimbal: str, swing_deg: float, row: float) -> float:
    """How wide the strip is that a row of the image sees in a whole swing, in heights."""
    angles = np.radians(np.linspace(-swing_deg, swing_deg, SAMPLES))
    R = _attitude(tilt_deg, yaw=angles) if gimbal == "yaw" else _attitude(tilt_deg, roll=angles)
    sides = []
    for column in (0.0, (camera.width - 1) / 2, camera.width - 1.0):
        uv = np.tile([column, row], (SAMPLES, 1))
        points = intersect_plane(pixel_rays(camera, uv, R), _LENS, 0.0)
        far = np.linalg.norm(points - _LENS, axis=1)
        if not (far <= FURTHEST).all():
            raise WildlabError(
                f"a swing of {swing_deg:g} degrees looks at ground more than {FURTHEST:g} heights away, or "
                "over the horizon",
                "swing less far with --swing, or tilt the camera further down",
                field="--swing",
            )
        sides.append(points[:, 1])
    return float(np.max(sides) - np.min(sides))
