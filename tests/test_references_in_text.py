"""Names of wildlab that docstrings and documents give in backquotes are there."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from wildlab.paths import ROOT

_NAMED = re.compile(r"`(wildlab\.[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)`")


@cache
def names_in(source: Path) -> set[str]:
    """Whatever a module defines, imports or assigns, at any depth."""
    found = set()
    for node in ast.walk(ast.parse(source.read_bytes())):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.alias):
            found.add((node.asname or node.name).split(".")[-1])
    return found


def is_there(name: str, root: Path) -> bool:
    """Whether a dotted name is a module, or something in one."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        base = root.joinpath(*parts[:k])
        module = base.with_suffix(".py")
        if not module.is_file():
            module = base / "__init__.py"
        if module.is_file():
            return k == len(parts) or parts[k] in names_in(module)
    return False


def missing(root: Path) -> list[str]:
    files = [root / "CONTRIBUTING.md", *(root / "docs").glob("*.md"), *(root / "wildlab").rglob("*.py")]
    return [
        f"{file.relative_to(root)}: {name}"
        for file in files
        for name in _NAMED.findall(file.read_text(encoding="utf-8"))
        if not is_there(name, root)
    ]


def test_what_is_named_is_there():
    assert ROOT is not None
    assert missing(ROOT) == []


def test_a_name_that_has_gone_is_found(tmp_path):
    (tmp_path / "wildlab" / "room").mkdir(parents=True)
    (tmp_path / "docs").mkdir()
    (tmp_path / "CONTRIBUTING.md").write_text("`wildlab.room.a.gone`, `wildlab.attic`, `wildlab.room.a.here`")
    (tmp_path / "wildlab" / "__init__.py").write_text("")
    (tmp_path / "wildlab" / "room" / "__init__.py").write_text("")
    (tmp_path / "wildlab" / "room" / "a.py").write_text("here = 1")
    assert missing(tmp_path) == ["CONTRIBUTING.md: wildlab.room.a.gone", "CONTRIBUTING.md: wildlab.attic"]
