"""Finding vessels in thermal images of the sea: H 4.3, 4.4.1."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.rendered import judge
from wildlab.detection.floating import PUBLISHED, FloatingThresholds, find_edges, find_objects
from wildlab.evaluation.intervals import share_interval
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.mount import Mount
from wildlab.messages.catalogue import load_texts
from wildlab.reporting.charts.drawing import draw_dots, finish, name_rows
from wildlab.reporting.charts.forms import Values, draw_picture, lines_chart, rows_chart, spread_points
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, PURPLE, VERMILLION, new_figure
from wildlab.simulation.scene.bodies import KINDS
from wildlab.simulation.scene.drawn import Draw, Drawn, draw_scene
from wildlab.simulation.scene.render import Scene, render
from wildlab.simulation.scene.response import CameraResponse, expose, sensor_of
from wildlab.simulation.scene.sea import Sea
from wildlab.studies.monte_carlo import pooled_share
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study
from wildlab.studies.vessel_detection import trial
from wildlab.studies.vessel_detection.trial import CUT, SHIP, WHOLE, Image

#: Heights of the sweep over kinds, m, and for which of them the smallest area of 50 px is.
HEIGHTS = (25.0, 50.0, 100.0, 150.0, 200.0, 300.0, 400.0)
REFERENCE = 100.0
#: Lengths of vessels, m, and what their decks have over the sea, K.
LENGTHS = (5.0, 10.0, 20.0, 40.0)
EXCESSES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
#: Winds of the sweep over weather, m/s, and how far its camera is tilted from straight down, rad.
WINDS = (2.0, 5.0, 8.0, 12.0, 16.0)
TILT = float(np.radians(45.0))
#: How much warmer the mirrored sun makes the water look, K: H says nothing of it.
GLINTS = (0.0, 1.0, 4.0)
#: How many seas the sweeps over single things share.
SEAS = 6
#: How long a side of a small image is at least, and over the length of what it shows, px.
_SIDE, _AROUND = 96, 2.5
_LARGEST = {"person": 0.5, "buoy": 1.6, "boat": 5.0, "mammal": 6.0}


def small_camera(camera: Camera, length: float, height: float) -> Camera:
    """A window of a camera's image, just large enough for something of that length (m) seen from there."""
    side = int(max(_SIDE, _AROUND * length * camera.fx / height))
    side = min(side, camera.height)
    middle = (side - 1) / 2
    return Camera(side, side, camera.fx, camera.fy, middle, middle)


def found_share(
    scenes: Sequence[tuple[Drawn, Camera]], thresholds: Sequence[FloatingThresholds], seed: int
) -> list[float]:
    """In which share of scenes what floats there is found, with each of several thresholds."""
    response = replace(CameraResponse(), vignetting=0.0)
    hits = np.zeros(len(thresholds))
    for number, (drawn, camera) in enumerate(scenes):
        rng = np.random.default_rng([seed, number])
        view = render(drawn.scene, camera, drawn.poses.p_nc, drawn.poses.R_nc)
        sensor = sensor_of(response, (camera.height, camera.width), rng)
        counts = expose(view.kelvin, response, sensor, rng)
        for k, one in enumerate(thresholds):
            hits[k] += any(judge(view, find_objects(counts, thresholds=one)).found.values())
    return [float(share) for share in hits / len(scenes)]


def over_heights(camera: Camera, draws: int, seed: int) -> pd.DataFrame:
    """Small things from several heights.

    Returns
    -------
    DataFrame
        ``kind``, ``height_m``, ``found`` with the printed area, ``scaled`` with that scaled with the height
        (H 4.4.1) from `REFERENCE` on, both shares of ``draws``.
    """
    rows = []
    for kind in KINDS:
        for height in HEIGHTS:
            window = small_camera(camera, _LARGEST[kind], height)
            draw = Draw(
                height=(height, height), tilt=float(np.radians(10.0)), inside=0.4 * window.width, seas=SEAS
            )
            rng = np.random.default_rng([seed, int(height), len(kind)])
            scenes = [(draw_scene(rng, window, draw, kind), window) for _ in range(draws)]
            fixed = FloatingThresholds()
            found, scaled = found_share(scenes, (fixed, fixed.at_height(height, REFERENCE)), seed)
            row = {"kind": kind, "height_m": height, "found": found, "scaled": scaled, "draws": draws}
            rows.append(row)
    return pd.DataFrame(rows)


def over_contrast(camera: Camera, draws: int, seed: int, height: float = 300.0) -> pd.DataFrame:
    """Vessels of several lengths and temperatures from one height, without a hot engine.

    Returns
    -------
    DataFrame
        ``length_m``, ``excess_k`` of the deck, ``found``, a share of ``draws``.
    """
    rows = []
    for length in LENGTHS:
        window = small_camera(camera, length, height)
        for excess in EXCESSES:
            draw = Draw(
                length=(length, length), excess=(excess, excess), engine=(0.0, 0.0), height=(height, height),
                tilt=float(np.radians(10.0)), inside=0.4 * window.width, seas=SEAS,
            )  # fmt: skip
            rng = np.random.default_rng([seed, int(length), int(10 * excess)])
            scenes = [(draw_scene(rng, window, draw), window) for _ in range(draws)]
            (found,) = found_share(scenes, (FloatingThresholds(),), seed)
            rows.append({"length_m": length, "excess_k": excess, "found": found, "draws": draws})
    return pd.DataFrame(rows)


