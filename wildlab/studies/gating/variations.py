"""What moves the success rates of H 6.4.3: the parts that are not printed, changed one at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from wildlab.flight.store import Flight
from wildlab.geometry.camera import in_image
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.studies.gating.monte_carlo import (
    FORMS,
    GATES,
    RATE_HZ,
    Choices,
    Outcome,
    Overflight,
    overflight,
    success_rates,
)
from wildlab.studies.gating.readings import DEFAULT, READINGS, STRESS

#: How far to the side the targets are put, m: three quarters of the way to the edge of the image.
ASIDE_M = 30.0


def variations(flight: Flight, chosen: Choices) -> dict[str, tuple[Overflight, Choices]]:
    """The flight and the choices of each variation, by what is changed; the first changes nothing."""
    over = overflight(flight)
    flights = {
        "as chosen": over,
        "camera at rest, looking down": overflight(flight, gimbal="down"),
        "camera of half the focal length": overflight(flight, focal_scale=0.5),
        "camera of one and a half times it": overflight(flight, focal_scale=1.5),
        "50 m high": overflight(flight, height_scale=0.5),
        "200 m high": overflight(flight, height_scale=2.0),
        f"targets {ASIDE_M:.0f} m to the right": overflight(flight, right=ASIDE_M),
        f"targets {ASIDE_M:.0f} m to the left": overflight(flight, right=-ASIDE_M),
    }
    filters: dict[str, Callable[[Choices], Choices]] = {
        "no process noise": lambda c: replace(c, sd_acceleration=0.0),
        "process noise 0.2 m/s²": lambda c: replace(c, sd_acceleration=0.2),
        "process noise 1 m/s²": lambda c: replace(c, sd_acceleration=1.0),
        "a second between the 50 iterations": lambda c: replace(c, warm_up_step=1.0),
        "track not updated": lambda c: replace(c, updated_with="nothing"),
        "one-argument arctangent": lambda c: replace(c, azimuth="arctan"),
        "(6.10) to the letter": lambda c: replace(c, azimuth="printed"),
        "only images that show both": lambda c: replace(c, in_image_only=True),
    }
    return {name: (other, chosen) for name, other in flights.items()} | {
        name: (over, change(chosen)) for name, change in filters.items()
    }


def vary(flight: Flight, chosen: Choices, runs: int, seed: int) -> pd.DataFrame:
    """Mean success rates (per cent) of every variation, on the same draws.

    Returns
    -------
    DataFrame
        ``variation``; for each form its mean, and as ``<form>_change`` and ``<form>_se`` the mean difference
        from the first row, run by run, with its standard error; and as ``<form>_mean_se`` the mean's own.
    """
    rows: list[dict[str, object]] = []
    first: Array | None = None
    for name, (over, choices) in variations(flight, chosen).items():
        rates = success_rates(over, choices, runs, seed)[: len(FORMS)]
        first = rates if first is None else first
        row: dict[str, object] = {"variation": name}
        for form, own, base in zip(FORMS, rates, first, strict=True):
            change = (own - base)[np.isfinite(own)]
            row |= {
                form: np.nanmean(own),
                f"{form}_change": change.mean(),
                f"{form}_se": standard_error(change),
                f"{form}_mean_se": standard_error(own),
            }
        rows.append(row)
    return pd.DataFrame(rows)


def standard_error(values: Array) -> float:
    """Of the mean of independent values (N,), those that are NaN left out."""
    finite = values[np.isfinite(values)]
    return float(finite.std(ddof=1) / np.sqrt(len(finite)))


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
    differ = np.where(outcome.mistakes.sum(axis=0) > 0, 0.5 - outcome.same_images, np.nan)
    return {
        "forms-agree": np.stack([1 - sign * (a - b) for a, b in pairs for sign in (1, -1)]),
        "angles-least-accurate": np.stack([rates[form] - rates["angles"] for form in ("position", "pixels")]),
        "mistakes-on-different-images": 100 * differ[None],
    }


def verdict(margins: Array) -> str:
    """Whether the means of all margins (k, runs) are positive, each by twice its standard error."""
    known = [one[np.isfinite(one)] for one in margins]
    if min(len(one) for one in known) < 2:
        return "cannot be decided"
    mean = np.array([one.mean() for one in known])
    unsure = 2 * np.array([standard_error(one) for one in known])
    if (mean > unsure).all():
        return "holds"
    return "does not hold" if (mean < -unsure).any() else "cannot be decided"


def seconds_in_view(over: Overflight) -> float:
    """For how long the middle between the targets is inside the edge of the image, s."""
    poses = over.poses
    at = np.append(over.place, 0.0)
    return float(
        in_image(poses.camera, ground_to_pixel(poses.camera, at, poses.p_nc, poses.R_nc)).sum() / RATE_HZ
    )


def chosen_parts(over: Overflight, shown: float, at_rest_s: float) -> pd.DataFrame:
    """What H 6.4.3 does not print, what stands in its place, and why.

    ``shown`` is that of `share_in_image`; ``at_rest_s`` for how long a camera at rest has the targets in
    view, by `seconds_in_view`.
    """
    camera = over.poses.camera
    height = -over.poses.p_nb[:, 2].mean()
    own, stress = READINGS[DEFAULT], READINGS[STRESS]
    rows = [
        ("flight", f"14 s of the twin from {over.time_s[0]:.1f} s, {height:.0f} m high",
         "the poses were never published; the twin is that of H 6.4.1, with the same airframe and payload. "
         "Of all stretches with the middle between the targets in every image, the one that stays nearest"),
        ("gimbal", "pan zero, tilt after the targets",
         f"table 6.4 has a gimbal; a camera at rest that looks down has the middle between the targets in "
         f"view "
         f"for {at_rest_s:.1f} s of these {len(over.time_s) / RATE_HZ:.1f} s"),
        ("lens", f"{camera.width} by {camera.height} px, {camera.fx:.0f} px of focal length",
         "that of the twin"),
        ("mounting", "no misalignment", "the poses are taken for the truth, as in H 6.4.3"),
        ("beyond the edge", f"counts; both are inside in {100 * shown:.0f} % of the images",
         "H associates in each of the 141 images"),
        ("track updated with", f"{own.short}; {stress.short} in the stress test", "the readings above"),
        ("update where angles gate", "by pixels", "H 6.3.2; by angles in the third reading"),
        ("pixels and angles together", "the two distances added",
         "H proposes to combine them and does not say how; with two detections, the surer gate decides"),
        ("azimuth", "arctangent of two arguments",
         "that of one, as printed, cannot tell a target from the one opposite, and (6.10) makes elevations "
         "negative in the left half of the image"),
        ("process noise", f"{Choices().sd_acceleration} m/s²",
         "that of the slow vessel in H 6.4.2, whose positions have the same 10 m of noise"),
        ("start", "truth with 10 m of noise per axis, velocity zero", "table 6.5, H 6.2.4"),
        ("50 iterations", f"{Choices().warm_up_step} s apart", "the rate of the images"),
        ("targets", "the main object 5 m south and 7.5 m west of the origin, the other opposite",
         "their middle is where the twin's route passes"),
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=["part", "chosen", "reason"])
