"""Verdicts of the report on consistency bounds, on opposed numbers."""

import numpy as np

from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDED
from wildlab.studies.consistency_bounds import decide


def test_a_share_is_decided_by_its_interval():
    runs = np.arange(2000)
    assert decide(runs < 1900)[0] == HOLDS
    assert decide(runs < 1860)[0] == FAILS and decide(runs < 2000)[0] == FAILS
    assert decide(np.arange(20) < 19)[0] == UNDECIDED
