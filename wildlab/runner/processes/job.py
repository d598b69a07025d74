"""What a process that runs a notebook is told, and what is left to say where it failed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wildlab.runner.seeds.kept import SeedWork


@dataclass(frozen=True)
class Job:
    """What a process needs to know. Folders are absolute."""

    name: str
    title: str
    notebook: str
    work: str
    runtime: str
    reports: str
    seed: int = 1
    #: The page's main heading; "" leaves the notebook's.
    heading: str = ""
    flight: str = ""
    #: As its folder, of which nothing else is told.
    flight_name: str = ""
    twin: str | None = None
    dataset: str | None = None
    recipe: str | None = None
    #: Recipes of further flights of the data set.
    beside: tuple[str, ...] = ()
    parameters: dict[str, Any] = field(default_factory=dict)
    #: What to type to run it again.
    again: str = ""
    timeout_s: float = 1800.0
    #: How many cells the notebook has, and what is to be computed for each seed before it starts.
    cells: int = 0
    seeds: SeedWork | None = None
    #: What a first look takes less of, by parameter: (how many, of how many). Empty: the full numbers.
    first_look: dict[str, tuple[int, float]] = field(default_factory=dict)
    #: What the page depends on, see `wildlab.runner.seeds.fingerprint.page_key`.
    fingerprint: str = ""
    #: Whether the notebook takes no parameters, leaves no numbers, and is shown with its code.
    tutorial: bool = False

    def hidden(self) -> dict[str, str]:
        """Folders that get into nothing that is left behind, with what stands for each."""
        if not self.flight:
            return {self.work: "."}
        around = str(Path(self.flight).parent)
        return {self.work: ".", around: "[flights]", self.flight: f"[flight {self.flight_name}]"}


@dataclass(frozen=True)
class Failure:
    """Why a job failed: a sentence, the step, and the traceback for whoever mends it."""

    reason: str
    step: str = ""
    details: str = ""
