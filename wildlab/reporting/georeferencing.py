"""The page on positions read from single images: how far off they are, why, and whether their ellipses tell.

What is said follows by rules from what `wildlab.analysis.accuracy.judge_accuracy` found; the words lie in
``data/messages/en/georeferencing.toml``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis import Fact
from wildlab.analysis.accuracy import Accuracy, Repeats, corrections, on_one_heading
from wildlab.analysis.diagnose import CAUSES, Diagnosis, nonzero
from wildlab.analysis.georeference import FEW_POINTS, best_known, errors_of
from wildlab.analysis.verdict import (
    MANY_LOST,
    VERDICT_LEVEL,
    WORTH,
    Evidence,
    Verdict,
    is_possible,
    verdict_of,
)
from wildlab.evaluation.correlated_errors import WanderNoise
from wildlab.evaluation.ellipses import EllipseVerdict, is_conservative
from wildlab.evaluation.errors import ErrorSummary, summarise
from wildlab.evaluation.outliers import Outlier
from wildlab.flight.calibration_files import beside_zone
from wildlab.flight.store import Flight
from wildlab.geometry.corrections import BORESIGHT, Calibration
from wildlab.messages.catalogue import Message, PageTexts, load_texts, words
from wildlab.messages.quantities import length, measure, percent_of, significant
from wildlab.names import listed
from wildlab.reporting.charts.drawing import sightings_chart
from wildlab.reporting.charts.tracks import error_map, error_scatter, error_shares, errors_by_image
from wildlab.reporting.figures import colour
from wildlab.reporting.notebook_pages import ADVICE
from wildlab.reporting.report import Report, Wording

#: From this share of the error on a constant error is most of it.
MOST = 0.5
#: Messages of what to do, at most.
MOST_ADVICE = 3


# -- tables

#: Rows of the table of models, and of that of the worst images.
SHOWN, MOST_IMAGES = 8, 10
_NOISE = {
    "position_horizontal": ("position_horizontal_m", "m"),
    "position_vertical": ("position_vertical_m", "m"),
    "tilt": ("tilt_deg", "deg"),
    "heading": ("heading_deg", "deg"),
    "pixel": ("pixel_px", "px"),
}
#: Fields of an error summary by the names of their metrics.
SUMMARY = {
    "horizontal_error_mean": "mean",
    "horizontal_error_median": "median",
    "horizontal_error_p90": "p90",
    "horizontal_error_max": "max",
    "bias_north": "bias_north",
    "bias_east": "bias_east",
    "sd_north": "sd_north",
    "sd_east": "sd_east",
}


def groups_table(groups: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """One row of errors for each scored part of a flight, with images and ellipse coverage."""
    return pd.DataFrame(
        [
            {
                "part": name,
                "images": rows["frame_id"].nunique(),
                **summarise(errors_of(rows))._asdict(),
                "inside": 100 * rows["inside_90"].mean(),
            }
            for name, rows in groups.items()
        ]
    )


def worst_images(scored: pd.DataFrame) -> pd.DataFrame:
    """The images with the largest mean error, `MOST_IMAGES` at most, numbered as on the map."""
    each = scored.dropna(subset=["error_m"]).groupby("frame_id", sort=False)["error_m"]
    found = each.agg(["count", "mean", "max"]).nlargest(MOST_IMAGES, "mean").reset_index(names="image")
    return found.assign(number=np.arange(len(found)) + 1)


def worst_sightings(flight: Flight, scored: pd.DataFrame) -> pd.DataFrame:
    """The detection that is furthest off in each of the `worst_images`, with its pixel and a ``line``."""
    worst = worst_images(scored)
    furthest = scored.loc[scored.groupby("frame_id")["error_m"].idxmax().dropna()].set_index("frame_id")
    pixels = flight.table("detections").set_index("detection_id")[["u_px", "v_px"]]
    found = worst.join(furthest.loc[worst["image"]].join(pixels, on="detection_id"), on="image")
    lines = [f"{n}: {length(m)}" for n, m in zip(found["number"], found["error_m"], strict=True)]
    return found.assign(line=lines)


def simplest_rivals(diagnosis: Diagnosis) -> list[int]:
    """Numbers of the rivals that hold no other rival, the two of the least held-out error at most; of those
    with the same causes, one."""
    models, winner = diagnosis.models, diagnosis.winner
    rivals = [m for m in diagnosis.ranked.rivals if models[m].causes not in ((), winner.causes)]
    held = [set(models[m].causes) for m in rivals]
    simple: dict[tuple[str, ...], int] = {}
    for m in sorted(rivals, key=lambda m: models[m].gain.with_):
        if not any(one < set(models[m].causes) for one in held):
            simple.setdefault(models[m].causes, m)
    return [*simple.values()][:2]


def models_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """The most likely models, the winner bold, rivals that the page names, and the poses as logged."""
    likeliest = np.argsort(diagnosis.ranked.scores, kind="stable")[:SHOWN].tolist()
    rows = []
    for m in dict.fromkeys([*likeliest, diagnosis.ranked.winner, *simplest_rivals(diagnosis), 0]):
        model = diagnosis.models[m]
        gain = model.gain.gain
        rows.append(
            {
                "what": f"**{model.name}**" if m == diagnosis.ranked.winner else model.name,
                "parameters": len(model.fit.names),
                "error": model.gain.with_,
                "gain": gain.estimate if model.causes else np.nan,
                "low": gain.low if model.causes else np.nan,
                "high": gain.high if model.causes else np.nan,
            }
        )
    return pd.DataFrame(rows)


def parameters_table(report: Report, calibration: Calibration) -> pd.DataFrame:
    """Estimated corrections with their 95 % intervals, one row each; recorded as metrics too."""
    names, rows = load_texts("georeferencing").quantities, []
    for one in corrections(calibration):
        name, value, low, high, unit = one.values()
        metric = f"boresight_{name}" if name in BORESIGHT else f"{name}_offset"
        report.metric(metric, "calibration", value, unit, n=calibration.n_images, low=low, high=high)
        shown = {"what": names[name], "unit": "" if unit == "1" else unit, "zero": low <= 0 <= high}
        rows.append(one | shown)
    return pd.DataFrame(rows)


def outliers_table(outliers: Sequence[Outlier]) -> pd.DataFrame:
    """Marks, photos and clicks that are outliers, largest first."""
    return pd.DataFrame(
        [
            {
                "kind": one.kind,
                "photo": one.photo or "several",
                "mark": one.mark or ("several" if one.kind == "photo" else "not known"),
                "points": one.points,
                "error": one.off_m,
            }
            for one in outliers
        ]
    )


def noise_table(noise: WanderNoise, assumed: Mapping[str, float]) -> pd.DataFrame:
    """Assumed and estimated standard deviations, one row each, in degrees, metres and pixels."""
    names = load_texts("georeferencing").quantities
    return pd.DataFrame(
        [
            {
                "what": names[kind],
                "assumed": assumed[key],
                "estimated": np.degrees(noise.sd[kind]) if unit == "deg" else noise.sd[kind],
                "unit": unit,
            }
            for kind, (key, unit) in _NOISE.items()
        ]
    )


# -- what is recorded


def record_summary(
    report: Report,
    subject: str,
    summary: ErrorSummary,
    intervals: Mapping[str, tuple[float, float]] | None = None,
) -> None:
    """Record the figures of a summary of errors under ``subject``; ``intervals`` by metric name."""
    for name, field in SUMMARY.items():
        low, high = (intervals or {}).get(name, (None, None))
        report.metric(name, subject, getattr(summary, field), "m", n=summary.n, low=low, high=high)


def record_errors(
    report: Report,
    subject: str,
    scored: pd.DataFrame,
    intervals: Mapping[str, tuple[float, float]] | None = None,
) -> ErrorSummary:
    """Record the metrics of one scored table under ``subject``, and return its summary."""
    summary = summarise(errors_of(scored))
    record_summary(report, subject, summary, intervals)
    if scored["inside_90"].notna().any():
        known = int(scored["inside_90"].notna().sum())
        report.metric("ellipse_coverage_90", subject, scored["inside_90"].mean(), "1", n=known)
    return summary


def record_accuracy(
    report: Report, found: Accuracy, answers: Mapping[str, pd.DataFrame]
) -> dict[str, ErrorSummary]:
    """Record the metrics of a flight and of other programs' answers; return the summaries of these."""
    record_errors(report, "logged-pose", found.best, found.intervals)
    diagnosis = found.diagnosis
    if diagnosis is not None:
        gain, n = diagnosis.winner.gain.gain, int(diagnosis.inliers.sum())
        report.metric("gain", "winner", gain.estimate, "m", n=n, low=gain.low, high=gain.high)
        if diagnosis.counts:
            record_summary(report, "calibrated-pose", diagnosis.held_summary())
    if diagnosis and diagnosis.outliers and diagnosis.inliers.any():
        kept, whole = diagnosis.held_summary(diagnosis.inliers), diagnosis.held_summary()
        record_summary(report, "without-far-out", kept)
        report.metric("gain", "without-far-out", whole.mean - kept.mean, "m", n=kept.n)
        out = int((~diagnosis.inliers).sum())
        report.metric("points_far_out", "winner", out, "1", n=len(diagnosis.inliers))
    others = {}
    for program, table in answers.items():
        subject = "recorded-answers" if len(answers) == 1 else f"recorded-answers/{program}"
        others[program] = record_errors(report, subject, best_known(table))
    return others


