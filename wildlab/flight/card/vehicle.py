"""Blocks of a recipe about the vehicle, out of the columns that a part of a log has: poses and sensors.

What is assumed where logs say nothing stands in data, and is written into the recipe with a note.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wildlab.flight.card.proposal import Proposal, Sources, angles, stream_of
from wildlab.flight.card.roles import Choice
from wildlab.flight.files import read_toml
from wildlab.flight.readers.log import Stream
from wildlab.paths import DATA

FILE = DATA / "recipes" / "assumed.toml"


def assumed(part: str) -> dict[str, Any]:
    """What is assumed of ``"uncertainty"`` or ``"imu"``, as it stands in a recipe."""
    return dict(read_toml(FILE, "what is assumed where logs say nothing")[part])


def uncertainty_of(streams: Mapping[tuple[str, str], Stream]) -> tuple[dict[str, Any], str]:
    """The part ``[uncertainty]``: positions by the receivers' own statements where there are any.

    Parameters
    ----------
    streams
        The parts with positions.

    Returns
    -------
    dict, and a sentence on it
    """
    found, stated = assumed("uncertainty"), []
    for key, column in (
        ("position_horizontal_m", "sd_horizontal_m"),
        ("position_vertical_m", "sd_vertical_m"),
    ):
        values = [one.columns[column][one.used] for one in streams.values() if column in one.columns]
        every = np.concatenate([np.empty(0), *values])
        every = every[np.isfinite(every) & (every > 0)]
        if len(every):
            found[key] = round(float(np.median(every)), 4)
            stated.append(key.removesuffix("_m").replace("_", " "))
    if stated:
        found["note"] = (
            f"{' and '.join(stated).capitalize()}: median of what the receiver stated. The rest: "
            + found["note"]
        )
    said = (
        f"Assumed, since no log states it: pixels to {found['pixel_px']:g} px, tilt to "
        f"{found['tilt_deg']:g} deg, heading to {found['heading_deg']:g} deg"
    )
    if "position horizontal" not in stated:
        level, height = found["position_horizontal_m"], found["position_vertical_m"]
        said += f", positions to {level:g} m ({height:g} m in height)"
    return found, said + ". [uncertainty] has them: ellipses and verdicts on consistency rest on that."


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


def add_vehicle(proposal: Proposal, sources: Sources, own: Choice, name: str, receiver: bool) -> None:
    """What the vehicle's own log has: poses, and its sensors."""
    data = proposal.data
    if own.found.part("gnss") is not None and receiver:
        add_satellites(proposal, sources, own, name)
    if own.found.part("poses") is not None:
        add_poses(proposal, sources, own, "autopilot")
    imu, field_, gimbal = (own.found.part(one) for one in ("imu", "magnetometer", "gimbal"))
    if imu is not None:
        data["imu"] = {
            **assumed("imu"),
            **sources.over_time(own, "imu", f"{name}-imu"),
            "force": {axis: quantity(f"f_{axis}_m_s2", "m/s2") for axis in "xyz"},
            "rate": {axis: quantity(f"w_{axis}_rad_s", "rad/s") for axis in "xyz"},
        }
    if field_ is not None:
        data["magnetometer"] = {
            **sources.over_time(own, "magnetometer", f"{name}-magnetometer"),
            "field": {axis: quantity(f"field_{axis}_ut", "uT") for axis in "xyz"},
        }
    if gimbal is not None:
        add_gimbal(proposal, sources, own, gimbal, name)


def add_satellites(proposal: Proposal, sources: Sources, choice: Choice, name: str) -> None:
    stream = stream_of(choice, "gnss")
    block = sources.over_time(choice, "gnss", f"{name}-gnss")
    block |= {"position": position(), **velocity(stream), **truth_spreads(stream)}
    if "sd_velocity_m_s" in stream.columns:
        block["sd_velocity"] = quantity("sd_velocity_m_s", "m/s")
    block |= {key: key for key in ("satellites", "fix") if key in stream.columns}
    proposal.data["gnss"] = block


def add_poses(proposal: Proposal, sources: Sources, choice: Choice, name: str) -> None:
    stream = stream_of(choice, "poses")
    block = sources.over_time(choice, "poses", f"{name}-poses")
    block |= {"attitude": attitude(stream), **velocity(stream), **spreads(stream)}
    placed = "latitude_deg" in stream.columns
    block |= {"position": position()} if placed else {"position_from": "gnss"}
    proposal.data.setdefault("poses", {})[name] = block


def add_gimbal(proposal: Proposal, sources: Sources, own: Choice, stream: Stream, name: str) -> None:
    """A gimbal's angles: against the airframe a table of its own, against the world the camera's poses."""
    block = sources.over_time(own, "gimbal", f"{name}-gimbal")
    if {"pan_deg", "tilt_deg"} <= set(stream.columns):
        turned = {"pan": quantity("pan_deg", "deg"), "tilt": quantity("tilt_deg", "deg")}
        proposal.data["gimbal"] = block | turned
    elif angles(stream) is not None and "gnss" in proposal.data:
        attitude = {axis: quantity(f"{axis}_world_deg", "deg") for axis in ("roll", "pitch", "yaw")}
        poses = block | {"position_from": "gnss", "attitude": attitude}
        proposal.data.setdefault("poses", {})["camera"] = poses
    else:
        del sources.logs[block["file"]]
