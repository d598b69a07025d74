"""Two vessels that cross, distinguished by their images: H 6.4.4."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.analysis.rendered import Photographer
from wildlab.evaluation.shares import Check, columns_of
from wildlab.reporting.charts.drawing import draw_dots, draw_way, finish, new_strips
from wildlab.reporting.charts.forms import Values, draw_lines, draw_picture, spread_points
from wildlab.reporting.figures import BLUE, GREEN, GREY, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.reporting.published import bounds_of
from wildlab.studies.crossing_vessels import trial
from wildlab.studies.crossing_vessels.rendered import WHOLE, Counted, CrossingTracks, Rendering, Spotted, spot
from wildlab.studies.crossing_vessels.trial import (
    BOATS,
    DISTANCE,
    FEATURES,
    JOINT,
    LOOKS,
    NAMES,
    NONE,
    SEPARATIONS,
    SUBJECTS,
    TUNING,
    WAYS,
    Flown,
    curve_subject,
    looks_of,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

Array = NDArray[np.float64]


def check_claims(runs: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for each claim of H 6.4.4, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each flight.
    """

    of = columns_of(runs)

    def worse(subject: str) -> Array:
        """The larger share of wrong associations of the two vessels."""
        return np.maximum(*(of(subject, f"wrong_rate_boat_{n}") for n in (1, 2)))

    met = of(LOOKS, "closest") < TUNING.measurement
    swapped = of(DISTANCE, "swapped") > 0
    size, intensity, hu = (of(LOOKS, f"separation_{name}") for name in ("size", "intensity", "hu"))
    wrong, wrong_without = of(FEATURES, "wrong"), of(DISTANCE, "wrong")
    return {
        "swap-without-features": Check(true=swapped, premise=met),
        "never-recovers": Check(true=of(DISTANCE, "swapped_at_end") > 0, premise=swapped),
        "accurate-though-swapped": Check(true=of(DISTANCE, "any_near_share") > 0.5, premise=swapped),
        "size-best": Check(true=(size > intensity) & (size > hu)),
        "intensity-differs": Check(measured=intensity, above=True),
        "hu-similar": Check(measured=hu),
        "no-swap-with-features": Check(true=of(FEATURES, "swapped") == 0, premise=met),
        "mostly-within-20-m": Check(true=of(FEATURES, "near_share") > 0.5),
        "most-correct-in-contrast": Check(
            true=(worse(FEATURES) < 0.5) & (worse(DISTANCE) >= 0.5), premise=met
        ),
        "fewer-wrong": Check.smaller(wrong, wrong_without, "detections"),
    }


def rules_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each rule: the flights swapped (%), and medians over flights."""
    medians = ("wrong", "unassigned", "tracks", "swaps", "breaks", "mae", "gospa", "anees")
    return pd.DataFrame(
        [
            {"rule": names[rule], "swapped": 100 * float(runs[rule, "swapped"].mean())}
            | {name: float(runs[rule, name].median()) if (rule, name) in runs else np.nan for name in medians}
            for rule in (*SUBJECTS, JOINT)
        ]
    )


def reacquired_shares(runs: pd.DataFrame, subject: str, name: str) -> Array:
    """(n,) of the tracks of each flight that could be reacquired or were, which share was; NaN for none.

    Tracks that are rightly new do not count.
    """
    parts = {one: runs[subject, one].to_numpy(float) for one in ("found_right", "found_wrong", "not_found")}
    total = sum(parts.values())
    return np.where(total > 0, parts[name] / np.where(total > 0, total, 1.0), np.nan)


def reacquisition_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each way: mean shares of tracks (%), and flights (%) with none wrong, of those with any."""
    rows = []
    for way in WAYS:
        shares = {
            name: pd.Series(reacquired_shares(runs, way, name)).dropna()
            for name in ("found_right", "found_wrong", "not_found")
        }
        none_wrong = 100 * float((shares["found_wrong"] == 0).mean())
        means = {name: 100 * float(one.mean()) for name, one in shares.items()}
        rows.append({"way": names[way], **means, "none_wrong": none_wrong})
    return pd.DataFrame(rows)


def detected_table(flights: Sequence[Rendering]) -> pd.DataFrame:
    """What the detector makes of both vessels in rendered frames, a row for each flight."""
    rows = []
    for one in flights:
        near: Counted = one.near
        counts = {name: getattr(near, name) for name in ("whole", "found", "joined", "missed")}
        rows.append({"flight": str(one.seed), **counts, "false": near.false + one.sea.false})
    return pd.DataFrame(rows)


def rendered_table(flights: Sequence[Rendering], names: Mapping[str, str]) -> pd.DataFrame:
    """One row for each rule: flights swapped, and detections wrong (%), drawn and from rendered frames."""

    def row(rule: str) -> dict[str, object]:
        cells: dict[str, object] = {"rule": names[rule]}
        for way in ("drawn", "frames", "inside"):
            tracks: list[CrossingTracks] = [getattr(one, way) for one in flights]
            found = [one.by_rule[rule] for one in tracks]
            own = sum(one.own or 0 for one in found)
            cells[f"{way}_swapped"] = sum(one.swapped for one in found)
            cells[f"{way}_wrong"] = 100 * sum(one.wrong or 0 for one in found) / own if own else np.nan
        return cells

    return pd.DataFrame([row(rule) for rule in (*SUBJECTS, JOINT)])


