"""The words of the report on camera and mounting, each from the numbers it states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from wildlab.geometry.camera import Camera
from wildlab.studies.camera_calibration.mounting import CONSTANT, Cause

#: A difference of so many standard deviations is no chance.
CHANCE = 3.0
#: A calibration of the mount that is wrong by less than this share of the printed 6.6 m is better than it.
CLEARLY = 0.8
#: Directions that differ by less than a pixel are alike.
ALIKE_PX = 1.0


def aspect(found: pd.DataFrame, printed: Camera) -> tuple[float, float]:
    """The difference of both focal lengths as printed, px, and its standard deviation over calibrations."""
    return printed.fy - printed.fx, float((found["fy"] - found["fx"]).std(ddof=1))


def focal_words(found: pd.DataFrame, images: int, noise: float) -> str:
    """How well so many images tell the focal length."""
    sd = float(found["fx"].std(ddof=1))
    return (
        f"{images} images of a warm circle grid tell the focal length of this camera to {sd:.1f} pixels in "
        f"{found['fx'].mean():.0f}, where circles are found to {noise:.2f} pixels."
    )


def aspect_words(apart: float, sd: float, noise: float) -> str:
    """Whether the printed focal lengths may differ by chance, with circles found to ``noise`` px."""
    times = abs(apart) / sd
    said = f"The two focal lengths that the thesis prints differ by {abs(apart):.1f} pixels"
    if times > CHANCE:
        return (
            f"{said}, {times:.0f} times what chance gives here: circles would have to be "
            f"{noise * times / 2:.1f} "
            "pixels off, or pixels, lens or plate are not even."
        )
    return f"{said}, which chance may give (its standard deviation is {sd:.1f} pixels)."


def offset_words(printed: Camera, sheet: Camera, found: pd.DataFrame, middle: float, corner: float) -> str:
    """How far printed and theoretical camera are apart, and what taking the wrong one costs."""
    du, dv = sheet.cx - printed.cx, printed.cy - sheet.cy
    longer = 100 * (np.array([printed.fx, printed.fy]) / sheet.fx - 1)
    sd = float(np.hypot(found["cx"].std(ddof=1), found["cy"].std(ddof=1)))
    beyond = np.hypot(du, dv) / sd
    chance = (
        f"{beyond:.0f} times what chance gives here" if beyond > CHANCE else "no more than chance may give"
    )
    return (
        f"The calibrated principal point is {abs(du):.0f} and {abs(dv):.0f} pixels from the middle of the "
        f"image, "
        f"{chance}, and the focal lengths are {longer[0]:.1f} and {longer[1]:.1f} % "
        f"{'longer' if longer.min() > 0 else 'away from'} than the data sheet's. From 350 m, straight down, "
        f"the "
        f"data sheet's camera puts a point {middle:.1f} m off in the middle of the image and {corner:.1f} m "
        f"at "
        "its corner."
    )


def distortion_words(cost: Mapping[float, tuple[float, float]]) -> str:
    """How strongly a lens may bend before neglecting it shows; ``cost`` is by k1."""
    shown = [abs(k1) for k1, (_, largest) in cost.items() if largest >= ALIKE_PX]
    harmless = [k1 for k1 in cost if abs(k1) < min(shown, default=np.inf)]
    strongest = max(cost, key=abs)
    if not harmless:
        least = min(cost, key=lambda k1: abs(k1))
        return (
            f"Even k1 = {least:g} moves a direction by {cost[least][1]:.1f} px somewhere in the image, once "
            f"the "
            "lens is taken for straight: the thesis neglects distortion, and does not print how small it is."
        )
    most = max(harmless, key=abs)
    return (
        f"A lens with k1 of {abs(most):g} either way may be taken for straight: no direction moves by a "
        f"whole pixel. "
        f"With {strongest:g} it is {cost[strongest][1]:.1f} px. The thesis does not print its distortion."
    )


def second_set_words(share: float, within: float) -> str:
    """Whether a second set of images gives the same camera."""
    return (
        f"A second set of images gives focal lengths within {within:g} px of the first's in "
        f"{100 * share:.0f} % of "
        "the simulated calibrations. What both sets share, a board that is not flat for instance, does not "
        "show so."
    )


def mounting_words(causes: Sequence[Cause], printed_error: float, printed_ground: float) -> str:
    """What the printed error means in flight, if it is one of those that differ from image to image."""
    varied = [one for one in causes if one.name not in CONSTANT]
    low, high = min(one.ground for one in varied), max(one.ground for one in varied)
    said = (
        f"The {100 * printed_error:.1f} centimetres that the mounting calibration leaves make {low:.1f} to "
        f"{high:.1f} "
        "metres from 350 metres, if their cause differs from image to image"
    )
    if high < CLEARLY * printed_ground:
        return f"{said}: less than the {printed_ground:.1f} metres of the thesis."
    if low > printed_ground:
        return f"{said}: more than the {printed_ground:.1f} metres of the thesis."
    return f"{said}: about the {printed_ground:.1f} metres of the thesis."


def cause_words(causes: Sequence[Cause]) -> str:
    """Which sizes would be needed."""
    return (
        "To leave as much as the thesis prints takes "
        + ", or ".join(f"{_size(one)} of {one.name}" for one in causes)
        + "."
    )


def offset_trap_words(size: float, left: float, angle_deg: float, ground: float, printed: float) -> str:
    """What an unknown offset of the lens does: does it show in what is left?"""
    said = (
        f"A lens that sits {1000 * size:.0f} mm from where it is believed to be leaves {1000 * left:.1f} mm "
        f"in the "
        f"calibration and turns the lens by {angle_deg:.2f} degrees, {ground:.1f} m from 350 m"
    )
    if left < 0.5 * printed and angle_deg > 0.1:
        return (
            f"{said}: from so near, a wrong place passes for a wrong angle, and what is left does not tell."
        )
    return f"{said}."


def title(causes: Sequence[Cause], printed_ground: float) -> str:
    """Title of the chart of causes."""
    worst = max((one for one in causes if one.name not in CONSTANT), key=lambda one: one.ground)
    return f"{worst.ground:.1f} m or less in flight, {printed_ground:.1f} m in print"


def _size(one: Cause) -> str:
    if one.unit == "m":
        return f"{1000 * one.size:.0f} mm"
    return f"{one.size:.0f} px" if one.unit == "px" else f"{one.size:.1f} {one.unit}"
