"""How a run is shown while it goes: one bar over everything on a terminal, some lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column

from wildlab.runner.job import Job

_STAGES = {"flight": "preparing the flight", "notebook": "starting", "page": "writing the page"}
#: Where there is no terminal, a line says what is under way after so long without one, s.
SILENT_S = 10.0
_ENDS = {"done": "[green]done[/]", "failed": "[red]failed[/]", "skipped": "[yellow]skipped[/]"}


def outcome_line(outcome: Any) -> str:
    """One line about how a study went, with rich's markup."""
    took = f"  {outcome.seconds:.0f} s" if outcome.state != "skipped" else ""
    why = f"  {escape(outcome.reason)}" if outcome.reason else ""
    return f"{_ENDS[outcome.state]}  [bold]{escape(outcome.name)}[/]{took}{why}"


def pass_line(jobs: Sequence[Job]) -> str:
    """What is said before a pass that takes first looks; nothing before any other."""
    looks = sum(bool(job.first_look) for job in jobs)
    if not looks:
        return ""
    whole = len(jobs) - looks
    return f"First looks: {looks} of {len(jobs)} reports from few flights" + (
        f", and {whole} in full." if whole else "."
    )


class _Steps:
    """What is under way: the step of each study, since when it runs, and how long it took the last time."""

    def __init__(self) -> None:
        self._step: dict[str, str] = {}
        self._began: dict[str, float] = {}
        #: How long each took the last time, in words with a blank before; "" where that is not known.
        self.usual: dict[str, str] = {}

    def note(self, name: str, event: str, what: Any) -> None:
        """Follow an event of `wildlab.runner.scheduling.Listener`."""
        if event == "start":
            self._began[name], self._step[name] = time.monotonic(), ""
            self.usual[name] = "" if what is None else f" ({what:.0f} s the last time)"
        elif event == "end":
            self._step.pop(name, None)
        elif event in ("seed", "cell"):
            self._step[name] = f"{event} {what[0] + (event == 'cell')} of {what[1]}, "
        elif event == "stage":
            self._step[name] = f"{_STAGES[what[0]]}, "
        elif event in ("note", "after"):
            self._step[name] = f"{escape(what or 'waiting for the other reports')}, "

    def __str__(self) -> str:
        now = time.monotonic()
        return " · ".join(
            f"[bold]{escape(one)}[/] {step}{now - self._began[one]:.0f} s{self.usual[one]}"
            for one, step in self._step.items()
        )


@contextmanager
def shown(console: Console) -> Iterator[Callable[[str, str, Any], None]]:
    """Yields the listener for `wildlab.runner.scheduling.run_jobs`."""
    if not console.is_terminal:
        yield _in_lines(console)
        return
    columns = (
        SpinnerColumn(),
        BarColumn(bar_width=20),
        TextColumn("{task.completed:.0f} of {task.total:.0f}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        # Whatever does not fit is cut off: the line must not wrap.
        TextColumn("{task.description}", table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1)),
    )
    # Seeds and cells take unlike times: ten minutes of them are a steadier guess than half a minute.
    with Progress(
        *columns, console=console, transient=True, expand=True, speed_estimate_period=600
    ) as progress:
        task = progress.add_task("", total=0)
        steps = _Steps()

        def tell(name: str, event: str, what: Any) -> None:
            steps.note(name, event, what)
            if event == "plan":
                progress.update(task, total=what)
            elif event == "end":
                progress.console.print(outcome_line(what), highlight=False, soft_wrap=True)
            elif event in ("seed", "cell"):
                progress.advance(task)
            progress.update(task, description=str(steps))

        yield tell


def _in_lines(console: Console) -> Callable[[str, str, Any], None]:
    """A line where a study starts and ends, for each quarter of its seeds, and after `SILENT_S`."""
    steps, last = _Steps(), time.monotonic()

    def say(line: str) -> None:
        nonlocal last
        last = time.monotonic()
        console.print(line, highlight=False, soft_wrap=True)

    def tell(name: str, event: str, what: Any) -> None:
        steps.note(name, event, what)
        if event == "tick" and time.monotonic() - last > SILENT_S:
            say(f"still {steps}")
        elif event == "start":
            say(f"start {escape(name)}{steps.usual[name]}")
        elif event == "seeds":
            missing, count = what
            if count:
                say(f"seeds {escape(name)}: {missing} to compute, {count - missing} are there")
        elif event == "seed":
            done, count = what
            if 4 * done // count > 4 * (done - 1) // count:
                say(f"seeds {escape(name)}: {done} of {count}")
        elif event == "note":
            say(f"note  {escape(name)}: {escape(what)}")
        elif event == "end":
            say(outcome_line(what))

    return tell
