"""A simulated flight's navigation against its truth: H 5.5 and 7.3, on the flights of 7.5.3 and 7.5.4."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.analysis.navigate import SETTLING_S, numbers_of, study_navigation
from wildlab.evaluation.shares import Check
from wildlab.simulation.twins import simulate_twin


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """One simulated flight, navigated and compared with its truth from `SETTLING_S` on.

    Raises
    ------
    WildlabError
        If there is no such twin, or it has no inertial unit and receivers.
    """
    return numbers_of(study_navigation(simulate_twin(twin, seed)), SETTLING_S)


def check_claims(runs: pd.DataFrame, tuned: str) -> dict[str, Check]:
    """What the flights give for each claim of H 7.5.3 and 7.5.4 on its figures, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each flight.
    tuned
        Subject of the filter that was tuned like the published one of that flight.
    """

    def outside(*names: str) -> Check:
        share = np.column_stack([runs[tuned, f"inside_{name}"].to_numpy(float) for name in names])
        return Check(measured=1 - share.min(axis=1))

    return {
        "roll-pitch-within-bounds": outside("roll", "pitch"),
        "roll-within-bounds": outside("roll"),
        "velocity-within-bounds": outside("velocity"),
        "velocity-mostly-within-bounds": outside("velocity"),
    }
