"""Two vessels that cross, as one flight saw them: detections on the sea, and where the two were."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe
from wildlab.analysis.rendered import Photographer, exposures_of
from wildlab.analysis.tracks.sighting import truth_states
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import gate_threshold
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.reporting.charts.drawing import draw_dots, draw_way, finish
from wildlab.reporting.charts.forms import draw_picture, spread_points
from wildlab.reporting.figures import BLUE, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.simulation.error_models import stream
from wildlab.simulation.twins import simulate_twin
from wildlab.tracking.association import Appearance, image_features
from wildlab.tracking.many.bank import Bank, Looks, Tuning, run_bank

Index = NDArray[np.int64]
#: Numbers of a flight by (subject, name).
Numbers = dict[tuple[str, str], float]

#: The vessels as H 6.4.4 names them.
BOATS = ("boat 1", "boat 2")
#: H 6.4.4; the gate is of 99 %, of the 95 to 99 % of H 3.3, and the largest speed, which serves the start
#: alone, the deviation of the first velocity. Both are chosen.
TUNING = Tuning(
    measurement=17.5, acceleration=0.2, velocity_0=5.0, gate=gate_threshold(0.99, 2), max_speed=5.0
)
#: Apart again are vessels twice the measurement noise from each other; how a crossing went is seen in the two
#: minutes from then on, several laps, and how it ended in the last two. Chosen.
APART_M, WINDOW_S = 2 * TUNING.measurement, 120.0


class Crossing(NamedTuple):
    """What one flight saw of the two.

    Attributes
    ----------
    looks
        All detections.
    boat
        (D,) 0 or 1: whose each is, as by manual classification.
    times
        (K,) s, of the images with detections.
    truth
        (2, K, 2) where the two were by their own receivers, m.
    """

    looks: Looks
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
    looks = Looks(number[order], positions[order], float(np.median(np.diff(stamps))))
    truth = np.stack([truth_states(flight, name, times)[:, :2] for name in BOATS])
    return Crossing(looks, boat[order], times, truth)


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
#: Spreads of a detection's features that association is told, in the units of `image_features`, and their
#: weights. Chosen, once for all flights: about what rendered images of six other flights of the twin had.
TOLD_SD, WEIGHTS = np.array([0.1, 8.0, 0.05]), np.ones(3)
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


def dressed(crossing: Crossing, looks: list[Array], seed: int) -> Appearance:
    """Each detection looks like one of those rendered of its vessel, drawn with replacement."""
    rng = stream(seed, "looks of the detections")
    features = np.full((len(crossing.boat), len(NAMES)), np.nan)
    for number, pool in enumerate(looks):
        own = np.flatnonzero(crossing.boat == number)
        if len(pool):
            features[own] = pool[rng.integers(len(pool), size=len(own))]
    return Appearance(features, TOLD_SD, WEIGHTS)


def wrong_of(crossing: Crossing, bank: Bank) -> NDArray[np.bool_]:
    """(D,) which detections went to a track that the other vessel's detection started."""
    owner = np.append(crossing.boat[bank.started], -1)[bank.track]  # track -1: of none
    return np.asarray((owner >= 0) & (owner != crossing.boat))


def swapped(crossing: Crossing, bank: Bank) -> tuple[bool, bool]:
    """Whether the two have each other's track just after the crossing, and at the end.

    That is, of each more than half of its detections in `WINDOW_S` went to a track of the other; a vessel
    without detections then has no track of the other.
    """
    at = np.searchsorted(bank.images, crossing.looks.image)
    _, from_s = apart_times(crossing)
    wrong, when = wrong_of(crossing, bank), crossing.times[at]

    def both(since: float) -> bool:
        inside = (when >= since) & (when <= since + WINDOW_S)
        of = [wrong[inside & (crossing.boat == number)] for number in (0, 1)]
        return all(len(one) > 0 and one.mean() > 0.5 for one in of)

    return both(from_s), both(float(crossing.times[-1] - WINDOW_S))


def numbers_of(crossing: Crossing, banks: dict[str, Bank]) -> Numbers:
    """What `UNITS` names of the tracks by each rule."""
    numbers: Numbers = {}
    for subject, bank in banks.items():
        wrong = wrong_of(crossing, bank)
        own, any_one = distances_of(crossing, bank)
        after, end = swapped(crossing, bank)
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


class Flown(NamedTuple):
    """A flight, what its camera saw of the two, how they looked, and their tracks by each rule."""

    crossing: Crossing
    looks: list[Array]
    banks: dict[str, Bank]


def fly(seed: int, twin: str, images: int, flight: Flight | None = None) -> Flown:
    """One simulated flight through every rule; ``flight`` where it is at hand."""
    flight = flight or simulate_twin(twin, seed, ("imu", "gnss"))
    crossing, looks = gather(flight), photograph(twin, seed, flight, images)
    appearance = dressed(crossing, looks, seed)
    return Flown(crossing, looks, {DISTANCE: track(crossing), FEATURES: track(crossing, appearance)})


def track(crossing: Crossing, appearance: Appearance | None = None) -> Bank:
    """All detections, tracked with the published tuning; by distance alone without an appearance."""
    return run_bank(crossing.looks, TUNING, appearance)


def all_numbers(flown: Flown) -> Numbers:
    """What the trial gives of a flight that was flown."""
    return {
        **numbers_of(flown.crossing, flown.banks),
        **looks_of(flown.looks),
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
    return finish(fig, "")


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
    images, detections = np.unique(crossing.looks.image, return_counts=True)
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
