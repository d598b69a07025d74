"""Commands that pages, help texts and the README print are ones that can be typed."""

from __future__ import annotations

import re
import shlex

import click
import pytest

from wildlab.cli import main, wildlab
from wildlab.paths import ROOT

#: In backticks, as HTML, or on a line of its own; what stands two blanks behind it is an explanation.
_PRINTED = re.compile(r"(?:`|<code>|^ {4,8})wildlab ([a-z][a-z-]*(?: [^`<\n]*?)?)(?:`|<| {2,}|$)", re.M)


def printed() -> list[str]:
    assert ROOT is not None
    folders = [ROOT / "wildlab", ROOT / "data", ROOT / "docs"]
    files = [file for folder in folders for file in (*folder.rglob("*.py"), *folder.rglob("*.md"))]
    files += [ROOT / "README.md", *(ROOT / "notebooks").glob("*.ipynb")]
    found = [command for file in files for command in _PRINTED.findall(file.read_text(encoding="utf-8"))]
    return sorted({command.strip() for command in found if "{" not in command and "..." not in command})


def test_every_command_that_is_printed_can_be_typed():
    commands, wrong = printed(), []
    assert len(commands) > 60
    for command in commands:
        name, *arguments = shlex.split(command, comments=True)
        if name not in wildlab.commands:
            wrong.append(command)
        elif arguments:
            try:
                wildlab.commands[name].make_context(name, arguments)
            except click.UsageError as error:
                # A text may name a command with an option alone, and its files are not here.
                named = isinstance(error, click.MissingParameter) or "requires an argument" in error.message
                if not named and "does not exist" not in error.message:
                    wrong.append(f"{command}: {error.message}")
    assert wrong == []


@pytest.mark.slow
def test_the_front_pages_own_commands_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = str(tmp_path / "reports")
    for line in (
        "simulate large-ship --out flights/trial",
        f"evaluate flights/trial --out {out}",
        f"track flights/trial --out {out}/trial-tracking --overwrite",
        f"replay flights/trial --out {out}/trial-replay",
        f"share {out}/trial",
    ):
        with pytest.raises(SystemExit) as ended:
            main(line.split())
        assert ended.value.code == 0, line
    assert (tmp_path / "flight-public.html").is_file()
