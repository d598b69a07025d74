"""Folders of images: what stands in their headers."""
