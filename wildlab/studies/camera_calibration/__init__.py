"""The camera and how it is mounted, from patterns and known points: H 2.5.1, 5.3.2, 5.6.1."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.evaluation.shares import Check
from wildlab.geometry.calibration import Mounting
from wildlab.geometry.intrinsics import PINHOLE
from wildlab.reporting.charts.drawing import draw_dots, finish
from wildlab.reporting.charts.forms import Values, rows_chart
from wildlab.reporting.figures import BLUE, GREEN, INK, VERMILLION, new_figure
from wildlab.reporting.published import error_name
from wildlab.studies.camera_calibration.calibration import (
    CONSTANT,
    PRINTED_AT_HEIGHT,
    Cause,
    Centres,
    error_from_height,
    printed_angles,
    theoretical,
    theoretical_focal_length,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study
from wildlab.studies.sensitivity import TAU2


class Recorded(NamedTuple):
    """A number of ``metrics.json``."""

    name: str
    subject: str
    value: float
    unit: str
    n: int | None = None
    low: float | None = None
    high: float | None = None


def metrics_of(
    calibrated: pd.DataFrame, causes: Sequence[Cause], mounted: Sequence[Mounting]
) -> list[Recorded]:
    """What is recorded.

    Parameters
    ----------
    calibrated
        Of `wildlab.studies.camera_calibration.calibration.calibrations`.
    causes
        Of `wildlab.studies.camera_calibration.calibration.explain`, that of the clicks first.
    mounted
        Calibrations whose angles are compared with the printed ones.
    """
    sheet, focal, height = theoretical(), theoretical_focal_length(), error_from_height()
    n, angles = len(calibrated), np.degrees([printed_angles(one) for one in mounted]).T
    found = [
        Recorded("focal_length", "data-sheet", focal.estimate, "px", low=focal.low, high=focal.high),
        Recorded("centre_column", "data-sheet", sheet.cx, "px"),
        Recorded("centre_row", "data-sheet", sheet.cy, "px"),
        Recorded("offset_columns", "tau2-data-sheet", abs(TAU2.cx - sheet.cx), "px"),
        Recorded("offset_rows", "tau2-data-sheet", abs(TAU2.cy - sheet.cy), "px"),
    ]
    for name in PINHOLE:
        values = calibrated[name].to_numpy(float)
        sd = values.std(ddof=1)
        found += [
            Recorded(name, "tau2", values.mean(), "px", n),
            Recorded(error_name(name), "tau2", sd / n**0.5, "px", n),
            Recorded(f"sd_{name}", "tau2", sd, "px", n),
        ]
    for name, values in zip(("roll", "tilt", "pan"), angles, strict=True):
        count = len(values)
        found += [
            Recorded(name, "mounting", values.mean(), "deg", count),
            Recorded(error_name(name), "mounting", values.std(ddof=1) / count**0.5, "deg", count),
        ]
    return [
        *found,
        Recorded("error_left", "mounting", causes[0].left, "m", n),
        Recorded(error_name("error_left"), "mounting", causes[0].left_error, "m", n),
        Recorded("error_at_350_m", "mounting", height.estimate, "m", low=height.low, high=height.high),
    ]


def check_claims(calibrated: pd.DataFrame) -> dict[str, Check]:
    """By the claim's id: how far the focal lengths of a second set of images are from the first's, px."""
    moved = np.abs(calibrated[["fx", "fy"]].to_numpy() - calibrated[["second_fx", "second_fy"]].to_numpy())
    return {"second-set": Check(measured=moved.max(axis=1))}


def parameters_table(calibrated: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """The camera's parameters as printed; their mean, spread, predicted spread and coverage (%)."""
    return pd.DataFrame(
        [
            {
                "parameter": names[name],
                "published": getattr(TAU2, name),
                "mean": calibrated[name].mean(),
                "spread": calibrated[name].std(ddof=1),
                "predicted": calibrated[f"sd_{name}"].mean(),
                "inside": 100 * calibrated[f"inside_{name}"].mean(),
            }
            for name in PINHOLE
        ]
    )


def causes_table(causes: Sequence[Cause]) -> pd.DataFrame:
    """What each cause leaves, and what it does from the height of the flight; angles in degrees."""
    return pd.DataFrame([{**one._asdict(), "angle": np.degrees(one.angle)} for one in causes])


def circle_grid(centres: Centres, calibrated: pd.DataFrame) -> Figure:
    """One of the rendered images with its centres, and the principal points of all calibrations."""
    fig, axes = new_figure(5.9, 3.1, columns=2)
    axes[0].imshow(centres.image, cmap="gray")
    axes[0].plot(*centres.uv.T, "+", color=VERMILLION, ms=5)
    axes[0].set(xlabel="u (px)", ylabel="v (px)", title="Centres found")
    axes[0].grid(visible=False)
    draw_dots(axes[1], calibrated["cx"], calibrated["cy"], BLUE, "calibrations", size=8, alpha=1.0)
    axes[1].plot(TAU2.cx, TAU2.cy, "x", color=INK, ms=8, mew=2, label="truth")
    axes[1].set(ylabel="row (px)", title="Principal point")
    axes[1].set_aspect("equal", "datalim")
    return finish(fig, "", "principal point, column (px)")


def mounting_causes(causes: Sequence[Cause]) -> Figure:
    """The error on the ground from the height of the flight that each cause makes, and the printed one."""
    grounds = np.array([one.ground for one in causes])
    constant = np.isin([one.name for one in causes], CONSTANT)
    series = {
        name: Values(np.where(which, grounds, np.nan), color=color)
        for name, which, color in (
            ("new in each image", ~constant, BLUE),
            ("the same in all", constant, GREEN),
        )
    }
    least, most = min(*grounds, PRINTED_AT_HEIGHT) / 2, 2 * max(*grounds, PRINTED_AT_HEIGHT)
    limits = {"xscale": "log", "xlim": (least, most)}
    label = "error on the ground from 350 m (m)"
    fig = rows_chart([one.name for one in causes], series, label, size=(5.6, 3.3), apart=0.0, **limits)
    (ax,) = fig.axes
    for row, value in enumerate(grounds):
        ax.annotate(f"{value:.1f} m", (value, row), (0, 8), textcoords="offset points", ha="center")
    ax.axvline(PRINTED_AT_HEIGHT, color=INK, ls="--", lw=1)
    return fig


#: A focal length known to less than this, px, and a mounting error below this from 350 m, m, are small.
WELL_PX, SMALL_M = 1.0, 1.0


def answer(facts: Facts) -> list[str]:
    """How well the camera is known, then what the mounting calibration leaves."""
    camera, mounting = facts.value("tau2", "sd_fx"), facts.value("mounting", "error_at_350_m")
    if math.isnan(camera + mounting):
        return ["unknown"]
    return [
        f"camera-{'well' if camera < WELL_PX else 'poorly'}",
        f"mounting-{'small' if mounting < SMALL_M else 'large'}",
    ]


STUDY = Study("camera-calibration", answer=answer)
