"""Rendered images of animals in four kinds of weather, and what F finds in them (F 3.2, 7.4, 8.1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.detection.detections import Detections
from wildlab.detection.warm import (
    Warm,
    block_from_distance,
    enhance,
    find_warm,
    gate_from_distance,
    grey_above,
    subtract_background,
    to_grey,
)
from wildlab.evaluation.intervals import Interval, mean_interval
from wildlab.evaluation.matching import Rates, rates, shares
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import Values, draw_picture, rows_chart
from wildlab.reporting.figures import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, new_figure
from wildlab.simulation.error_models import stream
from wildlab.simulation.manifest import twin_manifest
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.drawn import ANIMALS, LandDraw, Layout, animal, draw_layout
from wildlab.simulation.scene.flights import CameraResponse, Sensor, expose, sensor_of, to_counts
from wildlab.simulation.scene.land import LandView, Weather, render_land
from wildlab.studies.page import interval_words
from wildlab.studies.rules import keys_of

#: When images are taken. F's were mostly taken under clouds, some in sunlight (F 7.4).
NIGHT, MORNING, NOON, CLOUDY = "night", "morning", "noon", "cloudy"
WEATHERS = {
    NIGHT: Weather(hour=2.0),
    MORNING: Weather(hour=8.0),
    NOON: Weather(hour=13.0),
    CLOUDY: Weather(hour=13.0, clouds=1.0),
}
#: Where from: the gondola, 3 to 20 m above the ground, looking aside (F 8.2), and the two heights of F 7.5.1.
VIEWS = {
    15: LandDraw(height=15.0, tilt=float(np.radians(45.0)), spread=float(np.radians(6.0)), animals=(1, 3),
                 stones=(1, 4), trees=(0, 0), border=60.0),
    30: LandDraw(height=30.0, animals=(2, 5)),
    60: LandDraw(height=60.0, animals=(3, 8), stones=(5, 12), trees=(1, 3)),
}  # fmt: skip
#: A herd, for what many animals do to the mean (F 8.1.1).
HERD = replace(VIEWS[30], animals=(14, 20), kinds=("rhinoceros",))

#: F's methods with F's numbers (figures 7.5 to 7.11). F calls the number of an adaptive threshold "val" where
#: it stands alone, as that of a constant one, and "level" after subtraction or enhancement. On seeds 101 to
#: 108, which no study uses, "val" finds more as a floor (F1 .83, else .45), "level" as an offset from the
#: mean of the block (.93 and .68, else .62 and .67). Blocks of 51 and of 251 without
#: a level have that of figure 7.10a here.
CONSTANT, SMALL, LARGE = "constant", "adaptive-51", "adaptive-251"
SUBTRACTED, ENHANCED = "subtracted", "enhanced"
#: The level of 150 as an offset: as a floor it is hardly more than `CONSTANT`, since the mean of so large a
#: block is seldom above 150. What is said of adaptive thresholds is held against this one.
OVER_MEAN = "adaptive-offset"
#: F 8.1.1: background subtraction and a constant threshold, by the mean, and by the median as F proposes.
BY_MEAN, BY_MEDIAN = "mean-constant", "median-constant"
#: The same with the threshold that the herd's place gives without the herd.
BY_EMPTY = "empty-constant"
#: F 3.2, 8.4: `SUBTRACTED` with what F proposes: sizes and blocks from the ground, and nothing too hot.
BY_SIZE, BY_BLOCK, NOT_HOT = "sized", "block", "not-hot"
#: The smallest contour, px^2; F prints none.
SMALLEST = 50.0
_PLAIN = Warm(background="none", smallest_px=SMALLEST, largest_px=float("inf"))
METHODS = {
    CONSTANT: replace(_PLAIN, threshold="constant", level=150.0),
    OVER_MEAN: replace(_PLAIN, threshold="adaptive", level=150.0, level_is="offset", block_px=451),
    SMALL: replace(_PLAIN, threshold="adaptive", level=65.0, level_is="offset", block_px=51),
    LARGE: replace(_PLAIN, threshold="adaptive", level=65.0, level_is="offset", block_px=251),
    SUBTRACTED: replace(
        _PLAIN, background="mean", threshold="adaptive", level=65.0, level_is="offset", block_px=251
    ),
    ENHANCED: replace(
        _PLAIN, background="enhance", threshold="adaptive", level=160.0, level_is="offset", block_px=251
    ),
    BY_MEAN: replace(_PLAIN, background="mean", threshold="constant", level=65.0),
    BY_MEDIAN: replace(_PLAIN, background="median", threshold="constant", level=65.0),
}
PROPOSED = (BY_SIZE, BY_BLOCK, NOT_HOT)
SUBJECTS = (*METHODS, *PROPOSED)
#: Area of an animal from above, m^2: half a small antelope's, twice a rhinoceros'.
AREA = (0.2, 8.0)
#: The hottest that the mean of an animal can be, K: that of its blood.
HOTTEST = 310.15
#: How wide the operator's window is, as a multiple of what animals have over the ground, and at least, K.
WINDOW, LEAST_WINDOW = 2.0, 8.0
#: Of an animal that is to be found this share must show.
SHOWN = 0.25
#: A detection is no animal's that is so many times larger, or further from it than so many px.
TOO_LARGE, NEAR = 3.0, 3
#: The animal is larger than the block by its major axis, px: F's small block has 51.
LARGER_THAN = 51.0
COUNTS = ("found", "invented", "missed")


@dataclass(frozen=True, eq=False)
class Picture:
    """An image with what it shows.

    Attributes
    ----------
    view
        Temperatures and labels.
    counts
        Of the camera, 14 bits.
    window
        What the operator makes black and white, counts (F 3.1).
    distance
        To the ground along the middle of the image, m.
    """

    view: LandView
    counts: NDArray[np.uint16]
    window: tuple[float, float]
    distance: float

    @cached_property
    def grey(self) -> NDArray[np.uint8]:
        """In 256 grey levels."""
        return to_grey(self.counts, self.window)

    @cached_property
    def animals(self) -> dict[int, int]:
        """Pixels by number of the animals that can be found."""
        return {
            seen.number: int((self.view.labels == seen.number).sum())
            for seen in self.view.seen
            if seen.kind in ANIMALS and self.view.visible(seen.number) >= SHOWN
        }


@dataclass(frozen=True)
class DetectionScore:
    """What detections are worth: rows by animal, and how many are of nothing."""

    rows: dict[int, list[int]]
    false: int

    @property
    def counts(self) -> NDArray[np.float64]:
        """(3,) found, invented and missed; a second piece of an animal is invented."""
        found = sum(bool(one) for one in self.rows.values())
        extra = sum(max(len(one) - 1, 0) for one in self.rows.values())
        return np.array([found, self.false + extra, len(self.rows) - found], float)


def judge(picture: Picture, found: Detections) -> DetectionScore:
    """Which detection is of which animal: that on whose pixels, or near them, its centroid lies.

    Detections of animals that hardly show count neither way.
    """
    labels, targets = picture.view.labels, picture.animals
    hidden = {seen.number for seen in picture.view.seen if seen.kind in ANIMALS} - set(targets)
    rows: dict[int, list[int]] = {number: [] for number in targets}
    false = 0
    for row in range(len(found)):
        u, v = np.rint(found.uv[row]).astype(int)
        part = labels[max(v - NEAR, 0) : v + NEAR + 1, max(u - NEAR, 0) : u + NEAR + 1]
        near = np.bincount(part[part > 0], minlength=1)
        best = int(near.argmax()) if near.any() else 0
        if best in rows and found.area[row] <= TOO_LARGE * targets[best]:
            rows[best].append(row)
        elif best not in hidden:
            false += 1
    return DetectionScore(rows, false)


def find(picture: Picture, thresholds: Warm) -> Detections:
    """What a method finds in a picture."""
    # What is too hot is said in counts; for the rest the grey image is all that F had.
    if np.isinf(thresholds.hottest):
        return find_warm(picture.grey, picture.view.ground, thresholds)
    return find_warm(picture.counts, picture.view.ground, replace(thresholds, window=picture.window))


def above(picture: Picture, thresholds: Warm) -> NDArray[np.bool_]:
    """The mask of a picture: where it is above the threshold (F figures 7.5 to 7.11)."""
    grey = picture.grey
    if thresholds.background == "enhance":
        grey = enhance(grey)
    elif thresholds.background != "none":
        grey = subtract_background(grey, picture.view.ground, thresholds.background)
    return np.asarray(grey_above(grey, thresholds), bool)


def proposed(name: str, picture: Picture, camera: Camera, response: CameraResponse) -> Warm:
    """One of `PROPOSED` for a picture."""
    base, focal = METHODS[SUBTRACTED], float(np.sqrt(camera.fx * camera.fy))
    if name == BY_SIZE:
        smallest, largest = gate_from_distance(picture.distance, focal, *AREA)
        return replace(base, smallest_px=smallest, largest_px=largest)
    if name == BY_BLOCK:
        return replace(base, block_px=block_from_distance(picture.distance, focal))
    return replace(base, hottest=float(to_counts(HOTTEST, response)))


class Operator(NamedTuple):
    """Who takes the pictures: a camera, and the response and the sensor that it has."""

    camera: Camera
    response: CameraResponse
    sensor: Sensor
    rng: np.random.Generator

    def window(self, view: LandView, weather: Weather) -> tuple[float, float]:
        """The middle between ground and animals, and about as wide as twice what is between (F 3.1)."""
        ground = float(np.median(view.kelvin[view.labels == 0]))
        skins = [animal(kind, weather).layers[-1].excess for kind in ANIMALS]
        warm = weather.air + float(np.mean(skins))
        half = max(WINDOW * abs(warm - ground), LEAST_WINDOW) / 2
        middle = (warm + ground) / 2
        low, high = to_counts([middle - half, middle + half], self.response)
        return float(low), float(high)

    def take(
        self,
        layout: Layout,
        weather: Weather,
        window: tuple[float, float] | None = None,
        with_animals: bool = True,
    ) -> Picture:
        """A picture of a place; the window is set for it where none is given."""
        view = render_land(layout.scene(weather, with_animals), self.camera, layout.p_nc, layout.R_nc)
        counts = expose(view.kelvin, self.response, self.sensor, self.rng)
        return Picture(view, counts, window or self.window(view, weather), layout.distance)


def operator_of(twin: str, seed: int) -> Operator:
    """F's camera, as the twin has it."""
    camera = twin_manifest(load_twin(twin), 0).geometry_camera()
    response = CameraResponse()
    sensor = sensor_of(response, (camera.height, camera.width), stream(seed, "sensor"))
    return Operator(camera, response, sensor, stream(seed, "exposures"))


