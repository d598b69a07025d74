"""Every package that wildlab asks for is imported by it or its notebooks, or there is a reason on paper."""

from __future__ import annotations

import ast
import json
import tomllib
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.test_architecture import imported_names, parsed
from wildlab import paths

#: Asked for and imported by nothing: why it is asked for all the same.
NOT_IMPORTED = {
    "ipykernel": "the kernel that runs the notebooks; Jupyter starts it by name",
    "jupyterlab": "what `make lab` opens",
}


def sources(root: Path) -> Iterable[ast.Module]:
    """The Python of the package and of the notebooks' code cells."""
    for path in sorted((root / "wildlab").rglob("*.py")):
        yield parsed(path)
    for path in sorted((root / "notebooks").rglob("*.ipynb")):
        if ".ipynb_checkpoints" not in path.parts:
            for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
                if cell["cell_type"] == "code":
                    yield ast.parse("".join(cell["source"]))


def complaints(root: Path, reasons: dict[str, str]) -> list[str]:
    """Packages without import and reason, and reasons that are no longer needed."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {canonicalize_name(Requirement(text).name) for text in project["dependencies"]}
    providers = metadata.packages_distributions()
    used: set[str] = set()
    for source in sources(root):
        for _, name in imported_names(source, ("wildlab",)):
            package = name.partition(".")[0]
            used |= {canonicalize_name(provider) for provider in providers.get(package, [package])}
    missing = [f"{name}: asked for and imported by nothing" for name in declared - used - set(reasons)]
    stale = [f"{name}: imported after all" for name in used & set(reasons)]
    gone = [f"{name}: not asked for" for name in set(reasons) - declared]
    return sorted(missing + stale + gone)


@pytest.mark.slow
def test_what_is_asked_for_is_used_or_has_a_reason():
    assert complaints(paths.ROOT, NOT_IMPORTED) == []
