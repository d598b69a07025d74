"""Two vessels that cross, as one flight saw them: detections on the sea, and where the two were.

A bank of Kalman filters on positions with firm association: the tracking system of H 3.3, 3.4 and 6.4.4.

What targets look like helps, H 3.3.1 and 6.4.4: a track keeps what its target looked like at its start. H
names size, intensity and the first of Hu's invariants, and prints no spreads: they are chosen.

A track starts on detections in two consecutive images that lie near each other (H 6.2.4, 6.4.4) and in no
gate that has room for them (H 3.3). None ends.

Beside it, both vessels as one state, by rules that a tracker of today has (`wildlab.tracking.joint_state`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.georeference import observe
from wildlab.analysis.tracks.pixels import truth_states
from wildlab.evaluation.intervals import share_interval
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import gate_threshold
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.reporting.charts.drawing import draw_dots, draw_picture, draw_way, finish, spread_points
from wildlab.reporting.figures import BLUE, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.simulation.error_models import stream
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.vessel_detection import Photographer, exposures_of
from wildlab.tracking.association import (
    Assignment,
    global_nearest,
    innovation_squared,
)
from wildlab.tracking.joint_state import RULES, JointScans, assign_jointly
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.motion import constant_velocity, in_steps

Index = NDArray[np.int64]

# -- the tracking system

_H = np.eye(2, 4)


def image_features(area: ArrayLike, intensity: ArrayLike, hu: ArrayLike, metres_per_px: ArrayLike) -> Array:
    """Size, intensity and first Hu moment of detections, on scales whose spread hardly depends on the value.

    Size is taken on the ground, so that it stays the same while the distance changes.

    Parameters
    ----------
    area
        (N,) px^2.
    intensity
        (N,) mean of each region less the background's, in any unit.
    hu
        (N, 7), of which the first invariant counts.
    metres_per_px
        (N,) or one: how long a pixel is at the target, m.

    Returns
    -------
    (N, 3)
        Natural logarithm of the size in m^2, intensity, natural logarithm of the Hu moment; NaN where a size
        or a moment is not positive.

    Examples
    --------
    >>> image_features([100.0], [12.0], [[0.2]], 0.5).round(2).tolist()
    [[3.22, 12.0, -1.61]]
    """
    first = np.asarray(hu, float)[:, 0]
    size = np.asarray(area, float) * np.asarray(metres_per_px, float) ** 2
    columns = (
        np.log(np.where(size > 0, size, np.nan)),
        np.asarray(intensity, float),
        np.log(np.where(first > 0, first, np.nan)),
    )
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def feature_distances(measured: ArrayLike, stored: ArrayLike, sd: ArrayLike) -> Array:
    """Sum of squared differences of features, each in units of its spread.

    With features that are normal and independent it is chi-square, as (3.9) is, so that the two may be added.

    Parameters
    ----------
    measured
        (N, f) of measurements.
    stored
        (M, f) of tracks.
    sd
        (f,) standard deviation of the difference between a measurement of a target and what its track keeps.

    Returns
    -------
    (N, M)
        A feature that is not known, NaN, on either side adds nothing.

    Examples
    --------
    >>> feature_distances([[3.0, 1.0]], [[1.0, 1.0], [3.0, 4.0]], sd=[1.0, 3.0]).tolist()
    [[4.0, 1.0]]
    """
    apart = (np.asarray(measured, float)[:, None] - np.asarray(stored, float)) / np.asarray(sd, float)
    return np.asarray(np.nansum(apart**2, axis=-1))


class Known(NamedTuple):
    """What is known of T tracks, by their numbers.

    Attributes
    ----------
    x, P
        (T, 4) and (T, 4, 4) state.
    stored
        (T, f) means of the features of the two first detections.
    """

    x: Array
    P: Array
    stored: Array


def nobody(f: int) -> Known:
    """No track, with so many features."""
    return Known(np.empty((0, 4)), np.empty((0, 4, 4)), np.empty((0, f)))


def pair_scans(
    waiting: ArrayLike, arrived: ArrayLike, dt: float, R: ArrayLike, max_speed: float, gate: float
) -> Assignment:
    """Which detection of a scan continues which one of the scan before: steps 1 and 2 of H 3.4.1.

    The validation region is that of the noise of both, about all places that the target may have come to:
    what lies in between counts only where it is more than the target can have moved. Where several lie in
    one region, those are paired whose distances, all counted, have the least sum.

    Parameters
    ----------
    waiting, arrived
        (M, 2) and (N, 2) positions of the scan before and of this one, m.
    dt
        Time between the two, s, not negative.
    R
        (2, 2) covariance of the noise of a position, m^2.
    max_speed
        Largest speed of a target, m/s.
    gate
        On the square of the distance in units of its spread, as of (3.9).

    Returns
    -------
    Assignment
        The waiting detections stand for its tracks.

    Examples
    --------
    >>> pair_scans([[0.0, 0.0]], [[90.0, 0.0], [4.0, 3.0]], 1.0, np.eye(2), max_speed=5.0, gate=9.21)
    Assignment(track=array([-1,  0]), measurement=array([1]))
    """
    old, new = (np.asarray(points, float).reshape(-1, 2) for points in (waiting, arrived))
    gap = new[:, None] - old
    distance = innovation_squared(gap, 2 * np.asarray(R, float)) if gap.size else np.zeros(gap.shape[:2])
    length = np.linalg.norm(gap, axis=-1)
    beyond = np.maximum(length - max_speed * dt, 0.0) / np.where(length > 0, length, 1.0)
    return global_nearest(np.where(beyond**2 * distance <= gate, distance, np.inf), np.inf)


class ImageDetections(NamedTuple):
    """Images with detections, in order of time; D detections in all, image after image.

    Attributes
    ----------
    image
        (D,) number of the image of each, of the camera's.
    positions
        (D, 2) on the sea, m.
    interval
        Between two images, s.
    """

    image: Index
    positions: Array
    interval: float


class Bank(NamedTuple):
    """What the tracking system made of it.

    Attributes
    ----------
    track
        (D,) the track that each detection went to, -1 where it went to none.
    started
        (T,) the detection that each track started with.
    images
        (K,) numbers of the images with detections.
    x, P
        (K, T, 4) and (K, T, 4, 4) states after each image; NaN before a track has started.
    """

    track: Index
    started: Index
    images: Index
    x: Array
    P: Array


def run_bank(detections: ImageDetections, looks: Array | None = None) -> Bank:
    """Track everything that was detected.

    Parameters
    ----------
    detections
        What was detected.
    looks
        (D, f) features of the detections, to be weighed in; by distance alone where they are left out.

    Returns
    -------
    Bank
        Tracks and their states.
    """

    motion = cache(partial(_motion, interval=detections.interval))
    R = MEASURED_M**2 * np.eye(2)
    track = np.full(len(detections.image), -1)
    features = np.empty((len(track), 0)) if looks is None else looks
    tracks = nobody(features.shape[1])
    images, firsts = np.unique(detections.image, return_index=True)
    started, states = list[int](), list[Known]()
    waiting, before = np.empty(0, int), 0
    for image, rows in zip(images.tolist(), np.split(np.arange(len(track)), firsts[1:]), strict=True):
        z = detections.positions[rows]
        free = np.ones(len(rows), bool)
        if started:
            x, P = predict(tracks.x, tracks.P, *motion(image - before))
            gap = z[:, None] - x[:, :2]
            distances = innovation_squared(gap, np.broadcast_to(P[:, :2, :2] + R, (*gap.shape, 2)))
            if looks is None:
                chosen = global_nearest(distances, GATE)
            else:
                # What is stored is the mean of two, and as uncertain as half of a detection.
                sd = np.sqrt(1.5) * TOLD_SD
                seen = feature_distances(features[rows], tracks.stored, sd)
                # The gate is one of the distance alone (H 6.4.4).
                chosen = global_nearest(np.where(distances <= GATE, distances + seen, np.inf), np.inf)
            one = np.flatnonzero(chosen.track >= 0)
            to = chosen.track[one]
            done = update(x[to], P[to], z[one], _H, R)
            x[to], P[to], track[rows[one]] = done.x, done.P, to
            tracks = Known(x, P, tracks.stored)
            free = chosen.track < 0
        new = rows[free]
        if len(waiting) and image - before == 1 and len(new):
            old, z = detections.positions[waiting], detections.positions[new]
            pairs = pair_scans(old, z, detections.interval, R, MOST_SPEED, GATE)
            for first, at in zip(waiting, pairs.measurement, strict=True):
                if at < 0:
                    continue
                two = np.array([first, new[at]])
                track[two] = len(started)
                started.append(int(first))
                fresh = _start(detections.positions[two], features[two], motion(1))
                tracks = Known._make(map(np.append, tracks, fresh, [0] * len(fresh)))
            new = new[pairs.track < 0]
        waiting, before = new, image
        states.append(tracks)
    xs = np.full((len(states), len(started), 4), np.nan)
    Ps = np.full((*xs.shape, 4), np.nan)
    for k, then in enumerate(states):
        xs[k, : len(then.x)], Ps[k, : len(then.x)] = then.x, then.P
    return Bank(track, np.array(started, int), images, xs, Ps)


def _motion(images: int, interval: float) -> tuple[Array, Array]:
    """F and Q over so many images: noise is held over the time between two, as often as H predicted (6.2)."""
    held = partial(constant_velocity, sd_acceleration=ACCELERATION)
    return in_steps(images * interval, held, 1.001 * interval)


def _start(z: Array, features: Array, step: tuple[Array, Array]) -> Known:
    """On the first of two positions with zero speed (H 6.2.4), updated with the second."""
    x = np.concatenate([z[0], np.zeros(2)])
    P = np.diag([MEASURED_M**2] * 2 + [VELOCITY_0**2] * 2)
    x, P = predict(x, P, *step)
    done = update(x, P, z[1], _H, MEASURED_M**2 * np.eye(2))
    parts = done.x, done.P, features.mean(axis=0)
    return Known._make(part[None] for part in parts)


# -- what one flight saw

#: Numbers of a flight by (subject, name).
Numbers = dict[tuple[str, str], float]

#: The vessels as H 6.4.4 names them.
BOATS = ("boat 1", "boat 2")
#: H 6.4.4; the gate is of 99 %, of the 95 to 99 % of H 3.3, and the largest speed, which serves the start
#: alone, the deviation of the first velocity. Both are chosen.
MEASURED_M, ACCELERATION, VELOCITY_0, GATE, MOST_SPEED = 17.5, 0.2, 5.0, gate_threshold(0.99, 2), 5.0
#: Apart again are vessels twice the measurement noise from each other; how a crossing went is seen in the two
#: minutes from then on, several laps, and how it ended in the last two. Chosen.
APART_M, WINDOW_S = 2 * MEASURED_M, 120.0


class Crossing(NamedTuple):
    """What one flight saw of the two.

    Attributes
    ----------
    detections
        All of them.
    boat
        (D,) 0 or 1: whose each is, as by manual classification.
    times
        (K,) s, of the images with detections.
    truth
        (2, K, 2) where the two were by their own receivers, m.
    """

    detections: ImageDetections
    boat: Index
    times: Array
    truth: Array

    @property
    def apart(self) -> Array:
        """(K,) distance between the two, m."""
        return np.asarray(np.linalg.norm(self.truth[0] - self.truth[1], axis=-1))


def gather(flight: Flight) -> Crossing:
    """The detections of both vessels on the sea, in order, with the autopilot's poses."""
    seen = observe(flight, "autopilot")
    boat = np.array([BOATS.index(name) for name in seen.table["target_id"]])
    positions = georeference_pixels(seen.poses, seen.uv, seen.plane_down)[:, :2]
    number = exposures_of(seen.table).astype(int)
    stamps = frame_times(flight)
    at = {one: stamp for one, stamp in zip(exposures_of(flight.table("frames")), stamps, strict=True)}
    order = np.lexsort((boat, number))
    order = order[np.isfinite(positions[order]).all(axis=1)]
    times = np.array([at[int(one)] for one in np.unique(number[order])])
    detected = ImageDetections(number[order], positions[order], float(np.median(np.diff(stamps))))
    truth = np.stack([truth_states(flight, name, times)[:, :2] for name in BOATS])
    return Crossing(detected, boat[order], times, truth)


