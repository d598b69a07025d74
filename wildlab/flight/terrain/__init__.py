"""Elevation maps into flights: what is said of a map, how it is read, and how it comes into frame n."""
