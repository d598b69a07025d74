"""What the audit of packages says of an answer, and where there is none."""

import importlib.util
from pathlib import Path

import pytest

SPEC = importlib.util.spec_from_file_location("audit", Path(__file__).parents[1] / "tools" / "audit.py")
assert SPEC is not None and SPEC.loader is not None
audit = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(audit)

CLEAN = {"name": "a", "version": "1", "vulns": []}
FAULTY = {"name": "b", "version": "2", "vulns": [{"id": "CVE-1", "fix_versions": ["2.1"]}]}
UNKNOWN = {"name": "c", "skip_reason": "not found"}


@pytest.mark.parametrize(("packages", "code"), [([CLEAN], 0), ([CLEAN, FAULTY], 1), ([CLEAN, UNKNOWN], 2)])
def test_the_exit_code(packages, code):
    said, found = audit.report({"dependencies": packages})
    assert found == code and any("CVE-1" in line for line in said) == (code == 1)


def test_a_tool_that_does_not_run_is_no_clean_audit(monkeypatch):
    class Ran:
        stdout, stderr = "", "trying\nno route to host\n"

    monkeypatch.setattr(audit.subprocess, "run", lambda *a, **k: Ran())
    assert audit.main() == 2
