"""Pixels of things in images: points and boxes of other programs, and of `wildlab click`."""