def over_weather(camera: Camera, draws: int, seed: int) -> pd.DataFrame:
    """False alarms on an empty sea, by wind and glint, the camera tilted half way to the horizon.

    Returns
    -------
    DataFrame
        ``wind`` m/s, ``glint`` K of the sun mirrored in view (0: no sun), and in which share of ``draws``
        images something is ``found``.
    """
    response = CameraResponse()
    sensor = sensor_of(response, (camera.height, camera.width), np.random.default_rng([seed, 5]))
    R_nb = euler_to_matrix(0.0, TILT, 0.0)
    rows = []
    for wind in WINDS:
        for glint in GLINTS:
            # Ahead, as far above the horizon as the camera looks below it: mirrored in the image's middle.
            elevation = float(np.pi / 2 - TILT) if glint else None
            sea = Sea(wind_speed=wind, sun_azimuth=0.0, sun_elevation=elevation, glint=glint, seed=seed)
            alarmed = 0
            for number in range(draws):
                rng = np.random.default_rng([seed, int(10 * wind), int(10 * glint), number])
                at = np.array([*rng.uniform(-1000.0, 1000.0, 2), -REFERENCE])
                poses = CameraPoses(camera, Mount("down"), at, R_nb)
                view = render(Scene(sea), camera, poses.p_nc, poses.R_nc)
                alarmed += bool(find_objects(expose(view.kelvin, response, sensor, rng)).detections)
            rows.append({"wind": wind, "glint": glint, "found": alarmed / draws, "draws": draws})
    return pd.DataFrame(rows)


def thresholds_table(thresholds: FloatingThresholds) -> pd.DataFrame:
    """Every threshold with its value, published or chosen, and where it is published or why it is so."""
    reasons = load_texts("vessel-detection").quantities
    return pd.DataFrame(
        [
            {
                "name": field.name.replace("_", " "),
                "value": str(getattr(thresholds, field.name)),
                "status": "published" if field.name in PUBLISHED else "chosen",
                "reason": reasons[field.name],
            }
            for field in fields(thresholds)
        ]
    )


_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE)


def plot_rates(
    runs: pd.DataFrame, published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """Detection rates over all images with their intervals; ``published`` by subject and name."""
    subjects = (SHIP, WHOLE, CUT)
    here, *ends = 100 * np.array([pooled_share(runs, one, "detection_rate")[0] for one in subjects]).T
    printed = [100 * published.get((one, "detection_rate"), np.nan) for one in subjects]
    series = {"here": Values(here, ends), "published": Values(printed, color=INK, look="D")}
    rows = [names[one] for one in subjects]
    return rows_chart(rows, series, "images in which all was found (%)", size=(5.6, 2.9), apart=0.0)


def plot_steps(image: Image, thresholds: FloatingThresholds) -> Figure:
    """One image as the detector sees it: grey, gradient, steep pixels, and what was found."""
    steps = find_edges(image.counts, None, thresholds)
    found = find_objects(image.counts, thresholds=thresholds).detections
    fig, axes = new_figure(5.9, 5.2, rows=2, columns=2)
    panels = {
        "8 bits": steps.grey,
        "Gradient": steps.gradient,
        f"At {thresholds.gradient:g} and above": steps.steep,
    }
    for ax, (title, picture) in zip(axes.flat, panels.items(), strict=False):
        draw_picture(ax, picture, title)
    last = axes.flat[3]
    draw_picture(last, steps.grey, "Found", boxes=found.box, colors=[ORANGE] * len(found.box))
    last.plot(*found.uv.T, "+", color=ORANGE, ms=8, mew=1.6)
    return fig


def plot_sweep(sweep: pd.DataFrame, along: str, group: str, xlabel: str, ylabel: str, label: str) -> Figure:
    """Shares ``found`` of ``draws`` with their 95 % intervals, a line for each ``group``.

    ``label`` is what a group is called, with its value as ``{}``. A column ``scaled`` is dotted.
    """
    lines = {}
    for colour, (value, own) in zip(_COLOURS, sweep.groupby(group, sort=False), strict=False):
        counts = zip(own["found"], own["draws"], strict=True)
        ends = np.transpose([share_interval(round(share * of), int(of))[1:] for share, of in counts])
        lines[label.format(value)] = Values(100 * own["found"], 100 * ends, colour)
    at = np.unique(sweep[along])
    fig = lines_chart(at, lines, xlabel, ylabel, size=(5.6, 3.7), ticks=False, bars=True, ylim=(-3, 103))
    if "scaled" in sweep:
        (ax,) = fig.axes
        for one, (_, own) in zip(lines.values(), sweep.groupby(group, sort=False), strict=False):
            ax.plot(own[along], 100 * own["scaled"], ":", color=one.color)
        ax.plot([], [], ":", color=INK, label="area scaled with height")
        fig.legends.clear()
        finish(fig, "")
    return fig


def plot_cut_shares(objects: pd.DataFrame) -> Figure:
    """The visible part of each object that the border cuts, found and missed."""
    fig, ax = new_figure(5.6, 2.6)
    cut = objects[objects["share"] < 1]
    for row, (found, colour) in enumerate(((True, BLUE), (False, VERMILLION))):
        share = 100 * cut[cut["found"].astype(bool) == found]["share"].to_numpy(float)
        draw_dots(ax, share, row + spread_points(len(share), 0.25), colour, size=10, alpha=0.8)
    name_rows(ax, ["found", "missed"])
    ax.set_xlim(-2, 102)
    return finish(fig, "", "visible part of the outline (%)")


def answer(facts: Facts) -> list[str]:
    """Whether vessels are missed, by the worse of both data sets, and whether anything else is found."""
    alarms = [facts.value(who, "false_alarms_per_image") for who in (trial.SHIP, trial.BOATS)]
    return [
        f"found-{facts.outcome('near-perfect')}",
        "alarms-unknown" if any(map(math.isnan, alarms)) else "alarms-some" if any(alarms) else "alarms-none",
    ]


STUDY = Study("vessel-detection", trial.trial, trial.check_claims, trial.RECORDED.get, answer)
