"""A flight over a tarpaulin, rendered in colour: what H 4.4.2 finds in it, and where the mean of it lies.

The images are rendered from the twin's true poses, and what is found in them is put on the ground with the
poses that its autopilot states. How the tarpaulin looks is not printed: `look_of` draws it for each flight.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from wildlab.analysis.georeference import errors_of, georeference, observe, score_points
from wildlab.detection.colour import Colour, coloured, find_coloured
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.reporting.charts.drawing import Values, draw_picture, lines_chart
from wildlab.reporting.figures import GREY, INK, ORANGE, new_figure
from wildlab.reporting.published import bounds_of, spread_key
from wildlab.simulation.camera_detections import marks, numbered
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.coloured import ColourView, Ground, Tarpaulin, render_colour
from wildlab.simulation.scene.flights import SceneFlight
from wildlab.simulation.twins import simulate_twin

#: What is found in the images, single positions, their mean, and images that show the horizon.
FOUND, SINGLE, MEAN, HORIZON = "tarpaulin", "single", "mean", "horizon"
#: After how many detections the mean is looked at.
COUNTS = (1, 2, 5, 10, 20, 40, 75)
#: Of the detector, H 4.4.2.
LIMITS = Colour()
#: Pixels that "a few pixels" are read as.
FEW_PX = 3.0
#: How far the tarpaulin's middle lies outside of an image at least that shows nothing of it; and how far
#: outside the borders at most in images that are looked at: further out nothing of it can be accepted.
MARGIN_PX, NEAR_PX = 60.0, 10.0


class GroundLook(NamedTuple):
    """How ground and tarpaulin look, as `look_of` draws it."""

    ground: Ground
    tarpaulin: Tarpaulin


class Drop(NamedTuple):
    """What a flight gave until enough was found.

    Attributes
    ----------
    look
        Of ground and tarpaulin.
    exposures
        (K,) numbers of the images in which something was accepted.
    uv
        (K, 2) what was accepted, px.
    true
        (K, 2) where the tarpaulin's middle is in these images, px.
    area_share
        (K,) area of what was found over that of the tarpaulin in the image.
    looked_at, should
        How many images with the tarpaulin were looked at, and in how many the middle lies inside the borders.
    right
        In how many of the latter the tarpaulin was found.
    false
        How many images gave something that is not the tarpaulin, of all and of `empty` without it.
    empty
        How many images without the tarpaulin were looked at, too.
    """

    look: GroundLook
    exposures: NDArray[np.intp]
    uv: Array
    true: Array
    area_share: Array
    looked_at: int
    should: int
    right: int
    false: int
    empty: int


def look_of(seed: int) -> GroundLook:
    """How ground, sky and tarpaulin look on the flight of a seed. All chosen; nothing of it is printed.

    The tarpaulin is of a blue within the printed limits and fades towards its rim (H 4.4.2), a few metres
    large; the ground is a dull green or brown; the light differs by a tenth.
    """
    rng = stream(seed, "look")
    tarpaulin = Tarpaulin(
        length=float(rng.uniform(3.0, 5.0)),
        width=float(rng.uniform(2.5, 4.0)),
        colour=(float(rng.uniform(5, 30)), float(rng.uniform(105, 130)), float(rng.uniform(232, 250))),
        rim=float(rng.uniform(0.2, 0.5)),
        course=float(rng.uniform(-np.pi, np.pi)),
    )
    red, green, blue = rng.uniform([90, 95, 60], [130, 130, 95])
    # How blue the sky is says whether it is taken for the tarpaulin: from pale to deep.
    ground = Ground(
        colour=(float(red), float(green), float(blue)),
        sky=(float(rng.uniform(15, 110)), float(rng.uniform(110, 140)), float(rng.uniform(215, 250))),
        light=float(rng.uniform(0.9, 1.0)),
        seed=int(rng.integers(2**31)),
    )
    return GroundLook(ground, tarpaulin)


def view_of(
    flight: SceneFlight, look: GroundLook, exposure: int, seed: int, *, shown: bool = True
) -> ColourView:
    """The image of an exposure, without the tarpaulin where it is not `shown`."""
    pose, rng = flight.poses.take(exposure), stream(seed, f"noise of image {exposure}")
    tarpaulin = look.tarpaulin if shown else None
    return render_colour(look.ground, tarpaulin, flight.poses.camera, pose.p_nc, pose.R_nc, rng)


def search(
    flight: SceneFlight,
    look: GroundLook,
    seed: int,
    wanted: int,
    empty: int,
    limits: Colour = LIMITS,
) -> Drop:
    """Look through the images as they come until enough was found.

    Parameters
    ----------
    flight
        Whose images are rendered.
    look
        Of ground and tarpaulin.
    seed
        Of the camera's noise.
    wanted
        Detections that are gathered.
    empty
        Images without the tarpaulin that are looked at besides.
    limits
        Of the detector.

    Returns
    -------
    Drop
    """
    camera = flight.poses.camera
    size = np.array([camera.width, camera.height])
    middle = np.array([look.tarpaulin.north, look.tarpaulin.east, 0.0])
    uv = ground_to_pixel(
        camera, np.tile(middle, (len(flight.times), 1)), flight.poses.p_nc, flight.poses.R_nc
    )
    with np.errstate(invalid="ignore"):
        shown = ((uv > -MARGIN_PX) & (uv < size + MARGIN_PX)).all(axis=1)
        beyond = np.maximum(limits.border_px - uv, uv - (size - 1 - limits.border_px)).max(axis=1)
    rows: list[tuple[int, Array, Array, float]] = []
    looked_at = should = right = false = 0
    valid = np.ones((camera.height, camera.width), bool)
    for exposure in map(int, np.flatnonzero(beyond < NEAR_PX)):
        view = view_of(flight, look, exposure, seed)
        looked_at += 1
        should += bool(beyond[exposure] <= 0)
        found = find_coloured(view.image, valid, limits)
        if not len(found):
            continue
        column, row = np.clip(np.rint(found.uv[0]).astype(int), 0, size - 1)
        on_it = bool(view.labels[row, column])
        false += not on_it
        right += on_it and bool(beyond[exposure] <= 0)
        share = float(found.area[0] / max(view.labels.sum(), 1))
        rows.append((exposure, found.uv[0], view.centre, share))
        if len(rows) == wanted:
            break
    away = stream(seed, "images without").permutation(np.flatnonzero(~shown))[:empty]
    for exposure in map(int, away):
        view = view_of(flight, look, exposure, seed, shown=False)
        false += bool(len(find_coloured(view.image, valid, limits)))
    return Drop(
        look,
        np.array([row[0] for row in rows], np.intp),
        np.array([row[1] for row in rows]).reshape(-1, 2),
        np.array([row[2] for row in rows]).reshape(-1, 2),
        np.array([row[3] for row in rows]),
        looked_at,
        should,
        right,
        false,
        len(away),
    )


def with_detections(flight: Flight, drop: Drop) -> Flight:
    """The flight with what was found in its rendered images in place of the detections that it came with."""
    target = str(flight.table("truth")["target_id"].iloc[0])
    table = numbered([marks(flight.table("frames"), drop.exposures, drop.uv, "detector", target, 0.0)])
    return Flight(
        flight.manifest, flight.nav, flight.tables | {"detections": table}, flight.folder, flight.terrain
    )


def horizon_views(camera: Camera, look: GroundLook, seed: int, images: int) -> list[ColourView]:
    """Images without the tarpaulin, from 100 m, of a camera that is turned up until it sees the horizon.

    The horizon lies in the upper half of the image, anywhere with equal chance, and level.
    """
    rng = stream(seed, "horizon")
    views = []
    for _ in range(images):
        row = rng.uniform(0.0, camera.height / 2)
        tilt = np.pi / 2 - np.arctan2(camera.cy - row, camera.fy)
        turn = euler_to_matrix(0.0, float(tilt), 0.0)
        views.append(render_colour(look.ground, None, camera, [0.0, 0.0, -100.0], turn @ R_MC_DOWN, rng))
    return views


def alarms(views: list[ColourView]) -> tuple[int, int]:
    """In how many images something is found: with the borders that keep the horizon out, and without."""
    valid = [np.ones(view.labels.shape, bool) for view in views]
    kept, every = (
        sum(bool(len(find_coloured(v.image, m, one))) for v, m in zip(views, valid, strict=True))
        for one in (LIMITS, replace(LIMITS, border_px=(0.0, 0.0)))
    )
    return kept, every


def numbers_of(drop: Drop, errors: Array, camera: Camera, height: float) -> dict[tuple[str, str], float]:
    """What is compared over flights, by (subject, name).

    Parameters
    ----------
    drop
        From `search`.
    errors
        (K, 2) north and east of each detection's position from the truth, m.
    camera, height
        Of the images, and how high they were taken, m.
    """
    distance = np.hypot(*errors.T)
    off = drop.uv - drop.true
    numbers = {
        (FOUND, "detection_rate"): drop.right / drop.should if drop.should else np.nan,
        (FOUND, "false_alarms_per_image"): drop.false / (drop.looked_at + drop.empty),
        (FOUND, "pixel_error"): np.hypot(*off.T).mean(),
        (FOUND, "off_centre"): np.hypot(*off.mean(axis=0)),
        (FOUND, "area_share"): drop.area_share.mean(),
        (FOUND, "few_pixels"): FEW_PX * height / camera.fx,
        (SINGLE, "median_error"): np.median(distance),
        (MEAN, "error"): error_of_mean(errors, len(errors)),
    }
    return numbers | {(MEAN, f"after_{count}"): error_of_mean(errors, count) for count in COUNTS}


def error_of_mean(errors: Array, count: int) -> float:
    """Size of the mean of so many detections in a row, the median over where in a flight they begin, m.

    Parameters
    ----------
    errors
        (N, 2) of single positions in the order of time, m.
    count
        How many are averaged; NaN where there are fewer.
    """
    if count > len(errors):
        return float("nan")
    sums = np.cumsum(np.vstack([np.zeros((1, 2)), errors]), axis=0)
    return float(np.median(np.hypot(*(sums[count:] - sums[:-count]).T)) / count)


def trial(seed: int, *, twin: str, detections: int, images: int) -> dict[tuple[str, str], float]:
    """One simulated flight until the target was found often enough, by `numbers_of`.

    Raises
    ------
    WildlabError
        If there is no such twin, or nothing is found on it.
    """
    return flown(seed, twin, detections, images)[2]


def flown(
    seed: int, twin: str, detections: int, images: int
) -> tuple[Drop, Array, dict[tuple[str, str], float]]:
    """What was found, the errors (K, 2) of its positions in m, and the numbers of `trial`."""
    parameters = load_twin(twin)
    scene = SceneFlight(parameters, seed)
    look = look_of(seed)
    drop = search(scene, look, seed, detections, images)
    if not len(drop.uv):
        raise WildlabError(
            f"on the flight of seed {seed} nothing was found", "look at the twin and its images", file=twin
        )
    flight = with_detections(simulate_twin(twin, seed), drop)
    points = georeference(observe(flight, "autopilot"), np.random.default_rng(seed))
    errors = errors_of(score_points(flight, points))
    camera = scene.poses.camera
    numbers = numbers_of(drop, errors, camera, parameters.flight.altitude.si)
    kept, every = alarms(horizon_views(camera, look, seed, images))
    numbers[HORIZON, "alarms_with_borders"] = kept / images
    numbers[HORIZON, "alarms_without_borders"] = every / images
    return drop, errors, numbers


def plot_image(view: ColourView) -> Figure:
    """A rendered image, what of it lies within the limits of colour, and what is accepted."""
    found = find_coloured(view.image, np.ones(view.labels.shape, bool), LIMITS)
    hsv = np.asarray(cv2.cvtColor(view.image, cv2.COLOR_RGB2HSV), np.uint8)
    fig, axes = new_figure(5.8, 2.3, columns=2)
    height, width = view.labels.shape
    across, down = LIMITS.border_px
    panels = {"Image": view.image, "Within the limits": coloured(hsv, LIMITS)}
    for ax, (title, picture) in zip(axes, panels.items(), strict=True):
        draw_picture(ax, picture, title, limits=(0, 1))
        inner = (width - 1 - 2 * across, height - 1 - 2 * down)
        ax.add_patch(Rectangle((across, down), *inner, fill=False, ec=ORANGE, lw=1, ls="--"))
    axes[0].plot(*found.uv.T, "o", mfc="none", mec="white", ms=20, mew=1.6)
    return fig


def plot_mean(runs: pd.DataFrame) -> Figure:
    """The error of the mean after so many detections, and what independent errors would give."""
    known = np.array([count for count in COUNTS if runs[MEAN, f"after_{count}"].notna().all()])
    columns = [runs[MEAN, f"after_{count}"] for count in known]
    middle = np.array([column.median() for column in columns])
    lines = {
        "median flight": Values(middle),
        "if errors were independent": Values(middle[0] / np.sqrt(known / known[0]), color=INK, look=":"),
        "a single one": Values(0 * middle + runs[SINGLE, "median_error"].median(), color=GREY, look="--"),
    }
    if len(runs) > 1:
        band = Values(None, np.transpose([bounds_of(column) for column in columns]))
        lines = {f"flights, {spread_key(len(runs))}": band} | lines
    x, y = "detections in the mean", "error of the mean (m)"
    return lines_chart(known, lines, x, y, size=(5.6, 4.2), xscale="log", ylim=(0, None))
