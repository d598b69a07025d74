"""Real notebooks in real kernels: those that succeed, and every way of failing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from rich.console import Console

from tests.notebooks import OPEN, notebook, write
from wildlab.paths import ROOT
from wildlab.runner.run import Outcome, run_studies

pytestmark = pytest.mark.slow

SHOW = (
    'report.head("A <good> report", "sub")\n'
    "from wildlab.reporting.figures import new_figure\n"
    "import numpy as np\n"
    "fig, ax = new_figure(4, 3)\n"
    "values = np.random.default_rng(seed).standard_normal(runs)\n"
    "ax.plot(values)\n"
    'report.section("Figures")\n'
    'report.figure(fig, name="fig-1", alt="A line.", caption="A line.")\n'
    'report.metric("mean", "all", values.mean(), "m", n=runs)\n'
    "report.save()"
)
#: A process of the notebook's own, which must not outlive it; {} is where its number goes.
SLEEP = (
    "import subprocess, sys, pathlib, os\n"
    'child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(300)"])\n'
    "pathlib.Path({!r}).write_text(f'{{os.getpid()}} {{child.pid}}')\n"
    "child.wait()"
)
HEAD = 'report.head("A report")\nreport.section("The hard part")'

STUDIES = {
    "good": [OPEN, SHOW],
    "again": [OPEN, SHOW],
    "raises": [OPEN, HEAD, "import wildlab.errors\n1 / 0"],
    "complains": [
        OPEN,
        HEAD,
        'from wildlab.errors import WildlabError\nraise WildlabError("it is raining", "wait")',
    ],
    "dies": ["# A heading", OPEN, "import os, signal\nos.kill(os.getpid(), signal.SIGKILL)", "# Not reached"],
    "unsaved": [OPEN, HEAD],
    "scripted": [
        OPEN,
        'report.head("a")\nreport.save()\nfrom IPython.display import HTML, display\n'
        'display(HTML("<script>1</script>"))',
    ],
}


def make_studies(folder: Path, pids: Path) -> Path:
    entries = []
    for name, cells in {**STUDIES, "slow": [OPEN, HEAD, SLEEP.format(str(pids))]}.items():
        write(folder, f"{name}.ipynb", notebook(*cells, more="runs = 3"))
        limit = "timeout_minutes = 0.75\n" if name == "slow" else ""
        entries.append(f'[{name}]\ntitle = "Study {name}"\nnotebook = "{name}.ipynb"\n{limit}')
        entries.append(f"[{name}.parameters]\nruns = 5\n")
    (folder / "studies.toml").write_text("".join(entries))
    return folder


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Outcome], str, list[int]]:
    """All studies, two at a time, with a foreign kernel of the same name lying in wait."""
    base = tmp_path_factory.mktemp("run with blank {and} braces")
    kernel = base / "jupyter" / "kernels" / "python3"
    kernel.mkdir(parents=True)
    (kernel / "kernel.json").write_text(
        json.dumps({"argv": ["false"], "display_name": "x", "language": "python"})
    )
    notebooks, reports = make_studies(base / "notebooks", base / "pids"), base / "reports"
    (reports / "raises").mkdir(parents=True)
    for name in ("metrics.json", "report.html", "status.json"):
        (reports / "raises" / name).write_text("old")
    with pytest.MonkeyPatch.context() as patch, (base / "log").open("w") as log:
        patch.setenv("JUPYTER_PATH", str(base / "jupyter"))
        outcomes = run_studies(
            everything=True,
            notebooks=notebooks,
            reports=reports,
            parallel=2,
            console=Console(file=log, force_terminal=False),
        )
    pids = [int(pid) for pid in (base / "pids").read_text().split()]
    return reports, {one.name: one for one in outcomes}, (base / "log").read_text(), pids


def gone(pids: list[int]) -> bool:
    """Whether the processes have ended; waits a little for the system to notice."""
    for _ in range(50):
        alive = [pid for pid in pids if psutil.pid_exists(pid)]
        if all(psutil.Process(pid).status() == psutil.STATUS_ZOMBIE for pid in alive):
            return True
        time.sleep(0.1)
    return False


def test_a_good_run_leaves_everything(ran):
    reports, outcomes, log, _ = ran
    folder = reports / "good"
    assert outcomes["good"].state == "done", outcomes["good"].reason
    left = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert left == {
        *("report.html", "metrics.json", "provenance.json", "notebook.ipynb", "status.json"),
        "figures/fig-1.png",
    }
    status = json.loads((folder / "status.json").read_text())
    assert (status["study"], status["state"], status["reason"]) == ("good", "done", "")
    content = json.loads((folder / "metrics.json").read_text())
    assert content["metrics"][0]["n"] == 5, "the study's own parameter arrived"
    assert json.loads((folder / "provenance.json").read_text())["parameters"] == {"runs": 5}
    assert "done  good" in log and "failed  raises" in log


def test_the_same_seed_gives_the_same_numbers_and_figures(ran):
    reports = ran[0]
    one, two = (json.loads((reports / name / "metrics.json").read_text()) for name in ("good", "again"))
    assert one["metrics"] == two["metrics"]
    figures = [(reports / study / "figures" / "fig-1.png").read_bytes() for study in ("good", "again")]
    assert figures[0] == figures[1]


@pytest.mark.parametrize(
    ("study", "reason", "step"),
    [
        ("raises", "The computation raised ZeroDivisionError: division by zero", "The hard part"),
        ("complains", "It is raining. Wait.", "The hard part"),
        ("dies", "crashed or was ended from outside", "A heading"),
        ("unsaved", "wrote no metrics.json", "The hard part"),
        ("scripted", "has a <script>", ""),
        ("slow", "time limit of 45 seconds", "The hard part"),
    ],
)
def test_a_failed_run_says_so_in_words(ran, study, reason, step):
    reports, outcomes, _, _ = ran
    assert outcomes[study].state == "failed" and reason in outcomes[study].reason
    status = json.loads((reports / study / "status.json").read_text())
    assert status["state"] == "failed" and reason in status["reason"]
    page = (reports / study / "report.html").read_text(encoding="utf-8")
    assert "This study failed" in page and f"wildlab run {study}" in page and "<script" not in page
    assert not step or f"step <b>{step}</b>" in page
    assert "Not reached" not in page
    assert not (reports / study / "metrics.json").exists()
    assert (reports / study / "notebook.ipynb").is_file()


def test_nothing_outlives_a_time_limit(ran):
    assert len(ran[3]) == 2 and gone(ran[3])


def test_nothing_is_left_lying_about(ran):
    reports = ran[0]
    assert not list(reports.glob(".*.part")) and not list((reports.parent / "notebooks").glob("*ipc*"))
    assert {path.name for path in (reports.parent / "notebooks").iterdir()} == {
        "studies.toml",
        "slow.ipynb",
        *(f"{name}.ipynb" for name in STUDIES),
    }


def test_no_path_of_this_machine_is_in_any_output(ran):
    reports = ran[0]
    secrets = [str(reports.parent), str(ROOT), sys.prefix]
    secrets += [str(Path.home()) + "/"] if len(str(Path.home())) > 1 else []
    looked = 0
    for path in reports.rglob("*"):
        if path.is_file():
            content, looked = path.read_bytes(), looked + 1
            assert not [secret for secret in secrets if secret.encode() in content], path.name
    assert looked > 40


def test_every_page_opens_offline(ran, faults):
    pages = [ran[0] / "index.html", *(ran[0] / name / "report.html" for name in ("good", "raises", "slow"))]
    assert {page.parent.name: faults(page) for page in pages} == {page.parent.name: [] for page in pages}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_run_that_is_broken_off_keeps_the_former_report(tmp_path, number):
    pids, reports = tmp_path / "pids", tmp_path / "reports"
    notebooks = make_studies(tmp_path / "notebooks", pids)
    (reports / "slow").mkdir(parents=True)
    former = {"report.html": "old", "metrics.json": "old", "status.json": "old"}
    for name, text in former.items():
        (reports / "slow" / name).write_text(text)
    program = tmp_path / "program.py"
    program.write_text(
        "import signal\nfrom pathlib import Path\nfrom wildlab.runner.run import run_studies\n"
        # In the background of a script Ctrl-C is ignored from birth; in a terminal it is not.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"if __name__ == '__main__':\n    run_studies(['slow'], notebooks=Path({str(notebooks)!r}), "
        f"reports=Path({str(reports)!r}))\n"
    )
    runner = subprocess.Popen(
        [sys.executable, str(program)], stderr=subprocess.DEVNULL, start_new_session=True
    )
    deadline = time.monotonic() + 60
    while not (pids.exists() and len(pids.read_text().split()) == 2) and time.monotonic() < deadline:
        time.sleep(0.1)
    os.killpg(runner.pid, number)
    assert runner.wait(20) != 0
    assert gone([int(pid) for pid in pids.read_text().split()])
    assert {path.name: path.read_text() for path in (reports / "slow").iterdir()} == former

    def left() -> list[Path]:
        return list(reports.glob(".*.part"))

    # A notebook whose runner was killed tidies up after itself, which on a busy machine takes a while.
    deadline = time.monotonic() + 30
    while left() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert left() == [], "nothing is left of the work, whoever ended it"


#: A notebook that ends as soon as what it waits for does, in a process whose folder takes a while to remove.
KILLED = """
import multiprocessing, shutil, subprocess, sys, time
from pathlib import Path
from wildlab.runner import job as notebook_process
from wildlab.runner.processes import start_process
from wildlab.runner.job import Job

def body(pipe, job, begun):
    remove = shutil.rmtree
    def outcome(*_):
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(300)"])
        Path(begun).touch()
        child.wait()
        return ("done", None)
    notebook_process._outcome = outcome
    shutil.rmtree = lambda folder, **more: (time.sleep(1.0), remove(folder, **more))
    notebook_process.run_notebook(pipe, job)

if __name__ == "__main__":
    base = Path(sys.argv[1])
    theirs, ours = multiprocessing.Pipe()
    job = Job("a", "A", "a.ipynb", work=str(base / "work"), reports=str(base))
    start_process("a", body, ours, job, str(base / "begun"))
    time.sleep(300)
"""


def test_a_notebook_whose_runner_is_killed_does_not_end_before_its_folder_is_gone(tmp_path):
    program, folder = tmp_path / "program.py", tmp_path / "work"
    program.write_text(KILLED)
    folder.mkdir()
    runner = subprocess.Popen([sys.executable, str(program), str(tmp_path)], start_new_session=True)
    deadline = time.monotonic() + 60
    while not (tmp_path / "begun").exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    os.killpg(runner.pid, signal.SIGKILL)
    runner.wait(20)
    deadline = time.monotonic() + 30
    while folder.exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not folder.exists()
