"""The table on noise that follows the view, and on fewer detections."""

from __future__ import annotations

import pandas as pd

from wildlab.analysis.measurement_noise import VARIATIONS
from wildlab.studies import noise_variations

SUBJECTS = ("kf", *(f"kf-{name}" for name in VARIATIONS))


def flights(nees: dict[str, float], mae: dict[str, float], kept: float = 30.0) -> pd.DataFrame:
    row = {("measurements", "detections"): 264.0}
    for who in SUBJECTS:
        row |= {(who, "nees"): nees.get(who, 8.0), (who, "mae"): mae.get(who, 10.0), (who, "nis"): 0.5}
        row[who, "detections"] = kept if who == "kf-thinned" else 264.0
    return pd.DataFrame([row, row, row])


def test_the_table_has_medians_the_filter_itself_first():
    spread = flights({"kf-thinned": 2.5}, {"kf-noise-by-tilt": 9.0})
    found = noise_variations.table(spread, "kf", 7.0)
    assert list(found.columns) == list(noise_variations.COLUMNS)
    assert found["filter"].iloc[0] == "of the table, 7 m" and len(found) == 5
    assert list(found["detections"]) == [264, 264, 264, 264, 30]
    assert list(found["mae"]) == [10.0, 10.0, 9.0, 10.0, 10.0] and found["nees"].iloc[-1] == 2.5
