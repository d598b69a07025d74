"""Advice on plans that would see little: the speed at which the images of a swing are sharp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wildlab.analysis.plans.coverage import Covered, images_of
from wildlab.analysis.plans.plan import Plan
from wildlab.analysis.plans.sorties import fly_rows

#: Share of ground in blurred images alone from which a speed is looked for, and of images to be sharp there.
MUCH, NEARLY_ALL = 0.5, 0.95
#: Metres per second between speeds that are tried, and rows that are flown for that at most.
STEP, ROWS = 0.5, 4


def swing_advice(plan: Plan, covered: Sequence[Covered]) -> list[str]:
    """Where a swing at its own rate blurs most of the ground, what would help, as a sentence.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plan.make_plan`.
    covered
        Of each area, from `wildlab.analysis.plan_coverage.cover`.

    Returns
    -------
    list of str
        Empty where the camera does not swing, its rate was stated, or less than half is blurred.
    """
    wanted = plan.wanted
    if wanted.gimbal == "fixed" or wanted.rate_deg_s is not None:
        return []
    sizes = np.array([area.size for area in plan.areas.areas])
    blurred = float(sizes @ [one.share(one.blurred) for one in covered] / sizes.sum())
    if blurred < MUCH:
        return []
    speed = sharp_speed(plan)
    begins = f"At {wanted.speed_m_s:g} m/s the camera has to swing so fast that most images are blurred"
    if speed is None:
        return [f"{begins}, and slower flights blur them, too: take a smaller swing, or a shorter exposure."]
    return [f"{begins}: at {speed:g} m/s nearly all of them would be sharp (--speed {speed:g})."]


def sharp_speed(plan: Plan) -> float | None:
    """The greatest speed, in steps of `STEP`, at which nearly all images of the first rows are sharp.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plan.make_plan`.

    Returns
    -------
    float or None
        Metres per second, below that of the plan; None where there is none.
    """
    rows = plan.sorties[0].rows[:ROWS]

    def sharp(speed: float) -> bool:
        slower = replace(plan, wanted=replace(plan.wanted, speed_m_s=speed))
        flown = fly_rows(
            "slower", list(rows), plan.pattern, plan.home, slower.wanted, plan.terrain, plan.height
        )
        return bool(images_of(slower, flown).sharp.mean() >= NEARLY_ALL)

    # Slower flights swing slower: the first speed that is too fast is found by halving.
    # A wing has to be faster than the wind.
    least = int(plan.wanted.wind_m_s / STEP) if plan.wanted.vehicle == "fixed-wing" else 0
    low, high = least, int(np.ceil(plan.wanted.speed_m_s / STEP)) - 1
    while high > low:
        middle = (low + high + 1) // 2
        if sharp(middle * STEP):
            low = middle
        else:
            high = middle - 1
    return low * STEP if low > least else None
