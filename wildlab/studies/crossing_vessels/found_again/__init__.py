"""Tracks of vessels that cross, ended between two laps and found again: H 3.4.2."""