def apart_times(crossing: Crossing) -> tuple[float, float]:
    """When the two were last `APART_M` from each other before they were nearest, and first after it, s.

    The first and the last time where they never were.
    """
    apart, times = crossing.apart, crossing.times
    nearest = int(np.nanargmin(apart))
    before, after = (np.flatnonzero(part > APART_M) for part in (apart[:nearest], apart[nearest:]))
    return (
        float(times[before[-1]] if len(before) else times[0]),
        float(times[nearest + after[0]] if len(after) else times[-1]),
    )


#: By distance alone, and with features weighed in.
DISTANCE, FEATURES = "without-features", "with-features"
SUBJECTS = (DISTANCE, FEATURES)
#: What the rendered images show.
LOOKS = "looks"
#: H figure 6.21, in its order.
NAMES = ("size", "intensity", "hu")
#: Spreads of a detection's features that association is told, in the units of `image_features`. Chosen, once
#: for all flights: about what rendered images of six other flights of the twin had.
TOLD_SD = np.array([0.1, 8.0, 0.05])
#: H 6.4.4: positions are mostly within this of the true ones.
NEAR_M = 20.0
#: Around a vessel, px: as wide as the longest is in the image, so that the sea about it is rendered too.
MARGIN = 40


def photograph(twin: str, seed: int, flight: Flight, images: int) -> list[Array]:
    """Features of the two in rendered images, (n, 3) each: of ``images`` at random of those that show it.

    Size is taken on the ground at the distance that the true pose has; an image in which the detector finds
    nothing of a vessel adds nothing.
    """
    camera, rng = Photographer(twin, seed), stream(seed, "images of the vessels")
    detections = flight.table("detections")
    shown = [exposures_of(detections[detections["target_id"] == name]) for name in BOATS]
    wanted = [set(rng.permutation(one)[:images].tolist()) for one in shown]
    found: list[list[Array]] = [[], []]
    for shot in camera.shoot(sorted(set.union(*wanted)), margin=MARGIN):
        poses = camera.flight.poses.take(np.array([shot.exposure]))
        for number, rows in shot.judged.found.items():
            if not rows or shot.exposure not in wanted[number - 1]:
                continue
            one = shot.detections.select(rows[:1])
            distance = np.linalg.norm(georeference_pixels(poses, one.uv, np.zeros(1)) - poses.p_nc, axis=1)
            per_px = distance / np.sqrt(poses.camera.fx * poses.camera.fy)
            found[number - 1].append(image_features(one.area, one.intensity, one.hu, per_px)[0])
    return [np.array(rows, float).reshape(-1, len(NAMES)) for rows in found]


