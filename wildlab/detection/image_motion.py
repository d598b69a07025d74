"""How a whole image moved since the one before: features of the scene followed by Lucas and Kanade's flow."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array

Grey = NDArray[np.uint8]
Mask = NDArray[np.bool_]

#: Features that are followed at most, and that have to agree on one motion at least.
MOST, FEWEST = 400, 12
#: How far (px) a feature may be from where it began when it is followed back, and from the common motion.
BACK_PX, AGREEMENT_PX = 0.7, 1.5
#: Share of the followed features that has to agree.
AGREE = 0.4
#: Window and levels of the pyramid: displacements up to about a sixth of 640 px are followed.
WINDOW, LEVELS = 21, 4


def as_grey(image: NDArray[Any], valid: Mask) -> Grey:
    """An image (H, W) or (H, W, 3) in 256 levels over the range of what can be seen.

    Parameters
    ----------
    image
        Grey levels, counts, kelvin, or red-green-blue.
    valid
        (H, W) where there is a scene.

    Returns
    -------
    (H, W) uint8
    """
    values = np.asarray(image, np.float32)
    values = values.mean(axis=2) if values.ndim == 3 else values
    shown = values[valid & np.isfinite(values)]
    low, high = np.quantile(shown, [0.01, 0.99]) if len(shown) else (0.0, 1.0)
    grey = (np.nan_to_num(values, nan=float(low)) - low) * (255.0 / max(float(high - low), 1e-6))
    return np.ascontiguousarray(np.clip(np.rint(grey), 0, 255).astype(np.uint8))


def image_motion(first: Grey, second: Grey, camera: Camera, valid: Mask | None = None) -> Array:
    """How the scene moved from one image to the next: a shift at the principal point, and a turn.

    Parameters
    ----------
    first, second
        (H, W) grey images of one size, from `as_grey`.
    camera
        Its lens: the motion is fitted to directions, not to pixels.
    valid
        (H, W) where features are looked for; everywhere, if not given.

    Returns
    -------
    (3,)
        Tangents along the columns and the rows, and the turn from the columns' to the rows' axis (rad); NaN
        where too few features agree.
    """
    lost = np.full(3, np.nan)
    mask = None if valid is None else np.asarray(valid, np.uint8)
    points = cv2.goodFeaturesToTrack(first, MOST, 0.01, 8, mask=mask)
    if points is None or len(points) < FEWEST:
        return lost
    there, found = _follow(first, second, np.asarray(points, np.float32))
    back, found_back = _follow(second, first, there)
    here, after = np.asarray(points, np.float32)[:, 0], there[:, 0]
    good = found & found_back & (np.linalg.norm(back[:, 0] - here, axis=1) < BACK_PX)
    if good.sum() < FEWEST:
        return lost
    _, kept = cv2.estimateAffinePartial2D(
        here[good], after[good], method=cv2.RANSAC, ransacReprojThreshold=AGREEMENT_PX, maxIters=500
    )
    rows = np.zeros(int(good.sum()), bool) if kept is None else np.asarray(kept).ravel() > 0
    if rows.sum() < max(FEWEST, AGREE * len(rows)):
        return lost
    a = normalise(camera, here[good][rows].astype(float)) @ [1, 1j]
    b = normalise(camera, after[good][rows].astype(float)) @ [1, 1j]
    known = np.isfinite(a) & np.isfinite(b)
    if known.sum() < FEWEST:
        return lost
    # Shift, turn and scale by least squares, as numbers of the complex plane.
    A = np.stack([np.ones(int(known.sum()), complex), a[known]], axis=1)
    shift, turn = np.linalg.lstsq(A, b[known], rcond=None)[0]
    return np.array([shift.real, shift.imag, np.angle(turn)])


def _follow(first: Grey, second: Grey, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], Mask]:
    """Where points (N, 1, 2) of one image are in the other, and which were found."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        first, second, points, np.empty_like(points), winSize=(WINDOW, WINDOW), maxLevel=LEVELS
    )
    return np.asarray(there, np.float32), np.asarray(found)[:, 0] == 1
