"""What a twin's camera has in front of it, and the rows that somebody who marks it writes down."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.gimbal import gimbal_angles
from wildlab.simulation.manifest import true_mount, twin_manifest
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.trajectory import Motion

#: Numbers of images.
Numbers = NDArray[np.intp]


class Exposures:
    """The camera at N exposures: their ``times`` (N,) s, and its true ``poses``."""

    def __init__(self, twin: TwinParameters, true: Motion) -> None:
        self.times = true.times
        camera = twin_manifest(twin, 0).geometry_camera()
        angles = (None, None) if twin.gimbal is None else gimbal_angles(twin.gimbal, true.times)
        self.poses = CameraPoses(camera, true_mount(twin), true.position, true.R_nb, *angles)
        self._marking_sd = twin.camera.marking_sd.si

    def pixels(self, points: ArrayLike) -> Array:
        """Where points in n, (N, 3) m, one for each exposure, are in the images: (N, 2) px; NaN behind."""
        return ground_to_pixel(self.poses.camera, points, self.poses.p_nc, self.poses.R_nc)

    def marked(self, pixels: ArrayLike, rng: np.random.Generator) -> Array:
        """Pixels (K, 2) as they are marked, with noise; nobody marks outside of the image."""
        uv = np.asarray(pixels, float)
        noisy = uv + self._marking_sd * rng.standard_normal(uv.shape)
        return np.clip(noisy, 0.0, [self.poses.camera.width, self.poses.camera.height])


def marks(
    frames: pd.DataFrame, images: Numbers, marked: Array, source: str, target: str, plane_down: float | Array
) -> pd.DataFrame:
    """Rows of detections of one target: in which of the images, (K,), and where, (K, 2) px."""
    return pd.DataFrame(
        {
            "detection_id": "",
            "frame_id": frames["frame_id"].to_numpy()[images],
            "source": source,
            "kind": "pixel",
            "u_px": marked[:, 0],
            "v_px": marked[:, 1],
            "target_id": target,
            "plane_down_m": plane_down,
        }
    )


def numbered(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Detections of several targets in the order of the images, each with its own number."""
    together = pd.concat(tables).sort_values("frame_id", kind="stable", ignore_index=True)
    together["detection_id"] = [f"d{number:06d}" for number in range(1, len(together) + 1)]
    return together