def dressed(crossing: Crossing, looks: list[Array], seed: int) -> Array:
    """Features (D, 3): a detection looks like one of those rendered of its vessel, with replacement."""
    rng = stream(seed, "looks of the detections")
    features = np.full((len(crossing.boat), len(NAMES)), np.nan)
    for number, pool in enumerate(looks):
        own = np.flatnonzero(crossing.boat == number)
        if len(pool):
            features[own] = pool[rng.integers(len(pool), size=len(own))]
    return features


def wrong_of(crossing: Crossing, track: Index, started: Index) -> NDArray[np.bool_]:
    """(D,) which detections went to a track that the other vessel's detection started; as in `Bank`."""
    owner = np.append(crossing.boat[started], -1)[track]  # track -1: of none
    return np.asarray((owner >= 0) & (owner != crossing.boat))


def swapped(crossing: Crossing, wrong: NDArray[np.bool_]) -> tuple[bool, bool]:
    """By `wrong_of`, whether the two have each other's track just after the crossing, and at the end.

    That is, of each more than half of its detections in `WINDOW_S` went to a track of the other; a vessel
    without detections then has no track of the other.
    """
    _, from_s = apart_times(crossing)
    when = crossing.times[np.unique(crossing.detections.image, return_inverse=True)[1]]

    def both(since: float) -> bool:
        inside = (when >= since) & (when <= since + WINDOW_S)
        of = [wrong[inside & (crossing.boat == number)] for number in (0, 1)]
        return all(len(one) > 0 and one.mean() > 0.5 for one in of)

    return both(from_s), both(float(crossing.times[-1] - WINDOW_S))


