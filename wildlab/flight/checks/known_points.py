"""Whether known points are where the poses have them, and if not, which mistake it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.mistakes import (
    FALL,
    LIKE_NOISE,
    Misfit,
    Mistake,
    Row,
    attitudes_in,
    blame,
    change_by,
    explain,
    mistake,
    one_row,
    places_in,
    raise_by,
    rotations_of_axes,
    rows_of,
    shift_clock,
    shift_poses,
    state,
    undo_in,
)
from wildlab.flight.checks.sightings import (
    Sightings,
    glance,
    halves_of,
    metres,
    misfit,
    missed,
    sightings,
)
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array, euler_to_matrix, matrix_to_euler
from wildlab.geometry.mount import R_MC_DOWN, R_MC_FORWARD, Looks, Mount, camera_pose, camera_rotation

#: Without a known mistake, misses this many times what is expected and this large (deg) are still said.
UNEXPLAINED, UNEXPLAINED_DEG = 4.0, 8.0
#: Heights are looked for this far (m) and clocks this far (s); finer steps near zero.
HEIGHTS = np.sinh(np.linspace(-7.5, 7.5, 41)) * 2.0
CLOCKS = np.sinh(np.linspace(-5.0, 5.0, 41)) * 0.8
HOURS = tuple(h for h in np.arange(-14.0, 14.25, 0.25) if h)
LEAP_S = (18.0, -18.0, 19.0, -19.0, 37.0, -37.0)
#: A mount is off by a few degrees and no wrong meaning; beyond the second, a turn is one of the usual ones.
TURNED_DEG, LARGEST_TURN_DEG, ROUNDS = 5.0, 40.0, 6
GOLDEN = (np.sqrt(5) - 1) / 2
#: A lever arm is no longer than this, m.
LONGEST_LEVER = 5.0


def known_points(flight: Flight) -> Iterator[Finding]:
    """Clicks on known points against the poses, for each nav source.

    Parameters
    ----------
    flight
        The flight.

    Yields
    ------
    Finding
    """
    for name in flight.nav:
        if name.startswith("truth"):  # a twin's own, no log
            continue
        given = sightings(flight, name)
        if given is not None:
            yield from judge(flight, given)


def judge(flight: Flight, given: Sightings) -> Iterator[Finding]:
    """The findings about one nav source."""
    if not given.named:
        many = flight.manifest.targets.many
        if many is not None and many.others:
            return  # most of what is detected may be of those whose places nobody knows
        yield from nameless(flight, given)
        return
    named = explain(misfit, given, camera_mistakes(flight, given), glance)
    # What is expected may change with a mistake, too: metres have to fall as well.
    named = [one for one in named if metres(one.undone) < metres(given)]
    table = f"nav/{given.source}"
    if named:
        corrections = [
            correct
            for one in named
            for correct in one.corrections or (_stated(one.undone.camera, one.undone.mount),)
        ]
        facts = {"before": metres(given), "after": metres(named[0].undone)}
        yield blame("problem", table, "", "points-explained", named, facts, corrections)
    else:
        m = missed(given)
        angle = np.degrees(np.median(m.angle[m.good])) if m.good.any() else np.nan
        if misfit(given)[0, 0] > UNEXPLAINED and angle > UNEXPLAINED_DEG:
            facts = {"metres": metres(given), "angle": angle}
            yield Finding("warning", table, "", "points-missed", facts)


def _stated(camera: Camera, mount: Mount) -> Callable[[Flight], Flight | None]:
    """State another calibration and another mount."""
    turned = zip(("roll", "tilt", "pan"), np.degrees(mount.misalignment).tolist(), strict=True)
    return state(
        {
            "camera": {
                **{f"{name}_px": float(getattr(camera, name)) for name in ("fx", "fy", "cx", "cy")},
                **dict(zip(("k1", "k2", "p1", "p2", "k3"), camera.distortion, strict=True)),
            },
            "mount": {
                "looks": mount.looks,
                "lever_arm_m": mount.lever_arm,
                **{f"misalignment_{name}_deg": angle for name, angle in turned},
            },
        }
    )


def camera_mistakes(flight: Flight, s: Sightings) -> Iterator[Mistake[Sightings]]:
    """All usual mistakes that change where known points are seen."""
    yield from mount_mistakes(s)
    yield from attitudes_in(s.source, "", "R_nb")
    yield from pixel_mistakes(s)
    yield from calibration_mistakes(s)
    yield from places_in(f"nav/{s.source}", s.origin, "poses", "p_nb")
    yield from places_in("truth", s.origin, "truth", "points")
    yield from height_mistakes(s)
    yield from turn_mistakes(s)
    if flight.manifest.time.kind == "utc":
        yield from clock_mistakes(s, flight.manifest.clocks.camera_offset_s)


# -- mount, pixels and calibration


def mount_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """The other of down and forward, and the 24 ways in which a camera can be turned by quarter turns."""

    def mounted(**parts: Any) -> Callable[[Sightings], Sightings]:
        return lambda x: replace(x, mount=replace(x.mount, **parts))

    mount = s.mount
    other: Looks = "forward" if mount.looks == "down" else "down"
    yield mistake(one_row("looks"), mounted(looks=other), other=other, looks=mount.looks)
    base = euler_to_matrix(*mount.misalignment)
    turns = {"down": R_MC_DOWN, "forward": R_MC_FORWARD}
    done = [camera_rotation(replace(mount, misalignment=(0.0, 0.0, 0.0), pan=0.0, tilt=0.0)), turns[other]]
    # Those with the fewest words first.
    by_words = sorted(rotations_of_axes(), key=lambda R: int((np.abs(matrix_to_euler(R)) > 1e-6).sum()))
    for way in by_words:
        for looks, R_mc in turns.items():
            R_bc = way @ R_mc
            if any(np.allclose(R_bc, one) for one in done):
                continue
            done.append(R_bc)
            turned = tuple(matrix_to_euler(base @ way))
            lines = [f'looks = "{looks}"'] + [
                f"misalignment_{key}_deg = {np.degrees(angle):.4g}"
                for key, angle in zip(("roll", "tilt", "pan"), turned, strict=True)
                if abs(angle) > 1e-6
            ]
            yield mistake(
                one_row("mounted"),
                mounted(looks=looks, misalignment=turned),
                lens=_side(R_bc @ [0.0, 0.0, 1.0]),
                top=_side(R_bc @ [0.0, -1.0, 0.0]),
                lines=", ".join(lines),
            )
    if any(abs(angle) > 1e-9 for angle in mount.misalignment):
        for row in rows_of("misalignment"):
            yield mistake(row, mounted(misalignment=_changed(row, mount.misalignment)))
    if (np.abs([s.pan, s.tilt]) > 1e-9).any():
        for row in rows_of("gimbal"):
            change = change_by(row, np.radians(1.0))
            yield mistake(row, _gimbal(change), where="[gimbal]" if s.own_gimbal else "[mount]")
    if max(map(abs, mount.lever_arm)) > LONGEST_LEVER:
        for row in rows_of("lever-arm"):
            arm = _changed(row, mount.lever_arm)
            yield mistake(row, mounted(lever_arm=arm), what="camera", part="mount")


def _changed(row: Any, numbers: tuple[float, ...]) -> tuple[float, ...]:
    changed = change_by(row)(np.array(numbers))
    return numbers if changed is None else tuple(changed.tolist())


def _gimbal(change: Callable[[Array], Array | None]) -> Callable[[Sightings], Sightings | None]:
    def undo(s: Sightings) -> Sightings | None:
        angles = change(np.column_stack([s.pan, s.tilt]))
        return None if angles is None else replace(s, pan=angles[:, 0], tilt=angles[:, 1])

    return undo


def _side(direction: Array) -> str:
    names = ("forward", "right", "down"), ("backward", "left", "up")
    axis = int(np.argmax(np.abs(direction)))
    return names[0 if direction[axis] > 0 else 1][axis]


def pixel_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """Where pixels are counted from, which is which, and in what."""
    for row in rows_of("pixels"):
        yield mistake(row, undo_in(change_by(row, [s.camera.width, s.camera.height]), "uv"))


def calibration_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """Focal length, principal point, distortion."""
    camera = s.camera
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion)
    size = np.array([0, 0, camera.width, camera.height, 0, 0, 0, 0, 0])
    for row in rows_of("calibration"):
        right = change_by(row, size)(np.array(numbers))
        if right is not None and tuple(right) != numbers:
            fx, fy, cx, cy, *distortion = right.tolist()
            changed = replace(camera, fx=fx, fy=fy, cx=cx, cy=cy, distortion=tuple(distortion))
            yield mistake(row, lambda x, c=changed: replace(x, camera=c), camera=changed)  # type: ignore[misc]


# -- constants that are fitted: height, clock, turn


def best_of(cost: Callable[[float], float], grid: Array) -> float:
    """Where a cost is least: the best of a grid, refined between its neighbours."""
    costs = np.array([cost(x) for x in grid])
    if not np.isfinite(costs).any():
        return 0.0
    k = int(np.nanargmin(np.where(np.isfinite(costs), costs, np.inf)))
    low, high = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, len(grid) - 1)])
    for _ in range(12):
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (low, b) if cost(a) < cost(b) else (a, high)
    return (low + high) / 2


def _cost(s: Sightings) -> float:
    """How badly sightings fit: with small errors allowed for a constant is hardly seen, and without it takes
    their part, so both count."""
    return float(np.sqrt(np.prod(glance(s))))


def _raised(s: Sightings, by: float) -> Sightings:
    return replace(s, p_nb=s.p_nb - np.array([0.0, 0.0, by]))


def height_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """A constant by which the poses are too high or too low."""
    by = best_of(lambda h: _cost(_raised(s, h)), HEIGHTS)
    if abs(by) >= 3.0:
        yield mistake(
            one_row("constant-height"),
            lambda x: _raised(x, by),
            raise_by(f"nav/{s.source}", by),
            fitted=True,
            source=s.source,
            by=by,
            correction=-by,
        )


def turn_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """A camera that is turned against its mount by a constant, as a tilt that was not stated."""
    m = missed(s)
    rows, across, e = m.good, m.across[m.good], np.zeros(3)
    for _ in range(ROUNDS):
        weight = _weight(np.linalg.norm(m.turn[rows] - across @ e, axis=1))
        A = np.einsum("nij,n->ij", across, weight) + 1e-9 * np.eye(3)
        e = np.linalg.solve(A, np.einsum("n,ni->i", weight, m.turn[rows]))
    size = np.degrees(np.linalg.norm(e))
    if not TURNED_DEG < size < LARGEST_TURN_DEG:
        return

    def turned(x: Sightings) -> Sightings:
        _, R_nc = camera_pose(x.mount, x.p_nb, x.R_nb, x.pan, x.tilt)
        R_cb = np.swapaxes(R_nc, 1, 2) @ x.R_nb
        return replace(x, R_nb=R_nc @ Rotation.from_rotvec(-e).as_matrix() @ R_cb)

    tilt, pan, roll = np.degrees(e)
    facts = {"size": size, "tilt": tilt, "pan": pan, "roll": roll}
    yield mistake(one_row("constant-turn"), turned, fitted=True, **facts)


def _weight(size: Array) -> Array:
    """Of misses: far ones count little, since a wrong click must not shift what all others say."""
    return 1 / (1 + (size / (2 * max(np.median(size), 1e-9))) ** 2)


def clock_mistake(
    row: Row, source: str, by: float, offset_s: float, fitted: bool = False, **facts: Any
) -> Mistake[Sightings]:
    """A camera's clock that is off by so many seconds; `offset_s` is what the manifest has."""
    corrections = (shift_clock("camera_offset_s", by), shift_poses(source, -by))
    facts |= {"by": by, "offset": offset_s + by}
    return mistake(row, lambda x: x.shifted(by), *corrections, fitted=fitted, **facts)


