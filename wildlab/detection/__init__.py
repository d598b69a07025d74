"""Finding things in frames: arrays in, detections with their own uncertainty out."""
