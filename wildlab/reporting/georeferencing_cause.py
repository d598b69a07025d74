"""What the report on single images says of the cause: words that follow from a measured gain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.diagnosis import CAUSES, Diagnosis
from wildlab.analysis.overviews.recommendations import is_possible
from wildlab.analysis.overviews.verdict import MANY_LOST, WORTH, Evidence
from wildlab.evaluation.axes import AlongAxis
from wildlab.evaluation.blocks import Neighbours
from wildlab.evaluation.causes import Gain
from wildlab.evaluation.ellipses import EllipseVerdict
from wildlab.evaluation.errors import ErrorSummary
from wildlab.geometry.calibration import BORESIGHT, PARAMETERS, Calibration
from wildlab.reporting.report import Report

#: A gain below this share of the error is called small, and above half of it most of the error.
SMALL, MOST = WORTH, 0.5
#: Rows of the table of models.
SHOWN = 8
#: Of each parameter: what it is called, its unit and how many of that are one.
_PARAMETERS = {
    "roll": ("camera's roll", "deg", 180 / np.pi),
    "tilt": ("camera's tilt", "deg", 180 / np.pi),
    "pan": ("camera's pan", "deg", 180 / np.pi),
    "heading": ("heading", "deg", 180 / np.pi),
    "clock": ("camera's clock", "s", 1.0),
    "down": ("position, down", "m", 1.0),
    "north": ("position, north", "m", 1.0),
    "east": ("position, east", "m", 1.0),
    "focal": ("focal lengths", "%", 100.0),
    "aspect": ("ratio of the focal lengths", "%", 100.0),
    "centre_u": ("principal point, right", "px", 1.0),
    "centre_v": ("principal point, down", "px", 1.0),
    "radial": ("radial distortion k1", "1", 1.0),
}
_CAUSES = {
    "position": "the position (north and east)",
    "height": "the height",
    "boresight": "the boresight (how the camera sits on the airframe)",
    "heading": "the heading",
    "clock": "the camera's clock",
    "focal length": "the focal length",
    "focal lengths": "the focal lengths",
    "lens": "the lens (focal lengths and principal point)",
    "distortion": "the radial distortion",
}
#: What a list of all that was tried calls them.
_SHORT = {"focal length": "lens", "focal lengths": "lens", "distortion": "lens", "clock": "camera's clock"}


def listed(parts: Sequence[str], last: str = "and") -> str:
    """``a, b and c``."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def causes_in_words(causes: Sequence[str]) -> str:
    """Causes as they stand in a sentence."""
    return listed([_CAUSES[cause] for cause in causes])


