"""Noise that is correlated in time, in the target's motion or in its measurements: H 7.2, 7.5.1, 7.5.2."""

from __future__ import annotations

import math

from wildlab.studies.coloured_noise import trial
from wildlab.studies.linear_vs_nonlinear import unit_of
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: The numbers of the thesis's figures, by twin.
FIGURES = {
    "fast-vessel": {
        "paths": "7-02",
        "map": "7-03",
        "errors": "7-04",
        "speed": "7-05",
        "squares": "7-06",
        "correlation": "7-07",
    },
    "drifting-vessel": {
        "paths": "7-08",
        "map": "7-09",
        "errors": "7-10",
        "squares": "7-11",
        "correlation": "7-12",
    },
}


def answer(facts: Facts) -> list[str]:
    """What differencing does to consistency, then what to accuracy."""
    plain, differenced = (facts.value(who, "nees") for who in ("cv", "coloured"))
    if math.isnan(plain + differenced):
        return ["consistency-unknown"]
    nearer = abs(math.log(differenced / 2)) < abs(math.log(plain / 2))
    otherwise = "nearer" if nearer else "not-gained"
    return [
        f"consistency-{facts.choose('differencing-consistent', 'gained', otherwise)}",
        f"accuracy-{facts.choose('differencing-costs', 'lost', 'gained')}",
    ]


STUDY = Study("coloured-noise", trial.trial, trial.check_claims, unit_of, answer)
