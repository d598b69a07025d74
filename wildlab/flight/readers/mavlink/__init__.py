"""Telemetry of MAVLink as ground stations keep it."""
