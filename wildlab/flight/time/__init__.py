"""Time scales and clocks: GPS time to UTC, and one clock's stamps to another's."""
