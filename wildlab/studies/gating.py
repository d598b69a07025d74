"""Which of two detections belongs to the tracked target: three ways to ask, by Monte Carlo, H 6.4.3.

Two targets at rest are seen in every image of a short flight, from poses that are known with white errors.
One of them, the main object, is tracked, and the detection with the smaller normalised innovation squared is
taken for its own. That distance is computed from georeferenced positions (H 6.2.3), from pixels (6.8), from
azimuth and elevation (6.11), or from pixels and angles together, as H 6.4.3 proposes at its end: there the
two distances are added, so that where they disagree the surer one decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDABLE
from wildlab.flight.schema import POSITION, QUATERNION
from wildlab.flight.store import Flight
from wildlab.geometry.camera import in_image
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import Array, euler_to_matrix, matrix_to_euler, quaternion_to_matrix
from wildlab.geometry.georeference import ground_to_pixel, pixel_to_plane
from wildlab.reporting.charts.drawing import Values, draw_dots, draw_lines, draw_way, finish
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    VERMILLION,
    log_band,
    map_axes,
    new_figure,
)
from wildlab.studies.page import Shown
from wildlab.tracking.association import innovation_squared
from wildlab.tracking.kalman import correct, predict
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.sensors import (
    azimuth_elevation_of_pixel,
    difference,
    on_state,
    predict_pixel,
    target_in_camera,
)

#: The three forms of H table 6.6, in its order.
FORMS = ("position", "pixels", "angles")
#: What a detection is associated by: a form, or pixels and angles together.
GATES = (*FORMS, "both")
#: What updates a track, and what is associated on it: pixels are used in the update and angles for gating (H
#: 6.3.2).
UPDATES = {"position": ("position",), "pixels": ("pixels", "angles")}

#: H 6.4.3: 141 images at 10 Hz; the second target 10 m north and 15 m east of the main one, each displaced
#: by 10 m per axis; 50 iterations of the filter before, on the true position with 10 m of noise per axis.
IMAGES, RATE_HZ, WARM_UP = 141, 10.0, 50
APART, DISPLACED_M, WARM_UP_M = (10.0, 15.0), 10.0, 10.0
#: H table 6.4: standard deviations of north, east, down (m), roll, pitch, yaw, pan and tilt (rad); pixels.
POSE_SD = np.array([2.0, 2.0, 5.0, *np.radians([1.0, 1.0, 2.0, 1.0, 1.0])])
PIXEL_SD = 2.0
#: H table 6.5: start, and noise of the measurements as the filters assume it.
START_P = np.diag([10.0**2, 10.0**2, 20.0, 20.0])
R_FORM = {
    "position": np.diag([10.0**2, 10.0**2]),
    "pixels": np.diag([360.0, 160.0]),
    "angles": np.diag(np.radians([6.0, 3.0]) ** 2),
}

#: Not printed. Process noise of H (6.1), m/s^2: that of the slow vessel of H 6.4.2, beside the same 10 m of
#: noise. The iterations before association begins are as far apart as the images.
SD_ACCELERATION = 0.01

#: Normal draws of a run: targets, start, warm-up, poses and pixels.
_DRAWS = (4, 2, 2 * WARM_UP, 8 * IMAGES, 4 * IMAGES)


@dataclass(frozen=True)
class Overflight:
    """True poses of `IMAGES` images over the middle between the targets, the origin of n.

    Attributes
    ----------
    poses
        T rows; the camera looks down where pan and tilt are zero.
    time_s
        (T,).
    euler
        (T, 3) rad, roll, pitch, yaw of the poses, to which the noise is added.
    """

    poses: CameraPoses
    time_s: Array
    euler: Array


class Gated(NamedTuple):
    """What happened in N runs of T images; gates in the order of `GATES`, the main object first."""

    right: NDArray[np.bool_]  # (4, N, T)
    nis: Array  # (4, N, T, 2)
    estimate: Array  # (2, N, T, 2) north, east after the update, by `UPDATES`
    measured: Array  # (N, T, 2, 2) georeferenced detections
    targets: Array  # (N, 2, 2) true positions


class GatingScene(NamedTuple):
    """Draws of N runs as things: targets (N, 2, 2), warm-up, detected pixels, and poses as they are known."""

    targets: Array
    start: Array  # (N, 2)
    warm_up: Array  # (N, WARM_UP, 2)
    pixels: Array  # (N, T, 2, 2)
    poses: CameraPoses  # (N, T) rows


def overflight(flight: Flight) -> Overflight:
    """The stretch of a twin's true trajectory that passes over the origin of n with the targets in view.

    Of all stretches of 141 images at 10 Hz in which every image shows the origin, the one whose farthest
    image (horizontally) is nearest to it. A camera that looks straight down from 100 m has a point in view
    for five seconds, not for fourteen: so the gimbal, which H table 6.4 says there was, keeps pan zero and
    tilts forwards and backwards after the targets.

    Raises
    ------
    WildlabError
        If the flight has no true poses, or no stretch of them that has the origin in view.
    """
    if "truth" not in flight.nav:
        raise WildlabError("the flight has no true poses", "use a twin", file=flight.folder, field="nav")
    nav = flight.nav["truth"]
    known = nav["time_s"].to_numpy(float)
    ticks = np.arange(np.ceil(known[0] * RATE_HZ), np.floor(known[-1] * RATE_HZ) + 1) / RATE_HZ
    rows = np.searchsorted(known, ticks - 1e-6)
    p = nav[POSITION].to_numpy(float)[rows]
    R_nb = quaternion_to_matrix(nav[QUATERNION].to_numpy(float)[rows])
    camera = flight.manifest.geometry_camera()
    tilt = _tilt_to_origin(p, R_nb)
    part = _stretch(CameraPoses(camera, Mount(), p, R_nb, np.zeros(len(p)), tilt))
    euler = matrix_to_euler(R_nb[part])
    poses = CameraPoses(camera, Mount(), p[part], euler_to_matrix(*euler.T), np.zeros(IMAGES), tilt[part])
    return Overflight(poses, ticks[part], euler)


def _stretch(seen: CameraPoses) -> slice:
    """See `overflight`."""
    p = seen.p_nb
    shown = in_image(seen.camera, ground_to_pixel(seen.camera, np.zeros(3), seen.p_nc, seen.R_nc))
    away = np.where(shown, np.hypot(p[:, 0], p[:, 1]), np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(away, min(IMAGES, len(away)))
    first = int(np.argmin(windows.max(axis=1)))
    if len(p) < IMAGES or np.isinf(windows[first]).any():
        fix = "use a flight that passes over the origin, as large-ship does"
        raise WildlabError("nowhere does the flight have the origin of n in view for 14 s", fix, field="nav")
    return slice(first, first + IMAGES)


def _tilt_to_origin(p: Array, R_nb: Array) -> Array:
    """Tilt (T,) with which a camera that looks down has the origin of n on the line across its axis."""
    to_origin = np.einsum("tji,tj->ti", R_nb, -p)
    return np.asarray(np.arctan2(to_origin[:, 0], to_origin[:, 2]))


def streams(seed: int, runs: int) -> list[np.random.SeedSequence]:
    """An independent stream for each run; a run's does not depend on how many there are."""
    return np.random.SeedSequence(seed).spawn(runs)


