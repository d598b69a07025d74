"""The extended and the Schmidt-Kalman filter on three flights with one tuning: H 7.5.3 and 7.5.4."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.flight.store import Flight
from wildlab.pipeline.navigate import PUBLISHED_LIKE, navigate_mekf
from wildlab.pipeline.track import (
    CvTuning,
    Scored,
    Sighting,
    evaluate_track,
    follow_pixels,
    follow_schmidt,
    sighting,
)
from wildlab.simulation.twins import simulate_twin
from wildlab.tracking.imm import run_imm
from wildlab.tracking.measurement import pixels
from wildlab.tracking.motion import Motion, constant_velocity, in_steps
from wildlab.tracking.run import Start, Track, start_from_first
from wildlab.tracking.unscented import run_unscented

Array = NDArray[np.float64]

#: The poses that both filters see.
SOURCE = "mekf"
#: One tuning for all three flights, printed in H 7.5.3 and kept in 7.5.4: sigma_v 0.05 m/s^2 (6.2), 10 m and
#: 10 m/s at the start, 30 px. Metres on the ground are not used here.
TUNING = CvTuning(acceleration=0.05, position_0=10.0, velocity_0=10.0, measurement=np.nan, pixel=30.0)
#: H 7.5.3: what the pixel noise "must be increased to" for the extended filter to be consistent.
MORE_NOISE = TUNING._replace(pixel=60.0)
#: Within which a time-averaged NEES or NIS counts as inside: 95 % of single values, two degrees of freedom.
BOUNDS = chi_square_interval(2)
#: NIS that differ by less than this share of the smaller are similar. H calls 0.42 and 0.37 (14 %) a little
#: different and 1.84 twice similar, 1.75 and 1.09 (61 %) a significant difference.
SIMILAR = 0.25

#: Subjects of the tables, and what else runs on every flight.
PUBLISHED = ("ekf", "schmidt")
SUBJECTS = (
    "ekf",
    "schmidt",
    "schmidt-navigated",
    "inflation",
    "schmidt-attitude-only",
    "schmidt-position-only",
    "ekf-60-pixels",
)
#: What is compared for each, with its unit here.
NAMES = {
    "mean_north": "m",
    "mean_east": "m",
    "mae": "m",
    "nees": "1",
    "nis": "1",
    "rmse_speed": "m/s",
    "rmse_course": "rad",
    "fraction_nees_inside": "1",
    "fraction_nis_inside": "1",
    "nees_predicted": "1",
}


class Compared(NamedTuple):
    """A sighting and each subject's track on it, scored; ``nees_predicted`` is among the numbers."""

    seen: Sighting
    tracks: dict[str, Track]
    scored: dict[str, Scored]


def navigated_sighting(flight: Flight) -> Sighting:
    """What the camera saw, with the poses of an MEKF whose mean deviations are those that H prints."""
    flight.nav[SOURCE] = navigate_mekf(flight, tuning=PUBLISHED_LIKE).nav
    return sighting(flight, SOURCE)


def only(covariance: ArrayLike, attitude: bool) -> Array:
    """Covariances of poses (N, 6, 6) with the other block, and what it shares with this one, at zero."""
    P = np.array(covariance, float)
    drop = slice(0, 3) if attitude else slice(3, 6)
    P[:, drop, :] = 0.0
    P[:, :, drop] = 0.0
    return P


def compare(seen: Sighting) -> Compared:
    """All of `SUBJECTS` on the same detections and poses.

    Raises
    ------
    WildlabError
        Where the poses have no covariance.
    """
    P = seen.poses.covariance
    if P is None:
        raise WildlabError(
            "the poses have no covariance", "use those of the MEKF: navigated_sighting(flight)", field="nav"
        )
    tracks = {
        "ekf": follow_pixels(seen, TUNING),
        "schmidt": follow_schmidt(seen, TUNING),
        "schmidt-navigated": follow_schmidt(seen, TUNING, change="navigated"),
        "inflation": follow_schmidt(seen, TUNING, correlation_time=0.0),
        "schmidt-attitude-only": follow_schmidt(seen, TUNING, only(P, True)),
        "schmidt-position-only": follow_schmidt(seen, TUNING, only(P, False)),
        "ekf-60-pixels": follow_pixels(seen, MORE_NOISE),
    }
    return Compared(seen, tracks, {name: evaluate(seen, track) for name, track in tracks.items()})


