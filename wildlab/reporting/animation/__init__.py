"""A flight that moves on a page without a script: arrays in, one SVG out, still where that is asked for."""

from wildlab.reporting.animation.drawing import animated_flight, pausable
from wildlab.reporting.animation.shown import Course, Ellipses, Outlines, ShownFlight

__all__ = ["Course", "Ellipses", "Outlines", "ShownFlight", "animated_flight", "pausable"]
