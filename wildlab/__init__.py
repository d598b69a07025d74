"""wildlab: a reproducible offline analysis and reporting workbench for UAV surveillance flights."""

__version__ = "0.1.0"