def causes_told(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The winner's causes that have a parameter told from zero; all of them where none has.

    Only these are named: what a fit takes along without being able to tell it from zero is not blamed.
    """
    told = {name for name in diagnosis.calibration.names if _told(diagnosis.calibration, name)}
    causes = diagnosis.winner.causes
    return tuple(cause for cause in causes if told & set(CAUSES[cause])) or causes


def _told(calibration: Calibration, name: str) -> bool:
    """Whether the interval of a parameter leaves zero out."""
    low, high = calibration.interval(name)
    return bool(low > 0 or high < 0)


def metres(value: float, low: float | None = None, high: float | None = None) -> str:
    """``4.3 m``, or with its interval ``4.3 m (3.9 to 4.8)``."""
    digits = 1 if not abs(value) < 0.95 else 2
    if low is None or high is None or not np.isfinite([low, high]).all():
        return f"{value:.{digits}f} m"
    return f"{value:.{digits}f} m ({low:.{digits}f} to {high:.{digits}f})"


def evidence_of(
    logged: ErrorSummary,
    lost: int,
    ellipses: EllipseVerdict,
    diagnosis: Diagnosis | None,
    amiss: Sequence[str] = (),
) -> Evidence:
    """What the verdict on the georeferencing follows from.

    Parameters
    ----------
    logged, lost
        Errors of the points that have a position, and how many have none.
    ellipses, diagnosis
        As `wildlab.analysis.accuracy.judge_accuracy` found them; None: nobody could look for a cause.
    amiss
        What does not fit together in the flight: `wildlab.flight.checks.sense.sense.sense_sentences`.

    Returns
    -------
    Evidence
    """
    total = logged.n + lost
    gains = []
    if diagnosis is not None and diagnosis.counts:
        gains.append(gained_share(diagnosis.winner.gain))
    if diagnosis is not None and diagnosis.outliers and diagnosis.inliers.any():
        whole, kept = diagnosis.held_summary().mean, diagnosis.held_summary(diagnosis.inliers).mean
        gains.append((whole - kept) / whole if whole > 0 else float("nan"))
    return Evidence(
        problems=sum(one.startswith("problem") for one in amiss),
        lost=lost / total if total else float("nan"),
        gain=max((gain for gain in gains if gain == gain), default=float("nan")),
        possible=possible_share(logged, diagnosis),
        troubled=len(diagnosis.outliers) if diagnosis is not None else 0,
        points=logged.n,
        excess=(ellipses.factor,),
        judged=int(diagnosis is not None),
    )


def possible_share(logged: ErrorSummary, diagnosis: Diagnosis | None) -> float:
    """What taking the cause off may gain, as a share of the mean error; 0 where certain, or too small."""
    if diagnosis is None or not diagnosis.winner.causes:
        return 0.0
    gain = diagnosis.winner.gain.gain.estimate
    return gain / logged.mean if is_possible(gain, logged.mean, certain=diagnosis.counts) else 0.0


def amiss_sentence(amiss: Sequence[str]) -> str:
    """That the flight does not make sense, where a problem and not only a warning says so."""
    problems = sum(one.startswith("problem") for one in amiss)
    if not problems:
        return ""
    what = "one thing does" if problems == 1 else f"{problems} things do"
    return f"The logs of this flight contradict each other: {what} not fit. Mend that first."


def gained_share(gain: Gain) -> float:
    """Gain as a share of the error without."""
    return gain.gain.estimate / gain.without if gain.without > 0 else 0.0


def lost_sentence(lost: int, total: int) -> str:
    """How many points have no position, with their denominator; nothing where none is lost."""
    if not lost:
        return ""
    if lost == total:
        return (
            f"None of the {total} points has a position: no ray of theirs has a pose and meets the ground. "
            "Where the camera looks, the signs of roll and pitch and the height of the ground come first. "
            "`wildlab check` looks at them."
        )
    first = f"{lost} of {total} points ({100 * lost / total:.0f} %) have no position on the ground"
    if lost > MANY_LOST * total:
        return f"{first}: that is too many to trust the figures of the others."
    return f"{first}; they are in no figure below."


def cause_sentence(diagnosis: Diagnosis) -> str:
    """What taking a constant error off gained on images it was not estimated from."""
    winner, gain = diagnosis.winner, diagnosis.winner.gain
    if diagnosis.too_many_out:
        return (
            f"No cause is certain: {int((~diagnosis.inliers).sum())} of {len(diagnosis.inliers)} points are "
            "far out, and which ones are depends on which are believed. Look at these first."
        )
    if not winner.causes:
        certain = [model for model in diagnosis.models if model.causes and model.gain.counts]
        if certain:
            least = min(certain, key=lambda model: (len(model.fit.names), model.gain.with_))
            some = f"{least.gain.gain.low:.2f} to {least.gain.gain.high:.2f} m"
            return (
                f"No constant error stands out: {causes_in_words(least.causes)} taken off gains {some} on "
                "images that it was not estimated from, which errors that wander explain as well."
            )
        causes = {_SHORT.get(one, one) for model in diagnosis.models for one in model.causes}
        if not causes:
            return "No constant error could be tried: these images do not tell one from another."
        tried = listed(sorted(causes), "or")
        return (
            f"No constant error is certain: taking one off ({tried}) gains nothing for certain on images "
            "that it was not estimated from."
        )
    told = causes_told(diagnosis)
    what, it = causes_in_words(told), "it"
    if others := _others(diagnosis):
        what += f" or, explaining it as well, of {listed([causes_in_words(one) for one in others], 'or')}"
        it = "the first"
    digits = 1 if min(gain.without, gain.with_) >= 0.95 and abs(gain.gain.estimate) >= 0.95 else 2
    low, high = f"{gain.gain.low:.{digits}f}", f"{gain.gain.high:.{digits}f}"
    figures = (
        f"with {it} taken off, the {_measure(diagnosis)} goes from {gain.without:.{digits}f} to "
        f"{gain.with_:.{digits}f} m on images that it was not estimated from (gain {low} to {high} m"
        f"{_with_far_out(diagnosis)})"
    )
    if unsure := [cause for cause in winner.causes if cause not in told]:
        figures += f"; fitted with it, {causes_in_words(unsure)} could not be told from zero"
    if diagnosis.implausible:
        figures += (
            f"; {causes_in_words(diagnosis.implausible[0].causes)} would fit better, with a correction "
            "larger than is plausible: look at camera, mount and heights"
        )
    if not diagnosis.counts and gained_share(gain) < SMALL:
        return f"No constant error is certain to explain it. The nearest is one of {what}: {figures}."
    if not diagnosis.counts:
        return f"A constant error of {what} is possible, not certain: {figures}."
    share = gained_share(gain)
    if share >= MOST:
        return f"Most of it is a constant error of {what}: {figures}."
    if share >= SMALL:
        return f"Part of it is a constant error of {what}: {figures}."
    return f"A constant error of {what} is certain and small: {figures}."


def _measure(diagnosis: Diagnosis) -> str:
    """What is gained in: the error, or, where places are not known, how far apart sightings are."""
    known = diagnosis.places_known
    return "mean error" if known else "mean distance of a sighting to the others of the same thing"


def _with_far_out(diagnosis: Diagnosis) -> str:
    """How many points a gain leaves out, and what it is with them; nothing where it leaves none out."""
    out = int((~diagnosis.inliers).sum())
    if not out:
        return ""
    one = diagnosis.winner.gain_of_all.gain
    points = f"the {out} points that are" if out > 1 else "the one point that is"
    return f"; without {points} far out, with {'them' if out > 1 else 'it'} {one.low:.2f} to {one.high:.2f} m"


def simplest_rivals(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Causes of the rivals that hold no other rival, the two of the least held-out error at most."""
    rivals = [one for one in diagnosis.rivals if one.causes and one.causes != diagnosis.winner.causes]
    simple = [one for one in rivals if not any(set(other.causes) < set(one.causes) for other in rivals)]
    return [one.causes for one in sorted(simple, key=lambda one: one.gain.with_)][:2]


def _others(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Rivals that explain it by something else: one that holds all that is named does not."""
    told = set(causes_told(diagnosis))
    return [one for one in simplest_rivals(diagnosis) if not told <= set(one)]


def neighbours_sentence(neighbours: Neighbours) -> str:
    """That images which follow each other stay wrong alike with the cause taken off; nothing where not."""
    if not neighbours.alike:
        return ""
    return (
        "Images that follow each other are still wrong alike with it taken off (correlation "
        f"{neighbours.correlation:.2f} of {neighbours.images} images), "
        "and the gain may be that of this flight alone."
    )


def size_sentence(calibration: Calibration, counts: bool) -> str:
    """The corrections whose interval leaves zero out, with it; nothing where there is none.

    ``counts``: whether taking them off gained something for certain.
    """
    parts = []
    for name in calibration.names:
        label, unit, scale = _PARAMETERS[name]
        low, high = (scale * end for end in calibration.interval(name))
        if low > 0 or high < 0:
            digits = {"1": 3, "deg": 2, "s": 2, "%": 2}.get(unit, 1)
            size = _with_unit(f"{scale * calibration.value(name):+.{digits}f}", unit)
            parts.append(f"{label} {size} ({low:+.{digits}f} to {high:+.{digits}f})")
    said = "What is to be added" if counts else "Not to be added unless another flight confirms it"
    return f"{said}: {listed(parts)}." if parts else ""


def _with_unit(number: str, unit: str) -> str:
    """``-5.00 °``; a number without a unit stands alone."""
    return number if unit == "1" else f"{number} {unit.replace('deg', '°')}"


def ambiguity_sentence(diagnosis: Diagnosis, unambiguous: Diagnosis | None) -> str:
    """That the cause hangs on clicks that may be of another mark; nothing where it does not."""
    if unambiguous is None or unambiguous.winner.causes == diagnosis.winner.causes:
        return ""
    return (
        "The cause hangs on clicks that may be of another mark: without them the verdict is "
        f"{unambiguous.winner.name!r}. Record which mark was clicked before you correct anything."
    )


def advice(diagnosis: Diagnosis, learnt_here: bool) -> str:
    """What to do, by the measured gain and by what is far out."""
    said = []
    first = next((one for one in diagnosis.outliers if one.kind != "click"), None)
    if first is not None:
        what = f"mark {first.mark}" if first.kind == "mark" else f"photo {first.photo}"
        said.append(f"Look at {what} first: it is {metres(first.off_m)} off where the others are not.")
    if diagnosis.counts and gained_share(diagnosis.winner.gain) >= SMALL:
        said.append(
            "Keep it with `wildlab calibrate`, and judge it on another flight with `--calibration`."
            if learnt_here
            else "The calibration that was applied leaves this in: it has no correction of it, or does not "
            "hold for this flight. Look for what changed."
        )
    elif diagnosis.rivals and diagnosis.winner.gain.counts and learnt_here:
        said.append(
            "Images from other heights, speeds and directions would tell which of these it is; there the "
            "wrong one, taken off, does harm."
        )
    elif diagnosis.counts and not said:
        said.append("It hardly matters: other things limit this flight.")
    return " ".join(said)


def alike_sentences(diagnosis: Diagnosis) -> list[str]:
    """Which causes the data cannot tell from the one that won, or from each other."""
    winner = set(diagnosis.winner.causes)
    said = [
        f"Explains it as well: {causes_in_words(rival.causes)} "
        f"({rival.gain.with_:.2f} m on images that it was not estimated from)."
        for rival in diagnosis.rivals
        if rival.causes
    ]
    for one, other in diagnosis.alike:
        if winner and not winner & {one, other}:
            continue
        said.append(f"These images cannot tell {_CAUSES[one]} from {_CAUSES[other]}.")
    # A cause that did not win was fitted to errors that it does not explain: what it lost says little.
    of = [diagnosis.winner] if winner else [m for m in diagnosis.models if len(m.causes) == 1]
    lost = {name: partners for model in of for name, partners in model.fit.undetermined.items()}
    for name, partners in lost.items():
        label = _PARAMETERS[name][0]
        if partners:
            others = listed([_PARAMETERS[p][0] for p in partners])
            said.append(f"These images cannot tell the {label} from the {others}; it was left as it is.")
        else:
            _, unit, scale = _PARAMETERS[name]
            usual = _with_unit(f"{scale * PARAMETERS[name]:g}", unit)
            said.append(
                f"An error of the {label} of {usual} would not show in these images; it was left as it is."
            )
    return said


def models_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """The most likely models, and nothing."""
    shown = [m for m in np.argsort(diagnosis.ranked.scores, kind="stable")][:SHOWN]
    shown += [m for m in (diagnosis.ranked.winner, 0) if m not in shown]
    rows = []
    for m in shown:
        model = diagnosis.models[m]
        gain = model.gain.gain
        rows.append(
            {
                "what": f"**{model.name}**" if m == diagnosis.ranked.winner else model.name,
                "parameters": len(model.fit.names),
                "error": model.gain.with_,
                "gain": gain.estimate if model.causes else np.nan,
                "interval": f"{gain.low:.2f} to {gain.high:.2f}" if model.causes else "",
            }
        )
    return pd.DataFrame(rows)


def parameters_table(report: Report, calibration: Calibration) -> pd.DataFrame:
    """Estimated corrections with their 95 % intervals, one row each; recorded as metrics too."""
    rows = []
    for name in calibration.names:
        label, unit, scale = _PARAMETERS[name]
        value, (low, high) = scale * calibration.value(name), (scale * x for x in calibration.interval(name))
        metric = f"boresight_{name}" if name in BORESIGHT else f"{name}_offset"
        report.metric(metric, "calibration", value, unit, n=calibration.n_images, low=low, high=high)
        zero, digits = low <= 0 <= high, 3 if unit == "1" else 2
        rows.append(
            {
                "what": label if unit == "1" else f"{label} ({unit})",
                "value": value,
                "interval": f"{low:+.{digits}f} to {high:+.{digits}f}",
                "verdict": "not told from zero" if zero else "differs from zero",
            }
        )
    return pd.DataFrame(rows)


def axes_table(axes: dict[str, AlongAxis]) -> pd.DataFrame:
    """Mean error along each axis."""
    rows = [
        {
            "axis": name,
            "mean": one.mean.estimate,
            "interval": f"{one.mean.low:+.1f} to {one.mean.high:+.1f}",
            "share": 100 * one.share,
            "verdict": "lasting" if one.constant else "negligible" if one.told else "not told from zero",
        }
        for name, one in axes.items()
    ]
    return pd.DataFrame(rows)
