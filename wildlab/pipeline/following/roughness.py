"""How noisy detections are, from nothing but themselves: how rough they are from one look to the next."""

from __future__ import annotations

import numpy as np

from wildlab.geometry.frames import Array, wrap
from wildlab.pipeline.scans import Scans

#: Median of the size of a standard normal number.
MEDIAN_OF_NORMAL = 0.6744897501960817
#: Looks further apart than this many usual intervals are no neighbours.
NEIGHBOURS = 1.5


def roughness(scans: Scans) -> Array:
    """(m,) standard deviation of white noise that would make detections as rough as they are.

    Of three successive looks, the middle one less the mean of the others, of the same label or else each
    nearest to the last; by the median, which a few wrong ones do not move. What bends in the way of a target
    between looks counts as noise, what lasts does not. NaN where there are no three looks in a row.
    """
    times, z = scans.times, scans.detections
    gap = NEIGHBOURS * scans.interval_s
    found: list[Array] = []
    names = sorted({str(one) for one in scans.labels.ravel() if one}) or [""]
    angles = np.array(scans.angles)
    for name in names:
        last: list[tuple[float, Array]] = []
        for row in range(len(times)):
            here = z[row][np.isfinite(z[row]).all(axis=-1) & ((scans.labels[row] == name) | (name == ""))]
            if not len(here):
                continue
            if last and times[row] - last[-1][0] > gap:
                last = []
            step = here - last[-1][1] if last else np.zeros_like(here)
            step = np.where(angles, wrap(step), step)
            nearest = int(np.argmin(np.linalg.norm(step, axis=-1)))
            value = here[nearest] if not last else last[-1][1] + step[nearest]
            last.append((float(times[row]), value))
            if len(last) > 2:
                (t0, z0), (t1, z1), (t2, z2) = last[-3:]
                if t2 > t0:
                    share = (t1 - t0) / (t2 - t0)
                    weight = 1 + share**2 + (1 - share) ** 2
                    found.append((z1 - (1 - share) * z0 - share * z2) / np.sqrt(weight))
    if not found:
        return np.full(z.shape[-1], np.nan)
    return np.asarray(np.median(np.abs(np.stack(found)), axis=0) / MEDIAN_OF_NORMAL)
