"""Names that a package offers and imports only when they are asked for (PEP 562).

``import wildlab`` then costs nothing of what reads Parquet or checks recipes, and a room that is not needed
is not loaded. The package lists its names twice: in ``__all__``, and under ``TYPE_CHECKING`` with
where they come from, for type checkers, editors, and this module. A test holds them against each other.
"""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any


def offer(package: str, folders: Sequence[str] = ()) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """A package's ``__getattr__`` and ``__dir__``, by the imports that it has under ``if TYPE_CHECKING``.

    Parameters
    ----------
    package
        Its ``__name__``.
    folders
        Packages below it that are there without being imported by name.

    Returns
    -------
    (__getattr__, __dir__)

    Examples
    --------
    >>> get, names = offer("wildlab")
    >>> get("simulate").__name__
    'simulate'
    """
    home = _promised(Path(str(sys.modules[package].__file__)))

    def get(name: str) -> Any:
        if name in folders:
            return importlib.import_module(f"{package}.{name}")
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        found = getattr(importlib.import_module(home[name]), name)
        setattr(sys.modules[package], name, found)  # the next time it is simply there
        return found

    def listed() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home, *folders})

    return get, listed


def _promised(source: Path) -> dict[str, str]:
    """The names that a file imports for type checkers only, with their modules."""
    blocks = [node for node in ast.parse(source.read_bytes()).body if isinstance(node, ast.If)]
    imports = [
        node
        for block in blocks
        if isinstance(block.test, ast.Name) and block.test.id == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
    ]
    return {one.name: str(node.module) for node in imports for one in node.names}
