"""How a run is shown while it goes: a live display on a terminal, a line per study elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn

_STAGES = {"flight": "preparing the flight", "notebook": "starting", "page": "writing the page"}
_ENDS = {"done": "[green]done[/]", "failed": "[red]failed[/]", "skipped": "[yellow]skipped[/]"}


def outcome_line(outcome: Any) -> str:
    """One line about how a study went, with rich's markup."""
    took = f"  {outcome.seconds:.0f} s" if outcome.state != "skipped" else ""
    why = f"  {escape(outcome.reason)}" if outcome.reason else ""
    return f"{_ENDS[outcome.state]}  [bold]{escape(outcome.name)}[/]{took}{why}"


@contextmanager
def shown(console: Console) -> Iterator[Callable[[str, str, Any], None]]:
    """Yields the listener for `wildlab.reporting.run.run_jobs`."""
    if not console.is_terminal:

        def tell(name: str, event: str, what: Any) -> None:
            if event == "start":
                console.print(f"start {escape(name)}", highlight=False, soft_wrap=True)
            elif event == "end":
                console.print(outcome_line(what), highlight=False, soft_wrap=True)

        yield tell
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TextColumn("{task.fields[step]}"),
        TimeElapsedColumn(),
    )
    tasks: dict[str, TaskID] = {}
    with Progress(*columns, console=console, transient=True) as progress:

        def tell_live(name: str, event: str, what: Any) -> None:
            if event == "start":
                tasks[name] = progress.add_task(escape(name), total=None, step="")
            elif event == "stage":
                progress.update(tasks[name], step=_STAGES.get(what[0], str(what[0])))
            elif event == "cell":
                index, count = what
                progress.update(
                    tasks[name], completed=index, total=count, step=f"cell {index + 1} of {count}"
                )
            elif event == "end":
                progress.remove_task(tasks.pop(name))
                progress.console.print(outcome_line(what), highlight=False, soft_wrap=True)

        yield tell_live
