"""Seeds over processes and over a cluster: the same numbers, nothing twice, nothing left behind."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from tests.notebooks import OPEN, notebook, write
from tests.runner.cases.walk import LOG, trial
from wildlab.paths import ROOT

pytestmark = pytest.mark.slow

#: Name, seed and value of what a study records.
Numbers = list[tuple[str, str, float]]
PROGRAM = Path(__file__).with_name("flights_for_seeds.py")
#: A notebook that reads the table and records what is in it, to the last digit.
TABLE = (
    "import flights_for_seeds\nfrom wildlab.runner.open_study import trials_table\n"
    "drawn = {('walk', name): 1.0 for name in ('end', 'spread', 'none', 'beyond')}\n"
    "spread = trials_table(case, seeds, study=study, seed=seed, drawn=drawn, out=out, steps=steps, "
    "seconds=seconds)\n"
    'report.head("A report")\n'
    "assert list(spread.index) == [seed, *(k for k in range(1, seeds + 1) if k != seed)][:seeds]\n"
    "assert spread['walk', 'none'].isna().sum() == seeds - 1\n"
    "for k, row in spread.iterrows():\n"
    "    report.metric('end', str(k), row['walk', 'end'], '1')\n"
    "    report.metric('spread', str(k), row['walk', 'spread'], '1')\n"
    "report.save()"
)


def make(folder: Path, seconds: float = 0.0, seeds: int = 8) -> Path:
    """Notebooks and studies over seeds in ``folder``."""
    entries = []
    for study, each in (("walks", "walk"), ("more-walks", "walk"), ("troubled", "trouble")):
        more = f'seeds = 0\nsteps = 0\nseconds = 0.0\ncase = "{each}"'
        write(folder / "notebooks", f"{study}.ipynb", notebook(OPEN, TABLE, more=more))
        entries.append(
            f'[{study}]\ntitle = "Study {study}"\nnotebook = "{study}.ipynb"\nseed = 4\nseeds = {seeds}\n'
            f'case = "{each}"\n[{study}.parameters]\nsteps = 3000\nseconds = {seconds}\n'
        )
    write(folder / "notebooks", "once.ipynb", notebook(OPEN, 'report.head("One")\nreport.save()'))
    entries.append('[once]\ntitle = "Once"\nnotebook = "once.ipynb"\n')
    (folder / "notebooks" / "studies.toml").write_text("".join(entries))
    return folder


def environment(folder: Path) -> dict[str, str]:
    paths = [str(ROOT), str(PROGRAM.parent)]
    return os.environ | {LOG: str(folder / "flown"), "PYTHONPATH": os.pathsep.join(paths)}


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(PROGRAM), str(folder), *arguments],
        env=environment(folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def run(folder: Path, *arguments: str) -> str:
    """What it prints."""
    return start(folder, *arguments).communicate(timeout=240)[0]


def flown(folder: Path) -> list[tuple[int, int]]:
    """(seed, process) of each flight that began."""
    log = folder / "flown"
    return [(int(a), int(b)) for a, b in map(str.split, log.read_text().splitlines())] if log.exists() else []


def numbers(folder: Path, out: str) -> Numbers:
    found = json.loads((folder / out / "walks" / "metrics.json").read_text())["metrics"]
    return sorted((one["name"], one["subject"], one["value"]) for one in found)


@pytest.fixture
def computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[int], Numbers]:
    """The numbers of so many seeds as this process computes them; the flight that is drawn has its own."""
    monkeypatch.setenv(LOG, str(tmp_path / "own"))

    def compute(seeds: int) -> Numbers:
        found = [(name, "4", 1.0) for name in ("end", "spread")]
        for seed in (one for one in range(1, seeds + 1) if one != 4):
            values = trial(seed, steps=3000, seconds=0.0)
            found += [(name, str(seed), values["walk", name]) for name in ("end", "spread")]
        return sorted(found)

    return compute


def kept(folder: Path, out: str, study: str = "walks") -> dict[str, bytes]:
    """Content of each seed's file, by key and seed."""
    store = folder / out / ".seeds" / study
    return {f"{path.parent.name}/{path.stem}": path.read_bytes() for path in sorted(store.glob("*/*.json"))}


