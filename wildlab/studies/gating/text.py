"""What the report on gating, H 6.4.3, says: every sentence and title follows from the numbers it is given."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.evaluation.replication import Comparison
from wildlab.studies.gating.monte_carlo import FORMS, GATES, Gated, Outcome
from wildlab.studies.gating.readings import DEFAULT, READINGS, STRESS
from wildlab.studies.gating.variations import standard_error

Array = NDArray[np.float64]

NAMES = {
    "position": "position",
    "pixels": "pixels",
    "angles": "azimuth and elevation",
    "both": "pixels and angles together",
}
#: Less than this share of right associations (per cent) is mostly wrong.
MOSTLY_WRONG = 50.0


class Lead(NamedTuple):
    """Mean of a difference, run by run, and twice its standard error; percentage points."""

    mean: float
    twice: float

    @property
    def beyond_chance(self) -> bool:
        """Whether it is further from zero than twice its standard error."""
        return abs(self.mean) > self.twice


def lead_of(one: Array, other: Array) -> Lead:
    """By how much one gate is right more often than another, over the same runs (N,)."""
    return Lead(float(np.mean(one - other)), 2 * standard_error(one - other))


def mean_rates(rates: Array) -> dict[str, float]:
    """Mean success rate (%) of each of `GATES`; ``rates`` (4, runs)."""
    return dict(zip(GATES, (float(each) for each in rates.mean(axis=1)), strict=True))


def range_of(values: Iterable[float], decimals: int = 1) -> str:
    """Lowest to highest, or the one number where they are the same when written."""
    known = [float(value) for value in values]
    low, high = (f"{pick(known):.{decimals}f}" for pick in (min, max))
    return low if low == high else f"{low} to {high}"


# --- beside the print


def judged_words(verdicts: Mapping[str, Comparison]) -> str:
    """Whether each rate is close to the published one, and within chance of it; a sentence."""
    return "; ".join(f"{form}: {one.words}" for form, one in verdicts.items()) + "."


def beside_print_words(table: pd.DataFrame) -> str:
    """Which published rates a table of `tables.rates_table` differs from by more than chance; a sentence."""
    known = table[table["beyond"] != ""]
    apart = known[known["beyond"] == "yes"]
    if apart.empty:
        return "No rate differs from the published one by more than chance (twice both standard errors)."
    named = ", ".join(f"{row['form']} ({signed(row['difference'], 2)})" for _, row in apart.iterrows())
    return (
        f"By more than chance (twice both standard errors), {len(apart)} of {len(known)} rates differ from "
        f"the published ones: {named} percentage points."
    )


def order_words(rates: Array, published: Mapping[str, float]) -> str:
    """Which form is right most often and which least, by how much, here and in the thesis; a sentence."""
    best, worst, lead = _ends(rates)
    printed = sorted(FORMS, key=lambda form: published[form])
    apart = published[printed[-1]] - published[printed[0]]
    theirs = f"in the print it is {NAMES[printed[-1]]} before {NAMES[printed[0]]} by {apart:.1f}"
    if not lead.beyond_chance:
        return f"No way of measuring the distance is better than another by more than chance; {theirs}."
    ours = f"It is picked most often by {NAMES[best]}, least by {NAMES[worst]}, {lead.mean:.1f} points apart"
    return f"{ours}; {theirs}."


def summary_sentences(outcomes: Mapping[str, Outcome], published: Mapping[str, float]) -> list[str]:
    """What someone who never heard of gating should know, by reading."""
    rates, stress = outcomes[DEFAULT].rate[: len(FORMS)], outcomes[STRESS].rate[: len(FORMS)]
    how = range_of(rates.mean(axis=1), 0)
    printed = range_of(published.values(), 0)
    return [
        f"Of two dots in an image, the one that belongs to the boat we follow is picked {how} times in 100, "
        f"depending on how their distance from the track is measured; published were {printed}.",
        order_words(outcomes[DEFAULT].rate, published),
        "Where the picked dot also feeds the track, which is a stress test, "
        f"{range_of(stress.mean(axis=1), 0)} in 100 are right, and {range_of(mostly_wrong(stress), 0)} % of "
        "the overflights have the wrong dot in more than half of their images.",
    ]


def tiles(rates: Array, published: Mapping[str, float]) -> list[tuple[str, str]]:
    """The rate of each form with the published one, and of both gates with what they gain over the better."""
    mean = mean_rates(rates)
    found = [
        (
            f"{mean[form]:.1f} %",
            f"right by {NAMES[form]}; published {published[form]:.2f} %, "
            f"difference {signed(mean[form] - published[form], 1)}",
        )
        for form in FORMS
    ]
    better, gain = _gain(rates)
    about = (
        f"right by {NAMES['both']}: {signed(gain.mean, 2)} ± {gain.twice:.2f} beside {NAMES[better]} alone"
    )
    return [*found, (f"{mean['both']:.1f} %", about)]


def mostly_wrong(rates: Array) -> Array:
    """Share of the runs (%) in which more than half of the images are wrong; (k, runs) -> (k,)."""
    return np.asarray(100 * (rates < MOSTLY_WRONG).mean(axis=1))


def rates_title(rates: Array) -> str:
    """Which forms come first and last with the track's own measurement, for the figure."""
    best, worst, lead = _ends(rates)
    mean = mean_rates(rates)
    if not lead.beyond_chance:
        return (
            f"No form is better by more than chance:\n{range_of([mean[form] for form in FORMS])} % are right"
        )
    first = f"Most often right: by {NAMES[best]}, {mean[best]:.1f} %"
    return f"{first}\nleast: by {NAMES[worst]}, {mean[worst]:.1f} %"


