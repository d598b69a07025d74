"""A simulated flight's navigation against its truth: H 5.5 and 7.3, on the flights of 7.5.3 and 7.5.4."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.pipeline.navigation_errors import AXES, SETTLING_S, numbers_of, study_navigation
from wildlab.simulation.twins import simulate_twin


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """One simulated flight, navigated and compared with its truth from `SETTLING_S` on.

    Raises
    ------
    WildlabError
        If there is no such twin, or it has no inertial unit and receivers.
    """
    return numbers_of(study_navigation(simulate_twin(twin, seed)), SETTLING_S)


def check_claims(spread: pd.DataFrame, tuned: str) -> dict[str, NDArray[np.bool_]]:
    """On which flights each claim of H 7.5.3 and 7.5.4 on its figures is true, by the claim's id.

    Mainly, mostly and the majority are read as more than half of the time, few as less than a tenth.

    Parameters
    ----------
    spread
        What `trial` gives, one row for each flight.
    tuned
        Subject of the filter that was tuned like the printed one of that flight.
    """
    inside: dict[str, Any] = {name: spread[tuned, f"inside_{name}"] for name in (*AXES, "velocity")}
    checks = {
        "roll-pitch-within-bounds": (inside["roll"] > 0.5) & (inside["pitch"] > 0.5),
        "roll-within-bounds": inside["roll"] > 0.5,
        "velocity-within-bounds": inside["velocity"] > 0.5,
        "velocity-mostly-within-bounds": inside["velocity"] > 0.9,
    }
    return {claim: np.asarray(true, bool) for claim, true in checks.items()}
