"""Table and words on noise that follows the view, and on fewer detections, turn with their numbers."""

from __future__ import annotations

import pandas as pd
import pytest

from wildlab.pipeline.measurement_noise import VARIATIONS
from wildlab.studies import noise_variations

SUBJECTS = ("kf", *(f"kf-{name}" for name in VARIATIONS))


def flights(nees: dict[str, float], mae: dict[str, float], kept: float = 30.0) -> pd.DataFrame:
    row = {("measurements", "detections"): 264.0}
    for who in SUBJECTS:
        row |= {(who, "nees"): nees.get(who, 8.0), (who, "mae"): mae.get(who, 10.0), (who, "nis"): 0.5}
        row[who, "detections"] = kept if who == "kf-thinned" else 264.0
    return pd.DataFrame([row, row, row])


def test_the_table_has_medians_the_filter_itself_first() -> None:
    spread = flights({"kf-thinned": 2.5}, {"kf-noise-by-tilt": 9.0})
    found = noise_variations.table(spread, "kf", 7.0)
    assert list(found.columns) == list(noise_variations.COLUMNS)
    assert found["filter"].iloc[0] == "of the table, 7 m" and len(found) == 5
    assert list(found["detections"]) == [264, 264, 264, 264, 30]
    assert list(found["mae"]) == [10.0, 10.0, 9.0, 10.0, 10.0] and found["nees"].iloc[-1] == 2.5


@pytest.mark.parametrize(
    ("nees", "mae", "said"),
    [
        (
            {"kf": 18.0, "kf-noise-by-altitude": 8.0, "kf-noise-by-place": 4.0, "kf-thinned": 2.1},
            {"kf-thinned": 12.0, "kf-noise-by-place": 9.0},
            [
                "Errors of the filter of the table are 3.0 times as large as it states",
                "with 30 of 264 detections about as large as it states",
                "Nearest to a mean NEES of 2 comes fewer detections (2.1)",
                "make the mean NEES 50 % lower than the height alone does",
                "The one with noise by height, tilt and place is nearer to the truth on 3 of 3 flights",
                "The filter of the table is nearer to the truth on 3 of 3 flights, by 2.0 m",
            ],
        ),
        (
            {"kf": 2.0, "kf-noise-by-altitude": 4.0, "kf-noise-by-place": 6.0, "kf-thinned": 0.5},
            {"kf-thinned": 8.0, "kf-noise-by-place": 11.0},
            [
                "Errors of the filter of the table are about as large as it states",
                "with 30 of 264 detections 0.50 of what it states",
                "Nearest to a mean NEES of 2 comes the filter of the table (2.0)",
                "make the mean NEES 50 % higher than the height alone does",
                "The filter of the table is nearer to the truth on 3 of 3 flights, by 1.0 m",
                "The one with fewer detections is nearer to the truth on 3 of 3 flights, by 2.0 m",
            ],
        ),
        ({}, {}, ["make the mean NEES the same as the height alone does"]),
    ],
)
def test_words_turn_with_the_numbers(nees: dict[str, float], mae: dict[str, float], said: list[str]) -> None:
    found = noise_variations.words(flights(nees, mae), "kf")
    for sentence in said:
        assert sentence in found


def test_it_is_said_where_it_comes_from() -> None:
    assert "5 % of the height" in noise_variations.explanation()
    assert noise_variations.explanation().startswith("None of these is in the thesis's tables.")
