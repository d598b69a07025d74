"""Blocks of a recipe about the vehicle: its poses and its sensors."""

from __future__ import annotations

from typing import Any

from wildlab.flight.card.assumed import assumed
from wildlab.flight.card.blocks import angles, attitude, position, quantity, spreads, stream_of, velocity
from wildlab.flight.card.proposal import USED, UTC, Proposal, Sources
from wildlab.flight.card.roles import Choice
from wildlab.flight.readers.log import Stream


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
            "file": sources.table(own, "imu", f"{name}-imu"),
            "where": USED,
            "time": UTC,
            "force": {axis: quantity(f"f_{axis}_m_s2", "m/s2") for axis in "xyz"},
            "rate": {axis: quantity(f"w_{axis}_rad_s", "rad/s") for axis in "xyz"},
        }
    if field_ is not None:
        data["magnetometer"] = {
            "file": sources.table(own, "magnetometer", f"{name}-magnetometer"),
            "where": USED,
            "time": UTC,
            "field": {axis: quantity(f"field_{axis}_ut", "uT") for axis in "xyz"},
        }
    if gimbal is not None:
        add_gimbal(proposal, sources, own, gimbal, name)


def add_satellites(proposal: Proposal, sources: Sources, choice: Choice, name: str) -> None:
    stream = stream_of(choice, "gnss")
    block: dict[str, Any] = {
        "file": sources.table(choice, "gnss", f"{name}-gnss"),
        "where": USED,
        "time": UTC,
        "position": position(),
        **velocity(stream),
    }
    for key, column, unit in (
        ("sd_horizontal", "sd_horizontal_m", "m"),
        ("sd_vertical", "sd_vertical_m", "m"),
        ("sd_velocity", "sd_velocity_m_s", "m/s"),
    ):
        if column in stream.columns:
            block[key] = quantity(column, unit)
    block |= {key: key for key in ("satellites", "fix") if key in stream.columns}
    proposal.data["gnss"] = block


def add_poses(proposal: Proposal, sources: Sources, choice: Choice, name: str) -> None:
    stream = stream_of(choice, "poses")
    block: dict[str, Any] = {
        "file": sources.table(choice, "poses", f"{name}-poses"),
        "where": USED,
        "time": UTC,
        "attitude": attitude(stream),
        **velocity(stream),
        **spreads(stream),
    }
    if "latitude_deg" in stream.columns:
        block["position"] = position()
    else:
        block["position_from"] = "gnss"
    proposal.data.setdefault("poses", {})[name] = block


def add_gimbal(proposal: Proposal, sources: Sources, own: Choice, stream: Stream, name: str) -> None:
    """A gimbal's angles: against the airframe a table of its own, against the world the camera's poses."""
    file = sources.table(own, "gimbal", f"{name}-gimbal")
    block: dict[str, Any] = {"file": file, "where": USED, "time": UTC}
    if {"pan_deg", "tilt_deg"} <= set(stream.columns):
        turned = {"pan": quantity("pan_deg", "deg"), "tilt": quantity("tilt_deg", "deg")}
        proposal.data["gimbal"] = block | turned
    elif angles(stream) is not None and "gnss" in proposal.data:
        attitude = {axis: quantity(f"{axis}_world_deg", "deg") for axis in ("roll", "pitch", "yaw")}
        poses = block | {"position_from": "gnss", "attitude": attitude}
        proposal.data.setdefault("poses", {})["camera"] = poses
    else:
        del sources.logs[file]
