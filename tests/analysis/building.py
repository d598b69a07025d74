"""Parts of made-up flights: manifest, poses, surveyed points."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from wildlab.flight.manifest import Manifest, make_manifest
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import matrix_to_quaternion

NED = ["north_m", "east_m", "down_m"]


def manifest_of(camera: Camera | None = None, **parts: Any) -> Manifest:
    given: dict[str, Any] = {
        "name": "made-up",
        "kind": "logged",
        "origin": {"latitude_deg": 60.0, "longitude_deg": 10.0, "height_m": 0.0},
        "platform": {"name": "made up"},
        "time": {"kind": "utc", "epoch": "2024-01-01T00:00:00Z"},
    }
    if camera is not None:
        names = ("width", "height", "fx", "fy", "cx", "cy")
        given["camera"] = {"name": "made up"} | {f"{name}_px": getattr(camera, name) for name in names}
    return make_manifest(given | parts)


def poses_table(t: np.ndarray, p: np.ndarray, R: np.ndarray) -> pd.DataFrame:
    """Positions (n, 3) and attitudes (n, 3, 3) at times."""
    q = matrix_to_quaternion(R)
    columns = ["time_s", *NED, "q_w", "q_x", "q_y", "q_z"]
    return pd.DataFrame(np.column_stack([t, p, q]), columns=columns)


def surveyed(names: list[str], p: np.ndarray) -> pd.DataFrame:
    """The truth of points (n, 3) that stay where they are."""
    return pd.DataFrame({"target_id": names, "time_s": np.nan, **dict(zip(NED, p.T, strict=True))})
