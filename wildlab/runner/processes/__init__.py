"""Processes: jobs, their schedule, workers and notebooks, what is shown meanwhile, and their outputs."""