def numbers_of(crossing: Crossing, banks: dict[str, Bank]) -> Numbers:
    """What `UNITS` names of the tracks by each rule."""
    numbers: Numbers = {}
    for subject, bank in banks.items():
        wrong = wrong_of(crossing, bank.track, bank.started)
        own, any_one = distances_of(crossing, bank)
        after, end = swapped(crossing, wrong)
        numbers |= {
            (subject, "wrong"): wrong.sum(),
            (subject, "swapped"): after,
            (subject, "swapped_at_end"): end,
            (subject, "mae"): float(np.nanmean(own)),
            # Of the vessel with less.
            (subject, "near_share"): np.min(_share_near(own)),
            (subject, "any_near_share"): np.min(_share_near(any_one)),
        }
        for number in (0, 1):
            rate = float(wrong[crossing.boat == number].mean())
            numbers[subject, f"wrong_rate_boat_{number + 1}"] = rate
    return numbers


def distances_of(crossing: Crossing, bank: Bank) -> tuple[Array, Array]:
    """(2, K) how far each vessel is from its own first track, and from the nearest of all, m.

    NaN before its track has started.
    """
    away = np.linalg.norm(crossing.truth[:, :, None] - bank.x[None, :, :, :2], axis=-1)
    own = np.full(away.shape[:2], np.nan)
    for number in (0, 1):
        tracks = np.flatnonzero(crossing.boat[bank.started] == number)
        if len(tracks):
            own[number] = away[number, :, tracks[0]]
    started = np.isfinite(own)
    nearest = np.where(np.isfinite(away), away, np.inf).min(axis=-1, initial=np.inf)
    return own, np.where(started, nearest, np.nan)