def evaluate(seen: Sighting, track: Track) -> Scored:
    """`evaluate_track`, and ``nees_predicted``: the mean NEES at frames that show nothing of the target."""
    found = evaluate_track(seen, track, ("u", "v"))
    predicted = found.nees[~seen.seen]
    known = predicted[np.isfinite(predicted)]
    found.numbers["nees_predicted"] = float(known.mean()) if len(known) else float("nan")
    return found


def summarise(compared: Compared) -> dict[tuple[str, str], float]:
    """The numbers of `NAMES` by (subject, name); SI and radians."""
    return {(who, name): compared.scored[who].numbers[name] for who in compared.scored for name in NAMES}


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """One simulated flight, summarised as by `summarise`.

    Raises
    ------
    WildlabError
        If there is no such twin, or it has no inertial samples.
    """
    return summarise(compare(navigated_sighting(simulate_twin(twin, seed))))


def follow_others(seen: Sighting) -> dict[str, Track]:
    """UKF and IMM with the same tuning, asked at the same frames.

    They step from detection to detection, in steps of a frame, which is the same prediction as from frame to
    frame up to the jitter of the images' stamps. The IMM's second model holds ten times the acceleration;
    each lasts a minute on average. Both are chosen, for nothing of the kind is in the thesis.
    """
    frame = float(np.median(np.diff(seen.times)))

    def stepped(acceleration: float) -> Motion:
        def motion(dt: float) -> tuple[Array, Array]:
            return in_steps(dt, lambda step: constant_velocity(step, acceleration), frame)

        return motion

    rows = seen.seen
    sensor = pixels(seen.poses.take(rows), seen.plane_down[rows])
    times, uv = seen.times[rows], seen.uv[rows]
    begin: Start = start_from_first(times, seen.positions[rows], TUNING.position_0, TUNING.velocity_0)
    R = np.eye(2) * TUNING.pixel**2
    calm, brisk = stepped(TUNING.acceleration), stepped(10 * TUNING.acceleration)
    return {
        "ukf": run_unscented(times, uv, R, sensor, calm, begin, output_times=seen.times),
        "imm": run_imm(
            times, uv, R, sensor, (calm, brisk), (60.0, 60.0), begin, output_times=seen.times
        ).track,
    }


def inside(values: ArrayLike) -> NDArray[np.bool_]:
    """Whether time averages of NEES or NIS lie within `BOUNDS`; what is not known does not."""
    array = np.asarray(values, float)
    return np.asarray((array >= BOUNDS[0]) & (array <= BOUNDS[1]))


def check_claims(spread: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
    """On which flights each claim of H 7.5.3 and 7.5.4 is true, by the claim's id; a study asks for its own.

    Parameters
    ----------
    spread
        What `summarise` gives, one row for each flight.
    """

    def of(who: str, name: str) -> Array:
        return spread[who, name].to_numpy(float)

    nis = {who: of(who, "nis") for who in PUBLISHED}
    apart = np.abs(nis["ekf"] - nis["schmidt"]) / np.minimum(nis["ekf"], nis["schmidt"])
    most = {who: of(who, "fraction_nis_inside") > 0.5 for who in PUBLISHED}
    return {
        "schmidt-nees-inside": inside(of("schmidt", "nees")),
        "ekf-nees-above": of("ekf", "nees") > BOUNDS[1],
        "ekf-overconfident-between": of("ekf", "nees_predicted") > BOUNDS[1],
        "schmidt-inside-mostly": of("schmidt", "fraction_nees_inside") > 0.5,
        "ekf-hardly-inside": of("ekf", "fraction_nees_inside") < 0.1,
        "schmidt-pessimistic": of("schmidt", "nees") < 2.0,
        "schmidt-not-less-accurate": of("schmidt", "mae") <= of("ekf", "mae"),
        "speed-better": of("schmidt", "rmse_speed") < of("ekf", "rmse_speed"),
        "course-better": of("schmidt", "rmse_course") < of("ekf", "rmse_course"),
        "attitude-makes-the-difference": inside(of("schmidt-attitude-only", "nees"))
        & ~inside(of("schmidt-position-only", "nees")),
        "nis-similar": apart < SIMILAR,
        "nis-inside": most["ekf"] & most["schmidt"],
        "nis-small": inside(nis["ekf"]) & inside(nis["schmidt"]) & (nis["ekf"] < 2) & (nis["schmidt"] < 2),
        "schmidt-nis-inside-mostly": most["schmidt"],
        "nis-of-ekf-larger": nis["ekf"] > nis["schmidt"],
        "ekf-needs-more-noise": inside(of("ekf-60-pixels", "nees")) & ~inside(of("ekf", "nees")),
    }