def readings_words(outcomes: Mapping[str, Outcome]) -> str:
    """Range of the rates of the three forms by each reading: for those who do not see the figure."""
    said = {name: range_of(one.rate[: len(FORMS)].mean(axis=1)) for name, one in outcomes.items()}
    return "; ".join(f"updated with {READINGS[name].short} {words} %" for name, words in said.items())


def spread_title(outcomes: Mapping[str, Outcome]) -> str:
    """How many runs go mostly wrong, by the default reading and in the stress test."""
    said = [range_of(mostly_wrong(outcomes[name].rate[: len(FORMS)])) for name in (DEFAULT, STRESS)]
    return f"Wrong in more than half of the images:\n{said[0]} % of the runs, {said[1]} % in the stress test"


def readings_points() -> list[str]:
    """The readings, with what in the text speaks for and against each, a paragraph each."""
    return [
        f"**Updated with {one.short}** ({one.role}). For it: {one.speaks_for} "
        f"Against it: {one.speaks_against}"
        for one in READINGS.values()
    ]


# --- pixels and angles together


def together_words(outcome: Outcome) -> list[str]:
    """Where pixels and angles err, and what associating by both gains; sentences."""
    alone_pixels, alone_angles, both = outcome.mistakes.mean(axis=1)
    agree = 100 - alone_pixels - alone_angles
    right = 100 * (agree - both) / agree if agree > 0 else np.nan
    wrong_somewhere = outcome.mistakes.sum(axis=0) > 0
    differ = int((wrong_somewhere & ~outcome.same_images).sum())
    better, gain = _gain(outcome.rate)
    if not gain.beyond_chance:
        said = f"as many as by {NAMES[better]} alone, as far as chance allows to say"
    else:
        said = f"{'more' if gain.mean > 0 else 'fewer'} than by {NAMES[better]} alone"
    return [
        f"Of all images, {alone_pixels:.2f} % are wrong by pixels alone, {alone_angles:.2f} % by angles "
        f"alone and {both:.2f} % by both. In {differ} of the {int(wrong_somewhere.sum())} runs with a "
        f"mistake by either (of {len(wrong_somewhere)} runs), those are not exactly the same images.",
        f"With the two distances added, {mean_rates(outcome.rate)['both']:.2f} % are right: {said} "
        f"({signed(gain.mean, 2)} ± {gain.twice:.2f} points, the better of the two).",
        f"In {agree:.2f} % of the images both pick the same detection, and {right:.2f} % of those "
        f"are right; the other {100 - agree:.2f} % could be left unassociated. Whatever picks one of their "
        f"two "
        f"answers is right in {100 - both:.2f} % at best.",
    ]


