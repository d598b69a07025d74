"""What the report on single images says of what is left: outliers, averages, parts of the error, ellipses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wildlab.evaluation.blocks import Halves, Neighbours
from wildlab.evaluation.ellipses import EllipseVerdict
from wildlab.evaluation.errors import ErrorSummary, Scatter
from wildlab.evaluation.outliers import Outlier
from wildlab.evaluation.sightings import Averaged
from wildlab.reporting.georeferencing_cause import causes_in_words, listed, metres
from wildlab.reporting.known_positions import EXACT, KnownPositions, also_own_error


def outliers_table(outliers: Sequence[Outlier]) -> pd.DataFrame:
    """What is far out, largest first."""
    rows = [
        {
            "kind": {"click": "one click"}.get(one.kind, one.kind),
            "photo": one.photo or "several",
            "mark": one.mark or ("several" if one.kind == "photo" else "not known"),
            "points": one.points,
            "off": one.off_m,
        }
        for one in outliers
    ]
    return pd.DataFrame(rows)


def outliers_sentence(outliers: Sequence[Outlier], with_: ErrorSummary, without: ErrorSummary) -> str:
    """What the figures are without what is far out."""
    count = len(outliers)
    left = with_.n - without.n
    kinds = [f"{n} {kind}{'' if n == 1 else 's'}" for kind, n in _counted(outliers).items()]
    return (
        f"{listed(kinds)} {'is' if count == 1 else 'are'} far out where the others are not. Without "
        f"{'it' if count == 1 else 'them'} ({left} of {with_.n} points) the mean error is "
        f"{metres(without.mean)} in place of {metres(with_.mean)}, and the largest {metres(without.max)} in "
        f"place of {metres(with_.max)}. A wrong mark, a wrong pose and a wrong click look alike where "
        "only one point shows it."
    )


def _counted(outliers: Sequence[Outlier]) -> dict[str, int]:
    kinds = [one.kind for one in outliers]
    return {kind: kinds.count(kind) for kind in ("mark", "photo", "click") if kind in kinds}


def halves_sentence(halves: Halves) -> str:
    """That first and second half disagree; nothing where they do not."""
    if not halves.disagree:
        return ""
    low, high = halves.difference.low, halves.difference.high
    return (
        f"The two halves of the flight disagree: the mean error is {metres(halves.first)} in the first and "
        f"{metres(halves.second)} in the second (difference {low:+.1f} to {high:+.1f} m), so something "
        "changed on the way, and no one figure stands for both."
    )


def averaging_sentence(averaged: Averaged | None) -> str:
    """What averaging gained where it was tried; nothing where it could not be."""
    if averaged is None:
        return ""
    tried = (
        f"Averaging {averaged.k} images was tried on {averaged.things} marks: the mean error goes from "
        f"{metres(averaged.single)} to {metres(averaged.averaged)}"
    )
    if averaged.halves:
        return f"{tried}, which halves it."
    return f"{tried}." if averaged.helps else f"{tried}, which is no certain gain."


def remaining_sentence(scatter: Scatter, taken_off: Sequence[str]) -> str:
    """In which unit the parts of the error are given, and how large it is; nothing where it has none."""
    if not np.isfinite(scatter.whole_m):
        return ""
    off = f" with {causes_in_words(taken_off)} taken off" if taken_off else ""
    return (
        f"Points are off by {metres(scatter.whole_m)} (root mean square){off}. The parts are root mean "
        "squares in metres too; their squares, which are estimates, add up to about its square."
    )


def remaining_parts(
    scatter: Scatter, known: KnownPositions = EXACT, neighbours: Neighbours | None = None
) -> list[str]:
    """What the rest of the error is made of, in metres, largest first; nothing where it cannot be told.

    ``known``: what the errors were held against; ``neighbours``: how alike images are that follow each other,
    as far as that is known.
    """
    if not np.isfinite(scatter.whole_m):
        return []
    bias, image, within = scatter.parts_m
    parts = [
        (
            image,
            f"**The pose of each image**, {metres(image)}, that all points of an image "
            f"share{_next_image(neighbours)}.",
        ),
        (
            within,
            f"**Single points**, {metres(within)}, that differs from point to point in an image: marking, "
            f"lens, uneven ground{also_own_error(known)}.",
        ),
        (bias, f"**The same in north and east for all images**, {metres(bias)}."),
    ]
    return [text for _, text in sorted(parts, key=lambda part: -part[0])]


def _next_image(neighbours: Neighbours | None) -> str:
    """Whether the next image shares what an image has in common, as measured; nothing where it was not."""
    if neighbours is None or not np.isfinite(neighbours.correlation):
        return ""
    if neighbours.alike:
        return f", and in part the next image too (correlation {neighbours.correlation:.2f})"
    return " and the next image does not"


def coverage_words(verdict: EllipseVerdict) -> str:
    """Share of the ellipses that hold the truth, with its interval: ``88 % (83 to 92)``."""
    share, low, high = (100 * one for one in verdict.coverage[:3])
    return f"{share:.0f} %" + (f" ({low:.0f} to {high:.0f})" if np.isfinite(low + high) else "")


def ellipse_sentence(verdict: EllipseVerdict) -> str:
    """Whether the ellipses are honest, and how much larger they should be."""
    stated, inside = f"{100 * verdict.stated:.0f} %", coverage_words(verdict)
    f = verdict.factor
    held = f"The {stated} ellipses hold the truth in {inside} of {verdict.n} cases"
    span = f"{f.low:.1f} to {f.high:.1f}"
    if verdict.word == "too small":
        return (
            f"**Too small**: do not use these ellipses. {held}; their axes should be {f.estimate:.1f} times "
            f"as long ({span})."
        )
    if verdict.word == "too large":
        return f"**Too large**: {held}; axes {f.estimate:.1f} times as long ({span}) would do."
    if verdict.word == "honest":
        return (
            f"**Honest**: {held}; the right length of their axes is {f.estimate:.1f} times theirs ({span})."
        )
    if verdict.word == "undecided":
        return f"**Not decided**: {held}, and the right length of their axes may be {span} times theirs."
    return f"**Too few images to tell**: {held}."


def nearest_sentences(share: float, visible_m: float, p90: float) -> list[str]:
    """What the rule of the nearest mark hides."""
    hidden = [
        "Which mark was clicked is not recorded, and each click is held against the nearest one. An error "
        f"beyond about {metres(visible_m)}, half the spacing of the marks, goes to another mark and "
        "looks small."
    ]
    if p90 > 0.7 * visible_m:
        hidden.append(
            "Errors here are of that size: the true ones may be larger than every figure on this page."
        )
    if share > 0:
        hidden.append(
            f"{100 * share:.0f} % of the clicks are ambiguous: the second nearest mark is not clearly "
            "farther off."
        )
    return hidden