def wait_for(true: Callable[[], bool], seconds: float = 180.0) -> None:
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline, "it never came"
        time.sleep(0.05)


def alive(pids: set[int]) -> set[int]:
    return {
        pid for pid in pids if psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    }


def test_the_numbers_are_those_of_one_process(tmp_path, computed):
    folder = make(tmp_path)
    text = run(folder, "walks", "--jobs", "3")
    assert "seeds walks: 7 to compute, 0 are there" in text and "done  walks" in text, text
    assert len({process for _, process in flown(folder)}) > 1, "it was spread"
    assert sorted(seed for seed, _ in flown(folder)) == [1, 2, 3, 5, 6, 7, 8]
    assert numbers(folder, "reports") == computed(8) and len(kept(folder, "reports")) == 7
    about = json.loads((folder / "reports" / "walks" / "provenance.json").read_text())["seeds"]
    assert about["seeds"] == [1, 2, 3, 5, 6, 7, 8] and about["case"] == "walk"
    assert {key.partition("/")[0] for key in kept(folder, "reports")} == {about["key"]}
    assert about["parameters"] == {"steps": 3000, "seconds": 0.0}


def test_jobs_bounds_notebooks_and_seeds_together(tmp_path):
    folder = make(tmp_path, seconds=0.2, seeds=5)
    program = start(folder, "walks", "once", "more-walks", "--jobs", "2")
    most = 0
    while program.poll() is None:
        try:
            # They are forked from a server, which is the program's own child.
            below = [one for child in psutil.Process(program.pid).children() for one in child.children()]
        except psutil.Error:
            continue
        most = max(most, len(below))
        time.sleep(0.02)
    text = program.communicate()[0]
    assert all(f"done  {study}" in text for study in ("walks", "once", "more-walks")), text
    assert most == 2


def test_only_new_and_damaged_seeds_are_computed_and_all_with_other_parameters(tmp_path, computed):
    folder = make(tmp_path)
    run(folder, "walks", "--seeds", "4")
    assert sorted(seed for seed, _ in flown(folder)) == [1, 2, 3]
    assert len({process for _, process in flown(folder)}) == 1
    store = folder / "reports" / ".seeds" / "walks" / next(iter(kept(folder, "reports"))).partition("/")[0]
    whole = (store / "2.json").read_bytes()
    content = bytearray(whole)
    content[content.index(b'"walk/end": ') + 12] ^= 1
    (store / "2.json").write_bytes(bytes(content))
    text = run(folder, "walks", "once", "--seeds", "6", "--jobs", "2")
    assert "--seeds has no effect on once" in text and "seeds walks: 3 to compute, 2 are there" in text
    assert sorted(seed for seed, _ in flown(folder)[3:]) == [2, 5, 6]
    assert numbers(folder, "reports") == computed(6) and (store / "2.json").read_bytes() == whole
    origin = json.loads((folder / "reports" / "walks" / "provenance.json").read_text())["seeds"]
    assert origin["digests"]["2"] == json.loads(whole)["digest"]
    studies = folder / "notebooks" / "studies.toml"
    studies.write_text(studies.read_text().replace("steps = 3000", "steps = 2000"))
    run(folder, "walks", "--seeds", "3")
    assert len(flown(folder)) == 6 + 2
    after = {key.partition("/")[0] for key in kept(folder, "reports")}
    assert len(after) == 1 and after != {store.name}, "what the old parameters left is swept"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_run_that_is_broken_off_goes_on_where_it_stopped(tmp_path, number, computed):
    folder = make(tmp_path, seconds=0.4, seeds=12)
    program = start(folder, "walks", "--jobs", "2")
    wait_for(lambda: len(kept(folder, "reports")) >= 3)
    processes = {process for _, process in flown(folder)}
    os.killpg(program.pid, number)
    assert program.wait(20) != 0
    wait_for(lambda: not alive(processes), 20)
    first = {path: path.stat().st_mtime_ns for path in folder.glob("reports/.seeds/walks/*/*.json")}
    assert 3 <= len(first) < 11
    assert not (folder / "reports" / "walks" / "status.json").exists()
    begun = len(flown(folder))
    text = run(folder, "walks", "--jobs", "2")
    assert f"{11 - len(first)} to compute, {len(first)} are there" in text and "done  walks" in text
    again = {seed for seed, _ in flown(folder)[begun:]}
    assert again == {1, 2, 3, *range(5, 13)} - {int(path.stem) for path in first}
    assert {path: path.stat().st_mtime_ns for path in first} == first, "finished seeds were not written again"
    assert numbers(folder, "reports") == computed(12)