def draw_scene(over: Overflight, runs: list[np.random.SeedSequence]) -> GatingScene:
    """Targets, detections and known poses of runs, with the noise of H table 6.4."""
    normal = np.stack([np.random.default_rng(run).standard_normal(sum(_DRAWS)) for run in runs])
    around, start, warm_up, pose, pixel = np.split(normal, np.cumsum(_DRAWS)[:-1], axis=1)
    N, T = len(runs), IMAGES
    half = np.array(APART) / 2
    targets = np.stack([-half, half]) + DISPLACED_M * around.reshape(N, 2, 2)
    at_sea = np.concatenate([targets, np.zeros((N, 2, 1))], axis=-1)
    exact = over.poses
    true = ground_to_pixel(exact.camera, at_sea[:, None], exact.p_nc[:, None], exact.R_nc[:, None])
    off = POSE_SD * pose.reshape(N, T, 8)
    euler = over.euler + off[..., 3:6]
    pan, tilt = (0.0 if angle is None else angle for angle in (exact.pan, exact.tilt))
    known = replace(
        exact,
        p_nb=exact.p_nb + off[..., :3],
        R_nb=euler_to_matrix(*np.moveaxis(euler, -1, 0)),
        pan=pan + off[..., 6],
        tilt=tilt + off[..., 7],
    )
    main = targets[:, 0]
    return GatingScene(
        targets,
        main + np.sqrt(START_P[0, 0]) * start,
        main[:, None] + WARM_UP_M * warm_up.reshape(N, WARM_UP, 2),
        true + PIXEL_SD * pixel.reshape(N, T, 2, 2),
        known,
    )


