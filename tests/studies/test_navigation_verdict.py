"""The verdict on a flight's attitude follows how its errors stand to what the filter states."""

import numpy as np
import pandas as pd
import pytest

from wildlab.studies.navigation import text

#: Errors of 1.3 degrees, all axes together, where 2.6 are stated; roll and pitch by 0.5.
FOUND = {"rms_roll": 0.3, "rms_pitch": 0.4, "rms_yaw": 1.2}
FOUND |= {"mean_sd_roll": 0.6, "mean_sd_pitch": 0.8, "mean_sd_yaw": 2.4}


@pytest.mark.parametrize("true", [True, False])
@pytest.mark.parametrize(
    ("errors", "ratio", "verdict"),
    [(1.0, "0.5", "not judged"), (3.9, "1.9", "not judged"), (4.2, "2.1", "look closer")],
)
def test_the_verdict_follows_the_ratio(errors, ratio, verdict, true):
    found = FOUND | {name: value * errors for name, value in FOUND.items() if name.startswith("rms")}
    sentences, given, reason = text.summary(found, "in the air", true)
    said = " ".join(sentences)
    assert given.value == verdict and ratio in reason
    # 300 m above, roll and pitch move the point by that much.
    assert f"{1.3 * errors:.2f}" in said and "2.60" in said and f"{150 * np.radians(errors):.1f}" in said


def test_the_middle_flight_speaks_for_all_of_them():
    flights = [FOUND | {"rms_yaw": value} for value in (9.0, 1.2, 1.1)]
    spread = pd.DataFrame([{("mekf", name): value for name, value in one.items()} for one in flights])
    spread["observer", "rms_yaw"] = 50.0
    assert text.middle_flight(spread) == FOUND
    assert not text.summary(FOUND, "in the air", True, 3)[2]