def clock_mistakes(s: Sightings, offset_s: float) -> Iterator[Mistake[Sightings]]:
    """A constant by which the camera's clock is late or early."""
    by = best_of(lambda t: _cost(s.shifted(t)), CLOCKS)
    if abs(by) > 0.05:
        yield clock_mistake(one_row("camera-clock"), s.source, by, offset_s, fitted=True)
    for seconds in LEAP_S:
        yield clock_mistake(one_row("leap-seconds"), s.source, seconds, offset_s)
    for hours in HOURS:
        zone = clock_mistake(one_row("zone"), s.source, 3600.0 * hours, offset_s, hours=hours)
        yield replace(zone, corrections=())


# -- pixels without names

#: A ray meets a target that it passes by no more than so many times what is expected, and no more than this.
MEETS, MEETS_DEG = 3.0, 6.0
#: Undone, a mistake has to bring this share of rays to a target, which where all is right needs no
#: explanation; a clock that was chosen to make it fit, so many times as many.
LEAST, BY_CLOCK = 0.3, 4.0
#: Clocks that are looked for, s.
NAMELESS_CLOCKS = np.arange(-30.0, 30.5, 0.5)


def shares(s: Sightings) -> Array:
    """(3,) of all rays, and of those of either half of the images, the share that meets a known target."""
    m = missed(s)
    with np.errstate(invalid="ignore"):
        meets = m.good & (m.angle < np.minimum(MEETS * m.expected, np.radians(MEETS_DEG)))
    return np.array([meets[rows].mean() for rows in (slice(None), *halves_of(s.image))])


