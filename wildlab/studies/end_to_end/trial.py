"""The same flights twice: with detections that a twin draws, and with those of a detector in its images.

A twin's detections are the true pixel and noise. Here the frames that have one are rendered, the detector of
H 4.3 looks at them, and what it finds goes through the same filters, beside what was drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.rendered import Marks, Photographer, exposures_of, marks_of, with_detections
from wildlab.analysis.tracks.sighting import Sighting, sighting
from wildlab.errors import WildlabError
from wildlab.evaluation.shares import Check, columns_of
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.target_motion import target_path
from wildlab.studies.coloured_noise import trial as coloured
from wildlab.studies.linear_vs_nonlinear import trial as filters

Numbers = dict[tuple[str, str], float]

#: The twin's own detections, and those of rendered images.
DRAWN, RENDERED = "drawn", "rendered"
KINDS = (DRAWN, RENDERED)
#: Cases whose claims are computed on both.
TWO_FILTERS, COLOURED = "linear-vs-nonlinear", "coloured-noise"
#: Subjects of `wildlab.studies.coloured_noise` whose columns say that it was computed.
_OF = {TWO_FILTERS: ("kf", "ekf"), COLOURED: coloured.SUBJECTS}
#: The study whose claims they are, by case and twin.
STUDY_OF = {
    (TWO_FILTERS, "fast-vessel"): "linear-vs-nonlinear-fast",
    (TWO_FILTERS, "slow-vessel-eight"): "linear-vs-nonlinear-slow",
    (COLOURED, "fast-vessel"): "coloured-noise-fast",
    (COLOURED, "drifting-vessel"): "coloured-noise-drifting",
}
#: Rendered around a vessel, px: the detector's kernels see five of them.
MARGIN = 48
#: Names of the numbers of the detections themselves, and their units.
PIXEL_UNITS = {
    "pixel_rms": "px", "bias_ahead": "px", "bias_right": "px", "pixel_sd": "px",
    "detection_rate": "1", "false_alarms_per_image": "1", "images": "1",
    "ellipse_coverage_90": "1",
}  # fmt: skip


class FlightPair(NamedTuple):
    """One flight with both kinds of detections.

    Attributes
    ----------
    flights
        By kind, with the same frames, poses and truth.
    seen
        By kind, as the filters see them.
    marks
        The rendered ones in the images, in the order of the drawn ones.
    camera
        That took the images.
    drawn_uv
        (K, 2) px of the drawn ones.
    """

    flights: Mapping[str, Flight]
    seen: Mapping[str, Sighting]
    marks: Marks
    camera: Photographer
    drawn_uv: Array


def source_of(twin: str) -> str:
    """Whose poses the thesis uses for the flight that a twin stands for.

    Raises
    ------
    WildlabError
        Where no case here is about it.
    """
    if twin in filters.CASES:
        return filters.CASES[twin].source
    if twin in coloured.TUNINGS:
        return filters.OBSERVER
    known = sorted({*filters.CASES, *coloured.TUNINGS})
    raise WildlabError(f"the twin {twin!r} has no case to compare", f"use one of {', '.join(known)}")


def fly(twin: str, seed: int, every: int = 1) -> FlightPair:
    """A flight, and its images where the twin marks its target, rendered and searched.

    Parameters
    ----------
    twin
        `source_of` says which.
    seed
        Of the flight.
    every
        Of the drawn detections, every so many are kept and rendered; 1 is all of them.

    Returns
    -------
    Pair
    """
    source = source_of(twin)
    flight, _ = filters.fly_sighting(twin, seed, source)
    drawn = flight.table("detections").iloc[::every].reset_index(drop=True)
    flight = Flight(flight.manifest, flight.nav, flight.tables | {"detections": drawn})
    camera = Photographer(twin, seed)
    shape = camera.flight.poses.camera.height, camera.flight.poses.camera.width
    marks = marks_of(camera.shoot(exposures_of(drawn), margin=MARGIN), shape)
    target = str(drawn["target_id"].iloc[0])
    other = with_detections(flight, marks, target, float(drawn["plane_down_m"].iloc[0]), all_frames=True)
    flights = {DRAWN: flight, RENDERED: other}
    return FlightPair(
        flights,
        {kind: sighting(one, source) for kind, one in flights.items()},
        marks,
        camera,
        drawn[["u_px", "v_px"]].to_numpy(float),
    )


class PixelErrors(NamedTuple):
    """Errors (K, 2) px of detections by kind, ahead of the target and to its right; NaN where none is."""

    drawn: Array
    rendered: Array


def pixel_errors(pair: FlightPair, twin: str, seed: int) -> PixelErrors:
    """How far detections are from the target's point, along the target's own axes in the image."""
    target = load_twin(twin).targets[0]
    scenes = pair.camera.flight
    poses = scenes.poses.take(pair.marks.exposure)
    points = target_path(target, seed)(scenes.times[pair.marks.exposure])
    course = 0.0 if target.motion is None else target.motion.course.si
    uv = ground_to_pixel(poses.camera, points, poses.p_nc, poses.R_nc)
    axes = []
    for angle in (course, course + np.pi / 2):
        step = np.array([np.cos(angle), np.sin(angle), 0.0])
        along = ground_to_pixel(poses.camera, points + step, poses.p_nc, poses.R_nc) - uv
        axes.append(along / np.linalg.norm(along, axis=1)[:, None])
    both = [
        np.stack([((found - uv) * axis).sum(axis=1) for axis in axes], axis=1)
        for found in (pair.drawn_uv, pair.marks.uv)
    ]
    return PixelErrors(*both)


def detection_numbers(pair: FlightPair, twin: str, seed: int) -> Numbers:
    """What the detections themselves are worth, by kind and the names of `PIXEL_UNITS`."""
    result: Numbers = {}
    for kind, errors in pixel_errors(pair, twin, seed)._asdict().items():
        e = errors[np.isfinite(errors).all(axis=1)]
        result |= {
            (kind, "images"): len(errors),
            (kind, "detection_rate"): len(e) / len(errors),
            (kind, "pixel_rms"): np.sqrt((e**2).sum(axis=1).mean()),
            (kind, "bias_ahead"): e[:, 0].mean(),
            (kind, "bias_right"): e[:, 1].mean(),
            (kind, "pixel_sd"): np.sqrt((e.std(axis=0) ** 2).sum()),
        }
    marks = pair.marks
    found = marks.found & np.isfinite(marks.centre).all(axis=1)
    off = (marks.uv - marks.centre)[found]
    return result | {
        (RENDERED, "false_alarms_per_image"): marks.false.mean(),
        (RENDERED, "ellipse_coverage_90"): inside_ellipse(off, marks.covariance[found], 0.9).mean(),
    }


def track_numbers(seen: Sighting, twin: str) -> Numbers:
    """What the cases that are about a twin's flight compute of a sighting, by (subject, name)."""
    result: Numbers = {}
    if twin in filters.CASES:
        result |= filters.numbers_of(
            seen, filters.track_target(seen, filters.CASES[twin].tuning, filters.PUBLISHED)
        )
    if twin in coloured.TUNINGS:
        tuning = coloured.TUNINGS[twin]
        tracks = coloured.track_target(seen, tuning)
        result |= filters.numbers_of(seen, tracks | coloured.track_varied(seen, tuning))
        result |= coloured.beginnings(seen, tracks)
    return result