class Pictures(NamedTuple):
    """All of one seed: by weather and height; a sequence over which the sun comes out; a herd."""

    plain: dict[tuple[str, int], Picture]
    sequence: tuple[Picture, Picture]
    herd: Picture
    no_herd: Picture


def take_pictures(operator: Operator, seed: int) -> Pictures:
    """The pictures of one seed.

    The window is set once for each weather and height. In the sequence it is set under clouds; then the sun
    has come out over the same place, some time between nine and noon: high enough to change the ground.
    """
    camera = operator.camera
    plain = {}
    for height, draw in VIEWS.items():
        for name, weather in WEATHERS.items():
            layout = draw_layout(stream(seed, f"{name} {height}"), camera, draw)
            plain[name, height] = operator.take(layout, weather)
    rng = stream(seed, "sequence")
    layout, hour = draw_layout(rng, camera, VIEWS[30]), float(rng.uniform(9.0, 12.0))
    before = operator.take(layout, Weather(hour=hour, clouds=1.0))
    after = operator.take(layout, Weather(hour=hour), before.window)
    layout = draw_layout(stream(seed, "herd"), camera, HERD)
    alone = operator.take(layout, WEATHERS[CLOUDY], with_animals=False)
    herd = operator.take(layout, WEATHERS[CLOUDY], alone.window)
    return Pictures(plain, (before, after), herd, alone)


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """Counts and levels of the pictures of one seed.

    Parameters
    ----------
    seed
        Of places, animals, camera.
    twin
        Whose camera it is.

    Returns
    -------
    dict
        By (method, ``found_WEATHER_HEIGHT``).
    """
    operator = operator_of(twin, seed)
    return numbers_of(operator, take_pictures(operator, seed))