def test_seeds_that_fail_are_named_and_the_others_kept(tmp_path):
    folder = make(tmp_path, seeds=7)
    text = run(folder, "troubled", "once", "--jobs", "2", "--timeout", "15")
    status = json.loads((folder / "reports" / "troubled" / "status.json").read_text())
    assert status["state"] == "failed", text
    reason = "Seed 2 failed (so did 2 more: 3, 5): The flight of seed 2 has no solution. Look at it."
    assert status["reason"] == reason and reason in " ".join(text.split())
    page = (folder / "reports" / "troubled" / "report.html").read_text()
    assert "This study failed" in page and "wildlab run troubled" in page and "no solution" in page
    assert sorted(int(key.partition("/")[2]) for key in kept(folder, "reports", "troubled")) == [1, 6, 7]
    assert "done  once" in text


# -- a cluster
# ------------------------------------------------------------------------------------


class Cluster:
    """A scheduler and workers on this machine."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.workers: list[subprocess.Popen[bytes]] = []
        options = ("--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
        self.scheduler = self._start("scheduler", *options)
        wait_for(lambda: socket.socket().connect_ex(("127.0.0.1", port)) == 0)

    def add_worker(self) -> None:
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        self.workers.append(self._start("worker", self.address, *options, "--preload", str(PROGRAM)))

    def wait_for_workers(self, count: int) -> None:
        from distributed import Client

        with Client(self.address, timeout=30, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=60)

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            env=environment(self._folder) | one_thread,
            cwd=self._folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait(20)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    pytest.importorskip("distributed", reason="needs dask.distributed (the extra `cluster`)")
    one = Cluster(tmp_path)
    yield one
    one.end()


def test_a_cluster_that_loses_a_worker_gives_the_same_numbers(tmp_path, cluster, computed):
    folder = make(tmp_path, seconds=0.8, seeds=12)
    for _ in range(2):
        cluster.add_worker()
    cluster.wait_for_workers(2)
    # Long enough for a worker that is slow to begin to have its share.
    program = start(folder, "walks", "--out", "cluster", "--scheduler", cluster.address)
    both = {worker.pid for worker in cluster.workers}
    wait_for(lambda: len(kept(folder, "cluster")) >= 2 and {process for _, process in flown(folder)} == both)
    assert program.poll() is None
    victim = cluster.workers[0]
    victim.kill()
    begun = len(flown(folder))
    text = program.communicate(timeout=120)[0]
    assert "done  walks" in text, text
    assert {process for _, process in flown(folder)[begun:]} == {cluster.workers[1].pid}
    assert {seed for seed, _ in flown(folder)} == {1, 2, 3, *range(5, 13)}
    assert numbers(folder, "cluster") == computed(12)


def test_a_scheduler_that_goes_away_is_a_sentence(tmp_path, cluster):
    folder = make(tmp_path, seconds=0.4, seeds=50)
    cluster.add_worker()
    cluster.wait_for_workers(1)
    program = start(folder, "walks", "--scheduler", cluster.address, "--timeout", "60")
    wait_for(lambda: len(kept(folder, "reports")) >= 2 or program.poll() is not None)
    assert program.poll() is None, program.communicate()[0]
    cluster.end()
    text = program.communicate(timeout=120)[0]
    assert program.returncode == 1 and "--scheduler" in text and "run it again" in text, text
    assert len(kept(folder, "reports")) >= 2
