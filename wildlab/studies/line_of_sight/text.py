"""The words of the page on the line of sight, each from the numbers it states."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.evaluation.runs import mean_interval, mean_share_interval
from wildlab.geometry.frames import Array
from wildlab.reporting.text import number, percent, percent_between
from wildlab.simulation.landscape import EAST_M, HIGHEST_M, LOWEST_M, NORTH_M, STEP_M, TREES_M, TREES_SHARE
from wildlab.studies.line_of_sight.claims import at_heights, disagreement, hidden, saved
from wildlab.studies.line_of_sight.timing import REPEATS, WAYS, seconds
from wildlab.studies.line_of_sight.trial import (
    ANGLES,
    EXACT,
    HEIGHT,
    HEIGHTS,
    INCIDENCES,
    LETTER,
    OTHERS,
    RAYS,
    STEP,
    TILT,
    TOLERANCE,
    TREES,
    VIEW,
    WHOLE_RAYS,
    settings,
)

#: What each way is called.
NAMES = {
    RAYS: "ray casting",
    WHOLE_RAYS: "ray casting from the camera",
    ANGLES: "Bresenham",
    EXACT: "the exact line of sight",
}
#: Times within this factor of one another at every altitude are alike.
ALIKE = 1.5
#: Headings of `table_of`.
COLUMNS = {
    "where": "height, tilt",
    "points": "points in view",
    "seen": "seen, exactly",
    "rays": "rays agree",
    "rays_off": "rays: too many / too few",
    "angles": "Bresenham agrees",
    "angles_off": "Bresenham: too many / too few",
}

METHOD = rf"""For each seed a land of {EAST_M:.0f} m by {NORTH_M:.0f} m is drawn with a grid point every
{STEP_M:g} m and {HIGHEST_M - LOWEST_M:.0f} m between its lowest and its highest point, as F's map has them
(F 2.1, 6.1), and the thermal camera is set above it: at each of {len(HEIGHTS)} heights with the lens {TILT}
degrees from straight down, and at {HEIGHT} m with other tilts. Places and headings are drawn; the middle of
the image lies on the map. Nothing flies.

All ways are asked of the grid points in the field of view (2.22)-(2.23) of a camera that is centred and
without distortion. The exact line of sight follows the line over bilinear patches between grid points; it
is held against GRASS and GDAL on a real map by the tests. Ray casting is algorithm 1
with steps of {STEP:g} m that ends within {TOLERANCE:g} m of the point; F prints neither length, and half and
twice of both are tried beside them. Rays begin at the height of the highest grid point in view (F 2.5.2), or
where said at the camera. Bresenham compares the angles of (2.24) of the nearest grid points along the line,
in the sense: the point itself is not among them, and the longer side is found without regard to signs.

Trees stand in groups on {percent(TREES_SHARE, 0)} of the ground, {TREES_M:g} m high on average; both are
chosen. The surface that hides slopes from a tree down to the grid points beside it, and so covers more of
the ground than trees are planted on. Points are drawn all over the land, each with a bearing, and the camera
stands {HEIGHT} m above the point as far off as the incidence angle asks for.

Intervals are of the mean over lands (Student, 95 %). Times are those of this machine and this code:
compiled loops for all ways, angles by the arc tangent as (2.24) has it. They are times of the processor,
taken in turn, of {REPEATS} calls the quickest; they are not the same twice, and the steps are."""

#: What stands before the claims.
LANDS = (
    "What is called a flight here is a land: drawn, with the camera above it once at each height and tilt."
)
LIMITS = [
    "F timed Matlab on another machine and another map; figure 7.1 is not in the text of the thesis, and "
    "no number of it is used.",
    "The land is drawn: rolling ground without cliffs, walls or houses. On other ground "
    "both ways of F may differ from the exact one by more or less.",
    "How trees stand, how high and on how much of the ground is chosen, and the shares that they hide "
    "follow from it.",
    "Of points at a height above the ground, such as animals, nothing is said here.",
]


def with_interval(values: ArrayLike) -> str:
    """Mean share of lands in per cent, and its 95 % interval where there are two of them."""
    return percent_between(mean_share_interval(values))


def time_ratios(times: pd.DataFrame, way: str) -> Array:
    """(heights,) median over lands of how many times Bresenham's time a way takes."""
    return np.asarray(np.nanmedian(seconds(times, way) / seconds(times, ANGLES), axis=0))


