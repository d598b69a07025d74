"""Constant offsets of sightings, found on the sightings themselves: height, clock, hours of a zone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from wildlab.flight.checks.corrections import change_place, shift_clock, shift_poses
from wildlab.flight.checks.sense.sightings import Sightings, finite, glance, missed
from wildlab.flight.checks.sense.trial import Mistake
from wildlab.geometry.frames import Array
from wildlab.geometry.mount import camera_pose

#: Heights are looked for this far (m) and clocks this far (s); finer steps near zero.
HEIGHTS = np.sinh(np.linspace(-7.5, 7.5, 41)) * 2.0
CLOCKS = np.sinh(np.linspace(-5.0, 5.0, 41)) * 0.8
HOURS = tuple(h for h in np.arange(-14.0, 14.25, 0.25) if h)
LEAP_S = (18.0, -18.0, 19.0, -19.0, 37.0, -37.0)
#: A mount is off by a few degrees and no wrong meaning; beyond the second, a turn is one of the usual ones.
TURNED_DEG, LARGEST_TURN_DEG, ROUNDS = 5.0, 40.0, 6
#: Over which misses are differentiated by the clock, either way, s.
STEP_S = 0.05
#: Beyond this correlation a clock and a turn of the camera are hard to tell apart.
HARD = 0.7
GOLDEN = (np.sqrt(5) - 1) / 2


def best_of(cost: Callable[[float], float], grid: Array, rounds: int = 12) -> float:
    """Where a cost is least: the best of a grid, refined between its neighbours."""
    costs = np.array([cost(float(x)) for x in grid])
    if not np.isfinite(costs).any():
        return 0.0
    k = int(np.nanargmin(np.where(np.isfinite(costs), costs, np.inf)))
    low, high = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, len(grid) - 1)])
    for _ in range(rounds):
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (low, b) if cost(a) < cost(b) else (a, high)
    return (low + high) / 2


def cost_of(s: Sightings) -> float:
    """How badly sightings fit: with small errors allowed for a constant is hardly seen, and without it takes
    their part, so both count."""
    return float(np.sqrt(np.prod(glance(s))))


def raised(s: Sightings, by: float) -> Sightings:
    """Poses that are higher by so many metres."""
    return replace(s, p_nb=s.p_nb - np.array([0.0, 0.0, by]))


def shifted(s: Sightings, by: float) -> Sightings:
    """The same sightings, had the camera's clock been so many seconds later."""
    return replace(s, **s.looked(by)._asdict())


def height_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """A constant by which the poses are too high or too low."""
    by = best_of(lambda h: cost_of(raised(s, h)), HEIGHTS)
    if abs(by) < 3.0:
        return
    part = f"poses.{s.source}"
    yield Mistake(
        "constant height",
        f"the heights of nav/{s.source} are {abs(by):.0f} m too {'low' if by > 0 else 'high'} against "
        "those of "
        "the known points (another vertical reference, as the geoid or the place of the start?)",
        f'`correction_m = {-by:.1f}` more in [vertical] with `taken_off = ["poses"]`, or the right column in '
        f"[{part}.position]",
        lambda x: raised(x, by),
        fitted=True,
        corrections=(change_place(f"nav/{s.source}", lambda p: p - np.array([0.0, 0.0, by])),),
    )


def turn_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """A camera that is turned against its mount by a constant, as a tilt that was not stated."""
    e = constant_turn(s)
    size = float(np.degrees(np.linalg.norm(e)))
    if not TURNED_DEG < size < LARGEST_TURN_DEG:
        return
    tilt, pan, roll = np.degrees(e)
    yield Mistake(
        "camera turned",
        f"the camera is turned by {size:.0f} deg against what is stated (about the image's axes: right "
        f"{tilt:.0f}, down {pan:.0f}, optical axis {roll:.0f} deg)",
        "the right angles of [mount], or the misalignment that `wildlab calibrate` estimates",
        lambda x: turned_camera(x, e),
        fitted=True,
    )


def constant_turn(s: Sightings) -> Array:
    """The rotation vector (3,) in c, rad, from known points to rays that all sightings share; robust."""
    m = missed(s)
    rows = finite(m)
    e = np.zeros(3)
    across = (np.eye(3) - m.towards[:, :, None] * m.towards[:, None, :])[rows]
    for _ in range(ROUNDS):
        size = np.linalg.norm(m.turn[rows] - across @ e, axis=1)
        weight = 1 / (1 + (size / (2 * max(float(np.median(size)), 1e-9))) ** 2)
        A = np.einsum("nij,n->ij", across, weight) + 1e-9 * np.eye(3)
        e = np.linalg.solve(A, np.einsum("n,ni->i", weight, m.turn[rows]))
    return np.asarray(e)


