"""Tracks of satellite receivers: GPX, NMEA 0183, u-blox UBX, RTKLIB."""