def summary(spread: pd.DataFrame, times: pd.DataFrame) -> list[str]:
    """Three sentences."""
    off = {way: with_interval(disagreement(spread, way)) for way in (RAYS, ANGLES)}
    trees = hidden(spread)
    letter = float(np.nanmax([spread[LETTER, f"seen_{name}"].max() for name, *_ in settings()]))
    nothing = "sees nothing at all" if letter == 0 else f"sees {percent(letter)} of the points at most"
    return [
        f"Whether a camera that looks {TILT} degrees off straight down sees a point is answered wrongly for "
        f"{off[ANGLES]} of the points by the thesis's Bresenham, and for {off[RAYS]} by its ray casting.",
        f"On this machine {alike_words(times, RAYS)}; {alike_words(times, WHOLE_RAYS)}.",
        f"By the letter of its formula the thesis {nothing}; trees, which it leaves out, would hide "
        f"{percent(float(np.nanmean(trees[:, 0])))} of the ground from straight above, and "
        f"{percent(float(np.nanmean(trees[:, -1])))} at {INCIDENCES[-1]} degrees.",
    ]


def alike_words(times: pd.DataFrame, way: str) -> str:
    """Whether a way takes as long as Bresenham at every height."""
    found = time_ratios(times, way)
    low, high = float(found.min()), float(found.max())
    name = "rays from the highest ground in view" if way == RAYS else "rays from the camera"
    said = f"take {number(low, 2)} to {number(high, 2)} times Bresenham's time, by altitude"
    return f"{name} {said}, which is {'' if max(high, 1 / low) <= ALIKE else 'not '}alike at every one"


def agreement_words(spread: pd.DataFrame) -> str:
    """How near both ways of F are to the exact one, and in which direction they err."""
    parts = []
    for way in (RAYS, ANGLES):
        more, less = (float(np.nanmean(at_heights(spread, way, name))) for name in ("too_many", "too_few"))
        errs = (
            "sees too much"
            if more > 1.5 * less
            else "sees too little"
            if less > 1.5 * more
            else "errs both ways"
        )
        name = NAMES[way][0].upper() + NAMES[way][1:]
        parts.append(
            f"{name} agrees with the exact line of sight on "
            f"{with_interval(1 - disagreement(spread, way))} of "
            f"the points and {errs}: {percent(more)} are seen by it alone, {percent(less)} are missed."
        )
    below = [with_interval(spread[way, "agreement_0deg"]) for way in (RAYS, ANGLES)]
    parts.append(f"Straight down they agree on {below[0]} and {below[1]}.")
    others = ", ".join(
        f"{with_interval(spread[RAYS, f'agreement_{name}'])} with {step:g} m within {tolerance:g} m"
        for name, (step, tolerance) in OTHERS.items()
    )
    parts.append(
        f"F prints no step of the rays: from {HEIGHT} m ray casting agrees on "
        f"{with_interval(spread[RAYS, f'agreement_{HEIGHT}m'])} with steps of {STEP:g} m that end within "
        f"{TOLERANCE:g} m, and on {others}."
    )
    return " ".join(parts)


