"""Targets followed through a flight by any of its sensors: what filters are told, what they make of it, and
how far to believe them."""