def nameless(flight: Flight, given: Sightings) -> Iterator[Finding]:
    """What is wrong with a detector's flight, where a usual mistake says why few of its rays meet a target.

    What a detector saw may be a known target, another one, or nothing. So it is not asked by how far rays
    pass the nearest known target, which where most of what is seen is something else says nothing, but what
    share of them meets one; and only mistakes are tried that change what is seen as a whole. Lengths, places
    and heights are left out: with these, what is beside a known target is easily brought to it.

    Parameters
    ----------
    flight
        Whose clocks they are.
    given
        Pixels without names, with all known targets.
    """

    def too_few(s: Sightings) -> Misfit:
        # What is left is like noise from `LEAST` on; of a share below that none is far better.
        return np.tile(LIKE_NOISE * LEAST / np.maximum(shares(s), LEAST / FALL), (2, 1))

    share = shares(given)[0]
    named = explain(too_few, given, _nameless_mistakes(flight, given)) if share < LEAST else []
    if named:
        then = " or ".join(f"{100 * shares(one.undone)[0]:.0f} % were if {one.said}" for one in named)
        facts = {"share": 100 * share, "then": then}
        yield blame("warning", f"nav/{given.source}", "", "few-meet-a-target", named, facts, [])


def _nameless_mistakes(flight: Flight, s: Sightings) -> Iterator[Mistake[Sightings]]:
    yield from mount_mistakes(s)
    yield from attitudes_in(s.source, "", "R_nb")
    yield from pixel_mistakes(s)
    by = best_of(lambda t: -float(shares(s.shifted(t)).min()), NAMELESS_CLOCKS)
    far_more = (shares(s.shifted(by)) >= BY_CLOCK * shares(s)).all()
    if flight.manifest.time.kind == "utc" and abs(by) >= 1.0 and far_more:
        offset_s = flight.manifest.clocks.camera_offset_s
        yield clock_mistake(one_row("camera-clock"), s.source, by, offset_s, fitted=True)
