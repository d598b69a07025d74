"""First looks: every page from a few flights, before the full numbers take hours.

A run of all studies goes twice over them. The first pass leaves pages from a few flights each, the quick
studies first; the second puts the full numbers in their place, page by page, and computes no flight again
that the first one had. Whichever moment it is broken off, every page that is there says what it shows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from wildlab.runner.catalogue import StudyEntry
from wildlab.runner.processes.job import Job
from wildlab.runner.processes.scheduling import Outcome
from wildlab.runner.record.digests import read_status
from wildlab.runner.seeds import missing_seeds

#: Guessed seconds of a study that has not been run here yet. Only their order matters.
GUESSED_S = {"computed": 5.0, "logged": 30.0, "twin": 60.0}
THERE = "its full report is there already, from the same code, data and parameters"


class Passes(NamedTuple):
    """What each pass runs, and what the first one leaves alone."""

    first: list[Job]
    second: list[Job]
    kept: list[Outcome]


def plan_passes(whole: Sequence[Job], looks: Mapping[str, Job]) -> Passes:
    """Which jobs go into which pass.

    A study whose full numbers cost no more than a first look is run once, in full, in the first pass: one
    without anything to take less of, and one all of whose seeds are there. A full report from the same code,
    data and parameters is not replaced by a first look.

    Parameters
    ----------
    whole
        The full jobs, in the order in which they are to be run.
    looks
        The jobs of first looks by name; of some studies there is none.
    """
    first, second, kept = [], [], []
    for job in whole:
        look = looks.get(job.name)
        seeded = set(look.first_look) == {"seeds"} if look else False
        if look is None or (seeded and job.seeds is not None and not missing_seeds(job.seeds)):
            first.append(job)
            continue
        second.append(job)
        if has_whole_report(job):
            kept.append(Outcome(job.name, "skipped", 0.0, THERE, Path(job.reports) / job.name))
        else:
            first.append(look)
    return Passes(first, second, kept)


def has_whole_report(job: Job) -> bool:
    """Whether the report of this very job is there, and not a first look."""
    folder = Path(job.reports) / job.name
    status = read_status(folder)
    return (
        status.get("state") == "done"
        and status.get("fingerprint") == job.fingerprint
        and not status.get("first_look")
        and (folder / "report.html").is_file()
    )


def quick_first(studies: Sequence[StudyEntry], reports: Path) -> list[StudyEntry]:
    """The studies by how long they took when they were last run, or by what they need: no flight, a logged
    one, simulated ones."""

    def cost(study: StudyEntry) -> float:
        seconds = read_status(reports / study.name).get("seconds")
        return float(seconds) if isinstance(seconds, (int, float)) else GUESSED_S[study.kind]

    return sorted(studies, key=cost)