def gate(over: Overflight, runs: list[np.random.SeedSequence]) -> Gated:
    """Every image of every run, associated by each of `GATES`. Keeps everything: for some 1000 runs.

    What updates the track is not published; here it is the main object's own measurement.
    """
    return _gate(draw_scene(over, runs))


class Outcome(NamedTuple):
    """What became of each of N runs."""

    rate: Array  # (4, N) per cent of the images associated rightly, gates in the order of `GATES`
    mistaken: NDArray[np.bool_]  # (N,) whether pixels or angles are ever wrong
    same_images: NDArray[np.bool_]  # (N,) whether both are wrong in exactly the same images


def outcomes(over: Overflight, runs: int, seed: int, chunk: int = 500) -> Outcome:
    """What became of each run.

    Parameters
    ----------
    over
        The flight, from `overflight`.
    runs, seed
        How many, and of their streams; see `streams`.
    chunk
        Runs held in memory at a time; the numbers do not depend on it.
    """
    sources = streams(seed, runs)
    parts = [_outcome(gate(over, sources[first : first + chunk])) for first in range(0, runs, chunk)]
    return Outcome(*(np.concatenate(values, axis=-1) for values in zip(*parts, strict=True)))


def _outcome(done: Gated) -> Outcome:
    pixels, angles = (done.right[GATES.index(form)] for form in ("pixels", "angles"))
    rate = 100 * done.right.sum(axis=-1) / IMAGES
    return Outcome(rate, ~(pixels & angles).all(axis=-1), (pixels == angles).all(axis=-1))


def _warm_up(scene: GatingScene) -> tuple[Array, Array]:
    """State (N, 4) and covariance (4, 4) after the iterations on positions: the same for all three forms."""
    x = np.concatenate([scene.start, np.zeros_like(scene.start)], axis=-1)
    P = START_P
    H, R = on_state(np.eye(2), 4), R_FORM["position"]
    F, Q = constant_velocity(1 / RATE_HZ, SD_ACCELERATION)
    for k in range(WARM_UP):
        x, P = predict(x, P, F, Q)
        step = correct(x, P, scene.warm_up[:, k] - x[:, :2], H, R)
        x, P = step.x, step.P
    return x, P


def expected(form: str, position: Array, poses: CameraPoses) -> tuple[Array, Array]:
    """Measurements (N, 2) of targets at (N, 2) north and east, H (6.3), (6.4), (6.9), and their derivatives.

    NaN of a target in or behind the plane of the lens, and of an azimuth on its axis.
    """
    if form == "position":
        return position, np.broadcast_to(np.eye(2), (*position.shape, 2))
    if form == "pixels":
        return predict_pixel(position, poses, 0.0)[:2]
    inner = target_in_camera(position, poses, 0.0)
    level2 = (inner.z[..., :2] ** 2).sum(axis=-1)
    seen = (inner.z[..., 2] > 0) & (level2 > 0)
    x, y, z = np.moveaxis(np.where(seen[..., None], inner.z, np.nan), -1, 0)
    level, range2 = np.sqrt(level2), level2 + z * z
    azimuth = np.stack([-y, x, 0 * z], axis=-1) / level2[..., None]
    elevation = np.stack([-z * x / level, -z * y / level, level], axis=-1) / range2[..., None]
    slopes = np.stack([azimuth, elevation], axis=-2) @ inner.H_position
    return np.stack([np.arctan2(y, x), np.arctan2(z, level)], axis=-1), slopes


