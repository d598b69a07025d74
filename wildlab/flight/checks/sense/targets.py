"""One target whose truth is off: other sensors see it beside where it is said to be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sense.looks import NEAR_M, SourceLooks, scans_of
from wildlab.flight.checks.sense.trial import FAR_BETTER_ALONE
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: What is seen this near (m) to a target may be of it; a constant offset is at least so large, and holds for
#: at least this share of it and so many detections.
AROUND_M, OFF_M, SHARE, ENOUGH = 60.0, 15.0, 0.4, 30


def offset_of(away: Array) -> tuple[Array, float, float]:
    """Where most of what is seen around a target lies: the offset (2,) m, and the shares there and at it.

    Parameters
    ----------
    away
        (N, 2): detections less the target, m, all of them near.

    Returns
    -------
    The offset, the share of detections near it, and the share near the target itself.

    Examples
    --------
    >>> offset, there, here = offset_of(np.array([[25.0, 0.0]] * 40 + [[-30.0, 9.0]] * 10))
    >>> print(offset, there, here)
    [25.  0.] 0.8 0.0
    """
    near = np.linalg.norm(away[:, None] - away[None], axis=2) < NEAR_M
    centre = away[int(np.argmax(near.sum(axis=1)))]
    for _ in range(3):
        centre = away[np.linalg.norm(away - centre, axis=1) < NEAR_M].mean(axis=0)
    there = float(np.mean(np.linalg.norm(away - centre, axis=1) < NEAR_M))
    return centre, there, float(np.mean(np.linalg.norm(away, axis=1) < NEAR_M))


def targets(flight: Flight) -> Iterator[Finding]:
    """Every target against the sources of positions."""
    scans = [one for one in scans_of(flight) if one.places is not None]
    if flight.truth is None:
        return
    names = list(dict.fromkeys(flight.truth["target_id"]))
    for number, name in enumerate(names):
        for scan in scans:
            away = _near(scan, number)
            if len(away) < ENOUGH:
                continue
            offset, there, here = offset_of(away)
            size = float(np.hypot(*offset))
            if size > OFF_M and there > SHARE and there > FAR_BETTER_ALONE * max(here, 0.01):
                yield Finding(
                    "warning",
                    "truth",
                    "target_id",
                    f"{scan.source} sees target {name!r} {size:.0f} m beside its truth, "
                    f"{100 * there:.0f} % of "
                    f"the time, and {100 * here:.0f} % of the time there",
                    "check where the receiver sits on the target, and position, name and clock of this truth",
                    ("one mark off",),
                )
                break


def _near(scan: SourceLooks, number: int) -> Array:
    if scan.places is None:
        return np.empty((0, 2))
    others = np.linalg.norm((scan.targets - scan.places)[..., :2], axis=2)
    with np.errstate(invalid="ignore"):
        own = (np.nanmin(np.where(np.isfinite(others), others, np.inf), axis=0) == others[number]) & (
            others[number] < AROUND_M
        )
    return np.asarray((scan.places - scan.targets[number])[own, :2])