def numbers_of(operator: Operator, pictures: Pictures) -> dict[tuple[str, str], float]:
    """What `trial` gives, from pictures."""
    numbers: dict[tuple[str, str], float] = {}

    def tally(subject: str, at: str, picture: Picture, thresholds: Warm) -> DetectionScore:
        judged = judge(picture, find(picture, thresholds))
        for name, value in zip(COUNTS, judged.counts, strict=True):
            numbers[subject, f"{name}_{at}"] = value
        return judged

    for (weather, height), picture in pictures.plain.items():
        at = f"{weather}_{height}"
        for method, thresholds in METHODS.items():
            tally(method, at, picture, thresholds)
        for method in PROPOSED:
            tally(method, at, picture, proposed(method, picture, operator.camera, operator.response))
        numbers["ground", f"as_warm_{at}"] = as_warm(picture)
        left = background_left(picture)
        numbers[SUBTRACTED, f"background_{at}"], numbers[ENHANCED, f"background_{at}"] = left
    for name, picture in zip(("before", "after"), pictures.sequence, strict=True):
        for method in (CONSTANT, OVER_MEAN):
            tally(method, name, picture, METHODS[method])
        numbers["ground", f"level_{name}"] = float(np.median(picture.grey[picture.view.labels == 0]))
    near = pictures.plain[CLOUDY, min(VIEWS)]
    for method in (SMALL, LARGE):
        numbers[method, "pieces_offset_65"] = pieces_of(near, METHODS[method])
    for method in (BY_MEAN, BY_MEDIAN):
        tally(method, "herd", pictures.herd, METHODS[method])
    for name, middle in (("mean", np.mean), ("median", np.median)):
        numbers["herd", f"{name}_rise"] = float(middle(pictures.herd.grey) - middle(pictures.no_herd.grey))
    lower = METHODS[BY_MEAN].level - numbers["herd", "mean_rise"]
    tally(BY_EMPTY, "herd", pictures.herd, replace(METHODS[BY_MEAN], level=float(np.clip(lower, 0, 255))))
    return numbers


