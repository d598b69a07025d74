"""Lines that are broken one at a time, and the tests that must notice: ``make mutants``.

``tests/mutants.toml`` names for each a file, a piece of one line that occurs once in it, what takes its
place, and the tests that are to fail. The code is broken in a copy of the checkout, whose tests are run whole
first. Exit code 0 where every mutant dies, 1 where one lives, 2 where the list or the whole copy is wrong.

More arguments are parts of files' names: ``make mutants ARGS="geometry tracking/many"``.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
#: What the tests of the copy need.
COPIED = ("wildlab", "tests", "data", "notebooks", "docs", "tools", "benchmarks")
#: A mutant that goes on for ever is dead, too.
PATIENCE_S = 600


class Mutant(NamedTuple):
    """A line that is broken: ``line``, which occurs once in ``file``, becomes another."""

    file: str
    line: str
    becomes: str
    tests: tuple[str, ...]


def load_mutants(path: Path) -> list[Mutant]:
    """The list, as it stands in the file."""
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    return [
        Mutant(one["file"], one["line"], one["becomes"], tuple(one["tests"])) for one in content["mutant"]
    ]


def faults(mutants: Sequence[Mutant], root: Path) -> list[str]:
    """What is wrong with the list: lines that do not occur once, tests that are not there."""
    found = []
    for one in mutants:
        count = (
            (root / one.file).read_text(encoding="utf-8").count(one.line)
            if (root / one.file).is_file()
            else 0
        )
        if count != 1:
            found.append(f"{one.file}: {one.line!r} occurs {count} times")
        if one.line == one.becomes or "\n" in one.line + one.becomes:
            found.append(f"{one.file}: {one.line!r} does not become another line")
        found += [f"{one.file}: no test {test}" for test in one.tests if not (root / test).is_file()]
    return found


def main(names: Sequence[str]) -> int:
    mutants = load_mutants(ROOT / "tests" / "mutants.toml")
    mutants = [one for one in mutants if not names or any(name in one.file for name in names)]
    wrong = faults(mutants, ROOT)
    if wrong or not mutants:
        print("\n".join(wrong) or "no mutant of that name")
        return 2
    with tempfile.TemporaryDirectory(prefix="wildlab-mutants-") as folder:
        copy = Path(folder)
        _copy(copy)
        if not _pass(copy, sorted({test for one in mutants for test in one.tests})):
            print("The tests fail where nothing is broken: mend that first.")
            return 2
        living = list(_living(copy, mutants))
    print(f"{len(mutants) - len(living)} of {len(mutants)} died.")
    return 1 if living else 0


def _living(copy: Path, mutants: Sequence[Mutant]) -> Iterator[Mutant]:
    for number, one in enumerate(mutants, 1):
        path = copy / one.file
        whole = path.read_text(encoding="utf-8")
        path.write_text(whole.replace(one.line, one.becomes), encoding="utf-8")
        lives = _pass(copy, one.tests)
        path.write_text(whole, encoding="utf-8")
        print(
            f"{number}/{len(mutants)} {'LIVES' if lives else 'died '} {one.file}: {one.becomes}", flush=True
        )
        if lives:
            yield one


def _copy(folder: Path) -> None:
    leave = shutil.ignore_patterns("__pycache__", "fetched")
    for name in COPIED:
        shutil.copytree(ROOT / name, folder / name, ignore=leave)
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy(path, folder)


def _pass(folder: Path, tests: Sequence[str]) -> bool:
    data = os.environ.get("WILDLAB_TEST_DATA") or str(ROOT.parent / "shared" / "data")
    environment = os.environ | {"PYTHONPATH": str(folder), "WILDLAB_TEST_DATA": data, "CI": "true"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        ran = subprocess.run(  # noqa: S603 - our own list, and no shell
            command, cwd=folder, env=environment, capture_output=True, timeout=PATIENCE_S, check=False
        )
    except subprocess.TimeoutExpired:
        return False
    return ran.returncode == 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
