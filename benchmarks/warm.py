"""Detectors on one thermal image of 640 x 512 pixels with twenty animals, on one core.

The yardstick is the shortest chain of OpenCV's own functions that finds the same outlines and says nothing of
them: no shapes, no covariances, no gates but that of size.
"""

from __future__ import annotations

import cv2
import numpy as np

from benchmarks.timing import best_of
from wildlab.detection.contrast import Contrast, find_by_contrast
from wildlab.detection.warm import Warm, find_warm


def make_image(animals: int = 20) -> np.ndarray:
    """Uneven ground, noise, and animals 80 grey levels above it."""
    rng = np.random.default_rng(1)
    rough = cv2.GaussianBlur(rng.normal(0, 1, (512, 640)), (0, 0), 20)
    image = 90 + 400 * rough + rng.normal(0, 3, (512, 640))
    for _ in range(animals):
        u, v = (int(one) for one in rng.integers([30, 30], [610, 480]))
        cv2.ellipse(image, (u, v), (11, 5), float(rng.uniform(0, 180)), 0, 360, 190.0, cv2.FILLED)
    return np.clip(image, 0, 255).astype(np.uint8)


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to plain OpenCV, what is wanted)."""
    image, valid = make_image(), np.ones((512, 640), bool)
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)

    def plain() -> list[object]:
        level = float(np.median(image)) + 65
        white = cv2.threshold(image, level, 255, cv2.THRESH_BINARY)[1]
        outlines = cv2.findContours(white, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
        return [cv2.moments(one) for one in outlines if 12 <= cv2.contourArea(one) <= 1500]

    chains = {
        "F's chain, constant threshold": lambda: find_warm(image, valid, Warm()),
        "F's chain, adaptive threshold": lambda: find_warm(image, valid, Warm(threshold="adaptive")),
        "local contrast": lambda: find_by_contrast(image, valid, Contrast()),
    }
    try:
        baseline = best_of(plain, repeats=15)
        rows = [(f"plain OpenCV, {1 / baseline:.0f} frames/s", baseline, 1.0, "")]
        for name, chain in chains.items():
            seconds = best_of(chain, repeats=15)
            wanted = "at least 120 frames/s" if name.startswith("F") else ""
            rows.append((f"{name}, {1 / seconds:.0f} frames/s", seconds, seconds / baseline, wanted))
    finally:
        cv2.setNumThreads(threads)
    return "Warm things in an image of 640 x 512 pixels, one core", rows