def as_warm(picture: Picture) -> float:
    """How many pixels without an animal are as warm as animals' middle one, for each pixel of an animal."""
    kelvin, labels = picture.view.kelvin, picture.view.labels
    own = np.isin(labels, list(picture.animals))
    every = [seen.number for seen in picture.view.seen if seen.kind in ANIMALS]
    if not own.any():
        return float("nan")
    return float((kelvin[~np.isin(labels, every)] >= np.median(kelvin[own])).sum() / own.sum())


def background_left(picture: Picture) -> tuple[float, float]:
    """Mean grey level that ground has after background subtraction, and after enhancement (F 7.4.3)."""
    grey, ground = picture.grey, picture.view.labels == 0
    whole = np.ones(grey.shape, bool)
    return (
        float(subtract_background(grey, whole, "mean")[ground].mean()),
        float(enhance(grey)[ground].mean()),
    )


def pieces_of(picture: Picture, thresholds: Warm) -> float:
    """Detections for each animal that is found and longer than F's small block; NaN for none."""
    judged = judge(picture, find(picture, thresholds))
    long = {
        seen.number
        for seen in picture.view.seen
        if np.linalg.norm(np.ptp(seen.outline, axis=0)) > LARGER_THAN
    }
    pieces = [len(rows) for number, rows in judged.rows.items() if rows and number in long]
    return float(np.mean(pieces)) if pieces else float("nan")


