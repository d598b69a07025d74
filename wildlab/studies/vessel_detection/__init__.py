"""Finding vessels in thermal images of the sea: H 4.3, 4.4.1."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.detection.floating import PUBLISHED, FloatingThresholds, find_edges, find_objects
from wildlab.messages.catalogue import load_texts
from wildlab.reporting.charts.drawing import draw_dots, finish, name_rows
from wildlab.reporting.charts.forms import Values, draw_picture, rows_chart, spread_points
from wildlab.reporting.figures import BLUE, INK, ORANGE, VERMILLION, new_figure
from wildlab.studies.monte_carlo import pooled_share
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study
from wildlab.studies.vessel_detection import trial
from wildlab.studies.vessel_detection.trial import CUT, SHIP, WHOLE, Image


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
