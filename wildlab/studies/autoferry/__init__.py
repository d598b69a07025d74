"""Sensors of a ferry and two boats with satellite positions: the filters of H 7.2 to 7.4 on public data."""

from __future__ import annotations

import math

from wildlab.evaluation.runs import share_interval
from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study


def answer(facts: Facts) -> list[str]:
    """What one filter held fixed gains and spoils, then which sensors keep their tracks."""
    return [f"filter-{_gain(facts)}", f"sensors-{_use(facts)}"]


def _gain(facts: Facts) -> str:
    """Of all sensors, by the interval of the share that gained of those that gained or were spoilt."""
    subject = next(
        (who for name, who in facts.recorded if (name, who[-12:]) == ("tracks_gained", "/all-sensors")), ""
    )
    gained, spoilt = (facts.value(subject, f"tracks_{name}") for name in ("gained", "spoilt"))
    if math.isnan(gained + spoilt) or gained + spoilt == 0:
        return "unknown"
    _, low, high = share_interval(gained, gained + spoilt)
    return "helps" if low > 0.5 else "harms" if high < 0.5 else "neither"


def _use(facts: Facts) -> str:
    """Whether each sensor alone keeps more than half of its tracks with their boats."""
    kept = {
        who.split("/")[-1]: 2 * facts.value(who, name) > facts.value(who, name, "n")
        for name, who in facts.recorded
        if name == "tracks_kept_at_best"
    }
    useless = {sensor for sensor, enough in kept.items() if not enough}
    if not kept:
        return "unknown"
    return "all" if not useless else "ranging" if useless == {"ir", "eo"} else "some"


STUDY = Study("autoferry", (), answer=answer)
