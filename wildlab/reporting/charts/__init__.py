"""Figures of the reports, one file for each field: georeferencing, navigation, gating, tracks, sensors."""