def _share_near(distances: Array) -> Array:
    """(2,) share of the known distances within `NEAR_M`."""
    known = np.isfinite(distances)
    return np.asarray((distances < NEAR_M).sum(axis=1) / np.maximum(known.sum(axis=1), 1))


def looks_of(looks: list[Array]) -> Numbers:
    """How far apart the two look: differences of the means, in units of the spread within a vessel."""
    numbers: Numbers = {}
    for k, name in enumerate(NAMES):
        groups = [pool[:, k][np.isfinite(pool[:, k])] for pool in looks]
        enough = all(len(group) > 1 for group in groups)
        spread = float(np.sqrt(np.mean([group.var(ddof=1) for group in groups]))) if enough else np.nan
        apart = abs(float(groups[0].mean() - groups[1].mean())) if enough else np.nan
        numbers[LOOKS, f"separation_{name}"] = apart / spread if spread > 0 else np.nan
    return numbers


#: Per axis, m: a detection's own error, and what both of an image share, on six other flights of the twin
#: (root mean squares of their difference, divided by the root of two, and of their mean).
OWN_M, SHARED_M = 2.0, 10.2


def join(crossing: Crossing, features: Array, rule: str) -> Numbers:
    """What both vessels as one state give by a rule of `RULES`: each detection's error its own, part of it
    shared by those of an image, and with features.

    They are told apart in the first image that shows both. How they look is kept from there.
    """
    seen = crossing.detections
    images, first, count = np.unique(seen.image, return_index=True, return_counts=True)
    both = int(np.flatnonzero(count == len(BOATS))[0])
    started = first[both] + np.arange(len(BOATS))
    rows = np.arange(started[-1] + 1, len(seen.image))
    motion = cache(partial(_motion, interval=seen.interval))
    F, Q = (np.array(part) for part in zip(*map(motion, np.diff(images[both:]).tolist()), strict=True))
    unlike = feature_distances(features[rows], features[started], np.sqrt(2) * TOLD_SD)
    x = np.pad(seen.positions[started], ((0, 0), (0, 2)))
    numbers: Numbers = {}
    for name, own, shared, weighed in (
        ("independent", np.hypot(OWN_M, SHARED_M), 0.0, 0.0),
        ("shared", OWN_M, SHARED_M, 0.0),
        ("features", OWN_M, SHARED_M, 1.0),
    ):
        alone = np.diag(np.square([own, own, VELOCITY_0, VELOCITY_0]))
        P = np.kron(np.eye(2), alone) + np.kron(np.ones((2, 2)), np.diag(np.square([shared, shared, 0, 0])))
        scans = JointScans(seen.positions[rows], count[both + 1 :], F, Q, own, shared, weighed * unlike)
        track = np.full(len(seen.image), -1)
        track[started], track[rows] = np.arange(len(BOATS)), assign_jointly(scans, x, P, RULES[rule])
        wrong = wrong_of(crossing, track, started)
        numbers[rule, f"wrong_{name}"] = wrong.sum()
        numbers[rule, f"swapped_{name}"], numbers[rule, f"swapped_at_end_{name}"] = swapped(crossing, wrong)
    return numbers


