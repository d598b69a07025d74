"""Is a flight usable, for what, and does it make sense? One file for each kind of finding; `check` asks all."""
