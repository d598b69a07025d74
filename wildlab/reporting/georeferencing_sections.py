"""Sections of the report on positions read from single images: what is shown, in which order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wildlab.analysis.accuracy import Accuracy
from wildlab.analysis.diagnosis import Diagnosis
from wildlab.analysis.overviews.verdict import MANY_LOST, VERDICT_LEVEL, Verdict, verdict_of
from wildlab.evaluation.ellipses import EllipseVerdict
from wildlab.evaluation.errors import ErrorSummary
from wildlab.reporting import georeferencing as words
from wildlab.reporting import georeferencing_cause as cause
from wildlab.reporting import georeferencing_left as left
from wildlab.reporting.arrange import ADVICE
from wildlab.reporting.ground import ground_height_words
from wildlab.reporting.known_positions import EXACT, KnownPositions
from wildlab.reporting.report import Report
from wildlab.reporting.text import percent


def summary_section(
    report: Report, found: Accuracy, applied: str = "", amiss: Sequence[str] = (), clock: str = ""
) -> None:
    """The summary: how far off, how many points are lost, the cause and what to do.

    Parameters
    ----------
    report
        Is added to.
    found
        What is shown.
    applied
        What is to be said of the calibration that was applied, where one was.
    amiss
        What does not fit together in the flight: `wildlab.flight.checks.sense.sense.sense_sentences`.
    clock
        What is to be said of the offset of the camera's clock that was applied, where one was.
    """
    logged, total, diagnosis = found.summary, len(found.scored), found.diagnosis
    said, lost = words.headline(logged, total), cause.lost_sentence(found.lost, total)
    said = [lost, *said] if found.lost > MANY_LOST * total else [*said, lost]
    if logged.n:
        said.append(clock)
    if diagnosis is not None and logged.n >= words.FEW:
        unsure = cause.ambiguity_sentence(diagnosis, found.unambiguous)
        said.append(cause.cause_sentence(diagnosis))
        if diagnosis.counts:
            said.append(cause.neighbours_sentence(diagnosis.neighbours()))
        said += [unsure or cause.advice(diagnosis, not applied)]
    said = [cause.amiss_sentence(amiss), *said]
    verdict, reason = verdict_words(logged, found.lost, found.ellipses, diagnosis, amiss)
    shown = [one for one in said if one]
    report.summary(shown, level=verdict.colour, verdict=(verdict.value, reason))
    report.metric(VERDICT_LEVEL, "georeferencing", verdict.level, "1")
    if applied:
        report.text(applied)


def verdict_words(
    logged: ErrorSummary, lost: int, ellipses: EllipseVerdict, diagnosis: Diagnosis | None,
    amiss: Sequence[str] = (),
) -> tuple[Verdict, str]:  # fmt: skip
    """What the georeferencing comes to, and why: parameters of `cause.evidence_of`."""
    evidence = cause.evidence_of(logged, lost, ellipses, diagnosis, amiss)
    verdict, total = verdict_of(evidence), logged.n + lost
    if evidence.problems:
        count = "1 finding" if evidence.problems == 1 else f"{evidence.problems} findings"
        return verdict, f"The logs contradict each other: {count}."
    if lost > MANY_LOST * total or not logged.n:
        return verdict, f"{lost} of {total} points have no position."
    said = []
    gain = cause.gained_share(diagnosis.winner.gain) if diagnosis is not None and diagnosis.counts else 0.0
    if gain >= cause.SMALL:
        said.append(f"a constant error is {percent(gain, 0)} of the mean error")
    if possible := cause.possible_share(logged, diagnosis):
        said.append(f"taking a constant error off may gain {percent(possible, 0)} of the mean error")
    if diagnosis is not None and diagnosis.outliers:
        far_out = len(diagnosis.outliers)
        said.append("1 thing is far out" if far_out == 1 else f"{far_out} things are far out")
    if ellipses.word == "too small":
        said.append("the stated uncertainty is too small")
    if logged.n < words.FEW:
        said.append(f"{logged.n} points are few")
    if said:
        reason = "; ".join(said)
        return verdict, f"{reason[0].upper()}{reason[1:]}."
    if diagnosis is None:
        return verdict, "Nobody could look for a cause: there are too few images with known points."
    held = f"; {left.coverage_words(ellipses)} of the 90 % ellipses hold the truth" if ellipses.n else ""
    return verdict, f"{_small(diagnosis)}, nothing far out{held}."


def _small(diagnosis: Diagnosis) -> str:
    """Why no constant error is worth taking off: it is certain and small, or none is certain."""
    if diagnosis.counts:
        share = percent(cause.gained_share(diagnosis.winner.gain), 0)
        return f"The constant error that is certain is small, {share} of the mean error"
    if diagnosis.winner.causes:
        return f"A constant error of {cause.causes_in_words(diagnosis.winner.causes)} is not certain"
    return "No constant error is certain"


def amiss_section(report: Report, amiss: Sequence[str], *, shown: bool) -> None:
    """What does not fit together in the flight; only how much where its locations are not open."""
    if not amiss:
        return
    count = "1 finding" if len(amiss) == 1 else f"{len(amiss)} findings"
    said = list(amiss) if shown else [f"{count}. `wildlab check` on the flight's folder says which."]
    report.alert("What does not fit together", said)


def models_section(report: Report, diagnosis: Diagnosis) -> None:
    """Models, parameters, and what the data do not separate, where places are not known."""
    report.section("The cause", cause.size_sentence(diagnosis.calibration, diagnosis.counts))
    _models(report, diagnosis)
    if alike := cause.alike_sentences(diagnosis):
        report.points(alike)


def _models(report: Report, diagnosis: Diagnosis) -> None:
    report.table(
        cause.models_table(diagnosis),
        columns={
            "what": "constant error taken off",
            "parameters": "parameters",
            "error": "mean error (m)",
            "gain": "gain (m)",
            "interval": "90 % interval",
        },
        digits={"parameters": 0, "error": 2, "gain": 2},
        caption="Mean error on images that the parameters were not estimated from, "
        f"{diagnosis.blocks.max() + 1} blocks left out in turn"
        f"{', without what is far out' if diagnosis.outliers else ''}; the most likely first. Bold: the "
        "simplest within odds of 19 to 1 of the best.",
    )
    if diagnosis.winner.causes:
        report.table(
            cause.parameters_table(report, diagnosis.calibration),
            columns={
                "what": "to be added to",
                "value": "estimate",
                "interval": "95 % interval",
                "verdict": "verdict",
            },
            digits={"value": 3 if "radial" in diagnosis.calibration.names else 2},
            caption=f"From {diagnosis.calibration.n_points} points in {diagnosis.calibration.n_images} images"
            f"{', without what is far out' if diagnosis.outliers else ''}. The intervals hold where the "
            "error is of these kinds alone; one of another kind is taken for them.",
        )


def cause_section(report: Report, found: Accuracy) -> None:
    """Models, parameters, axes, what is far out, and what the nearest mark hides; nothing if undiagnosed."""
    diagnosis = found.diagnosis
    if diagnosis is None:
        return
    said = [cause.size_sentence(diagnosis.calibration, diagnosis.counts), left.halves_sentence(found.halves)]
    report.section("The cause", " ".join(filter(None, said)))
    _models(report, diagnosis)
    if alike := cause.alike_sentences(diagnosis):
        report.points(alike)
    report.table(
        cause.axes_table(found.axes),
        columns={
            "axis": "axis",
            "mean": "mean error (m)",
            "interval": "90 % interval",
            "share": "of the squared error (%)",
            "verdict": "verdict",
        },
        digits={"mean": 1, "share": 0},
        caption="Errors along axes of the world, of the camera and of the course, nothing taken off. "
        "Lasting: constant, or slower than the flight; negligible: under a twentieth of the squared error.",
    )
    _far_out(report, diagnosis)
    if found.nearest is not None:
        report.subsection("What the nearest mark hides")
        share = float(found.nearest.ambiguous.mean())
        said = left.nearest_sentences(share, found.nearest.visible_m, found.summary.p90)
        if found.unambiguous is not None:
            said.append(f"Without ambiguous clicks: {cause.cause_sentence(found.unambiguous)}")
        report.points(said)


def _far_out(report: Report, diagnosis: Diagnosis) -> None:
    if not diagnosis.outliers:
        return
    with_, without = diagnosis.held_summary(), diagnosis.held_summary(diagnosis.inliers)
    report.subsection("Far out", left.outliers_sentence(diagnosis.outliers, with_, without))
    report.table(
        left.outliers_table(diagnosis.outliers),
        columns={"kind": "what", "photo": "photo", "mark": "mark", "points": "points", "off": "off by (m)"},
        digits={"points": 0, "off": 1},
        caption="Farther off than its like, the cause above taken off where it is certain. No cause was "
        "estimated from these points, or chosen by them.",
    )


def left_section(
    report: Report, found: Accuracy, more: Sequence[str] = (), known: KnownPositions = EXACT
) -> None:
    """What the errors are made of once the cause is taken off, what averaging gained, and ``more``.

    ``known``: what the errors were held against.
    """
    diagnosis = found.diagnosis
    taken = diagnosis.winner.causes if diagnosis is not None and diagnosis.counts else ()
    said, parts = left.averaging_sentence(found.averaged), list(more)
    if found.summary.n:
        said = " ".join(filter(None, (left.remaining_sentence(found.remaining, taken), said)))
        parts = [
            *left.remaining_parts(found.remaining, known, diagnosis.neighbours() if diagnosis else None),
            *parts,
        ]
    if parts:
        report.section("What is left", said, part=ADVICE)
        report.points(parts, ordered=True)


def ellipse_section(
    report: Report, found: Accuracy, *, learnt_elsewhere: bool, known: KnownPositions = EXACT
) -> None:
    """The verdict on the ellipses, what they come from, and what noise the errors themselves tell.

    ``known``: what the errors were held against.
    """
    if not found.summary.n:
        return
    own = found.observations.poses.covariance is not None and not learnt_elsewhere
    pose = (
        "that of the log (root mean square)"
        if own
        else "learnt with the calibration"
        if learnt_elsewhere
        else "assumed"
    )
    ground = found.observations.terrain
    report.section("Does it know how wrong it is?")
    how = words.ellipse_words(found.scored, terrain=ground is not None)
    report.text(
        f"{left.ellipse_sentence(found.ellipses)}\n\nOf {len(found.scored)} ellipses {how}. The uncertainty "
        f"of the pose is {pose}: {words.assumed_words(found.assumed)}."
        f"{ground_height_words(ground, found.assumed)}"
    )
    if found.noise is None:
        return
    report.text(
        "Learnt from the errors on one half of the flight and scored on the other, without what is far out, "
        f"90 % ellipses hold the truth in {100 * found.learnt:.0f} % (mean over several halvings). A number "
        "with a factor near 3 is one the data could not decide; it stays near what was assumed."
    )
    report.table(
        words.noise_table(found.noise, found.assumed, known),
        columns={
            "what": "standard deviation of",
            "assumed": "used above",
            "estimated": "learnt",
            "unit": "unit",
            "factor": "uncertain by a factor",
        },
        digits={"assumed": 2, "estimated": 2, "factor": 1},
        caption="How noisy poses and pixels were, the cause taken off where it is certain.",
    )
    camera = found.observations.poses.camera
    if found.noise.sd["pixel"] > 5 * found.assumed["pixel_px"]:
        report.text(
            f"{found.noise.sd['pixel']:.0f} pixels are more than marking explains. Look at the calibration "
            f"of the camera: its focal lengths are {camera.fx:.0f} and {camera.fy:.0f} pixels."
        )


def tiles(found: Accuracy, others: dict[str, ErrorSummary]) -> list[tuple[str, str]]:
    """The few numbers to remember; none where all points are lost."""
    logged, diagnosis, m = found.summary, found.diagnosis, words.short_length
    if not logged.n:
        return []
    interval = found.intervals.get("horizontal_error_mean")
    again = f", {m(interval[0])} to {m(interval[1])} for these images, resampled" if interval else ""
    shown = [
        (m(logged.mean), f"mean error{again}"),
        (m(logged.median), "median"),
        (m(logged.p90), "nine of ten points within"),
    ]
    if diagnosis is not None and diagnosis.counts:
        shown.append((m(diagnosis.held_summary().mean), "mean error of unseen images, the cause taken off"))
    shown += [(m(s.mean), f"mean error of the answers recorded by {name}") for name, s in others.items()]
    if np.isfinite(found.ellipses.coverage.estimate):
        shown.append((left.coverage_words(found.ellipses), "of the 90 % ellipses hold the truth"))
    return [*shown, (f"{found.lost} of {len(found.scored)}", "points have no position")]