def _gate(scene: GatingScene) -> Gated:
    poses, pixels = scene.poses, scene.pixels
    lens = poses.p_nc[:, :, None], poses.R_nc[:, :, None]
    ground = pixel_to_plane(poses.camera, pixels, *lens, 0.0)[..., :2]
    angles = azimuth_elevation_of_pixel(poses.camera, pixels)
    measured = dict(zip(FORMS, (ground, pixels, angles), strict=True))
    F, Q = constant_velocity(1 / RATE_HZ, SD_ACCELERATION)
    N, T = pixels.shape[:2]
    nis, estimate = np.empty((len(GATES), N, T, 2)), np.empty((len(UPDATES), N, T, 2))
    for row, (update, forms) in enumerate(UPDATES.items()):
        x, P = _warm_up(scene)
        P = np.tile(P, (N, 1, 1))
        for t in range(T):
            x, P = predict(x, P, F, Q)
            here = poses.take((slice(None), t))
            with np.errstate(divide="ignore", invalid="ignore"):
                for form in forms:
                    h, H = expected(form, x[:, :2], here)
                    S = H @ P[:, :2, :2] @ np.swapaxes(H, -1, -2) + R_FORM[form]
                    v = difference(measured[form][:, t], h[:, None], (form == "angles", False))
                    nis[GATES.index(form), :, t] = innovation_squared(v, S[:, None])
                h, H = expected(update, x[:, :2], here)
                gap = measured[update][:, t, 0] - h
                step = correct(x, P, gap, on_state(H, 4), R_FORM[update])
            used = np.asarray(np.isfinite(gap).all(axis=1))
            x, P = np.where(used[:, None], step.x, x), np.where(used[:, None, None], step.P, P)
            estimate[row, :, t] = x[:, :2]
    nis[GATES.index("both")] = nis[GATES.index("pixels")] + nis[GATES.index("angles")]
    known = np.isfinite(nis)
    right = known.any(axis=-1) & (np.where(known, nis, np.inf).argmin(axis=-1) == 0)
    return Gated(right, nis, estimate, ground, scene.targets)


#: Success rates (per cent) of the run that H 6.4.3 shows, in the order of `FORMS`.
PUBLISHED_RUN = (91.5, 91.5, 92.2)


def metrics_of(outcome: Outcome) -> list[dict[str, Any]]:
    """Every mean rate with its standard error."""
    return [
        {"name": name, "subject": gate, "value": value, "unit": "%", "n": len(rates)}
        for gate, rates in zip((*FORMS, "pixels-and-angles"), outcome.rate, strict=True)
        for name, value in (("success_rate", rates.mean()), ("success_rate_se", standard_error(rates)))
    ]


def typical_run(over: Overflight, sources: Sequence[np.random.SeedSequence]) -> Gated:
    """Of some runs the one whose rates are nearest to those of H's single run."""
    runs = list(sources)
    shares = 100 * gate(over, runs).right[: len(FORMS)].mean(axis=2)
    chosen = int(np.abs(shares.T - PUBLISHED_RUN).max(axis=1).argmin())
    return gate(over, runs[chosen : chosen + 1])


def standard_error(values: Array) -> float:
    """Of the mean of independent values (N,)."""
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def claim_margins(outcome: Outcome) -> dict[str, Array]:
    """How far each claim of H 6.4.3 is from its limits in each run, by its id: (k, runs) for k limits.

    A claim is true where the means of all its margins are positive. ``forms-agree``: no two forms differ by
    more than one percentage point, either way. ``angles-least-accurate``: the leads of position and of
    pixels over the angles, percentage points. ``mistakes-on-different-images``: of the runs in which pixels
    or angles are ever wrong, more than half have them wrong in different images (percentage points from
    half); NaN in a run without mistakes, which says nothing.
    """
    rates = dict(zip(GATES, outcome.rate, strict=True))
    pairs = [(rates[a], rates[b]) for i, a in enumerate(FORMS) for b in FORMS[i + 1 :]]
    differ = np.where(outcome.mistaken, 0.5 - outcome.same_images, np.nan)
    return {
        "forms-agree": np.stack([1 - sign * (a - b) for a, b in pairs for sign in (1, -1)]),
        "angles-least-accurate": np.stack([rates[form] - rates["angles"] for form in ("position", "pixels")]),
        "mistakes-on-different-images": 100 * differ[None],
    }


def verdict(margins: Array) -> str:
    """Whether the means of all margins (k, runs) are positive, each by twice its standard error."""
    known = [one[np.isfinite(one)] for one in margins]
    if min(len(one) for one in known) < 2:
        return UNDECIDABLE
    mean = np.array([one.mean() for one in known])
    unsure = 2 * np.array([standard_error(one) for one in known])
    if (mean > unsure).all():
        return HOLDS
    return FAILS if (mean < -unsure).any() else UNDECIDABLE


#: Runs behind a published success rate, H 6.4.3.
PUBLISHED_RUNS = 10_000
_COLOURS = {"position": BLUE, "pixels": VERMILLION, "angles": GREEN, "both": PURPLE}
_OBJECTS = {"main object": BLUE, "second object": ORANGE}


