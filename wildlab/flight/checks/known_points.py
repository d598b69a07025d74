"""Whether known points are where the poses have them, and if not, which mistake it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import bdtrc

from wildlab.flight.checks.findings import POSITION, Finding, number
from wildlab.flight.checks.mistakes import (
    ALIKE,
    FAR_BETTER,
    MOST_NAMED,
    Change,
    Mistake,
    attitudes_in,
    blame,
    change_by,
    change_columns,
    change_geodetic,
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
    Missed,
    Sightings,
    glance,
    halves_of,
    left_over,
    metres,
    misfit,
    missed,
    sightings,
)
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array, Origin, euler_to_matrix, matrix_to_euler
from wildlab.geometry.mount import R_MC_DOWN, R_MC_FORWARD, Looks, Mount, camera_pose, camera_rotation
from wildlab.names import listed

#: Without a known mistake, misses this many times what is expected and this large (deg) are still said.
UNEXPLAINED, UNEXPLAINED_DEG = 4.0, 8.0
#: A single photo or mark is named where most of its misses are so many times those of all, by at least so
#: many points, and so many times what is expected.
SINGLE, SINGLE_POINTS, SINGLE_EXPECTED = 6.0, 2, 5.0
#: Rays that pass known points by less than this (m) are not told apart.
CLOSE_M = 0.1
#: So many photos of a flight in which all is as stated may be named, in the mean.
BY_CHANCE = 0.05
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
        if flight.manifest.scoring.rule == "nearest":
            yield from _single(given)
        return
    named = explain(misfit, given, camera_mistakes(flight, given), glance)
    # Misfits are in units of what is expected, which a mistake may change too: metres have to fall as well.
    named = [
        one for one in named if _plain(given, one.undone) or metres(one.undone, False) < metres(given, False)
    ]
    if named:
        yield _finding(given, named)
        given = named[0].undone
    else:
        m = missed(given)
        angle = np.degrees(np.median(m.angle[m.good])) if m.good.any() else np.nan
        if misfit(given)[0, 0] > UNEXPLAINED and angle > UNEXPLAINED_DEG:
            facts = {"metres": metres(given), "angle": angle}
            yield Finding("warning", f"nav/{given.source}", "", "points-missed", facts)
    yield from _single(given)


def _plain(given: Sightings, undone: Sightings) -> bool:
    """Whether the distance falls by far with nothing else taken off."""
    return metres(undone) * FAR_BETTER <= metres(given)


def _finding(given: Sightings, named: list[Mistake[Sightings]]) -> Finding:
    # Where other small errors hide what is gained, it is the distance without these that shows it.
    plain = _plain(given, named[0].undone)
    # What is as good in angles and leaves ten times the distance explains it less.
    left = np.nan_to_num([metres(one.undone, plain) for one in named], nan=np.inf)
    chosen = [
        (one, off) for one, off in zip(named, left, strict=True) if off <= ALIKE * max(left.min(), CLOSE_M)
    ]
    first = chosen[0][0]
    alike = [f"{one.said} ({number(off)} m)" for one, off in chosen[1:]]
    return blame(
        "problem",
        f"nav/{given.source}",
        "",
        "points-explained",
        [one for one, _ in chosen],
        {
            "first": first.said,
            "plain": plain,
            "before": metres(given, plain),
            "after": metres(first.undone, plain),
            "alike": f"; as well explained: {listed(alike, 'or')}" if alike else "",
        },
        [
            correct
            for one, _ in chosen
            for correct in one.corrections or (_stated(one.undone.camera, one.undone.mount),)
        ],
    )


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
    yield from shared_place_mistakes(s)
    yield from height_mistakes(s)
    yield from turn_mistakes(s)
    if flight.manifest.time.kind == "utc":
        yield from clock_mistakes(s, flight.manifest.clocks.camera_offset_s)


def shared_place_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """Mistakes about latitude and longitude that poses, truth and the origin share: the points stay near, and
    north lies elsewhere."""
    for row in rows_of("geodetic"):
        change = change_by(row)
        there = change(np.array(s.origin))
        if there is None or abs(there[0]) > np.pi / 2:
            continue
        at: Origin = tuple(there.tolist())
        moved = partial(change_geodetic, change, origin=s.origin, to=at)

        def undo(x: Sightings, moved: Change = moved, at: Origin = at) -> Sightings | None:
            done = undo_in(moved, "p_nb", "points")(x)
            return None if done is None else replace(done, origin=at)

        def correct(flight: Flight, moved: Change = moved, at: Origin = at) -> Flight | None:
            placed = [one for one in ("gnss", "truth") if one in flight.tables]
            for table in (*(f"nav/{name}" for name in flight.nav), *placed):
                changed = change_columns(table, POSITION, moved)(flight)
                if changed is None:
                    return None
                flight = changed
            latitude, longitude = np.degrees(at[:2]).tolist()
            return state({"origin": {"latitude_deg": latitude, "longitude_deg": longitude}})(flight)

        of = mistake(row, undo, part=f"poses.{s.source}.position] and [truth")
        yield of.within("poses and truth", undo, correct)


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


def clock_mistakes(s: Sightings, offset_s: float) -> Iterator[Mistake[Sightings]]:
    """A constant by which the camera's clock is late or early; `offset_s` is what the manifest has."""

    def clock(row: Any, by: float, fitted: bool = False, **facts: Any) -> Mistake[Sightings]:
        corrections = (shift_clock("camera_offset_s", by), shift_poses(s.source, -by))
        facts |= {"by": by, "offset": offset_s + by}
        return mistake(row, lambda x: x.shifted(by), *corrections, fitted=fitted, **facts)

    by = best_of(lambda t: _cost(s.shifted(t)), CLOCKS)
    if abs(by) > 0.05:
        yield clock(one_row("camera-clock"), by, fitted=True)
    for seconds in LEAP_S:
        yield clock(one_row("leap-seconds"), seconds)
    for hours in HOURS:
        yield replace(clock(one_row("zone"), 3600.0 * hours, hours=hours), corrections=())


