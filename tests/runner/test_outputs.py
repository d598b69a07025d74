"""What a run leaves behind: whole or not at all, and nothing about this machine."""

from __future__ import annotations

import getpass
import json
import os
import platform
import signal
import sys
from pathlib import Path
from typing import Any

import nbformat
import pytest

from tests.notebooks import notebook, write
from wildlab.files import write_atomic, write_json
from wildlab.paths import ROOT
from wildlab.reporting import notebook_pages as privacy
from wildlab.runner import job as outputs
from wildlab.runner import provenance

DONE = {"study": "s", "state": "done", "reason": "", "seconds": 1.0}


def work_folder(parent: Path, *names: str, text: str = "new") -> Path:
    folder = parent / f".s.{os.getpid()}.part"
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return folder


def contents(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): p.read_text() for p in folder.rglob("*") if p.is_file()}


def test_install_replaces_what_a_run_makes_and_leaves_what_is_not_ours(tmp_path):
    target = tmp_path / "s"
    old = outputs.install(
        work_folder(tmp_path, "report.html", "metrics.json", "figures/old.png"), target, DONE
    )
    assert old is None
    (target / "my notes.txt").write_text("keep")
    for path in tmp_path.glob(".*.part"):
        outputs.clear_folder(path)
    outputs.install(
        work_folder(tmp_path, "report.html", "figures/new.png"), target, DONE | {"state": "failed"}
    )
    found = contents(target)
    assert set(found) == {"report.html", "figures/new.png", "my notes.txt", "status.json"}
    assert json.loads(found["status.json"])["state"] == "failed"


def test_as_long_as_files_move_there_is_no_status(tmp_path, monkeypatch):
    target = tmp_path / "s"
    outputs.install(work_folder(tmp_path, "report.html", "metrics.json", text="old"), target, DONE)
    outputs.clear_folder(next(tmp_path.glob(".*.part")))
    folder = work_folder(tmp_path, "report.html", "metrics.json")
    moved: list[Path] = []

    def dies(self: Path, other: Path) -> None:
        moved.append(self)
        raise OSError("the machine stops here")

    monkeypatch.setattr(Path, "replace", dies)
    with pytest.raises(OSError, match="stops here"):
        outputs.install(folder, target, DONE)
    assert moved and not (target / "status.json").exists()


def test_ctrl_c_waits_for_the_move(tmp_path, monkeypatch):
    folder = work_folder(tmp_path, "report.html")
    real = outputs.seal

    def interrupted(*given: Any) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        real(*given)

    monkeypatch.setattr(outputs, "seal", interrupted)
    with pytest.raises(KeyboardInterrupt):
        outputs.install(folder, tmp_path / "s", DONE)
    assert set(contents(tmp_path / "s")) == {"report.html", "status.json"}


def test_leftovers_of_killed_runners_are_swept_and_those_of_running_ones_are_not(tmp_path):
    for name in (f".s.{os.getpid()}.part", ".s.999999999.part", ".other", ".young.999999999.part"):
        (tmp_path / name).mkdir()
        if "young" not in name:
            os.utime(tmp_path / name, (0, 0))
    outputs.sweep(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        f".s.{os.getpid()}.part",
        ".other",
        ".young.999999999.part",
    }


def test_atomic_writing(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"a": 1})
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text()) == {"a": 1}
    assert [one.name for one in tmp_path.iterdir()] == ["a.json"]
    write_atomic(path, b"2")
    assert path.read_bytes() == b"2" and path.stat().st_mode & 0o777 == 0o644


def test_text_loses_the_paths_of_this_machine():
    text = f"{ROOT}/wildlab/a.py, {sys.prefix}/lib, {Path.home()}/x, /tmp/ipykernel_123/456.py \x1b[31mred"
    cleaned = privacy.clean_text(text)
    assert str(ROOT) not in cleaned and sys.prefix not in cleaned and "ipykernel" not in cleaned
    assert "[wildlab]/wildlab/a.py" in cleaned and cleaned.endswith("red")
    assert "[wildlab]" not in privacy.clean_text(f"{ROOT}-else/x")


def test_an_executed_notebook_can_be_passed_on(tmp_path):
    node = notebook("1 / 0")
    injected = nbformat.v4.new_code_cell(f'out = "{tmp_path}"')
    injected.metadata["tags"] = ["injected-parameters"]
    node.cells.insert(1, injected)
    output = nbformat.v4.new_output("error", ename="E", evalue=f"in {tmp_path}", traceback=[f"{ROOT}/a.py"])
    node.cells[2].outputs = [output]
    cleaned = privacy.clean_notebook(node, {"out": ".", "seed": 1}, {str(tmp_path): "."})
    whole = nbformat.writes(cleaned)
    assert str(tmp_path) not in whole and str(ROOT) not in whole
    assert "out = '.'" in cleaned.cells[1].source and "seed = 1" in cleaned.cells[1].source
    assert str(tmp_path) in nbformat.writes(node), "the original stays as it was"


def test_provenance_says_where_numbers_come_from_and_not_who_or_where(tmp_path):
    flight = tmp_path / "flight"
    flight.mkdir()
    manifest = (
        'name = "rhino"\nkind = "logged"\n[origin]\nlatitude_deg = -24.123456\nlongitude_deg = 31.654321\n'
    )
    (flight / "flight.toml").write_text(manifest)
    path = write(tmp_path, "a.ipynb", notebook())
    found = provenance.collect(study="s", notebook=path, flight=flight, parameters={"runs": 3}, seed=7)
    text = json.dumps(found) + provenance.footer(found)
    assert found["flight"]["locations"] == "withheld" and found["seed"] == 7
    assert len(found["flight"]["files"]["flight.toml"]) == 64
    for secret in ("24.123456", "31.654321", str(tmp_path), platform.node(), str(Path.home())):
        assert len(secret) < 3 or secret not in text
    assert getpass.getuser() not in json.dumps(found["platform"])
