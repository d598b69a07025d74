"""Targets tracked through a flight: scans, noise, starts, filters, and how good the tracks are."""