class Flown(NamedTuple):
    """What a flight's camera saw of the two, how they looked, features of detections, and H's tracks."""

    crossing: Crossing
    looks: list[Array]
    features: Array
    banks: dict[str, Bank]


def fly(seed: int, twin: str, images: int, flight: Flight | None = None) -> Flown:
    """One simulated flight through every rule; ``flight`` where it is at hand."""
    flight = flight or simulate_twin(twin, seed, ("imu", "gnss"))
    crossing, looks = gather(flight), photograph(twin, seed, flight, images)
    features = dressed(crossing, looks, seed)
    rules = {DISTANCE: None, FEATURES: features}
    banks = {name: run_bank(crossing.detections, how) for name, how in rules.items()}
    return Flown(crossing, looks, features, banks)


def all_numbers(flown: Flown) -> Numbers:
    """What the trial gives of a flight that was flown."""
    joint = (join(flown.crossing, flown.features, rule) for rule in RULES)
    return {
        **numbers_of(flown.crossing, flown.banks),
        **looks_of(flown.looks),
        **{key: value for numbers in joint for key, value in numbers.items()},
        (LOOKS, "closest"): np.nanmin(flown.crossing.apart),
    }


def trial(seed: int, *, twin: str, images: int) -> Numbers:
    """One simulated flight by `all_numbers`.

    Raises
    ------
    WildlabError
        If there is no such twin.
    """
    return all_numbers(fly(seed, twin, images))