def places(weather: str) -> list[str]:
    """Names of the pictures of a weather, from all heights."""
    return [f"{weather}_{height}" for height in VIEWS]


def counts_of(runs: pd.DataFrame, subject: str, at: Sequence[str]) -> Array:
    """(images, 3) found, invented and missed of all seeds; an image that was not looked at has no row."""
    named = [[(subject, f"{name}_{one}") for name in COUNTS] for one in at]
    rows = [runs[one].to_numpy(float) for one in named if one[0] in runs.columns]
    table = np.concatenate([np.zeros((0, 3)), *rows])
    return np.asarray(table[np.isfinite(table).all(axis=1)])


def rates_of(runs: pd.DataFrame, subject: str, at: Sequence[str]) -> Rates:
    """Precision, recall and F1 over all images, with intervals over images."""
    return rates(counts_of(runs, subject, at))


def false_alarms(runs: pd.DataFrame, subject: str, at: Sequence[str]) -> Interval:
    """How many an image, with the interval of the mean, which ends at zero."""
    invented = counts_of(runs, subject, at)[:, 1]
    if len(invented) < 2:
        return Interval(float(invented.mean()) if len(invented) else np.nan, np.nan, np.nan)
    found = mean_interval(invented)
    return Interval(found.estimate, max(found.low, 0.0), found.high)


def rates_metrics(runs: pd.DataFrame) -> list[tuple[str, str, Interval, int]]:
    """Name, subject, value with interval, and number of images of each method's rates in each weather."""
    found = []
    for subject in (*METHODS, *PROPOSED):
        for weather in WEATHERS:
            at = places(weather)
            one, alarms = rates_of(runs, subject, at), false_alarms(runs, subject, at)
            if one.groups:
                values = {"recall": one.recall, "f1": one.f1, "false_alarms_per_image": alarms}
                found += [(f"{name}_{weather}", subject, each, one.groups) for name, each in values.items()]
    return found


def claim_functions(runs: pd.DataFrame) -> dict[str, Callable[[str, str], Array]]:
    """What the rules of claims ask of a method, (seeds,), over the pictures of a seed whose names fit: F1,
    recall, and how many false alarms."""

    def sums(method: str, at: str) -> Array:
        each = [
            [key for key in keys_of(runs) if key[0] == method and fnmatchcase(key[1], f"{name}_{at}")]
            for name in COUNTS
        ]
        return np.stack([runs[keys].to_numpy(float).sum(axis=1) for keys in each], axis=1)

    return {
        "f1": lambda method, at: f1(sums(method, at)),
        "recall": lambda method, at: np.asarray(shares(sums(method, at))[..., 1]),
        "invented": lambda method, at: sums(method, at)[:, 1],
    }


def f1(counts: Array) -> Array:
    """(...) of (..., 3) counts: zero where nothing was found, NaN where there was nothing."""
    return np.asarray(shares(counts)[..., 2])


_COLOURS = {CONSTANT: BLUE, OVER_MEAN: VERMILLION, SUBTRACTED: GREEN, ENHANCED: PURPLE, BY_SIZE: ORANGE}


def _thresholded(ax: Axes, picture: Picture, thresholds: Warm) -> DetectionScore:
    """Draw the image after a threshold, with its detections: right ones blue, others red."""
    found = find(picture, thresholds)
    judged = judge(picture, found)
    right = {row for rows in judged.rows.values() for row in rows[:1]}
    colors = [SKY if row in right else VERMILLION for row in range(len(found.box))]
    draw_picture(ax, above(picture, thresholds), limits=(0, 1), boxes=found.box, colors=colors, margin=3)
    return judged


