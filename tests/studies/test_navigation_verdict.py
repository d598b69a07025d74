"""The verdict on a flight's attitude follows how its errors compare with what the filter predicts."""

import pandas as pd
import pytest

from wildlab.analysis.verdict import Verdict
from wildlab.messages.catalogue import load_texts
from wildlab.studies.navigation import attitude_of, level_of, verdict_of_attitude

#: Errors of 1.3 degrees, all axes together, where 2.6 are predicted.
FOUND = {"rms_roll": 0.3, "rms_pitch": 0.4, "rms_yaw": 1.2}
FOUND |= {"mean_sd_roll": 0.6, "mean_sd_pitch": 0.8, "mean_sd_yaw": 2.4}


@pytest.mark.parametrize(
    ("times", "verdict"), [(1.0, Verdict.UNJUDGED), (3.9, Verdict.UNJUDGED), (4.2, Verdict.LOOK)]
)
def test_the_verdict_follows_the_ratio(times, verdict):
    found = FOUND | {name: value * times for name, value in FOUND.items() if name.startswith("rms")}
    assert attitude_of(found) == pytest.approx((1.3 * times, 2.6))
    assert verdict_of_attitude(found) == verdict
    runs = pd.DataFrame([{("mekf", name): value for name, value in found.items()}])
    assert level_of(runs) == verdict.level
    assert level_of(pd.concat([runs, runs])) == Verdict.UNJUDGED.level


def test_every_message_of_a_logged_flight_has_a_text():
    keys = {"plausible", "overconfident", "reason"}
    keys |= {f"observer-{one}" for one in ("course", "field", "biases")}
    assert set(load_texts("navigation-logged").answers) == keys
