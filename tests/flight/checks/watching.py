"""Flights whose sensors watch what goes about: poses, looks and what is in them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from wildlab.flight.store import Flight


def level_poses(t: Any, north: Any, east: Any = 0.0, yaw: Any = 0.0) -> pd.DataFrame:
    nav = pd.DataFrame({"time_s": t, "north_m": north, "east_m": east, "down_m": 0.0})
    return nav.assign(q_w=np.cos(yaw / 2), q_x=0.0, q_y=0.0, q_z=np.sin(yaw / 2))


def watch(
    make: Callable[..., Flight],
    nav: pd.DataFrame,
    looks: Any,
    *seen: dict[str, Any],
    kind: str = "range-bearing",
) -> Flight:
    """The small flight with poses `log`, looks ``l0``, ``l1``, ... of a radar at those times, and no truth.

    Of each thing `seen`, columns that have a value for each look.
    """
    flight = make()
    flight.nav.clear()
    flight.nav["log"] = nav
    ids = [f"l{k}" for k in range(len(looks))]
    flight.tables["frames"] = pd.DataFrame({"frame_id": ids, "time_s": looks, "sensor": "radar"})
    rows = pd.concat([pd.DataFrame({"frame_id": ids, **one}) for one in seen], ignore_index=True)
    numbers = [str(k) for k in range(len(rows))]
    flight.tables["detections"] = rows.assign(detection_id=numbers, source="radar", kind=kind, target_id="")
    del flight.tables["truth"]
    return flight


def add_sensor(flight: Flight, name: str, detections: pd.DataFrame, late_s: float = 0.0) -> None:
    """Looks and detections of a second sensor, as the first one's, but for their names and stamps."""
    frames, seen = flight.table("frames"), flight.table("detections")
    looks = frames.assign(frame_id=name + frames["frame_id"], sensor=name, time_s=frames["time_s"] + late_s)
    ids = {one: name + detections[one] for one in ("frame_id", "detection_id")}
    other = detections.assign(source=name, **ids)
    both = pd.concat([frames, looks]).sort_values("time_s", kind="stable", ignore_index=True)
    flight.tables["frames"] = both
    flight.tables["detections"] = pd.concat([seen, other], ignore_index=True)