def named(tables: Mapping[str, pd.DataFrame], kind: str, *, shown: bool) -> dict[str, pd.DataFrame]:
    """Tables by the names that a report and its metrics may have for them.

    Parameters
    ----------
    tables
        By the names that the flight gives, which may tell of a place.
    kind
        What they are, ``"part"``: where their names are not shown, they are numbered.
    shown
        Whether the flight's locations are open.

    Returns
    -------
    dict
        In the same order; blanks are hyphens, and no two names are alike.
    """
    found: dict[str, pd.DataFrame] = {}
    for i, (name, table) in enumerate(tables.items(), 1):
        short = re.sub(r"\s+", "-", name.strip()) if shown else f"{kind}-{i}"
        while short in found:
            short += "-again"
        found[short] = table
    return found


# -- what follows from it


def truth_errors(found: Accuracy) -> dict[str, float]:
    """Reported SD (m, or NaN) of the "track" and "mark" among the best known truth, of those there are."""
    best = found.by_target[found.by_target["target"].isin(found.best["truth_id"])]
    return {str(kind): float(sd) for kind, sd in best.groupby("kind")["sd"].median().items()}


def targets_table(by_target: pd.DataFrame) -> pd.DataFrame:
    """A row for each target of which several points are compared; none where that is one target."""
    rows = by_target[by_target["n"] > 1]
    if len(rows) < 2:
        return rows[:0]
    names = load_texts("georeferencing").subjects
    ends = [
        names["too-few"] if math.isnan(low) else f"{low:.2f} to {high:.2f}"
        for low, high in zip(rows["low"], rows["high"], strict=True)
    ]
    return rows.assign(interval=ends, kind=rows["kind"].map(names))


