"""Surveyed points: KML, GeoJSON and tables."""
