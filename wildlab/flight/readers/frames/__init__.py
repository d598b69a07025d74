"""Frames of cameras: folders of images, videos, radiometric JPEGs, as numbers with a unit and a mask.

A file is opened only where it is a regular one, its claims are held against limits before it is decoded, and
what cannot be used is a frame with a sentence in ``problem``: the rest goes on.
"""

from wildlab.flight.readers.frames.image import Frame, Polarity, Unit, read_image
from wildlab.flight.readers.frames.sequence import Frames, open_frames

__all__ = ["Frame", "Frames", "Polarity", "Unit", "open_frames", "read_image"]
