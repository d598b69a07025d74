"""The same flights twice: with detections that a twin draws, and with those of a detector in its images.

A twin's detections are the true pixel and noise. Here the frames that have one are rendered, the detector of
H 4.3 looks at them, and what it finds goes through the same filters, beside what was drawn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.tracks.pixels import PixelMeasurements, read_pixels
from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import mean_interval, mean_share_interval
from wildlab.evaluation.shares import Check, Decision, decide
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.messages.quantities import percent_between
from wildlab.reporting.charts.drawing import draw_dots, draw_marks, draw_picture, finish, name_rows
from wildlab.reporting.figures import BLUE, VERMILLION, new_figure
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.flights import corner_of
from wildlab.simulation.target_motion import target_path
from wildlab.studies import coloured_noise as coloured
from wildlab.studies import linear_vs_nonlinear as filters
from wildlab.studies.page import interval_words
from wildlab.studies.rules import keys_of, load_rules
from wildlab.studies.vessel_detection import Marks, Photographer, exposures_of, marks_of, with_detections

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
    seen: Mapping[str, PixelMeasurements]
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
        {kind: read_pixels(one, source) for kind, one in flights.items()},
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
    """What the detections themselves are worth, by kind."""
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


def track_numbers(seen: PixelMeasurements, twin: str) -> Numbers:
    """What the cases that are about a twin's flight compute of a sighting, by (subject, name)."""
    result: Numbers = {}
    if twin in filters.CASES:
        result |= filters.numbers_of(seen, filters.track_target(seen, filters.CASES[twin].tuning))
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
    named = {
        (who.removeprefix(f"{kind}-"), name): spread[who, name]
        for who, name in keys_of(spread)
        if who.startswith(f"{kind}-")
    }
    return pd.DataFrame(named | {("beside", "lag1"): np.nan})


def checks_of(spread: pd.DataFrame, kind: str) -> dict[str, dict[str, Check]]:
    """What the flights give for the claims of the cases about them with one kind of detections, by case."""
    own = of_kind(spread, kind)
    subjects = {who for who, _ in keys_of(own)}
    return {case: load_rules(case).checks(own) for case, needed in _OF.items() if subjects >= set(needed)}


def tracked_filters(spread: pd.DataFrame) -> tuple[str, ...]:
    """The filters whose tracks are there with both kinds of detections."""
    subjects = {who for who, _ in keys_of(spread)}
    wanted = dict.fromkeys(who for several in _OF.values() for who in several)
    return tuple(who for who in wanted if all(f"{kind}-{who}" in subjects for kind in KINDS))


def claim_numbers(runs: pd.DataFrame) -> dict[str, Array]:
    """By which share a filter's mean errors with both kinds of detections differ at most, (flights,)."""
    filters = tracked_filters(runs)
    drawn, rendered = (np.array([runs[f"{kind}-{who}", "mae"] for who in filters]) for kind in KINDS)
    return {"tracks/apart": np.max(np.abs(rendered / drawn - 1), axis=0)}


#: Numbers of the detections themselves, with their decimals; None: a share, shown in per cent.
DETECTIONS = {
    "pixel_rms": 2, "bias_ahead": 2, "bias_right": 2, "pixel_sd": 2, "detection_rate": None,
    "false_alarms_per_image": 3, "ellipse_coverage_90": None,
}  # fmt: skip


def detections_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """The detections themselves, drawn and rendered: means over flights with intervals, shares in per cent.

    ``names`` says what each quantity is called.
    """
    rows = []
    for name, decimals in DETECTIONS.items():
        row = {"quantity": names[name]}
        for kind in KINDS:
            if (kind, name) not in runs:
                row[kind] = ""
            elif decimals is None:
                row[kind] = percent_between(mean_share_interval(runs[kind, name]), 0)
            else:
                row[kind] = interval_words(mean_interval(runs[kind, name]), decimals)
        rows.append(row)
    return pd.DataFrame(rows)


def decision_text(decision: Decision) -> str:
    """A verdict with what it is by.

    Examples
    --------
    >>> decision_text(decide([True, True, False]))
    'undecided: 2 of 3'
    """
    return f"{decision.verdict}: {decision.true} of {decision.met}" if decision.met else decision.verdict


def verdicts_table(
    checks: Mapping[str, Mapping[str, Mapping[str, Check]]], claims: Mapping[str, Sequence[Mapping[str, Any]]]
) -> pd.DataFrame:
    """Every claim with its verdict by either kind of detections.

    Parameters
    ----------
    checks
        By kind, case and the claim's id.
    claims
        Of each case, as `wildlab.reporting.published.load_claims` gives them.

    Returns
    -------
    DataFrame
        ``claim``, ``source``; for each kind the ``verdict_`` and, under its own name, that with its counts;
        ``flights``, on how many the claim comes out otherwise.
    """
    rows = []
    for case, several in claims.items():
        for claim in several:
            threshold = None if "threshold" not in claim else float(claim["threshold"])
            row: dict[str, Any] = {"claim": claim["text"], "source": claim["source"]}
            true = {}
            for kind in KINDS:
                check = checks[kind][case][claim["id"]]
                true[kind] = check.holds(threshold)
                decision = decide(true[kind], check.premise)
                row |= {f"verdict_{kind}": decision.verdict, kind: decision_text(decision)}
            row["flights"] = int((true[DRAWN] != true[RENDERED]).sum())
            rows.append(row)
    return pd.DataFrame(rows)


def count_turned(verdicts: pd.DataFrame) -> int:
    """How many claims have another verdict by the rendered detections than by the drawn ones."""
    return int((verdicts[f"verdict_{DRAWN}"] != verdicts[f"verdict_{RENDERED}"]).sum())


def frame(pair: FlightPair) -> Figure:
    """A frame about the vessel, with what is drawn, what is found and where its outline's centre is."""
    rows = np.flatnonzero(pair.marks.found)
    row = int(rows[len(rows) // 2])
    exposure = int(pair.marks.exposure[row])
    window = pair.camera.flight.window(exposure, MARGIN)
    _, counts = pair.camera.image(exposure, window)
    fig, ax = new_figure(5.2, 4.2)
    draw_picture(ax, counts, limits=None)
    marks = {"drawn": pair.drawn_uv[row], "found": pair.marks.uv[row], "centre": pair.marks.centre[row]}
    draw_marks(ax, {name: at - corner_of(window) for name, at in marks.items()})
    return finish(fig)


def track_errors(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Mean distance of each filter on each flight, with both kinds of detections."""
    fig, ax = new_figure(5.6, 3.0)
    filters = tracked_filters(runs)
    for row, who in enumerate(filters):
        drawn, rendered = (runs[f"{kind}-{who}", "mae"].to_numpy(float) for kind in (DRAWN, RENDERED))
        y = row + 0.5 * ((np.arange(len(drawn)) + 0.5) / len(drawn) - 0.5)
        ax.hlines(y, drawn, rendered, color="0.75", lw=1)
        draw_dots(ax, drawn, y, VERMILLION, "drawn", size=5, marker="x", mec=VERMILLION, alpha=1.0)
        draw_dots(ax, rendered, y, BLUE, "rendered", marker="o", alpha=1.0)
    name_rows(ax, [names[who] for who in filters])
    ax.set_xlim(left=0)
    return finish(fig, "mean distance from the truth (m)")
