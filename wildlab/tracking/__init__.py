"""Tracking filters: stateless predict and update on arrays."""
