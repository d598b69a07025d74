"""Attitudes at the stamps of 100,000 images, between those of a log: compiled, and by scipy."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.timing import best_of
from wildlab.geometry.kernels import between_attitudes

COUNT = 100_000


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to scipy's, what is wanted)."""
    rng = np.random.default_rng(1)
    q = rng.normal(size=(30_000, 4))
    before = rng.integers(0, len(q) - 1, COUNT)
    given = q, before, before + 1, rng.uniform(size=COUNT)

    def by_scipy() -> None:
        start, end = (Rotation.from_quat(q[rows], scalar_first=True) for rows in given[1:3])
        turn = given[3][:, None] * (start.inv() * end).as_rotvec()
        (start * Rotation.from_rotvec(turn)).as_matrix()

    theirs = best_of(by_scipy, repeats=5)
    ours = best_of(lambda: between_attitudes(*given), repeats=5)
    rows = [("scipy", theirs, 1.0, ""), ("wildlab", ours, ours / theirs, "at most 0.5")]
    return f"{COUNT:,} attitudes between two others", rows
