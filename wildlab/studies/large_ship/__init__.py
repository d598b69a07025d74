"""Tracking a ship that does not fit into the image: H 6.4.1."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from wildlab.evaluation.shares import Check
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import draw_line, finish, new_strips
from wildlab.reporting.charts.forms import draw_errors, draw_marks, draw_picture
from wildlab.reporting.figures import BLUE, GREEN, INK, VERMILLION, map_axes, new_figure
from wildlab.studies.large_ship import trial
from wildlab.studies.large_ship.trial import (
    DETECTOR,
    NEAR_M,
    START_S,
    WITH,
    WITHOUT,
    Photographs,
    Tracked,
    errors_of,
)
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study


def check_claims(spread: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for each claim of H 6.4.1, by the claim's id.

    Parameters
    ----------
    spread
        What `trial` gives, one row for each flight.
    """

    def both(name: str) -> tuple[Array, Array]:
        return spread[WITH, name].to_numpy(float), spread[WITHOUT, name].to_numpy(float)

    def of(name: str) -> Array:
        return spread[DETECTOR, name].to_numpy(float)

    north, east = both("sd_north"), both("sd_east")
    shares = {float(limit): both(f"share_near_{limit}") for limit in NEAR_M}
    near, far = shares[NEAR_M[1]]
    rest, rest_without = (np.nan_to_num(times, nan=np.inf) for times in both("time_to_rest"))
    known = np.isfinite(rest) | np.isfinite(rest_without)
    # What true poses would leave of the scatter, of both kinds of centres.
    left = [true / one for true, one in zip(both("sd_true_poses"), both("sd_both"), strict=True)]
    logged = [np.hypot(*pair) for pair in zip(north, east, strict=True)]
    return {
        "mean-nearer": Check.smaller(*both("error_of_mean"), "m"),
        "variance-increases": Check(
            true=(north[0] > north[1]) & (east[0] > east[1]), first=logged[0], second=logged[1], unit="m"
        ),
        "more-near-centre": Check(
            by_threshold={limit: one > other for limit, (one, other) in shares.items()},
            first=near,
            second=far,
        ),
        "mostly-a-part": Check(true=of("share_cut") > 0.5),
        "not-every-image-adjusted": Check(true=of("share_moved") < 1.0),
        "more-accurate-after-start": Check.smaller(*both("mae_after_start"), "m"),
        "within-five-metres": Check(true=of("share_within_5_m") > 0.5),
        "rest-sooner": Check(true=rest < rest_without, premise=known),
        "speed-near-zero": Check(measured=np.max(both("speed_after_start"), axis=0)),
        "mainly-navigation": Check(measured=np.max(left, axis=0), reach=(0, 1)),
        "high-success-rate": Check(measured=1 - of("detection_rate")),
    }


_COLOURS = {WITH: BLUE, WITHOUT: VERMILLION}


def images(taken: Photographs) -> Figure:
    """An image that shows much of the ship, and one that shows about half of it (H figures 6.2, 4.8)."""
    plain, moved = taken.marks(moved=False), taken.marks()
    whole = int(np.argmax(np.where(plain.found, plain.share, -1.0)))
    cut = moved.moved if moved.moved.any() else plain.found
    part = int(np.argmin(np.where(cut, np.abs(plain.share - 0.5), 2.0)))
    height, width = taken.shape
    beyond = [max(float((-at).max()), *(at - [width, height])) for at in plain.centre[[whole, part]]]
    reach = max(0.0, *beyond) + 25
    fig, axes = new_figure(5.9, 3.1, columns=2)
    for ax, row, name in zip(axes, (whole, part), ("Most in view", "Nearest to half"), strict=True):
        _, counts = taken.camera.image(int(plain.exposure[row]))
        draw_picture(ax, counts, f"{name}: {100 * plain.share[row]:.0f} %", limits=None)
        shot = taken.shots[row]
        one = shot.detections.select(shot.judged.found[1][:1])
        angle = float(np.degrees(one.orientation[0]))
        outline = Ellipse(tuple(one.uv[0]), *one.axes[0], angle=angle, fill=False, ec=VERMILLION, lw=1.6)
        ax.add_patch(outline)
        draw_marks(ax, {"found": plain.uv[row], "moved": moved.uv[row], "true": plain.centre[row]})
        ax.set(xlim=(-reach, width + reach), ylim=(height + reach, -reach), facecolor="0.92")
    return finish(fig, "")


def positions(tracked: Mapping[str, Tracked], names: Mapping[str, str]) -> Figure:
    """Georeferenced positions about the ship's receiver, with and without (H figure 6.3)."""
    fig, axes = new_figure(5.9, 3.7, columns=2)
    errors = {who: -errors_of(one)[0][one.seen.seen] for who, one in tracked.items()}
    reach = 1.08 * max(float(np.abs(e).max()) for e in errors.values())
    for ax, (who, e) in zip(axes, errors.items(), strict=True):
        draw_errors(ax, e, _COLOURS[who], names[who].capitalize(), reach)
        ax.plot(0, 0, "o", mfc="none", mec=GREEN, ms=9, mew=2)
        map_axes(ax, scale_bar=False, north="north (m)" if ax is axes[0] else "")
    return fig


def errors_and_speed(tracked: Mapping[str, Tracked], names: Mapping[str, str]) -> Figure:
    """Distance from the receiver and estimated speed over the joined segments (H figure 6.4)."""
    fig, (far, fast) = new_strips(2, 4.6)
    for who, one in tracked.items():
        draw_line(far, one.seen.times, np.hypot(*errors_of(one)[1].T), _COLOURS[who], names[who])
        draw_line(fast, one.seen.times, np.hypot(*one.track.x[:, 2:4].T), _COLOURS[who])
    for ax in (far, fast):
        ax.axvline(START_S, color=INK, lw=0.8, ls=":")
        ax.set_ylim(bottom=0)
    fast.set_ylabel("speed (m/s)")
    return finish(fig, "", "time, segments joined (s)", "distance (m)")


def answer(facts: Facts) -> list[str]:
    """Whether the track is nearer with the centre moved, then whether the centre in the image is."""
    errors = [facts.value(who, "mae_after_start") for who in trial.SUBJECTS]
    if math.isnan(sum(errors)):
        return ["unknown"]
    track = facts.choose("more-accurate-after-start", "helps", "harms")
    apart = facts.value(trial.WITH, "pixel_error", "high") < facts.value(trial.WITHOUT, "pixel_error", "low")
    return [f"track-{track}", "image-nearer" if apart else "image-unclear"]


STUDY = Study("large-ship", trial.trial, check_claims, trial.UNITS.get, answer)