def turned_camera(s: Sightings, e: Array) -> Sightings:
    """The sightings of a camera turned back by a rotation vector (3,) in c, by the attitude of the poses."""
    _, R_nc = camera_pose(s.mount, s.p_nb, s.R_nb, s.pan, s.tilt)
    R_cb = np.swapaxes(R_nc, 1, 2) @ s.R_nb
    return replace(s, R_nb=R_nc @ Rotation.from_rotvec(-e).as_matrix() @ R_cb)


class ClockFit(NamedTuple):
    """How well an offset of the clock is known: its standard deviation (s) from image to image, a turn of the
    camera being as free, and the multiple correlation of the two, 0 to 1."""

    sd_s: float
    correlation: float


def clock_fit(s: Sightings, by: float) -> ClockFit | None:
    """How well an offset of the camera's clock is known beside a turn of the camera.

    Least squares of the misses about the offset, linear in it and in three small turns; what images share
    is allowed for by taking each as one.

    Parameters
    ----------
    s
        The sightings as they are.
    by
        The offset, s.

    Returns
    -------
    ClockFit or None
        None where the sightings do not determine it.
    """
    m, before, after = (missed(shifted(s, by + step)) for step in (0.0, -STEP_S, STEP_S))
    rows = finite(m) & finite(before) & finite(after)
    across = np.eye(3) - m.towards[:, :, None] * m.towards[:, None, :]
    J = np.concatenate([across, ((before.turn - after.turn) / (2 * STEP_S))[:, :, None]], axis=2)[rows]
    size = np.linalg.norm(m.turn[rows], axis=1)
    # Far ones count little: a wrong click must not widen or shift what all others say.
    weight = 1 / (1 + (size / (2 * max(float(np.median(size)), 1e-9) + 1e-12)) ** 2) if len(size) else size
    A = np.einsum("nia,n,nib->ab", J, weight, J)
    image = np.unique(s.image[rows], return_inverse=True)[1]
    if len(size) < 8 or image.max() < 5 or np.linalg.cond(A) > 1e12:
        return None
    C = np.linalg.inv(A)
    left = m.turn[rows] - J @ (C @ np.einsum("nia,n,ni->a", J, weight, m.turn[rows]))
    score = np.zeros((image.max() + 1, 4))
    np.add.at(score, image, np.einsum("nia,n,ni->na", J, weight, left))
    n = len(score)
    variance = float((C @ (score.T @ score) @ C)[3, 3]) * n / (n - 4)
    return ClockFit(float(np.sqrt(variance)), float(np.sqrt(max(0.0, 1 - 1 / (A[3, 3] * C[3, 3])))))


def _how_sure(s: Sightings, by: float) -> str:
    """The interval of an offset of the clock, and what it is hard to tell from; nothing if not known.

    Noise of poses that is new at each of them is least half-way between two: where images come as regularly
    as poses, the offset that fits best lies there, up to half of the time between two poses from the true.
    """
    found = clock_fit(s, by)
    if found is None:
        return ""
    wide = 1.96 * found.sd_s + s.between_s / 2
    low, high = abs(by) - wide, abs(by) + wide
    hard = ", from which it is hard to tell" if found.correlation > HARD else ""
    return (
        f" ({low:.2f} to {high:.2f} s, 95 %; correlation {found.correlation:.2f} with a tilt or turn of the "
        f"camera{hard})"
    )


def clock_mistakes(s: Sightings, offset_s: float) -> Iterator[Mistake[Sightings]]:
    """A constant by which the camera's clock is late or early; `offset_s` is what the manifest has."""
    by = best_of(lambda t: cost_of(shifted(s, t)), CLOCKS)
    if abs(by) > 0.05:
        yield Mistake(
            "clock of the camera",
            f"the images were taken {abs(by):.2f} s {'later' if by > 0 else 'earlier'} than their stamps say"
            f"{_how_sure(s, by)}",
            f"`camera_offset_s = {offset_s + by:.2f}` in [clocks], or what `wildlab clock` measures; "
            "reports on these same points flatter it then",
            lambda x: shifted(x, by),
            fitted=True,
            corrections=(shift_clock("camera_offset_s", by), shift_poses(s.source, -by)),
        )
    for seconds in LEAP_S:
        yield Mistake(
            f"leap seconds ({seconds:g} s)",
            f"the images were taken {abs(seconds):g} s {'later' if seconds > 0 else 'earlier'} than their "
            "stamps say, as between GPS time and UTC",
            f"`camera_offset_s = {offset_s + seconds:g}` in [clocks]",
            lambda x, t=seconds: shifted(x, t),  # type: ignore[misc]
            corrections=(shift_clock("camera_offset_s", seconds), shift_poses(s.source, -seconds)),
        )
    for hours in HOURS:
        yield Mistake(
            f"zone ({hours:+g} h)",
            f"the stamps of the images are {abs(hours):g} h {'early' if hours > 0 else 'late'}",
            f"the `zone` of the stamps in [frames.time] or [time]: they are {abs(hours):g} h off",
            lambda x, t=3600.0 * hours: shifted(x, t),  # type: ignore[misc]
        )
