"""The linter and the type checker, as tests, so that one command and one summary tell all."""

from __future__ import annotations

import subprocess
import sys

import pytest

from wildlab import paths


def run(*command: str) -> None:
    command = (sys.executable, "-m", *command)
    done = subprocess.run(command, cwd=paths.ROOT, capture_output=True, text=True, timeout=900, check=False)
    if done.returncode:
        pytest.fail(f"{' '.join(command[2:])}:\n{done.stdout}{done.stderr}", pytrace=False)


def test_ruff():
    run("ruff", "check", "--quiet", "--output-format", "concise", ".")


@pytest.mark.slow
def test_mypy():
    run("mypy")