# -- pixels without names

#: A ray meets a target that it passes by no more than so many times what is expected, and no more than this.
MEETS, MEETS_DEG = 3.0, 6.0
#: Undone, a mistake has to bring so many times as many rays to a target, on the whole and on either half, and
#: this share at least, which where all is right needs no explanation; where a number was chosen to make it
#: fit, twice as many times.
MORE, LEAST = 2.0, 0.3
#: Mistakes are named together whose shares are so near each other.
ALIKE_SHARE = 0.9
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
    before = shares(given)
    if before[0] >= LEAST:
        return
    found: list[tuple[bool, float, Mistake[Sightings]]] = []
    for one in _nameless_mistakes(flight, given):
        undone = one.undo(given)
        if undone is not None:
            after = shares(undone)
            more = MORE**2 if one.fitted else MORE
            if after[0] >= LEAST and (after >= more * before).all():
                found.append((one.fitted, -after[0], one))
    best = min((less for _, less, _ in found), default=0.0)
    alike = sorted((one for one in found if one[1] <= ALIKE_SHARE * best), key=lambda one: one[:2])
    if alike:
        named = alike[:MOST_NAMED]
        then = " or ".join(f"{-100 * less:.0f} % were if {one.said}" for _, less, one in named)
        facts = {"share": 100 * before[0], "then": then}
        mistakes = [one for _, _, one in named]
        yield blame("warning", f"nav/{given.source}", "", "few-meet-a-target", mistakes, facts, [])


def _nameless_mistakes(flight: Flight, s: Sightings) -> Iterator[Mistake[Sightings]]:
    yield from mount_mistakes(s)
    yield from attitudes_in(s.source, "", "R_nb")
    yield from pixel_mistakes(s)
    by = best_of(lambda t: -float(shares(s.shifted(t)).min()), NAMELESS_CLOCKS)
    if flight.manifest.time.kind == "utc" and abs(by) >= 1.0:
        offset = flight.manifest.clocks.camera_offset_s + by
        yield mistake(one_row("camera-clock"), lambda x: x.shifted(by), fitted=True, by=by, offset=offset)


# -- one photo or mark


def _single(s: Sightings) -> Iterator[Finding]:
    """One photo, or one mark, that is off while the others are not."""
    m = missed(s)
    good = m.good
    if good.sum() < 8:
        return
    angle = left_over(m, good)
    size = angle / m.expected
    # What is expected takes the mean of the angles; one photo may be off by the one that is known least.
    least = np.sqrt(m.expected**2 - s.sd[:, 0] ** 2 + s.sd[:, 3] ** 2)
    for what, names, table, field in (
        ("photo", s.frames, "frames", "frame_id"),
        ("mark", s.labels, "truth", "target_id"),
    ):
        count = len(set(names))
        most = np.sqrt(2 * np.log(max(count, 1) / BY_CHANCE))
        far = (size > SINGLE * np.median(size[good])) & (size > SINGLE_EXPECTED)
        off = _off(far & (angle > most * least), names, good)
        if off and len(off) <= max(1, count // 5):
            facts = {"source": s.source, "n": len(off), "which": [_turned(m, names, one) for one in off[:5]]}
            yield Finding("warning", table, field, f"one-{what}-off", facts, (f"one {what} off",))


def _turned(m: Missed, names: NDArray[np.object_], name: str) -> str:
    angle = float(np.degrees(np.nanmedian(m.angle[names == name])))
    return f"{name!r} ({number(angle)} deg)"


def _off(far: NDArray[np.bool_], names: NDArray[np.object_], good: NDArray[np.bool_]) -> list[str]:
    """Those whose points are for the most part far, where so many of them are hardly together by chance.

    Far ones are everywhere: wrong clicks, and detections of what is no known point.
    """
    rows = {str(name): (names == name) & good for name in dict.fromkeys(names) if name != ""}
    rows = {name: of for name, of in rows.items() if of.sum() >= SINGLE_POINTS}
    # More than half of them: one wrong click is not a wrong photo.
    off = [name for name, of in rows.items() if far[of].mean() > 0.5]
    others = good & ~np.isin(names.astype(str), off)
    # As if there had been half a far one more, so that none seen is not none ever.
    share = (far[others].sum() + 0.5) / (others.sum() + 1)

    def by_chance(of: NDArray[np.bool_]) -> float:
        return len(rows) * float(bdtrc(far[of].sum() - 1, of.sum(), share))

    return [name for name in off if by_chance(rows[name]) < BY_CHANCE]
