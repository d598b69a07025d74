"""How noisy detections are, from nothing but themselves: how rough they are from one look to the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from wildlab.analysis.scans import Scans
from wildlab.geometry.frames import Array, wrap

#: Median of the size of a standard normal number.
MEDIAN_OF_NORMAL = 0.6744897501960817
#: A quarter of all are smaller than this.
QUARTER_OF_NORMAL = 0.3186393639643751
#: Looks further apart than this many usual intervals are no neighbours.
NEIGHBOURS = 1.5
#: A triple that is so many standard deviations off the line is of no target.
FAR_OFF = 4.0
#: By so much each look is turned more than the last to see what chance makes of it, rad: no turn comes back.
TURN = np.pi * (3 - np.sqrt(5))
#: What is of targets lies nearer to a line than so many times what chance makes.
NEARER = 0.5


def roughness(scans: Scans) -> Array:
    """(m,) standard deviation of white noise that would make detections as rough as they are.

    Of three successive looks, the middle one less the mean of the others, of the same label, or without
    labels of detections that are nearest to each other from look to look; by the median, which a few wrong
    ones do not move. What bends in the way of a target between looks counts as noise, what lasts does not.
    NaN where there are no three looks in a row, or
    nothing in them lies better in line than chance makes it.
    """
    if not any(str(one) for one in scans.labels.ravel()):
        return _unnamed(scans)
    times, z = scans.times, scans.detections
    gap = NEIGHBOURS * scans.interval_s
    found: list[Array] = []
    names = sorted({str(one) for one in scans.labels.ravel() if one})
    angles = np.array(scans.angles)
    for name in names:
        last: list[tuple[float, Array]] = []
        for row in range(len(times)):
            here = z[row][np.isfinite(z[row]).all(axis=-1) & (scans.labels[row] == name)]
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
    return _spread(np.stack(found))


def _spread(values: Array) -> Array:
    """(m,) standard deviations of (N, m) by their medians."""
    return np.asarray(np.median(np.abs(values), axis=0) / MEDIAN_OF_NORMAL)


def _unnamed(scans: Scans) -> Array:
    """`roughness` where nobody says which detections are of one target, and some may be of none.

    Two of successive looks go together where each is the other's nearest. Triples of clutter lie much farther
    off the line than those of a target: they are left out by and by, until none is beyond `FAR_OFF`. What is
    left must lie nearer to a line than the same detections do when every look is turned by another angle,
    where nothing is of one target any more: else it is clutter itself, and NaN.
    """
    nothing = np.full(scans.detections.shape[-1], np.nan)
    values, off = _triples(scans, 0.0)
    if not len(values):
        return nothing
    # Half of all may be clutter: it starts from those that lie best in line.
    sd = np.quantile(np.abs(values), 0.25, axis=0) / QUARTER_OF_NORMAL
    while True:
        good = (np.abs(values) <= FAR_OFF * sd).all(axis=1)
        values, off = values[good], off[good]
        if not len(values):
            return nothing
        before_sd, sd = sd, _spread(values)
        if (sd >= before_sd).all():
            break
    _, by_chance = _triples(scans, TURN)
    alike = len(by_chance) and np.median(off) > NEARER * np.median(by_chance)
    return nothing if alike else sd


def _triples(scans: Scans, turn: float) -> tuple[Array, Array]:
    """(N, m) of three looks' detections that go together the middle one less the mean of the others, and (N,)
    how far that is where they are compared. Each look is turned by ``turn`` (rad) more than the last."""
    gap = NEIGHBOURS * scans.interval_s
    values = [np.zeros((0, scans.detections.shape[-1]))]
    off = [np.zeros(0)]
    before: list[tuple[float, Array, Array]] = []
    last = np.zeros(0, np.intp)
    for row, (time, z) in enumerate(zip(scans.times, scans.detections, strict=True)):
        here = z[np.isfinite(z).all(axis=-1)]
        if not len(here):
            continue
        if before and time - before[-1][0] > gap:
            before = []
        before = [*before[-2:], (float(time), here, _metric(scans, here, row, row * turn))]
        # Of each detection of this look, the one of the look before that it goes together with, or -1.
        own = _mutual(before[-2][2], before[-1][2]) if len(before) > 1 else np.full(len(here), -1)
        if len(before) == 3 and before[2][0] > before[0][0]:
            (t0, z0, x0), (t1, z1, x1), (t2, z2, x2) = before
            third = np.flatnonzero(own >= 0)
            third = third[last[own[third]] >= 0]
            second = own[third]
            first = last[second]
            share = (t1 - t0) / (t2 - t0)
            ahead, behind = z2[third] - z1[second], z0[first] - z1[second]
            ahead, behind = (np.where(np.array(scans.angles), wrap(one), one) for one in (ahead, behind))
            weight = 1 + share**2 + (1 - share) ** 2
            values.append(-((1 - share) * behind + share * ahead) / np.sqrt(weight))
            off.append(np.linalg.norm(x1[second] - (1 - share) * x0[first] - share * x2[third], axis=1))
        last = own
    return np.concatenate(values), np.concatenate(off)


def _metric(scans: Scans, z: Array, row: int, turn: float) -> Array:
    """Detections of a look where they may be compared, turned by an angle: ranges and bearings as places,
    bearings on a circle."""
    if scans.kind == "bearing":
        azimuth = z[:, 0] + turn
        return np.column_stack([np.cos(azimuth), np.sin(azimuth), z[:, 1:]])
    if scans.kind == "range-bearing":
        azimuth = z[:, 1] + turn
        return np.asarray(z[:, :1] * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1))
    c, s = np.cos(turn), np.sin(turn)
    centre = np.nan_to_num(scans.platform[row]) if scans.kind == "position" else np.zeros(2)
    return np.asarray((z[:, :2] - centre) @ np.array([[c, s], [-s, c]]) + centre)


def _mutual(before: Array, here: Array) -> NDArray[np.intp]:
    """(M,) of each detection of a look its nearest of the look before, where it is that one's nearest too."""
    back = np.asarray(cKDTree(before).query(here)[1], np.intp)
    forth = np.asarray(cKDTree(here).query(before)[1], np.intp)
    return np.where(forth[back] == np.arange(len(here)), back, -1)
