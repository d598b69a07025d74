"""Is a flight usable, for what, and does it make sense? A file for each kind of finding; `check` asks all."""
