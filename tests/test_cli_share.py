"""The command `wildlab share`: its words, its password, its exit codes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from wildlab.cli import wildlab
from wildlab.commands.sharing import VARIABLE
from wildlab.sharing import share as sharing


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What the command asks for; nothing is made."""
    calls: list[dict[str, Any]] = []

    def made(report: Path, tier: str, **given: Any) -> sharing.Shared:
        calls.append({"report": report, "tier": tier, **given})
        return sharing.Shared(Path("flight-public.html"), Path("told.txt"), ("origin: '1, 2' -> withheld",))

    monkeypatch.setattr(sharing, "share", made)
    return calls


def test_the_most_careful_is_the_default(asked):
    result = CliRunner().invoke(wildlab, ["share", "reports/mine"])
    assert result.exit_code == 0, result.output
    assert (asked[0]["tier"], asked[0]["password"], asked[0]["overwrite"]) == ("public", None, False)
    # What was removed is for the terminal, and the file for the next command.
    assert result.stdout == "flight-public.html\n"
    assert "origin: '1, 2' -> withheld" in result.stderr and "told.txt" in result.stderr


def test_a_password_comes_from_the_environment_or_is_asked_for_twice(asked):
    words = "four words that differ"
    CliRunner().invoke(wildlab, ["share", "reports/mine", "--encrypt"], env={VARIABLE: words})
    typed = CliRunner().invoke(
        wildlab, ["share", "reports/mine", "--encrypt"], input=f"{words}\n{words}\n", env={VARIABLE: ""}
    )
    assert [call["password"] for call in asked] == [words, words]
    assert words not in typed.output


@pytest.mark.slow
def test_without_a_terminal_the_variable_is_named(tmp_path):
    """In a process of its own session, which has no terminal: one sentence, no warning of Python's."""
    done = subprocess.run(
        [sys.executable, "-m", "wildlab", "share", "reports/mine", "--encrypt"],
        cwd=tmp_path, env={**os.environ, VARIABLE: ""}, stdin=subprocess.DEVNULL, start_new_session=True,
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 2 and not done.stdout
    assert VARIABLE in done.stderr and "Warning" not in done.stderr


def test_no_option_takes_a_password(asked):
    """Others on the machine can read what is typed after a command."""
    result = CliRunner().invoke(wildlab, ["share", "reports/mine", "--password", "x"])
    assert result.exit_code == 2 and not asked
