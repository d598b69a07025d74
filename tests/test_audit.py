"""What the audit of packages says of an answer, and where there is none."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

SPEC = importlib.util.spec_from_file_location("audit", Path(__file__).parents[1] / "tools" / "audit.py")
assert SPEC is not None and SPEC.loader is not None
audit = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(audit)

CLEAN = {"name": "a", "version": "1", "vulns": []}
FAULTY = {"name": "b", "version": "2", "vulns": [{"id": "CVE-1", "fix_versions": ["2.1"]}]}
UNKNOWN = {"name": "c", "skip_reason": "not found"}


@pytest.mark.parametrize(
    ("packages", "code", "said"),
    [
        ([CLEAN], 0, ["0 known faults in 1 of 1 packages of environment.lock."]),
        (
            [CLEAN, FAULTY],
            1,
            ["b 2: CVE-1, mended in 2.1", "1 known faults in 2 of 2 packages of environment.lock."],
        ),
        (
            [CLEAN, UNKNOWN],
            2,
            [
                "0 known faults in 1 of 2 packages of environment.lock.",
                "1 could not be looked up on the package index: check the network.",
            ],
        ),
    ],
)
def test_what_is_said_and_the_exit_code(packages: list[dict[str, Any]], code: int, said: list[str]) -> None:
    assert audit.report({"dependencies": packages}) == (said, code)


def test_a_tool_that_does_not_run_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Ran:
        stdout, stderr = "", "trying\nno route to host\n"

    monkeypatch.setattr(audit.subprocess, "run", lambda *a, **k: Ran())
    assert audit.main() == 2
    assert capsys.readouterr().out == "pip-audit did not run (no route to host): check the network.\n"
