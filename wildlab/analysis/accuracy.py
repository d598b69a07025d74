"""How accurate a flight's single positions are, and why; and a calibration learnt on one flight and applied
to another."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.analysis import Fact, fact
from wildlab.analysis.diagnose import Diagnosis, diagnose
from wildlab.analysis.georeference import (
    FEW_POINTS,
    FEWEST_IMAGES,
    Observations,
    assumed_deviations,
    best_known,
    blocks_of,
    calibrated,
    covariances_of,
    error_covariances,
    errors_of,
    georeference,
    observe,
    pose_errors,
    score_points,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.causes import mean_of_others
from wildlab.evaluation.correlated_errors import WanderNoise
from wildlab.evaluation.ellipses import (
    EllipseVerdict,
    Spread,
    judge_ellipses,
    spread_of_sightings,
)
from wildlab.evaluation.errors import (
    ErrorSummary,
    bootstrap_interval,
    summarise,
)
from wildlab.evaluation.intervals import block_mean, independent_blocks
from wildlab.evaluation.outliers import largest_visible
from wildlab.flight.calibration_files import (
    UNITS,
    Conditions,
    Learnt,
    LearntGain,
    LearntNoise,
    LearntOn,
    LearntParameter,
    read_learnt,
    refuse_other_camera,
    without_own_clock,
)
from wildlab.flight.clocks import truth_at
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.corrections import Calibration, apply_calibration, calibrated_camera
from wildlab.geometry.covariances import tilt_and_heading
from wildlab.geometry.frames import (
    euler_to_matrix,
    matrix_to_euler,
    matrix_to_quaternion,
    quaternion_to_matrix,
    wrap,
)
from wildlab.geometry.uncertainty import PoseErrors


@dataclass(frozen=True)
class Accuracy:
    """What a flight's points are worth.

    Attributes
    ----------
    observations, points, scored
        What was put on the ground, where, and against the truth: N rows, lost points among them.
    summary, intervals
        Of the errors as they are, of points with the best known truth, and low and high of its figures by
        name (these images, resampled); none below six images or `FEWEST_INDEPENDENT` independent blocks.
    by_target
        A row a target, from `errors_by_target`.
    lost
        How many of the N points have no position.
    assumed
        The standard deviations that the ellipses come from.
    ellipses
        What they are worth, of the same points as the summary.
    diagnosis
        The cause, where six images or more show a known point.
    visible_m
        Where each point is held against the nearest mark: larger errors go to another one; else NaN.
    """

    observations: Observations
    points: pd.DataFrame
    scored: pd.DataFrame
    summary: ErrorSummary
    intervals: dict[str, tuple[float, float]]
    by_target: pd.DataFrame
    lost: int
    assumed: dict[str, float]
    ellipses: EllipseVerdict
    diagnosis: Diagnosis | None
    visible_m: float

    @property
    def best(self) -> pd.DataFrame:
        """The scored points that are compared with the best known truth."""
        return best_known(self.scored)


#: Of fewer independent blocks than this an interval is a guess; that there are as many has to be sure with a
#: probability of 95 %: few blocks often look independent by chance, and their interval is then too narrow.
FEWEST_INDEPENDENT, SURELY = 5, 1.645


def errors_by_target(flight: Flight, scored: pd.DataFrame) -> pd.DataFrame:
    """Errors of the points of each target, the best known truth first.

    Parameters
    ----------
    flight
        With truth.
    scored
        From `score_points`, of it.

    Returns
    -------
    DataFrame
        ``target``, ``kind`` (``mark`` or ``track``), ``sd`` (reported of the truth, m, or NaN), ``n``,
        ``mean`` (m), ``low`` and ``high`` (95 %; NaN of fewer than `FEWEST_INDEPENDENT` independent blocks).
    """
    truth, rows = flight.table("truth"), []
    stated = (
        truth.reindex(columns=["target_id", "sd_horizontal_m"])
        .groupby("target_id")["sd_horizontal_m"]
        .median()
    )
    tracks = set(truth.loc[truth["time_s"].notna(), "target_id"])
    blocks = pd.Series(blocks_of(flight, scored), scored.index)
    for target, points in scored.dropna(subset=["error_m"]).groupby("truth_id"):
        error = block_mean(points["error_m"], blocks[points.index], 0.95)
        known = is_known(points["error_m"], blocks[points.index])
        low, high = (max(error.low, 0.0), error.high) if known else (np.nan, np.nan)
        kind = "track" if target in tracks else "mark"
        rows.append([target, kind, stated[target], len(points), error.estimate, low, high])
    table = pd.DataFrame(rows, columns=["target", "kind", "sd", "n", "mean", "low", "high"])
    # A mark that reports nothing counts as exact, a track as anything.
    counts = table["sd"].fillna(table["kind"].map({"mark": 0.0, "track": np.inf}))
    order = table.assign(sd=counts).sort_values(["sd", "kind", "n"], ascending=[True, True, False]).index
    return table.loc[order]


def is_known(values: ArrayLike, blocks: ArrayLike) -> bool:
    """Whether values (N,) in blocks (N,) surely have independent ones enough for an interval.

    Examples
    --------
    >>> is_known([1.0, 0.0, 1.0, 0.0, 1.0, 0.0], range(6)), is_known(np.sin(np.arange(20) / 4), range(20))
    (True, False)
    """
    return len(np.unique(blocks)) > 1 and independent_blocks(values, blocks, SURELY) >= FEWEST_INDEPENDENT


def judge_accuracy(
    observations: Observations,
    rng: np.random.Generator,
    deviations: dict[str, float] | None = None,
) -> Accuracy:
    """Place a flight's detections, hold them against the truth, and look for the cause of their errors.

    Parameters
    ----------
    observations
        From `observe` of a flight with truth, with a calibration applied or not.
    rng
        Draws blocks, and samples of flat rays.
    deviations
        Standard deviations in place of those that log and manifest state.

    Returns
    -------
    Accuracy

    Raises
    ------
    WildlabError
        Where the flight has no truth, or no detection can be compared with it.
    """
    flight = observations.flight
    errors_stated = pose_errors(observations, deviations)
    points = georeference(observations, rng, errors_stated)
    scored = score_points(flight, points)
    blocks, best = blocks_of(flight, scored), scored["best_truth"].to_numpy()
    summary = summarise(errors_of(best_known(scored)))
    located = np.isfinite(scored["error_m"]) & np.isfinite(scored["cov_nn"])
    enough = scored.loc[located, "frame_id"].nunique() >= FEWEST_IMAGES
    diagnosis = diagnose(observations, scored) if enough and summary.n >= FEW_POINTS else None
    intervals, known = {}, best & scored["error_m"].notna().to_numpy()
    if enough and is_known(scored.loc[known, "error_m"], blocks[known]):
        figures = {
            "horizontal_error_mean": lambda e: float(np.hypot(*e.T).mean()),
            "horizontal_error_median": lambda e: float(np.median(np.hypot(*e.T))),
            "horizontal_error_p90": lambda e: float(np.quantile(np.hypot(*e.T), 0.9)),
        }
        for name, figure in figures.items():
            low, high = bootstrap_interval(figure, errors_of(scored[known]), blocks[known], rng)
            intervals[name] = max(low, 0.0), high
    by_nearest = flight.manifest.scoring.rule == "nearest"
    return Accuracy(
        observations=observations,
        points=points,
        scored=scored,
        summary=summary,
        intervals=intervals,
        by_target=errors_by_target(flight, scored),
        lost=int((~np.isfinite(scored["error_m"])).sum()),
        assumed=used_deviations(observations, deviations),
        ellipses=judge_ellipses(errors_of(scored[best]), error_covariances(scored[best]), blocks[best], rng),
        diagnosis=diagnosis,
        visible_m=visible_error(flight, scored) if by_nearest else np.nan,
    )


def used_deviations(observations: Observations, assumed: dict[str, float] | None = None) -> dict[str, float]:
    """The standard deviations that the ellipses of observations really come from.

    Parameters
    ----------
    observations
        From `observe`.
    assumed
        As for `pose_errors`: takes the place of what the log and the manifest state.

    Returns
    -------
    dict
        By the names of ``USUAL``: those of the poses are the log's own where it has a covariance (root of the
        mean variance), otherwise the manifest's or the usual ones.
    """
    sd = assumed_deviations(observations.flight) | (assumed or {})
    covariance = observations.poses.covariance
    if covariance is None or assumed is not None or not np.isfinite(covariance).any():
        return sd
    own = np.sqrt(np.nanmean(np.diagonal(covariance, axis1=1, axis2=2), axis=0))
    tilt, heading = tilt_and_heading(covariance[:, 3:, 3:], observations.poses.R_nb)
    return sd | {
        "position_horizontal_m": float(np.sqrt((own[:2] ** 2).mean())),
        "position_vertical_m": float(own[2]),
        "tilt_deg": float(np.degrees(np.sqrt(np.nanmean(tilt**2)))),
        "heading_deg": float(np.degrees(np.sqrt(np.nanmean(heading**2)))),
    }


def as_deviations(noise: WanderNoise) -> dict[str, float]:
    """Estimated deviations under the names that ``pose_errors`` takes."""
    return {
        "position_horizontal_m": noise.sd["position_horizontal"],
        "position_vertical_m": noise.sd["position_vertical"],
        "tilt_deg": float(np.degrees(noise.sd["tilt"])),
        "heading_deg": float(np.degrees(noise.sd["heading"])),
        "pixel_px": noise.sd["pixel"],
    }


class Repeats(NamedTuple):
    """Sightings of the same things.

    Attributes
    ----------
    points
        On the ground, one row a detection; lost points are NaN.
    lost
        How many.
    spread
        Of the sightings of things that were seen in two images or more; None where there are none.
    things
        Names of the things, most seen first, with their sightings, images and spread (m per axis).
    diagnosis
        Which constant error makes sightings of the same thing lie apart; None where fewer than six images
        show a thing that another image shows too.
    """

    points: pd.DataFrame
    lost: int
    spread: Spread | None
    things: pd.DataFrame
    diagnosis: Diagnosis | None = None


def compare_sightings(points: pd.DataFrame) -> pd.DataFrame:
    """Distance of each sighting to the mean of those of the same thing in other images.

    Parameters
    ----------
    points
        From `wildlab.analysis.georeference.georeference`.

    Returns
    -------
    DataFrame
        The points that name a thing, with ``truth_id`` (its name), ``error_north_m``, ``error_east_m`` and
        ``error_m``, as from `wildlab.analysis.georeference.score_points`; NaN where no other image shows it.
        ``truth_sd_m`` is zero: nothing is held against a truth, and all are alike (``best_truth``).
    """
    named = points[points["target_id"].astype(str) != ""].reset_index(drop=True)
    xy, things = named[["north_m", "east_m"]].to_numpy(float), named["target_id"].to_numpy(str)
    images, error = named["frame_id"].to_numpy(str), np.full((len(named), 2), np.nan)
    for image in np.unique(images):
        own = images == image
        error[own] = (xy - mean_of_others(xy, things, ~own))[own]
    return named.assign(
        truth_id=things, truth_sd_m=0.0, best_truth=True,
        error_north_m=error[:, 0], error_east_m=error[:, 1], error_m=np.hypot(*error.T),
    )  # fmt: skip


def judge_repeats(observations: Observations, rng: np.random.Generator) -> Repeats:
    """Place a flight's detections and compare the sightings of each thing with each other.

    Parameters
    ----------
    observations
        From `observe`, of a flight whose detections name their targets; truth is not looked at.
    rng
        Draws samples of flat rays.

    Returns
    -------
    Repeats

    Raises
    ------
    WildlabError
        Where no detection names a target.
    """
    points = georeference(observations, rng)
    named = points["target_id"].astype(str).to_numpy()
    if not (named != "").any():
        raise WildlabError(
            "no detection names what it is of, so that sightings cannot be compared with each other",
            "name the targets in the detections' target_id, or add truth",
            file=observations.flight.folder,
            field="detections.target_id",
        )
    xy, images = points[["north_m", "east_m"]].to_numpy(float), points["frame_id"].to_numpy(str)
    spread = spread_of_sightings(xy, named, images, covariances_of(points))
    rows = []
    for name in np.unique(named[named != ""]):
        own = (named == name) & np.isfinite(xy).all(axis=1)
        one = spread_of_sightings(xy[own], named[own], images[own])
        rows.append(
            {
                "thing": name,
                "sightings": int(own.sum()),
                "images": len(np.unique(images[own])),
                "sd": one.sd if one is not None else np.nan,
            }
        )
    things = (
        pd.DataFrame(rows).sort_values("sightings", ascending=False, kind="stable").reset_index(drop=True)
    )
    compared = compare_sightings(points)
    located = np.isfinite(compared["error_m"]) & np.isfinite(compared["cov_nn"])
    enough = compared.loc[located, "frame_id"].nunique() >= FEWEST_IMAGES
    diagnosis = diagnose(observations, compared, places_known=False) if enough else None
    return Repeats(points, int(np.isnan(xy[:, 0]).sum()), spread, things, diagnosis)


#: Heights that differ by more than this factor weigh angles and positions otherwise.
OTHER_HEIGHT = 1.25
_PLACE = ("north", "east", "down")
_TURN = ("q_w", "q_x", "q_y", "q_z")
_SCALES = {"deg": 180 / np.pi, "%": 100.0}


def learn_flight(
    flight: Flight, rng: np.random.Generator, source: str | None = None
) -> tuple[Learnt, Diagnosis]:
    """Learn on a flight's points what is constantly wrong, and how noisy its poses are.

    Parameters
    ----------
    flight
        With pixel detections and poses, and with truth, or with things that several images show.
    rng
        Draws samples of flat rays.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Returns
    -------
    Learnt, Diagnosis
        What to keep, and what it follows from.

    Raises
    ------
    WildlabError
        Where fewer than six images show a known point, or one that another image shows too, or poses are not
        clear.
    """
    observations = observe(flight, source)
    points = georeference(observations, rng)
    known = flight.truth is not None
    scored = score_points(flight, points) if known else compare_sightings(points)
    diagnosis = diagnose(observations, scored, places_known=known)
    return learn_from(observations, diagnosis), diagnosis


def corrections(calibration: Calibration) -> list[dict[str, Any]]:
    """``name``, ``value``, ``low``, ``high`` (95 %) and ``unit`` of each parameter, as a file has it."""
    rows = []
    for name in calibration.names:
        scale, ends = _SCALES.get(UNITS[name], 1.0), calibration.interval(name)
        value, low, high = (scale * one for one in (calibration.value(name), *ends))
        rows.append({"name": name, "value": value, "low": low, "high": high, "unit": UNITS[name]})
    return rows


def learn_from(observations: Observations, diagnosis: Diagnosis) -> Learnt:
    """What a diagnosis teaches: corrections only where they gained something for certain.

    Parameters
    ----------
    observations
        As `diagnose` had them.
    diagnosis
        Of it.

    Returns
    -------
    Learnt
    """
    flight, name = observations.flight, observations.source
    camera = flight.manifest.camera
    if camera is None:
        raise WildlabError(f"the flight {flight.name} has no camera", "there is nothing to calibrate")
    used = observations.of(diagnosis.scored)
    depression = np.degrees(np.arcsin(np.clip(used.poses.R_nc[:, 2, 2], -1, 1)))
    height = used.plane_down - used.poses.p_nc[:, 2]
    calibration, gain = diagnosis.calibration, diagnosis.winner.gain
    told = corrections(calibration) if diagnosis.counts else []
    scales = [_SCALES.get(one["unit"], 1.0) for one in told]
    covariance = calibration.covariance * np.outer(scales, scales) if scales else np.zeros((0, 0))
    return Learnt(
        learnt_on=LearntOn(
            flight=flight.name,
            source=name,
            fingerprint=fingerprint(observations),
            images=calibration.n_images,
            points=calibration.n_points,
            blocks=calibration.n_draws,
            camera_offset_s=flight.manifest.clocks.camera_offset_s,
        ),
        conditions=Conditions(height_m=_range(height), depression_deg=_range(depression)),
        camera=camera,
        mount=flight.manifest.mount,
        noise=LearntNoise(**as_deviations(diagnosis.noise)),
        gain=LearntGain(
            without_m=gain.without,
            with_m=gain.with_,
            gain_m=gain.gain.estimate,
            low_m=gain.gain.low,
            high_m=gain.gain.high,
        )
        if diagnosis.counts
        else None,
        covariance=tuple(tuple(map(float, row)) for row in covariance),
        parameter=tuple(LearntParameter(**one) for one in told),
    )


def fingerprint(observations: Observations) -> str:
    """SHA-256 of what a calibration is learnt from: clicks and poses, rounded to thousandths."""
    digest = hashlib.sha256()
    for values in (observations.uv, observations.poses.p_nb, observations.poses.R_nb):
        digest.update(np.round(np.nan_to_num(values, nan=-1.0), 3).tobytes())
    return digest.hexdigest()


class Applied(NamedTuple):
    """A flight with a calibration applied.

    Attributes
    ----------
    observations
        With corrected poses and camera.
    deviations
        Standard deviations for `pose_errors`, by its names.
    facts
        Which calibration that is, and whether it may be judged here.
    """

    observations: Observations
    deviations: dict[str, float]
    facts: list[Fact]


def apply_learnt(observations: Observations, learnt: Learnt) -> Applied:
    """Apply what was learnt on another flight.

    Parameters
    ----------
    observations
        As logged, of the flight that is judged.
    learnt
        From `wildlab.flight.calibration_files.read_learnt`.

    Returns
    -------
    Applied

    Raises
    ------
    WildlabError
        Where it was learnt with another camera or another mount.
    """
    refuse_other_camera(observations.flight.manifest, learnt)
    used = without_own_clock(observations.flight.manifest, learnt)
    facts = _facts(observations, used)
    if used is not learnt:
        facts.append(fact("applied-own-clock"))
    deviations = {name: float(value) for name, value in used.noise.model_dump().items()}
    return Applied(calibrated(observations, _calibration(used)), deviations, facts)


def corrected_flight(flight: Flight, source: str | None, learnt: Learnt) -> Flight:
    """A flight whose manifest and poses say what the calibration says.

    Parameters
    ----------
    flight
        As logged; is not changed.
    source
        Name of the ``nav`` table that is corrected.
    learnt
        Of this camera and mount.

    Returns
    -------
    Flight
        With other clock, mount, camera, noise, positions and heading of that source.
    """
    m = flight.manifest
    calibration = _calibration(without_own_clock(m, learnt))
    name, nav = flight.pose_source(source)
    if m.camera is None:
        return flight
    noise = {"uncertainty": learnt.noise.model_dump()}
    if not calibration.names:
        return replace(flight, manifest=replace_in_manifest(m, noise))
    camera = calibrated_camera(calibration, m.geometry_camera())
    roll, tilt, pan = np.degrees(apply_calibration(calibration, m.geometry_mount()).misalignment)
    changed = replace_in_manifest(
        m,
        {
            "clocks": {"camera_offset_s": m.clocks.camera_offset_s + calibration.value("clock")},
            **noise,
            "camera": {
                "fx_px": camera.fx,
                "fy_px": camera.fy,
                "cx_px": camera.cx,
                "cy_px": camera.cy,
                "k1": camera.distortion[0],
            },
            "mount": {
                "misalignment_roll_deg": float(roll),
                "misalignment_tilt_deg": float(tilt),
                "misalignment_pan_deg": float(pan),
            },
        },
    )
    moved = nav.assign(**{f"{axis}_m": nav[f"{axis}_m"] + calibration.value(axis) for axis in _PLACE})
    turned = euler_to_matrix(0.0, 0.0, calibration.value("heading")) @ quaternion_to_matrix(nav[[*_TURN]])
    moved[[*_TURN]] = matrix_to_quaternion(turned)
    return replace(flight, manifest=changed, nav={**flight.nav, name: moved})


def as_calibrated(flight: Flight, source: str | None = None) -> Flight:
    """`corrected_flight` by the calibration that the flight keeps; itself where it keeps none."""
    if flight.calibration is None:
        return flight
    learnt = read_learnt(flight.calibration)
    refuse_other_camera(flight.manifest, learnt)
    return corrected_flight(flight, source, learnt)


def observe_calibrated(flight: Flight, source: str | None = None) -> tuple[Observations, PoseErrors | None]:
    """`observe`, with the calibration applied that the flight keeps, and the errors of its noise; None for
    those that log and manifest state."""
    observations = observe(flight, source)
    if flight.calibration is None:
        return observations, None
    applied = apply_learnt(observations, read_learnt(flight.calibration))
    return applied.observations, pose_errors(applied.observations, applied.deviations)


def _calibration(learnt: Learnt) -> Calibration:
    n = len(learnt.parameter)
    scales = np.array([1 / _SCALES.get(one.unit, 1.0) for one in learnt.parameter])
    return Calibration(
        tuple(one.name for one in learnt.parameter),
        np.array([one.value for one in learnt.parameter]) * scales,
        np.array(learnt.covariance, float).reshape(n, n) * np.outer(scales, scales),
        {},
        learnt.learnt_on.points,
        learnt.learnt_on.images,
        learnt.learnt_on.blocks,
    )


def _facts(observations: Observations, learnt: Learnt) -> list[Fact]:
    on = learnt.learnt_on
    if fingerprint(observations) == on.fingerprint:
        return [fact("applied-here", flight=on.flight)]
    names = ", ".join(one.name for one in learnt.parameter)
    values = {"flight": on.flight, "images": str(on.images), "points": str(on.points), "corrections": names}
    facts = [fact("applied" if names else "applied-noise", **values)]
    if on.flight == observations.flight.name:
        facts.append(fact("applied-same-name"))
    depression = np.degrees(np.arcsin(np.clip(observations.poses.R_nc[:, 2, 2], -1, 1)))
    low, high = learnt.conditions.depression_deg
    outside = float(np.mean((depression < low - 5) | (depression > high + 5)))
    if outside > 0.1:
        facts.append(fact("applied-steepness", share=f"{100 * outside:.0f}"))
    height = observations.plane_down - observations.poses.p_nc[:, 2]
    low, high = learnt.conditions.height_m
    outside = float(np.mean((height < low / OTHER_HEIGHT) | (height > high * OTHER_HEIGHT)))
    if outside > 0.1:
        here, there = f"{np.nanmin(height):.0f} to {np.nanmax(height):.0f}", f"{low:.0f} to {high:.0f}"
        facts.append(fact("applied-height", share=f"{100 * outside:.0f}", here=here, there=there))
    return facts


def _range(values: np.ndarray) -> tuple[float, float]:
    return float(np.nanmin(values)), float(np.nanmax(values))


#: How far headings may lie from their mean, rad, for a flight on one heading: a turned camera and a shifted
#: position then move all points alike.
ONE_HEADING = np.radians(45.0)


def on_one_heading(observations: Observations) -> bool:
    """Whether all images were taken on one heading.

    Parameters
    ----------
    observations
        From `wildlab.analysis.georeference.observe`.

    Returns
    -------
    bool
    """
    R = observations.poses.R_nb[np.isfinite(observations.poses.R_nb).all(axis=(1, 2))]
    yaw = matrix_to_euler(R)[:, 2]
    mean = np.angle(np.exp(1j * yaw).mean()) if len(yaw) else 0.0
    return bool(len(yaw)) and bool(np.abs(wrap(yaw - mean)).max() <= ONE_HEADING)


def visible_error(flight: Flight, scored: pd.DataFrame) -> float:
    """Half the median spacing of the marks, m: larger errors go to another one, where the nearest counts.

    Parameters
    ----------
    flight
        With truth.
    scored
        From `score_points`.
    """
    offset = flight.manifest.clocks.truth_offset_s
    _, places = truth_at(flight.table("truth"), scored["time_s"].to_numpy(float), offset_s=offset)
    spots = np.nanmedian(places[:, :, :2], axis=1)
    return largest_visible(spots[np.isfinite(spots).all(axis=1)])