# --- one run


def same_tracks(one: Gated) -> list[list[str]]:
    """The forms of a single run, those with the same track together."""
    groups: list[list[str]] = []
    for row, form in enumerate(FORMS):
        like = (
            group for group in groups if np.allclose(one.estimate[FORMS.index(group[0])], one.estimate[row])
        )
        group = next(like, None)
        if group is None:
            groups.append([form])
        else:
            group.append(form)
    return groups


def rights_words(one: Gated) -> str:
    """Success rates (%) of the three forms in a single run."""
    counted = one.counted[0].sum()
    return ", ".join(f"{100 * right[0].sum() / counted:.1f}" for right in one.right[: len(FORMS)])


def mistakes_title(one: Gated) -> str:
    """How many images of a single run are wrong by pixels alone, by angles alone and by both."""
    pixels, angles = (~one.right[FORMS.index(form), 0] & one.counted[0] for form in ("pixels", "angles"))
    alone, other, both = (int(which.sum()) for which in (pixels & ~angles, angles & ~pixels, pixels & angles))
    return f"Images wrong by pixels alone: {alone}, by angles alone: {other}, by both: {both}"


def estimates_title(one: Gated) -> str:
    """How far off each track of a single run is, typically."""
    off = np.linalg.norm(one.estimate[: len(FORMS), 0] - one.targets[0, 0], axis=-1)
    parts = [
        f"{np.median(off[FORMS.index(group[0])]):.1f} m by {' and '.join(group)}"
        for group in same_tracks(one)
    ]
    return f"The track's median error: {', '.join(parts)}"


def detections_title(one: Gated) -> str:
    """How single detections of a single run scatter."""
    north, east = (one.measured[0] - one.targets[0]).std(axis=(0, 1))
    return f"Single detections scatter by {north:.0f} m north, {east:.0f} m east"


# --- what moves the rates, and the claims


def varied_title(varied: pd.DataFrame, reading: str) -> str:
    """Which variation changes a rate most, if any does by more than chance; for the figure."""
    rows, best = varied.iloc[1:], ("", "", 0.0)
    for form in FORMS:
        change = rows[f"{form}_change"].to_numpy(float)
        change = np.where(np.abs(change) > 2 * rows[f"{form}_se"].to_numpy(float), change, 0.0)
        row = int(np.argmax(np.abs(change)))
        if abs(change[row]) > abs(best[2]):
            best = (str(rows["variation"].iloc[row]), form, float(change[row]))
    title = f"Updated with {READINGS[reading].short}:"
    if not best[0]:
        return f"{title}\nno change moves a rate by more than chance"
    return f"{title}\nmost by {best[0]}, {best[1]} {signed(best[2], 1)}"


def varied_words(varied: pd.DataFrame, published: Mapping[str, float]) -> str:
    """Between which rates the variations lie, and whether the published one lies there too; a sentence."""
    parts = []
    for form in FORMS:
        values, twice = varied[form].to_numpy(float), 2 * varied[f"{form}_mean_se"].to_numpy(float)
        place = "among them"
        if published[form] > (values + twice).max():
            place = "above all of them"
        elif published[form] < (values - twice).min():
            place = "below all of them"
        parts.append(f"by {NAMES[form]} {values.min():.1f} to {values.max():.1f} % (published {place})")
    return f"Rates: {'; '.join(parts)}. Above and below allow for twice the standard error."


def _ends(rates: Array) -> tuple[str, str, Lead]:
    """The forms that are right most and least often, and the lead of the one over the other."""
    mean = mean_rates(rates)
    best, worst = (pick(FORMS, key=lambda form: mean[form]) for pick in (max, min))
    return best, worst, lead_of(rates[GATES.index(best)], rates[GATES.index(worst)])


def _gain(rates: Array) -> tuple[str, Lead]:
    """Which of pixels and angles is the better, and the lead of both together over it."""
    mean = mean_rates(rates)
    better = max(("pixels", "angles"), key=lambda form: mean[form])
    return better, lead_of(rates[GATES.index("both")], rates[GATES.index(better)])


def signed(value: float, decimals: int) -> str:
    return f"{value:+.{decimals}f}".replace("-", "−")