def rules_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each rule: the flights swapped (%), and medians over flights."""
    medians = ("wrong", "mae")
    return pd.DataFrame(
        [
            {"rule": names[rule], "swapped": 100 * float(runs[rule, "swapped"].mean())}
            | {name: float(runs[rule, name].median()) for name in medians}
            for rule in SUBJECTS
        ]
    )


def joint_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each of `RULES`: flights swapped, %, with Wilson's interval, by how errors count."""

    def share(rule: str, name: str) -> str:
        some = 100 * np.array(share_interval(float(runs[rule, name].sum()), len(runs)))
        return "{:.0f} ({:.0f} to {:.0f})".format(*some)

    cases = ("swapped_independent", "swapped_shared", "swapped_features")
    return pd.DataFrame(
        [{"rule": names[rule]} | {name: share(rule, name) for name in cases} for rule in RULES]
    )


#: Tracks by the vessel whose detections started them, as in H figure 6.21.
_COLOURS = (BLUE, ORANGE)
#: Of the height of a map, left free below everything on it for the scale bar.
FREE = 0.3
_AXES = {"size": "ln of the size in m²", "intensity": "intensity (counts)", "hu": "ln of Hu's first moment"}


def plot_tracks(flown: Flown, names: Mapping[str, str]) -> Figure:
    """True paths and tracks without features and with them (H figures 6.23 and 6.24)."""
    fig, axes = new_figure(5.9, 6.6, rows=2)
    for ax, rule in zip(axes, (DISTANCE, FEATURES), strict=True):
        bank, crossing = flown.banks[rule], flown.crossing
        for boat, way, style in zip(BOATS, crossing.truth, ("-", "--"), strict=True):
            draw_way(ax, way, INK, f"{boat}, true", ls=style)
        for track, owner in enumerate(crossing.boat[bank.started]):
            name = f"track that {BOATS[owner]} started"
            draw_way(ax, bank.x[:, track], _COLOURS[owner], name, width=1.4, alpha=0.85)
        ax.set_title(names[rule])
        low, high = ax.get_ylim()
        ax.set_ylim(low - FREE * (high - low), high)
        map_axes(ax, scale_bar=ax is axes[-1], east="east (m)" if ax is axes[-1] else "")
    return finish(fig)


def plot_features(looks: list[Array]) -> Figure:
    """Features of both vessels in rendered images (H figure 6.21)."""
    fig, axes = new_figure(5.9, 3.2, columns=3)
    apart = looks_of(looks)
    for ax, (k, name) in zip(axes, enumerate(NAMES), strict=True):
        for number, pool in enumerate(looks):
            across = number + spread_points(len(pool), 0.18)
            draw_dots(ax, across, pool[:, k], _COLOURS[number], size=10, alpha=0.7)
        ax.set(xlim=(-0.5, 1.5), xticks=[0, 1], xticklabels=["1", "2"], xlabel="boat", ylabel=_AXES[name])
        ax.grid(False, axis="x")
        value = apart["looks", f"separation_{name}"]
        ax.set_title(f"{value:.0f} apart" if value >= 10 else f"{value:.1f} apart")
    return fig


def plot_frame(flown: Flown, twin: str, seed: int) -> Figure:
    """A rendered frame in which both are detected, about `APART_M` apart, with what the detector finds."""
    crossing = flown.crossing
    images, detections = np.unique(crossing.detections.image, return_counts=True)
    both = np.flatnonzero(detections == len(BOATS))
    row = both[np.nanargmin(np.abs(crossing.apart[both] - APART_M))]
    camera = Photographer(twin, seed)
    _, counts = camera.image(int(images[row]))
    (shot,) = camera.shoot([int(images[row])])
    found, box = shot.judged.found, shot.detections.box
    colors = [
        next((_COLOURS[number - 1] for number, rows in found.items() if k in rows), VERMILLION)
        for k in range(len(box))
    ]
    fig, ax = new_figure(5.9, 4.6)
    draw_picture(ax, counts, f"{crossing.apart[row]:.0f} m apart", limits=None, boxes=box, colors=colors)
    return fig