def image_by_method(picture: Picture, names: Mapping[str, str]) -> Figure:
    """One image through each method side by side, as in F figures 7.5 to 7.11."""
    fig, axes = new_figure(5.6, 6.1, rows=3, columns=2)
    draw_picture(axes.flat[0], picture.grey, "8 bits")
    for ax, method in zip(axes.flat[1:], (CONSTANT, OVER_MEAN, LARGE, SUBTRACTED, ENHANCED), strict=True):
        _counted(ax, picture, method, names)
    return fig


def image_by_sun(before: Picture, after: Picture, names: Mapping[str, str]) -> Figure:
    """A sequence over which the background changes: constant and adaptive threshold (F figures 7.5, 7.6)."""
    fig, axes = new_figure(5.6, 6.1, rows=3, columns=2)
    for column, (when, picture) in enumerate((("under clouds", before), ("sun out", after))):
        draw_picture(axes[0, column], picture.grey, f"{when}, 8 bits")
        for row, method in enumerate((CONSTANT, OVER_MEAN), start=1):
            _counted(axes[row, column], picture, method, names)
    return fig


def animal_by_block(picture: Picture) -> Figure:
    """The largest animal with the small and the large block (F figures 7.7, 7.8)."""
    number = max(picture.animals, key=lambda one: picture.animals[one])
    v, u = np.nonzero(picture.view.labels == number)
    fig, axes = new_figure(5.6, 2.9, rows=1, columns=2)
    for ax, method in zip(axes.flat, (SMALL, LARGE), strict=True):
        thresholds = METHODS[method]
        count = len(_thresholded(ax, picture, thresholds).rows[number])
        ax.set_title(f"block {thresholds.block_px} px: {count} detection{'s' * (count != 1)}")
        middle, half = np.array([np.mean(u), np.mean(v)]), 0.9 * max(float(np.ptp(u)), float(np.ptp(v)), 40.0)
        ax.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] + half, middle[1] - half))
    return fig


def rates_by_weather(
    runs: pd.DataFrame, what: Literal["recall", "false"], names: Mapping[str, str]
) -> Figure:
    """Recall, or false alarms per image, by weather and method with their intervals."""
    series, most = {}, 1.0
    for method in (CONSTANT, OVER_MEAN, SUBTRACTED, ENHANCED, BY_SIZE):
        each = [places(weather) for weather in WEATHERS]
        if what == "recall":
            found = 100 * np.array([rates_of(runs, method, at).recall for at in each])
        else:
            found = np.array([false_alarms(runs, method, at) for at in each])
        middle, low, high = found.T
        series[names[method]] = Values(middle, (np.maximum(low, 0), high), _COLOURS[method])
        most = max(most, float(middle.max()))
    recall, rows = what == "recall", [names[one] for one in WEATHERS]
    label, limits = (
        ("animals found (%)", (-2, 102)) if recall else ("false alarms per image", (-0.02 * most, None))
    )
    return rows_chart(rows, series, label, size=(5.6, 3.9), apart=0.14, xlim=limits)


def methods_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """F1 of every method by weather."""
    rows = []
    for method in (*METHODS, *PROPOSED):
        each = {weather: rates_of(runs, method, places(weather)).f1 for weather in WEATHERS}
        rows.append(
            {"method": names[method]} | {key: interval_words(f1, 2, least=0.0) for key, f1 in each.items()}
        )
    return pd.DataFrame(rows)


def _counted(ax: Axes, picture: Picture, method: str, names: Mapping[str, str]) -> None:
    """The image after a method's threshold, with its detections, and how many of them are right."""
    found, invented, missed = _thresholded(ax, picture, METHODS[method]).counts
    said = f"{names[method]}\n{found:.0f} of {found + missed:.0f} found, {invented:.0f} false"
    ax.set_title(said, fontsize=10)
