"""A calibration learnt on one flight and applied to another: corrections, and how noisy the poses were."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wildlab.analysis.accuracy import compare_sightings, noise_without
from wildlab.analysis.diagnose import Diagnosis, diagnose
from wildlab.analysis.evaluate import score_points
from wildlab.analysis.georeference import Observations, calibrated, georeference, observe
from wildlab.analysis.pose_noise import as_deviations
from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import (
    UNITS,
    Conditions,
    Learnt,
    LearntGain,
    LearntNoise,
    LearntOn,
    LearntParameter,
    parse_learnt,
    refuse_other_camera,
)
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.corrections import Calibration, apply_calibration, calibrated_camera
from wildlab.geometry.frames import euler_to_matrix, matrix_to_quaternion, quaternion_to_matrix

__all__ = ["Applied", "apply_learnt", "corrected_flight", "learn_flight", "learn_from", "parse_learnt"]

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
    return learn_from(observations, diagnosis, rng), diagnosis


def learn_from(observations: Observations, diagnosis: Diagnosis, rng: np.random.Generator) -> Learnt:
    """What a diagnosis teaches: corrections only where they gained something for certain.

    Parameters
    ----------
    observations
        As `diagnose` had them.
    diagnosis
        Of it.
    rng
        Draws samples of flat rays.

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
    parameters, scales = [], []
    for one in calibration.names if diagnosis.counts else ():
        unit = UNITS[one]
        scale = _SCALES.get(unit, 1.0)
        low, high = calibration.interval(one)
        parameters.append(
            LearntParameter(
                name=one, value=scale * calibration.value(one), low=scale * low, high=scale * high, unit=unit
            )
        )
        scales.append(scale)
    covariance = calibration.covariance * np.outer(scales, scales) if scales else np.zeros((0, 0))
    learnt = diagnosis.noise if diagnosis.noise is not None and not diagnosis.places_known else None
    noise = as_deviations(learnt or noise_without(observations, diagnosis, rng))
    return Learnt(
        learnt_on=LearntOn(
            flight=flight.name,
            source=name,
            fingerprint=fingerprint(observations),
            images=calibration.n_images,
            points=calibration.n_points,
            blocks=calibration.n_draws,
        ),
        conditions=Conditions(height_m=_range(height), depression_deg=_range(depression)),
        camera=camera,
        mount=flight.manifest.mount,
        noise=LearntNoise(**noise),
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
        parameter=tuple(parameters),
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
    sentence
        Which calibration that is, and whether it may be judged here.
    """

    observations: Observations
    deviations: dict[str, float]
    sentence: str


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
    placed = calibrated(observations, _calibration(learnt))
    deviations = {name: float(value) for name, value in learnt.noise.model_dump().items()}
    return Applied(placed, deviations, _sentence(observations, learnt))


def corrected_flight(flight: Flight, source: str | None, learnt: Learnt) -> Flight:
    """A flight whose manifest and poses say what the calibration says, for checks of whether it makes sense.

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
        With other clock, mount, camera, positions and heading of that source.
    """
    calibration, m = _calibration(learnt), flight.manifest
    name, nav = flight.pose_source(source)
    if m.camera is None or not calibration.names:
        return flight
    camera = calibrated_camera(calibration, m.geometry_camera())
    roll, tilt, pan = np.degrees(apply_calibration(calibration, m.geometry_mount()).misalignment)
    changed = replace_in_manifest(
        m,
        {
            "clocks": {"camera_offset_s": m.clocks.camera_offset_s + calibration.value("clock")},
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


def _sentence(observations: Observations, learnt: Learnt) -> str:
    on = learnt.learnt_on
    if fingerprint(observations) == on.fingerprint:
        return (
            f"The calibration that is applied was learnt on this very flight ({on.flight}): the figures "
            "flatter it. Judge it on another one."
        )
    what = (
        f"corrections of {', '.join(one.name for one in learnt.parameter)}"
        if learnt.parameter
        else "no corrections"
    )
    said = (
        f"Applied: a calibration learnt on the flight {on.flight} ({on.images} images, {on.points} points), "
        f"with {what} and its standard deviations of the poses."
    )
    if on.flight == observations.flight.name:
        said += " It has the name of this flight, and other clicks or poses."
    depression = np.degrees(np.arcsin(np.clip(observations.poses.R_nc[:, 2, 2], -1, 1)))
    low, high = learnt.conditions.depression_deg
    outside = float(np.mean((depression < low - 5) | (depression > high + 5)))
    if outside > 0.1:
        said += f" {100 * outside:.0f} % of the views here are flatter or steeper than any there."
    height = observations.plane_down - observations.poses.p_nc[:, 2]
    low, high = learnt.conditions.height_m
    outside = float(np.mean((height < low / OTHER_HEIGHT) | (height > high * OTHER_HEIGHT)))
    if outside > 0.1:
        said += (
            f" {100 * outside:.0f} % of the views here are from another height than there "
            f"({np.nanmin(height):.0f} to {np.nanmax(height):.0f} m, there {low:.0f} to {high:.0f} m): "
            "errors of angle and of position, which one height tells apart badly, weigh otherwise here."
        )
    return said


def _range(values: np.ndarray) -> tuple[float, float]:
    return float(np.nanmin(values)), float(np.nanmax(values))
