"""How far a wrong pose moves a georeferenced point: H 5.3.1, F 2.3.1."""

from __future__ import annotations

import math

from wildlab.studies.page import Facts
from wildlab.studies.protocol import Study

#: A ratio of errors nearer to one than this is no growth.
ALIKE = 1.1


def answer(facts: Facts) -> list[str]:
    """What an angle moves, then whether flying lower helps against errors of position."""

    def error(offset: str, height: str) -> float:
        return facts.value(f"level/{offset}/{height}", "horizontal_error")

    growth = {name: error(name, "400m") / error(name, "100m") for name in ("roll", "north")}
    if any(math.isnan(one) for one in growth.values()):
        return ["unknown"]
    alike = {name: 1 / ALIKE <= times <= ALIKE for name, times in growth.items()}
    tilt = "alike" if alike["roll"] else "grows" if growth["roll"] > 1 else "shrinks"
    return [f"tilt-{tilt}", "position-alike" if alike["north"] else "position-differs"]


STUDY = Study("sensitivity", ("level", "turn", "ascent"), answer=answer)
