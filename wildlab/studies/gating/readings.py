"""How H 6.4.3 can be read where it does not say what updates the track, and what each reading gives.

Its own measurement: H judges image by image, and says nothing of what an answer does to the track. The
assigned one: that is what a tracker does. Angles where angles gate: table 6.5 gives them a noise of their
own, although H 6.3.2 updates with pixels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDABLE
from wildlab.geometry.frames import Array
from wildlab.reporting.spread import bounds_of
from wildlab.studies.gating.monte_carlo import FORMS, GATES, Choices, Gated, Outcome, Overflight, gate

#: The reading that is compared with published rates and that decides the claims.
DEFAULT = "own"
#: The one that shows what mistakes do to a tracker that believes them.
STRESS = "assigned"
READINGS: Mapping[str, Choices] = {
    "own": Choices(updated_with="own"),
    "assigned": Choices(updated_with="assigned"),
    "angles": Choices(updated_with="own", angles_update="angles"),
}
#: Less than this share of right associations (per cent) is mostly wrong.
MOSTLY_WRONG = 50.0
#: Success rates (per cent) of the run that H 6.4.3 shows, in the order of `FORMS`.
PUBLISHED_RUN = (91.5, 91.5, 92.2)


def subject(gate: str, reading: str) -> str:
    """Under what name a gate's numbers by a reading are recorded; by the default reading it is the gate's."""
    name = "pixels-and-angles" if gate == "both" else gate
    return name if reading == DEFAULT else f"{name}/updated-with-{reading}"


def mostly_wrong(rates: Array) -> Array:
    """Share of the runs (%) in which more than half of the images are wrong; (k, runs) -> (k,)."""
    return np.asarray(100 * (rates < MOSTLY_WRONG).mean(axis=1))


def metrics_of(outcomes: Mapping[str, Outcome]) -> list[dict[str, Any]]:
    """Every mean rate with its standard error, the spread of single runs, and how many are mostly wrong.

    The bounds of the spread are of single runs, so they stand with the median run and not with the mean.
    """
    found: list[dict[str, Any]] = []
    for reading, one in outcomes.items():
        for name, rates, half in zip(GATES, one.rate, mostly_wrong(one.rate), strict=True):
            about = {"subject": subject(name, reading), "unit": "%", "n": len(rates)}
            low, high = bounds_of(pd.Series(rates))
            found += [
                {"name": "success_rate", "value": rates.mean(), **about},
                {"name": "success_rate_se", "value": standard_error(rates), **about},
                {
                    "name": "success_rate_median_run",
                    "value": np.median(rates),
                    "low": low,
                    "high": high,
                    **about,
                },
                {"name": "runs_mostly_wrong", "value": half, **about},
            ]
    return found


def rates_table(outcomes: Mapping[str, Outcome], names: Mapping[str, str]) -> pd.DataFrame:
    """For each reading mean success rates (%) by each gate, and the runs (%) mostly wrong by angles."""
    return pd.DataFrame(
        [
            {"reading": names[f"updated-with-{reading}"]}
            | dict(zip(GATES, one.rate.mean(axis=1), strict=True))
            | {"mostly_wrong": mostly_wrong(one.rate)[GATES.index("angles")]}
            for reading, one in outcomes.items()
        ]
    )


def typical_run(over: Overflight, sources: Sequence[np.random.SeedSequence]) -> Gated:
    """Of some runs by the default reading the one whose rates are nearest to those of H's single run."""
    runs = list(sources)
    shares = 100 * gate(over, READINGS[DEFAULT], runs).right[: len(FORMS)].mean(axis=2)
    chosen = int(np.abs(shares.T - PUBLISHED_RUN).max(axis=1).argmin())
    return gate(over, READINGS[DEFAULT], runs[chosen : chosen + 1])


def standard_error(values: Array) -> float:
    """Of the mean of independent values (N,), those that are NaN left out."""
    finite = values[np.isfinite(values)]
    return float(finite.std(ddof=1) / np.sqrt(len(finite)))


def claim_margins(outcome: Outcome) -> dict[str, Array]:
    """How far each claim of H 6.4.3 is from its limits in each run, by its id: (k, runs) for k limits.

    A claim is true where the means of all its margins are positive. ``forms-agree``: no two forms differ by
    more than one percentage point, either way. ``angles-least-accurate``: the leads of position and of
    pixels over the angles, percentage points. ``mistakes-on-different-images``: of the runs in which pixels
    or angles are ever wrong, more than half have them wrong in different images (percentage points from
    half); NaN in a run without mistakes, which says nothing.
    """
    rates = dict(zip(GATES, outcome.rate, strict=True))
    pairs = [(rates[a], rates[b]) for i, a in enumerate(FORMS) for b in FORMS[i + 1 :]]
    differ = np.where(outcome.mistakes.sum(axis=0) > 0, 0.5 - outcome.same_images, np.nan)
    return {
        "forms-agree": np.stack([1 - sign * (a - b) for a, b in pairs for sign in (1, -1)]),
        "angles-least-accurate": np.stack([rates[form] - rates["angles"] for form in ("position", "pixels")]),
        "mistakes-on-different-images": 100 * differ[None],
    }


def verdict(margins: Array) -> str:
    """Whether the means of all margins (k, runs) are positive, each by twice its standard error."""
    known = [one[np.isfinite(one)] for one in margins]
    if min(len(one) for one in known) < 2:
        return UNDECIDABLE
    mean = np.array([one.mean() for one in known])
    unsure = 2 * np.array([standard_error(one) for one in known])
    if (mean > unsure).all():
        return HOLDS
    return FAILS if (mean < -unsure).any() else UNDECIDABLE