def numbers_of(pair: FlightPair, twin: str, seed: int) -> Numbers:
    """Everything that is compared, by (subject, name); a filter's subject begins with the kind."""
    result = detection_numbers(pair, twin, seed)
    for kind in KINDS:
        for (who, name), value in track_numbers(pair.seen[kind], twin).items():
            result[f"{kind}-{who}", name] = value
    return result


def trial(seed: int, *, twin: str, every: int) -> Numbers:
    """One simulated flight with both kinds of detections, by `numbers_of`.

    Raises
    ------
    WildlabError
        Where no case is about the twin's flight, or nothing is found.
    """
    return numbers_of(fly(twin, seed, every), twin, seed)


def of_kind(spread: pd.DataFrame, kind: str) -> pd.DataFrame:
    """The numbers of one kind, by the subjects that the cases themselves have."""
    columns: Any = spread.columns
    named = {
        (who.removeprefix(f"{kind}-"), name): spread[who, name]
        for who, name in columns
        if who.startswith(f"{kind}-")
    }
    return pd.DataFrame(named)


def checks_of(spread: pd.DataFrame, kind: str) -> dict[str, dict[str, Check]]:
    """What the flights give for the claims of the cases about them with one kind of detections, by case."""
    own = of_kind(spread, kind)
    columns: Any = own.columns
    subjects = {who for who, _ in columns}
    checked = {TWO_FILTERS: filters.check_claims, COLOURED: coloured.check_claims}
    return {case: check(own) for case, check in checked.items() if set(_OF[case]) <= subjects}


def tracked_filters(spread: pd.DataFrame) -> tuple[str, ...]:
    """The filters whose tracks are there with both kinds of detections."""
    columns: Any = spread.columns
    subjects = {who for who, _ in columns}
    wanted = dict.fromkeys(who for several in _OF.values() for who in several)
    return tuple(who for who in wanted if all(f"{kind}-{who}" in subjects for kind in KINDS))


def check_claims(spread: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for what this study claims itself, by the claim's id.

    Parameters
    ----------
    spread
        What `trial` gives, one row for each flight.
    """

    of = columns_of(spread)

    apart = np.max(
        [
            np.abs(of(f"{RENDERED}-{who}", "mae") / of(f"{DRAWN}-{who}", "mae") - 1)
            for who in tracked_filters(spread)
        ],
        axis=0,
    )
    bias = np.hypot(of(RENDERED, "bias_ahead"), of(RENDERED, "bias_right"))
    drawn, rendered = of(DRAWN, "pixel_rms"), of(RENDERED, "pixel_rms")
    return {
        "all-found": Check(measured=1 - of(RENDERED, "detection_rate")),
        "nearer-than-drawn": Check.smaller(rendered, drawn, "px"),
        "mostly-bias": Check.larger(bias, of(RENDERED, "pixel_sd")),
        "tracks-alike": Check(measured=apart),
    }
