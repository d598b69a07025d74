"""Logs of ArduPilot: DataFlash, binary and as text, in three generations of names."""