def steps_words(spread: pd.DataFrame) -> str:
    """What each way does for one point, counted: the same on every machine."""
    low, high = HEIGHTS[0], HEIGHTS[-1]
    count = {
        (way, height): float(spread[way, f"steps_{height}m"].mean())
        for way in (RAYS, WHOLE_RAYS, ANGLES)
        for height in (low, high)
    }
    factor = np.nanmean(saved(spread), axis=0)
    return (
        f"Counted, and so the same on every machine: a point takes {count[RAYS, low]:.0f} steps of a ray "
        f"at {low} m "
        f"and {count[RAYS, high]:.0f} at {high} m; from the camera {count[WHOLE_RAYS, low]:.0f} and "
        f"{count[WHOLE_RAYS, high]:.0f}; Bresenham asks {count[ANGLES, low]:.0f} and "
        f"{count[ANGLES, high]:.0f} grid "
        f"points. To begin at the highest ground in view saves a factor of {factor[0]:.1f} at {low} m and of "
        f"{factor[-1]:.1f} at {high} m."
    )


def view_words(spread: pd.DataFrame) -> str:
    """How wide the field of view is, and how it grows."""
    low, high = HEIGHTS[0], HEIGHTS[-1]
    exponent = mean_words(spread[VIEW, "exponent"], 3)
    return (
        f"Straight down the image is {spread[VIEW, f'width_{low}m'].mean():.1f} m wide from {low} m and "
        f"{spread[VIEW, f'width_{high}m'].mean():.0f} m from {high} m: its width goes with the altitude "
        f"to the power of "
        f"{exponent}, and what it covers with the square of that."
    )


def mean_words(values: pd.Series, digits: int) -> str:
    """Mean over lands, with its 95 % interval where there are two of them."""
    mean, low, high = mean_interval(values)
    return f"{mean:.{digits}f}" + ("" if np.isnan(low) else f" ({low:.{digits}f} to {high:.{digits}f})")


def trees_words(spread: pd.DataFrame) -> str:
    """What trees hide, by incidence."""
    shares = hidden(spread)
    said = [f"{with_interval(shares[:, k])} at {INCIDENCES[k]}" for k in (0, 2, 4, 5)]
    return (
        f"Of the ground that would be seen without trees they hide {', '.join(said[:-1])} and {said[-1]} "
        f"degrees from straight down. What they hide straight down is put in, not found: they are planted on "
        f"{with_interval(spread[TREES, 'planted'])} of the grid points, and the surface that is laid over "
        f"them stands above {with_interval(spread[TREES, 'covered'])} of the ground."
    )


def letter_words(spread: pd.DataFrame) -> str:
    """What the letter of (2.24) and of its line does."""
    seen = max(float(spread[LETTER, f"seen_{name}"].max()) for name, *_ in settings())
    itself = "no point at all is seen" if seen == 0 else f"at most {percent(seen)} of the points are seen"
    axis = np.nanmean([spread[LETTER, f"axis_{height}m"] for height in HEIGHTS], axis=0)
    return (
        f"F (2.24) says that a point is occluded if some angle is smaller than or equal to its own. Its "
        f"own is among "
        f"the angles of the line, so by the letter {itself}. And the longer side of the line is chosen by "
        f"its sign, "
        f"too, as absolute values are left out: that alone changes the answer for {with_interval(axis)} "
        f"of the points."
    )


def table_of(spread: pd.DataFrame) -> pd.DataFrame:
    """A row for each height and tilt, with the columns of `COLUMNS`."""
    rows = []
    for name, height, tilt in settings():
        row = {
            "where": f"{height:.0f} m, {tilt:.0f}°",
            "points": f"{spread[EXACT, f'points_{name}'].mean():.0f}",
            "seen": with_interval(spread[EXACT, f"seen_{name}"]),
        }
        for key, way in (("rays", RAYS), ("angles", ANGLES)):
            row[key] = with_interval(spread[way, f"agreement_{name}"])
            off = [percent(float(spread[way, f"{what}_{name}"].mean())) for what in ("too_many", "too_few")]
            row[f"{key}_off"] = " / ".join(off)
        rows.append(row)
    return pd.DataFrame(rows)


def times_table(times: pd.DataFrame) -> pd.DataFrame:
    """Median microseconds a grid point, by height."""
    rows = [
        {"height": f"{height} m"} | {way: number(1e6 * float(times[way, height].median()), 2) for way in WAYS}
        for height in HEIGHTS
    ]
    return pd.DataFrame(rows)
