"""All studies in two passes, in real processes: nothing twice, and whole wherever they are broken off."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.notebooks import OPEN, notebook, write
from tests.runner.test_seeds_many import TABLE, flown, numbers, run, start, wait_for
from wildlab.runner.catalogue import FIRST_LOOK_SEEDS

pytestmark = pytest.mark.slow

SEEDS = 9


def make(folder: Path, seconds: float = 0.0) -> Path:
    """A quick study and two over seeds."""
    entries = []
    for study in ("walks", "more-walks"):
        more = 'seeds = 0\nsteps = 0\nseconds = 0.0\ncase = "walk"'
        write(folder / "notebooks", f"{study}.ipynb", notebook(OPEN, TABLE, more=more))
        entries.append(
            f'[{study}]\ntitle = "Study {study}"\nnotebook = "{study}.ipynb"\ntwin = "large-ship"\nseed = 4\n'
            f'seeds = {SEEDS}\ncase = "walk"\n[{study}.parameters]\nsteps = 3000\nseconds = {seconds}\n'
        )
    write(folder / "notebooks", "once.ipynb", notebook(OPEN, 'report.head("One")\nreport.save()'))
    entries.append('[once]\ntitle = "Once"\nnotebook = "once.ipynb"\n')
    (folder / "notebooks" / "studies.toml").write_text("".join(entries))
    return folder


def status(folder: Path, study: str) -> dict[str, Any]:
    path = folder / "reports" / study / "status.json"
    found: dict[str, Any] = json.loads(path.read_text()) if path.is_file() else {}
    return found


def page(folder: Path, study: str) -> str:
    return (folder / "reports" / study / "report.html").read_text(encoding="utf-8")


def ledger(folder: Path) -> str:
    return (folder / "reports" / "ledger.html").read_text(encoding="utf-8")


LOOK = {"seeds": [FIRST_LOOK_SEEDS, SEEDS]}
SAID = f"{FIRST_LOOK_SEEDS} of {SEEDS} flights."
#: Seeds that the first looks at both studies fly.
FIRST = 2 * (FIRST_LOOK_SEEDS - 1)
#: Each seed of both studies but the drawn one, once.
ONCE = sorted(2 * [seed for seed in range(1, SEEDS + 1) if seed != 4])


def test_first_looks_then_full_numbers_and_no_seed_twice(tmp_path: Path) -> None:
    folder = make(tmp_path)
    assert "First looks: 2 of 3" in run(folder, "--first-look", "--jobs", "2")
    for study in ("walks", "more-walks"):
        assert status(folder, study)["first_look"] == LOOK
        assert SAID in page(folder, study) and f"wildlab run {study}" in page(folder, study)
        assert json.loads((folder / "reports" / study / "metrics.json").read_text())["seeds"] is None
        assert len(numbers(folder, "reports", study)) == 2 * FIRST_LOOK_SEEDS
    assert status(folder, "once")["first_look"] == {} and "first look" not in page(folder, "once")
    assert "1 / 3</b><span>studies done, 2 at a first look" in ledger(folder)
    assert len(flown(folder)) == FIRST
    run(folder, "--jobs", "2")
    assert sorted(seed for seed, _ in flown(folder)) == ONCE
    assert "first look" not in page(folder, "walks") + page(folder, "more-walks")
    assert "3 / 3</b><span>studies done</span>" in ledger(folder)
    run(folder, "walks", "--out", "whole")
    assert numbers(folder, "reports") == numbers(folder, "whole")
    before = (folder / "reports" / "walks" / "report.html").stat().st_mtime_ns
    text = run(folder, "walks", "--first-look")
    assert "done  walks" in text, "all its seeds are there, so that it runs in full"
    assert (folder / "reports" / "walks" / "report.html").stat().st_mtime_ns > before
    assert status(folder, "walks")["first_look"] == {}


@pytest.mark.parametrize("full", [1])
def test_broken_off_in_the_second_pass_every_page_is_there(tmp_path: Path, full: int) -> None:
    folder = make(tmp_path, seconds=0.4)
    program = start(folder, "--jobs", "2")
    both = ("walks", "more-walks")

    def looks() -> int:
        return sum(status(folder, study).get("first_look") == LOOK for study in both)

    def done() -> int:
        return sum(status(folder, study).get("first_look") == {} for study in both)

    assert not (folder / "reports" / "index.html").exists()
    wait_for(lambda: (folder / "reports" / "index.html").exists())
    wait_for(lambda: looks() == 2, 120)
    wait_for(lambda: done() == full and len(flown(folder)) > FIRST + full, 120)
    os.killpg(program.pid, signal.SIGINT)
    assert program.wait(20) != 0
    assert (looks(), done()) == (2 - full, full)
    text = ledger(folder)
    assert f"{1 + full} / 3</b>" in text and text.count('class="look"') == 2 - full
    for study in both:
        said = SAID in page(folder, study)
        assert said == (status(folder, study)["first_look"] == LOOK)
    begun = len(flown(folder))
    run(folder, "--jobs", "2")
    assert (looks(), done()) == (0, 2)
    again = len(flown(folder)) - begun
    # At most the seeds under way when it was broken off are flown twice.
    assert len(ONCE) <= begun + again <= len(ONCE) + 2
    assert {seed for seed, _ in flown(folder)} == set(ONCE)
