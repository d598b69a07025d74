"""Targets tracked through a flight: looks, beliefs, starts, filters, and how far to believe the tracks."""