def plot_rates(
    outcome: Outcome, published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """Mean success rates; ``published`` by subject and name, hollow.

    Bars are twice the standard error, the published ones' with the same spread between runs.
    """
    fig, ax = new_figure(5.6, 3.9)
    at, look = np.arange(len(GATES)), {"ms": 7, "capsize": 3}
    twice = [2 * standard_error(runs) for runs in outcome.rate]
    ax.errorbar(at, outcome.rate.mean(axis=1), twice, fmt="s", color=BLUE, label="here", **look)
    spread = outcome.rate.std(axis=1, ddof=1)[: len(FORMS)]
    printed = [published[form, "success_rate"] for form in FORMS]
    hollow = {"fmt": "D", "mfc": "white", "mec": INK, "ecolor": INK, "label": "published"}
    ax.errorbar(at[: len(FORMS)], printed, 2 * spread / np.sqrt(PUBLISHED_RUNS), **hollow, **look)
    ax.set_xticks(at, [fill(names[gate], 11) for gate in GATES])
    ax.set_xlim(-0.5, len(GATES) - 0.5)
    return finish(fig, ylabel="right associations (%)")


def plot_right_and_wrong(one: Gated, names: Mapping[str, str]) -> Figure:
    """Right and wrong associations of a single run by image, one band for each form."""
    fig, ax = new_figure(5.6, 3.4)
    for row, form in enumerate(FORMS):
        right = one.right[row, 0]
        ax.plot(np.arange(len(right)) + 1, 2 * row + right, ".", color=_COLOURS[form], ms=4)
        ax.annotate(names[form], (1, 2 * row + 0.5), fontsize=10, va="center", color=_COLOURS[form])
    ax.set_yticks(range(2 * len(FORMS)), ["wrong", "right"] * len(FORMS))
    ax.set_ylim(-0.4, 5.5)
    return finish(fig, "image")


def plot_nis(one: Gated, form: str) -> Figure:
    """NIS of both objects of a single run by image, with the band of a consistent filter."""
    nis = one.nis[GATES.index(form), 0]
    fig, ax = new_figure(5.6, 3.4)
    lines = {
        name: Values(nis[:, k], color=color, look=".-") for k, (name, color) in enumerate(_OBJECTS.items())
    }
    draw_lines(ax, np.arange(len(nis)) + 1, lines)
    log_band(ax, *chi_square_interval(2))
    return finish(fig, "image", "NIS")


def plot_estimates(one: Gated, names: Mapping[str, str]) -> Figure:
    """Where the forms have the main object of a single run; those with the same track share a line."""
    fig, ax = new_figure(5.0, 4.8)
    for way, forms in zip(one.estimate, UPDATES.values(), strict=True):
        label = "; ".join(names[form] for form in forms)
        draw_way(ax, way[0], _COLOURS[forms[0]], label, width=0.8, marker=".", ms=3)
    ax.plot(*one.targets[0, 0, ::-1], "k+", ms=13, mew=2, label="main object, truth")
    map_axes(ax)
    return finish(fig)


def plot_detections(one: Gated) -> Figure:
    """Georeferenced detections of both objects of a single run about their true places."""
    fig, ax = new_figure(5.0, 4.8)
    for which, (name, color) in enumerate(_OBJECTS.items()):
        north, east = one.measured[0, :, which].T
        draw_dots(ax, east, north, color, name, size=5, alpha=0.7)
    ax.plot(*one.targets[0, :, ::-1].T, "k+", ms=13, mew=2, label="truth")
    map_axes(ax)
    return finish(fig)


def run_figures(one: Gated, names: Mapping[str, str]) -> list[Shown]:
    """Counterparts of H figures 6.17 to 6.19 for a single run."""
    return [
        Shown(plot_right_and_wrong(one, names), "mistakes", "fig-6-17a"),
        Shown(plot_nis(one, "position"), "nis-position", "fig-6-17b"),
        Shown(plot_nis(one, "pixels"), "nis-pixels", "fig-6-18a"),
        Shown(plot_nis(one, "angles"), "nis-angles", "fig-6-18b"),
        Shown(plot_estimates(one, names), "estimates", "fig-6-19a"),
        Shown(plot_detections(one), "detections", "fig-6-19b"),
    ]