def gained_share(gain: Any) -> float:
    """A gain (`wildlab.evaluation.causes.Gain`) as a share of the error without it."""
    return gain.gain.estimate / gain.without if gain.without > 0 else 0.0


def significant_causes(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The winner's causes that have a parameter which differs from zero; all of them where none has.

    Only these are named: what a fit takes along without being able to tell it from zero is not blamed.
    """
    parameters = set(nonzero(diagnosis.calibration))
    causes = diagnosis.winner.causes
    return tuple(cause for cause in causes if parameters & set(CAUSES[cause])) or causes


def words_of_causes(causes: Sequence[str]) -> str:
    """Causes as they stand in a sentence."""
    names = load_texts("georeferencing").subjects
    return listed([names[cause] for cause in causes])


def cause_message(diagnosis: Diagnosis | None) -> Message:
    """Which constant error explains the errors, by what removing it gains on images it was not fitted to."""
    if diagnosis is None:
        return Message("cause-untried")
    if diagnosis.too_many_out:
        out = int((~diagnosis.inliers).sum())
        return Message("cause-outliers", {"out": out, "points": len(diagnosis.inliers)})
    winner = diagnosis.winner
    share = gained_share(winner.gain)
    if not winner.causes or (not diagnosis.counts and share < WORTH):
        return Message("cause-none")
    causes = significant_causes(diagnosis)
    values = {
        "causes": words_of_causes(causes),
        "share": percent_of(share),
        "without": length(winner.gain.without),
        "with": length(winner.gain.with_),
    }
    if not diagnosis.counts:
        simplest = [diagnosis.models[m].causes for m in simplest_rivals(diagnosis)]
        others = [one for one in simplest if not set(causes) <= set(one)]
        if others:
            common = diagnosis.certain
            own, *rivals = ([one for one in of if one not in common] for of in (causes, *others))
            values |= {
                "common": words_of_causes(common),
                "causes": words_of_causes(own),
                "others": listed([words_of_causes(one) for one in rivals], "or"),
            }
            return Message("cause-common" if common else "cause-inseparable", values)
        return Message("cause-possible", values)
    return Message(
        "cause-most" if share >= MOST else "cause-part" if share >= WORTH else "cause-small", values
    )


def answer(found: Accuracy) -> list[Message]:
    """How far off positions are, and why: the two sentences that answer the page's question."""
    summary, total = found.summary, len(found.scored)
    left_out = not found.scored["best_truth"].all()
    values = {
        "points": summary.n,
        "sd": measure(max(truth_errors(found).values()), "m") if left_out else "",
        "total": total,
        "lost": found.lost,
        "median": length(summary.median),
        "p90": length(summary.p90),
    }
    if not summary.n:
        return [Message("no-position", values)]
    if found.lost > MANY_LOST * total:
        return [Message("many-lost", values)]
    if summary.n < FEW_POINTS:
        return [Message("few-points", values)]
    return [Message("typical-best" if left_out else "typical", values), cause_message(found.diagnosis)]


def possible_share(logged: ErrorSummary, diagnosis: Diagnosis | None) -> float:
    """What taking the cause off may gain, as a share of the mean error; 0 where certain, or too small."""
    if diagnosis is None or not diagnosis.winner.causes:
        return 0.0
    gain = diagnosis.winner.gain.gain.estimate
    return gain / logged.mean if is_possible(gain, logged.mean, certain=diagnosis.counts) else 0.0


def evidence_of(found: Accuracy, problems: int = 0) -> Evidence:
    """What the verdict on the georeferencing follows from; so many things contradict each other."""
    diagnosis, total, gains = found.diagnosis, len(found.scored), []
    if diagnosis is not None and diagnosis.counts:
        gains.append(gained_share(diagnosis.winner.gain))
    if diagnosis is not None and diagnosis.outliers and diagnosis.inliers.any():
        whole, kept = diagnosis.held_summary().mean, diagnosis.held_summary(diagnosis.inliers).mean
        gains.append((whole - kept) / whole if whole > 0 else np.nan)
    return Evidence(
        problems=problems,
        lost=found.lost / total if total else np.nan,
        gain=max((gain for gain in gains if gain == gain), default=np.nan),
        possible=possible_share(found.summary, diagnosis),
        troubled=len(diagnosis.outliers) + diagnosis.misfit if diagnosis is not None else 0,
        points=found.summary.n,
        excess=(found.ellipses.factor,),
        judged=int(diagnosis is not None),
    )


def verdict_of_accuracy(found: Accuracy, problems: int = 0) -> tuple[Verdict, Message]:
    """What the georeferencing comes to, and the most pressing reason; parameters of `evidence_of`."""
    evidence, diagnosis, ellipses = evidence_of(found, problems), found.diagnosis, found.ellipses
    verdict, lost, total = verdict_of(evidence), found.lost, len(found.scored)
    gain = gained_share(diagnosis.winner.gain) if diagnosis is not None and diagnosis.counts else 0.0
    times = 1 / ellipses.factor.estimate if ellipses.factor.estimate > 0 else np.nan
    reasons: tuple[tuple[str, bool, dict[str, Any]], ...] = (
        ("reason-contradictions", problems > 0, {"problems": problems}),
        ("reason-lost", lost > MANY_LOST * total or not found.summary.n, {"lost": lost, "total": total}),
        ("reason-gain", gain >= WORTH, {"share": percent_of(gain)}),
        ("reason-misfit", diagnosis is not None and diagnosis.misfit, {}),
        ("reason-outliers", evidence.troubled > 0, {"outliers": evidence.troubled}),
        ("reason-possible", evidence.possible > 0, {"share": percent_of(evidence.possible)}),
        ("reason-ellipses", ellipses.word == "too small", {}),
        ("reason-ellipses-long", is_conservative(ellipses.factor), {"times": significant(times)}),
        ("reason-few", found.summary.n < FEW_POINTS, {"points": found.summary.n}),
        ("reason-untried", diagnosis is None, {}),
        ("reason-sound", True, {}),
    )
    return next((verdict, Message(key, values)) for key, applies, values in reasons if applies)


def advice(found: Accuracy, *, calibrated_elsewhere: bool, problems: int = 0) -> list[Message]:
    """What to do, the most pressing first, `MOST_ADVICE` at most."""
    diagnosis = found.diagnosis
    said = [Message("advice-contradictions")] if problems else []
    if found.lost > MANY_LOST * len(found.scored):
        said.append(Message("advice-lost"))
    if diagnosis is None:
        return [*said, *([Message("advice-more-points")] if found.summary.n else [])][:MOST_ADVICE]
    if diagnosis.counts and gained_share(diagnosis.winner.gain) >= WORTH:
        said.append(Message("advice-recalibrate" if calibrated_elsewhere else "advice-calibrate"))
    elif diagnosis.rivals and diagnosis.winner.gain.counts and not calibrated_elsewhere:
        said.append(Message("advice-vary"))
    first = next((one for one in diagnosis.outliers if one.kind != "click"), None)
    # What is far out may come of what contradicts itself, or of a constant error that is not certain.
    if first is not None and not problems and not possible_share(found.summary, diagnosis):
        name = first.mark if first.kind == "mark" else first.photo
        values = {"kind": first.kind, "name": str(name), "error": length(first.off_m)}
        said.append(Message("advice-outlier", values))
    return said[:MOST_ADVICE]


def one_heading_hides(found: Accuracy) -> bool:
    """Whether a tilted camera and a shifted position are not separated because all images have one
    heading."""
    d = found.diagnosis
    if d is None or d.counts:
        return False
    causes = {*d.winner.causes, *d.inseparable}
    return bool(causes & {"boresight", "position"}) and on_one_heading(found.observations)


def limits(
    flight: Flight, found: Accuracy, truth: Mapping[str, float], programs: Sequence[str], source: str | None
) -> list[Message]:
    """What the page does not tell: what always holds last, of the others those that apply; five at most."""
    manifest, diagnosis = flight.manifest, found.diagnosis
    rest = beside_zone(manifest.clocks.camera_offset_s)
    by_truth = int((found.points["ground"] == "truth").sum())
    timed = manifest.time.kind == "utc" and "frame_id" not in flight.pose_source(source)[1]
    conditional: tuple[tuple[str, bool, dict[str, Any]], ...] = (
        ("limit-heading", one_heading_hides(found), {}),
        ("limit-misfit", diagnosis is not None and diagnosis.misfit, {}),
        ("limit-extended", diagnosis is not None and diagnosis.extended, {}),
        ("limit-lost", 0 < found.lost <= MANY_LOST * len(found.scored), {"lost": found.lost}),
        ("limit-truth-height", by_truth > 0, {"points": by_truth}),
        ("limit-clock-fitted", manifest.kind != "twin" and abs(rest) > 1e-6, {"offset": f"{rest:+.2f}"}),
        ("limit-nearest", found.visible_m == found.visible_m, {"hidden": length(found.visible_m)}),
        ("limit-track", "track" in truth, {"sd": measure(truth.get("track", np.nan), "m")}),
        ("limit-wander", diagnosis is not None and diagnosis.counts, {}),
        ("limit-unlabelled", bool(programs), {}),
        ("limit-untimed", not timed, {}),
        ("limit-vertical", bool(manifest.vertical.correction_m), {}),
        ("limit-mark", "mark" in truth, {"sd": measure(truth.get("mark", np.nan), "m")}),
        ("limit-marking", True, {}),
        ("limit-ground", True, {}),
    )
    return [Message(key, values) for key, applies, values in conditional if applies][:5]


# -- the page


def span(values: Any) -> str:
    """The range of values without decimals: ``51 to 111``, or one number where both ends are the same."""
    low, high = f"{np.nanmin(values):.0f}", f"{np.nanmax(values):.0f}"
    return low if low == high else f"{low} to {high}"


def show_advice(report: Report, said: Sequence[str]) -> None:
    """What to do, in order; nothing where there is nothing."""
    if said:
        report.section("What to do", part=ADVICE)
        report.points(said, ordered=True)


def count_problems(amiss: Sequence[str]) -> int:
    """How many of what does not fit together are problems."""
    return sum(one.startswith("problem") for one in amiss)


def show_contradictions(report: Report, amiss: Sequence[str]) -> None:
    """What does not fit together in the flight: these sentences hold no coordinates, but names of targets."""
    if amiss:
        report.alert("What does not fit together", amiss)


def show_accuracy(
    report: Report,
    flight: Flight,
    found: Accuracy,
    *,
    programs: Mapping[str, pd.DataFrame],
    unlabelled: Sequence[str],
    amiss: Sequence[str],
    applied: Sequence[Fact] = (),
    source: str | None = None,
    pictures: Mapping[int, NDArray[Any]] | None = None,
) -> None:
    """Write the page.

    Parameters
    ----------
    report
        Is added to.
    flight, found
        The flight, and what its points are worth.
    programs
        Answers of other programs that the flight has, scored, by name.
    unlabelled
        Programs whose answers name no target.
    amiss
        What does not fit together in the flight: `wildlab.flight.checks.check.sense_sentences`.
    applied
        Facts on the calibration of another flight that was applied.
    source
        Name of the poses' ``nav`` table; None for the flight's own.
    pictures
        The worst images, (H, W) or (H, W, 3), by the row of `worst_sightings`, as far as they are at hand.
    """
    texts, shown = load_texts("georeferencing"), flight.manifest.locations.sensitivity == "open"
    programs = named(programs, "program", shown=shown)
    others = record_accuracy(report, found, programs)
    by_name = {str(name): rows for name, rows in found.scored.groupby("group") if name}
    ordered = dict(sorted(by_name.items(), key=lambda one: (len(one[0]), one[0])))
    groups = named(ordered, "part", shown=shown)
    for name, part in groups.items():
        record_errors(report, f"logged-pose/{name}", part)
    wording = Wording(report, texts)
    report.head(texts.subjects["question"], _subtitle(flight, found))
    problems = count_problems(amiss)
    wording.summary(answer(found), *verdict_of_accuracy(found, problems), "georeferencing")
    remedies = advice(found, calibrated_elsewhere=bool(applied), problems=problems)
    show_advice(report, wording.messages(remedies))
    if applied:
        report.text(" ".join(words("georeferencing", applied)))
    show_contradictions(report, amiss)
    logged, diagnosis = found.summary, found.diagnosis
    corrections = (
        parameters_table(report, diagnosis.calibration) if diagnosis and diagnosis.winner.causes else None
    )
    if logged.n:
        report.tiles(_tiles(found, texts))
        _figures(report, wording, found, programs)
        report.section(texts.subjects["where"])
        worst = worst_images(found.best)
        wording.figure("error-map", error_map(found.best, list(worst["image"])))
        wording.table("worst", worst)
        if pictures:
            wording.figure("worst-pictures", sightings_chart(worst_sightings(flight, found.best), pictures))
        rows = {texts.subjects["applied" if applied else "logged"]: logged}
        rows |= _other_summaries(found, texts)
        rows |= {texts.subjects["recorded"].format(program): one for program, one in others.items()}
        errors = pd.DataFrame([{"pose": name, **summary._asdict()} for name, summary in rows.items()])
        wording.table("errors", errors)
        wording.table("targets", targets_table(found.by_target))
        report.published(texts.subjects["published"], texts.subjects, {})
    if diagnosis is not None:
        if corrections is not None and (diagnosis.counts or possible_share(logged, diagnosis)):
            wording.table("parameters" if diagnosis.counts else "parameters-possible", corrections)
        wording.table("outliers", outliers_table(diagnosis.outliers))
    if logged.n:
        report.section(
            "Predicted uncertainty", " ".join(wording.messages([_ellipse_message(found.ellipses)]))
        )
    report.limits(wording.messages(limits(flight, found, truth_errors(found), unlabelled, source)))
    report.section("Details")
    if groups and logged.n:
        wording.table("groups", groups_table(groups))
    show_models(report, wording, diagnosis)
    if diagnosis is not None:
        wording.table("noise", noise_table(diagnosis.noise, found.assumed))
    report.method(texts.method)


def show_models(report: Report, wording: Wording, diagnosis: Diagnosis | None) -> None:
    """The constant errors that were tried, folded away, with the pairs that cannot be told apart."""
    if diagnosis is None:
        return
    names = wording.texts.subjects
    pairs = "; ".join(f"{names[one]} / {names[other]}" for one, other in diagnosis.alike)
    blocks = str(int(diagnosis.blocks.max()) + 1)
    wording.table("models", models_table(diagnosis), {"pairs": pairs or "–", "blocks": blocks})


def _subtitle(flight: Flight, found: Accuracy) -> str:
    scored = found.scored
    views = ""
    if found.summary.n:
        placed = found.points["detection_id"].isin(scored["detection_id"]).to_numpy() & np.isfinite(
            found.points["north_m"]
        )
        poses = found.observations.poses
        height = (found.observations.plane_down - poses.p_nb[:, 2])[placed]
        depression = np.degrees(np.arcsin(np.clip(poses.R_nc[placed, 2, 2], -1, 1)))
        names = load_texts("georeferencing").subjects
        ground = listed([names[f"ground-{one}"] for one in found.points.loc[placed, "ground"].unique()])
        views = f"{span(height)} m above {ground}, camera {span(depression)}° below the horizon, "
    rule = (
        "its known position" if flight.manifest.scoring.rule == "labelled" else "the nearest known position"
    )
    return f"{scored['frame_id'].nunique()} images, {views}{len(scored)} points, each against {rule}"


def _tiles(found: Accuracy, texts: PageTexts) -> list[tuple[str, str]]:
    logged, diagnosis, names = found.summary, found.diagnosis, texts.subjects
    interval = found.intervals.get("horizontal_error_mean")
    again = f" ({f'{length(interval[0])} to {length(interval[1])}' if interval else names['too-few']})"
    shown = [
        (length(logged.mean), names["tile-mean"] + again),
        (length(logged.p90), names["tile-p90"]),
    ]
    if diagnosis is not None and diagnosis.counts:
        shown.append((length(diagnosis.held_summary().mean), names["tile-corrected"]))
    coverage = found.ellipses.coverage
    if np.isfinite(coverage.estimate):
        ends = (
            f" ({percent_of(coverage.low)} to {percent_of(coverage.high)})"
            if np.isfinite(coverage.low)
            else ""
        )
        shown.append((percent_of(coverage.estimate), names["tile-ellipses"] + ends))
    return shown[:4]


def _other_summaries(found: Accuracy, texts: PageTexts) -> dict[str, ErrorSummary]:
    """Errors with the cause taken off, and without outliers."""
    diagnosis, rows = found.diagnosis, {}
    if diagnosis is not None and diagnosis.counts:
        rows[texts.subjects["corrected"]] = diagnosis.held_summary()
    if diagnosis is not None and diagnosis.outliers:
        rows[texts.subjects["inliers"]] = diagnosis.held_summary(diagnosis.inliers)
    return rows


def _ellipse_message(verdict: EllipseVerdict) -> Message:
    factor = verdict.factor
    values = {
        "inside": percent_of(verdict.coverage.estimate),
        "n": verdict.n,
        "factor": significant(factor.estimate),
        "low": significant(factor.low),
        "high": significant(factor.high),
    }
    return Message(f"ellipses-{verdict.word.replace(' ', '-')}", values)


def _figures(report: Report, wording: Wording, found: Accuracy, programs: Mapping[str, pd.DataFrame]) -> None:
    errors, diagnosis, names = errors_of(found.best), found.diagnosis, wording.texts.subjects
    series = {names["logged"]: (errors, colour("logged-pose"))}
    if diagnosis is not None and diagnosis.counts:
        held = diagnosis.winner.held[diagnosis.scored["best_truth"]]
        series[names["corrected"]] = (held, colour("calibrated-pose"))
    for program, table in programs.items():
        series[names["recorded"].format(program)] = (errors_of(best_known(table)), colour("recorded"))
    wording.figure("error-scatter", error_scatter(errors, colour("logged-pose")), main=True)
    report.figures(
        [
            wording.captioned("error-shares", error_shares(series)),
            wording.captioned("errors-by-image", errors_by_image(found.best)),
        ]
    )


#: Ellipses whose size is off by less than this factor fit the spread.
FITTING = 1.25
#: Rows of the table of things.
MOST_THINGS = 20


def answer_repeats(found: Repeats) -> Message:
    """How far apart sightings lie, and whether the ellipses fit that."""
    spread, total = found.spread, len(found.points)
    values: dict[str, Any] = {"lost": found.lost, "total": total}
    if found.lost > MANY_LOST * total:
        return Message("many-lost", values)
    if spread is None:
        return Message("none-twice", values)
    values |= {
        "scatter": length(spread.sd),
        "sightings": spread.sightings,
        "things": spread.things,
        "ratio": significant(spread.consistent),
    }
    if math.isnan(spread.consistent) or spread.sightings < FEW_POINTS:
        return Message("scatter", values)
    if spread.consistent > FITTING:
        return Message("ellipses-small", values)
    return Message("ellipses-large" if spread.consistent < 1 / FITTING else "ellipses-fit", values)


def verdict_of_repeats(found: Repeats, problems: int = 0) -> tuple[Verdict, Message]:
    """What it comes to, and why: never sound, for the errors themselves are not known."""
    total = len(found.points)
    word = verdict_of(Evidence(problems=problems, lost=found.lost / total if total else math.nan))
    if problems:
        return word, Message("reason-contradictions", {"problems": problems})
    if word == Verdict.MEND:
        return word, Message("reason-lost", {"lost": found.lost, "total": total})
    return word, Message("reason-unknown")


def show_repeats(report: Report, flight: Flight, found: Repeats, amiss: Sequence[str]) -> None:
    """Write the page, and record its numbers.

    Parameters
    ----------
    report
        Is added to.
    flight, found
        The flight, and its sightings.
    amiss
        What does not fit together in the flight: `wildlab.flight.checks.check.sense_sentences`.
    """
    texts = load_texts("repeat-sightings")
    wording = Wording(report, texts)
    spread, diagnosis, total = found.spread, found.diagnosis, len(found.points)
    images = found.points["frame_id"].nunique()
    report.head(texts.subjects["question"], f"{images} images, {total} points, no truth")
    word, reason = verdict_of_repeats(found, count_problems(amiss))
    said = wording.messages([answer_repeats(found)])
    cause = Wording(report, load_texts("georeferencing"))
    if diagnosis is not None and spread is not None:
        said += cause.messages([cause_message(diagnosis)])
    report.summary(said, level=word.colour, verdict=(word.value, wording.messages([reason])[0]))
    report.metric(VERDICT_LEVEL, "georeferencing", word.level, "1")
    show_contradictions(report, amiss)
    if spread is not None:
        report.metric("sighting_spread", "logged-pose", spread.sd, "m", n=spread.sightings)
        report.metric("sighting_consistency", "logged-pose", spread.consistent, "1", n=spread.sightings)
        report.tiles(
            [
                (length(spread.sd), texts.subjects["tile-scatter"]),
                (f"{spread.things} of {len(found.things)}", texts.subjects["tile-things"]),
                (f"{found.lost} of {total}", texts.subjects["tile-lost"]),
            ]
        )
        wording.table("things", found.things.head(MOST_THINGS))
    if diagnosis is not None:
        gain = diagnosis.winner.gain.gain
        n = len(diagnosis.scored)
        report.metric("sighting_gain", "winner", gain.estimate, "m", n=n, low=gain.low, high=gain.high)
        if diagnosis.winner.causes:
            cause.table("parameters", parameters_table(report, diagnosis.calibration))
    report.limits([wording.say(one) for one in texts.limits])
    report.section("Details")
    show_models(report, cause, diagnosis)
    report.method(texts.method)
