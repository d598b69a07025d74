"""Notebooks are kept without outputs, take parameters and stay short: checked here, not only by a filter."""

from __future__ import annotations

import ast
import importlib
import json
import re
import shutil
import subprocess
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from wildlab import paths

MOST_CODE_LINES = 250
#: A path that exists on one machine only: /home/..., /Users/..., /tmp/..., C:...
ABSOLUTE = re.compile(
    r"""(?:^|[\s"'=(\[,])(?:/(?:home|Users|root|tmp|mnt|media|work|opt|data|srv)/|[A-Za-z]:[\\/]{1,2}\w)"""
)


def tracked_notebooks(root: Path) -> list[Path]:
    """Those git knows; without git, those on disk."""
    if shutil.which("git") and (root / ".git").exists():
        command = ["git", "ls-files", "-z", "--", "*.ipynb"]
        done = subprocess.run(command, cwd=root, capture_output=True, check=True, timeout=60)
        names = [name for name in done.stdout.decode().split("\0") if name]
        return sorted(root / name for name in names if (root / name).exists())
    found = (root / "notebooks").rglob("*.ipynb")
    return sorted(path for path in found if ".ipynb_checkpoints" not in path.parts)


def text_of(cell: dict[str, Any]) -> str:
    source = cell.get("source", "")
    return source if isinstance(source, str) else "".join(source)


def problems(notebook: dict[str, Any], tutorial: bool = False) -> list[str]:
    """What keeps this notebook from being committed, one sentence each. A tutorial takes no parameters."""
    found = []
    cells = notebook.get("cells", [])
    code = [cell for cell in cells if cell.get("cell_type") == "code"]
    for number, cell in enumerate(cells, start=1):
        if cell.get("outputs"):
            found.append(f"cell {number} has outputs: run 'make strip'")
        if cell.get("execution_count") is not None:
            found.append(f"cell {number} has an execution count: run 'make strip'")
        if ABSOLUTE.search(text_of(cell)):
            found.append(f"cell {number} names an absolute path")
    parameters = [cell for cell in code if "parameters" in cell.get("metadata", {}).get("tags", [])]
    wanted = 0 if tutorial else 1
    if len(parameters) != wanted:
        found.append(f"{len(parameters)} cells are tagged 'parameters' and there must be {wanted or 'none'}")
    lines = sum(len([line for line in text_of(cell).splitlines() if line.strip()]) for cell in code)
    if lines > MOST_CODE_LINES:
        found.append(f"{lines} lines of code: move some into wildlab ({MOST_CODE_LINES} at most)")
    if notebook.get("metadata", {}).get("kernelspec", {}).get("name", "python3") != "python3":
        found.append("its kernel is not python3")
    if "widgets" in notebook.get("metadata", {}):
        found.append("it keeps the state of widgets: run 'make strip'")
    for number, cell in enumerate(cells, start=1):
        try:
            if cell.get("cell_type") == "code":
                ast.parse(text_of(cell))
        except SyntaxError as error:
            found.append(f"cell {number} is not plain Python: {error.msg}")
    return found


def test_tracked_notebooks():
    notebooks = tracked_notebooks(paths.ROOT)
    assert notebooks, "no notebook found"
    found = {
        str(path.relative_to(paths.ROOT)): faults
        for path in notebooks
        if (faults := problems(json.loads(path.read_text(encoding="utf-8")), path.parent.name == "tutorials"))
    }
    assert not found


def test_what_notebooks_import_is_there():
    missing = []
    for path in tracked_notebooks(paths.ROOT):
        cells = [one for one in json.loads(path.read_text())["cells"] if one["cell_type"] == "code"]
        for node in ast.walk(ast.parse("\n".join(map(text_of, cells)))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("wildlab"):
                home = importlib.import_module(str(node.module))
                names = [one.name for one in node.names if not hasattr(home, one.name)]
                # A module of a room is no attribute before it is imported.
                missing += [one for one in names if find_spec(f"{node.module}.{one}") is None]
    assert missing == []