#: Tracks by the vessel whose detections started them, as in H figure 6.21.
_COLOURS = (BLUE, ORANGE)
#: Of the height of a map, left free below everything on it for the scale bar.
FREE = 0.3
#: Around the boxes of a frame, px, and how wide what is shown is at least.
AROUND, LEAST = 30, 200
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


def plot_separation(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Wrong associations and swaps over the separation of a made-up feature."""
    fig, (top, low) = new_strips(2, 4.6)
    wrong = [runs[curve_subject(one), "wrong"] for one in SEPARATIONS]
    ends = np.transpose([bounds_of(one) for one in wrong])
    known = ends if np.isfinite(ends).all() else None
    draw_lines(top, SEPARATIONS, {"": Values([one.median() for one in wrong], known)})
    share = [100 * runs[curve_subject(one), "swapped"].mean() for one in SEPARATIONS]
    draw_lines(low, SEPARATIONS, {"one made-up feature": Values(share)})
    for rule, color in ((DISTANCE, GREY), (FEATURES, VERMILLION)):
        top.axhline(runs[rule, "wrong"].median(), color=color, lw=1.3, ls="--")
        low.axhline(100 * runs[rule, "swapped"].mean(), color=color, lw=1.3, ls="--", label=names[rule])
    top.set_yscale("symlog", linthresh=1)
    # None wrong lies a little above the axis, where its line is seen.
    top.set_ylim(-0.4, None)
    low.set(ylabel="swapped (%)", ylim=(-3, 103), xticks=SEPARATIONS)
    return finish(fig, "", "difference of the two (spreads of the feature)", "wrong")


class Picture(NamedTuple):
    """A frame of the crossing: its counts (H, W), its detections and their boxes, (D, 4) px; m apart."""

    exposure: int
    counts: NDArray[np.uint16]
    spotted: Spotted
    box: NDArray[np.float64]
    apart: float


def telling_exposures(one: Rendering) -> list[int]:
    """Of the frames with both whole in view: where they are nearest and detected each alone, and as one.

    None, one or two of these; a frame without any detection has no place among them.
    """
    spotted, crossing = one.spotted, one.frames.crossing
    images = np.unique(crossing.looks.image)
    both = (spotted.share >= WHOLE).all(axis=1)
    chosen = []
    for kind in (spotted.found.all(axis=1), spotted.joined.any(axis=1)):
        rows = np.flatnonzero(np.isin(images, spotted.frames[both & kind]))
        if len(rows) and np.isfinite(crossing.apart[rows]).any():
            chosen.append(int(images[rows[np.nanargmin(crossing.apart[rows])]]))
    return chosen


def picture_of(twin: str, one: Rendering, exposure: int) -> Picture:
    """A frame rendered and searched again."""
    camera = Photographer(twin, one.seed)
    _, counts = camera.image(exposure)
    shot = next(iter(camera.shoot([exposure])))
    crossing = one.frames.crossing
    apart = float(crossing.apart[np.searchsorted(np.unique(crossing.looks.image), exposure)])
    rows, columns = counts.shape
    return Picture(exposure, counts, spot([shot], (rows, columns)), shot.detections.box, apart)


def plot_frames(twin: str, flights: Sequence[Rendering]) -> Figure | None:
    """The two at the crossing, each detected alone, and as one: of the first flight that has most of these.

    None where both are whole in no frame with a detection.
    """
    chosen = [telling_exposures(one) for one in flights]
    most = max((len(found) for found in chosen), default=0)
    if not most:
        return None
    at = next(k for k, found in enumerate(chosen) if len(found) == most)
    fig, axes = new_figure(5.9, 3.1 if most > 1 else 4.6, columns=most, squeeze=False)
    for ax, exposure in zip(axes.flat, chosen[at], strict=True):
        picture = picture_of(twin, flights[at], exposure)
        (left, top), (right, bottom) = _part(picture)
        low, high = np.percentile(picture.counts[top:bottom, left:right], (0.5, 99.8))
        owners_of = zip(picture.spotted.boat, picture.spotted.both, strict=True)
        colors = [
            VERMILLION if boat == NONE else GREEN if both else _COLOURS[boat] for boat, both in owners_of
        ]
        title, box = f"{picture.apart:.0f} m apart", picture.box
        draw_picture(ax, picture.counts, title, limits=(low, high), boxes=box, colors=colors)
        ax.set(xlim=(left - 0.5, right - 0.5), ylim=(bottom - 0.5, top - 0.5))
    return fig


def _part(picture: Picture) -> tuple[tuple[int, int], tuple[int, int]]:
    """Corners of the part that is shown, px: all boxes, and some sea about them."""
    rows, columns = picture.counts.shape
    low = picture.box[:, :2].min(axis=0) - AROUND
    high = (picture.box[:, :2] + picture.box[:, 2:]).max(axis=0) + AROUND
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, LEAST / 2).max()
    size = np.array([columns, rows])
    half = min(half, size.min() / 2)
    middle = np.clip(middle, half, size - half)
    first, last = np.floor(middle - half).astype(int), np.ceil(middle + half).astype(int)
    return (int(first[0]), int(first[1])), (min(int(last[0]), columns), min(int(last[1]), rows))


def answer(facts: Facts) -> list[str]:
    """Whether features keep the tracks apart, and which feature does."""
    apart = facts.value(trial.LOOKS, "separation_size")
    best = "unknown" if math.isnan(apart) else "size" if facts.outcome("size-best") == "holds" else "open"
    return [f"swap-{facts.outcome('no-swap-with-features')}", f"feature-{best}"]


STUDY = Study("crossing-vessels", trial.trial, check_claims, trial.UNITS.get, answer)
