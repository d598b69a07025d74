"""What `wildlab plan` does: plan, and leave way points, maps and numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console

from wildlab.analysis.plans.coverage import Covered, cover
from wildlab.analysis.plans.files import RESULT, clear_folder, plan_texts, refuse_folder
from wildlab.analysis.plans.plan import Plan, make_plan
from wildlab.analysis.plans.said import plan_result
from wildlab.analysis.plans.wanted import Wanted
from wildlab.files import write_atomic, write_json


def plan_flight(
    wanted: Wanted, into: Path, console: Console, *, overwrite: bool = False
) -> tuple[Plan, list[Covered], dict[str, Any]]:
    """Plan, and write what a pilot takes along.

    Parameters
    ----------
    wanted
        What is asked for.
    into
        The folder; made where it is not there.
    console
        Where progress is shown.
    overwrite
        Whether an earlier plan there may be replaced.

    Returns
    -------
    plan, covered
        For its page.
    result
        For JSON, also in ``result.json``: numbers, sentences, and ``places``, the files that hold positions.

    Raises
    ------
    WildlabError
        Where nothing can be flown as it is wanted, or the folder is not free.
    """
    refuse_folder(into, overwrite)
    with console.status("planning") as status:
        plan = make_plan(wanted)
        texts = plan_texts(plan)

        def tell(done: int, of: int) -> None:
            status.update(f"looking what will be seen: {done} of {of} areas")

        tell(0, len(plan.areas.areas))
        covered = cover(plan, tell)
        result = plan_result(plan, covered)
    into.mkdir(parents=True, exist_ok=True)
    clear_folder(into)
    for name, text in texts.items():
        write_atomic(into / name, text)
    result["places"] = list(texts)
    write_json(into / RESULT, result)
    return plan, covered, result
