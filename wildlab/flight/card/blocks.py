"""Blocks of a recipe out of the columns that a part of a log has."""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.card.roles import PARTS_SHOWN, Choice
from wildlab.flight.readers.log import Stream


def stream_of(choice: Choice, part: str) -> Stream:
    """A part that a role asks for.

    Raises
    ------
    WildlabError
        Where no row of it can be used, as where a role was stated that the file does not have the data for.
    """
    stream = choice.found.part(part)
    if stream is None:
        raise WildlabError(
            f"{choice.found.shown} is to be {choice.role!r}, and has no {PARTS_SHOWN.get(part, part)} that "
            "can be used",
            f"say what else it is, or leave it out: --role {choice.found.name}=nothing",
            field="--role",
        )
    return stream


def has_utc(stream: Stream) -> bool:
    """Whether some row that can be used has a time in UTC."""
    times = stream.columns.get("time_s")
    return times is not None and bool(np.isfinite(times[stream.used]).any())


def angles(stream: Stream) -> tuple[str, str] | None:
    """Which angles a part has: beginning and end of their columns' names, None without any."""
    for end in ("_world_deg", "_deg"):
        names = [f"{axis}{end}" for axis in ("roll", "pitch", "yaw")]
        if all(name in stream.columns for name in names):
            values = np.column_stack([stream.columns[name] for name in names])[stream.used]
            if np.isfinite(values).all(axis=1).any():
                return "", end
    return None


def quantity(column: str, unit: str) -> dict[str, Any]:
    return {"column": column, "unit": unit}


def position() -> dict[str, Any]:
    return {
        "latitude": quantity("latitude_deg", "deg"),
        "longitude": quantity("longitude_deg", "deg"),
        "height": quantity("height_m", "m"),
    }


def velocity(stream: Stream) -> dict[str, Any]:
    """The velocity, where each row that can be used has one."""
    names = [f"v_{axis}_m_s" for axis in ("north", "east", "down")]
    if any(name not in stream.columns for name in names):
        return {}
    values = np.column_stack([stream.columns[name] for name in names])[stream.used]
    if not np.isfinite(values).all() or _only_level(stream):
        return {}
    axes = ("north", "east", "down")
    return {"velocity": {axis: quantity(name, "m/s") for axis, name in zip(axes, names, strict=True)}}


def attitude(stream: Stream) -> dict[str, Any]:
    parts = ("q_w", "q_x", "q_y", "q_z")
    turned = all(name in stream.columns for name in parts)
    if turned and np.isfinite(stream.columns["q_w"][stream.used]).all():
        return {"quaternion": parts, "order": "wxyz"}
    _, end = angles(stream) or ("", "_deg")
    return {axis: quantity(f"{axis}{end}", "deg") for axis in ("roll", "pitch", "yaw")}


def spreads(stream: Stream) -> dict[str, Any]:
    names = {
        "horizontal": ("sd_horizontal_m", "m"),
        "vertical": ("sd_vertical_m", "m"),
        **{axis: (f"sd_{axis}_deg", "deg") for axis in ("tilt", "heading")},
    }
    for column, _ in names.values():
        values = stream.columns.get(column)
        if values is None or not (np.isfinite(values) & (values > 0))[stream.used].all():
            return {}
    return {"spreads": {name: quantity(column, unit) for name, (column, unit) in names.items()}}


def truth_spreads(stream: Stream) -> dict[str, Any]:
    names = {"sd_horizontal": "sd_horizontal_m", "sd_vertical": "sd_vertical_m"}
    return {key: quantity(column, "m") for key, column in names.items() if column in stream.columns}


#: A vehicle that goes up or down by more than this does not do so at 0 m/s.
CLIMBED_M = 3.0


def _only_level(stream: Stream) -> bool:
    """Whether a receiver that does not measure climbing says 0 for it, as those that speak NMEA do."""
    if stream.columns["v_down_m_s"][stream.used].any():
        return False
    heights = [one[stream.used] for name, one in stream.columns.items() if name.startswith("height_")]
    return any(np.isfinite(one).any() and np.nanmax(one) - np.nanmin(one) > CLIMBED_M for one in heights)
