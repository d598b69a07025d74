"""Many targets of a flight at once: what the tracker is told, what it is given, and how it did."""
