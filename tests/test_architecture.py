"""Who may import whom, what is never imported, and how long a file may grow.

The rules are checked on the source text (nothing is imported), and the last tests show on a made-up tree that
each rule can fail.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from wildlab import doctor, paths

BELOW_ANALYSIS = {
    "geometry", "navigation", "detection", "tracking", "planning", "flight", "simulation", "evaluation",
}  # fmt: skip

#: Which rooms of wildlab each room may import. Data goes down the house once, and so do imports.
MAY_IMPORT: dict[str, set[str]] = {
    "geometry": set(),
    "navigation": {"geometry"},
    "detection": {"geometry"},
    "tracking": {"geometry"},
    "planning": {"geometry"},
    "flight": {"geometry"},
    "simulation": {"geometry", "flight"},
    "evaluation": {"geometry", "tracking"},
    "messages": {"flight"},
    "analysis": BELOW_ANALYSIS,
    "reporting": BELOW_ANALYSIS | {"analysis", "messages"},
    "replay": BELOW_ANALYSIS | {"analysis", "messages", "reporting"},
    "studies": BELOW_ANALYSIS | {"analysis", "messages", "reporting", "replay"},
    "runner": BELOW_ANALYSIS | {"analysis", "messages", "reporting", "replay", "studies"},
    "sharing": BELOW_ANALYSIS | {"analysis", "messages", "reporting", "studies", "runner"},
    # What `import wildlab` offers; nothing of wildlab imports it.
    "api": BELOW_ANALYSIS | {"analysis", "reporting", "replay"},
    "commands": BELOW_ANALYSIS | {"analysis", "messages", "reporting", "studies", "runner", "sharing"},
    "cli": BELOW_ANALYSIS | {"analysis", "reporting", "studies", "runner", "commands", "doctor"},
    "__main__": {"cli"},
    "summary_table": set(),
    "doctor": set(),
    "lazy": set(),
    "errors": set(),
    "files": set(),
    "names": set(),
    "paths": set(),
    # For type checkers only: at run time names are imported when they are asked for (`wildlab.lazy`).
    "__init__": {"api", "flight"},
}
#: These know nothing about flights and may be used by all.
FOR_ALL = {"summary_table", "errors", "files", "lazy", "names", "paths", "__version__"}

NOTEBOOK_PACKAGES = {
    "papermill", "nbconvert", "nbclient", "nbformat", "IPython", "ipykernel", "jupyter_client",
}  # fmt: skip
KNOW_NOTEBOOKS = {"reporting", "runner", "cli"}
#: The doctor asks which kernel Jupyter would start, no more.
ALSO = {("doctor", "jupyter_client")}

#: They check our numbers in tests and benchmarks, so our numbers must not come from them.
ORACLES = {"stonesoup", "pyins", "cameratransform", "osgeo", "gdal"}
#: Under the GPL or AGPL, which would bind whoever uses wildlab.
COPYLEFT = {"orthority", "opendm", "evo", "ultralytics", "yolov5", "PyQt5", "PyQt6"}
#: Reading such a file runs whatever code its author put into it.
UNSAFE_PACKAGES = {"pickle", "cPickle", "dill", "cloudpickle", "shelve", "marshal", "joblib"}
UNSAFE_CALLS = {
    "eval", "exec", "__import__", "os.system", "os.popen", "yaml.load", "yaml.unsafe_load",
}  # fmt: skip
UNSAFE_METHODS = {"read_pickle", "to_pickle"}
UNSAFE_KEYWORDS = {"shell", "allow_pickle"}

LONGEST_FILE = 800  # one subject is one file: mostly of 150 to 500 lines


def imported_names(tree: ast.AST, package: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """Line and dotted name of everything imported, also inside functions and by `import_module`.

    ``package`` is where the file lies, as in ``("wildlab", "geometry")``, for relative imports.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            start = ".".join((*base, *(node.module or "").split("."))).strip(".")
            # "from wildlab import geometry" names a room only in what is imported.
            yield from ((node.lineno, f"{start}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and called_name(node).endswith("import_module"):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield node.lineno, argument.value


def called_name(call: ast.Call) -> str:
    """``"os.system"`` for ``os.system(...)``, ``"eval"`` for ``eval(...)``, ``""`` for what has no name."""
    parts: list[str] = []
    node = call.func
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else ".".join(reversed(parts))


def check_imports(room: str, line: int, name: str) -> Iterator[str]:
    parts = name.split(".")
    package = parts[0]
    if package == "wildlab":
        target = parts[1] if len(parts) > 1 else ""
        if target and target != room and target not in FOR_ALL | MAY_IMPORT.get(room, set()):
            yield f"{line}: {room} may not import {target}"
    if package in NOTEBOOK_PACKAGES and room not in KNOW_NOTEBOOKS and (room, package) not in ALSO:
        yield f"{line}: only reporting, runner and cli know about notebooks, {room} imports {package}"
    if package in ORACLES:
        yield f"{line}: {package} is an oracle for tests and benchmarks"
    if package in COPYLEFT:
        yield f"{line}: {package} is under a copyleft licence"
    if package in UNSAFE_PACKAGES:
        yield f"{line}: {package} can run code that is in a file"


def check_calls(tree: ast.AST) -> Iterator[str]:
    for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
        name = called_name(call)
        if name in UNSAFE_CALLS or name.rpartition(".")[2] in UNSAFE_METHODS:
            yield f"{call.lineno}: {name}() can run what is in a file"
        for keyword in call.keywords:
            constant_false = isinstance(keyword.value, ast.Constant) and not keyword.value.value
            if keyword.arg in UNSAFE_KEYWORDS and not constant_false:
                yield f"{call.lineno}: {keyword.arg}=True in {name}()"


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def violations(root: Path) -> list[str]:
    """Every breach of the rules in ``root/wildlab``, as ``file:line: what``."""
    found: list[str] = []
    for path in sorted((root / "wildlab").rglob("*.py")):
        place = path.relative_to(root)
        room = place.parts[1].removesuffix(".py")
        if room not in MAY_IMPORT:
            found.append(f"{place}:1: the room {room} is not in MAY_IMPORT: decide what it may import")
            continue
        tree = parsed(path)
        for line, name in imported_names(tree, place.parts[:-1]):
            found += [f"{place}:{problem}" for problem in check_imports(room, line, name)]
        found += [f"{place}:{problem}" for problem in check_calls(tree)]
    return found


def module_of(place: Path) -> str:
    """``"wildlab.geometry.frames"`` for its path below the root; a package's is that of its ``__init__``."""
    parts = place.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def import_graph(root: Path) -> dict[str, set[str]]:
    """Which modules of wildlab each one imports, also inside functions, but not for type checkers alone."""
    places = {path: path.relative_to(root) for path in (root / "wildlab").rglob("*.py")}
    modules = {module_of(place) for place in places.values()}
    graph: dict[str, set[str]] = {}
    for path, place in places.items():
        tree = without_type_checking(parsed(path))
        names = {name for _, name in imported_names(tree, place.parts[:-1])}
        # "wildlab.geometry.frames.wrap" is a name in a module, "wildlab.geometry.frames" a module.
        found = {name if name in modules else name.rpartition(".")[0] for name in names}
        graph[module_of(place)] = {name for name in found if name in modules} - {module_of(place)}
    return graph


def without_type_checking(tree: ast.Module) -> ast.Module:
    """The module without what stands under ``if TYPE_CHECKING``."""
    left = [
        node
        for node in tree.body
        if not (
            isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        )
    ]
    return ast.Module(left, [])


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Modules that import each other round and round: strongly connected sets of more than one, sorted."""
    reach: dict[str, set[str]] = {}
    for start in graph:
        seen: set[str] = set()
        todo = list(graph[start])
        while todo:
            if (one := todo.pop()) not in seen:
                seen.add(one)
                todo += graph.get(one, set())
        reach[start] = seen
    together = {
        frozenset({one, *(other for other in reach[one] if one in reach.get(other, set()))})
        for one in graph
        if one in reach[one]
    }
    return sorted(sorted(group) for group in together)


def folder_graph(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """The same between the folders of a room and the files beside them: ``wildlab.flight.checks``."""

    def place(module: str) -> str:
        return ".".join(module.split(".")[:3])

    result: dict[str, set[str]] = {}
    for module, names in graph.items():
        own = place(module)
        result.setdefault(own, set()).update(place(name) for name in names if place(name) != own)
    return result


def undeclared(root: Path) -> list[str]:
    """Packages imported by ``root/wildlab`` that are here only because another package brought them."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    # `cluster` is for those who have one: what it brings is imported where it is needed and nowhere else.
    wanted = project["dependencies"] + project.get("optional-dependencies", {}).get("cluster", [])
    declared = {canonicalize_name(Requirement(text).name) for text in wanted}
    providers = metadata.packages_distributions()
    found = set()
    for path in (root / "wildlab").rglob("*.py"):
        for line, name in imported_names(parsed(path), path.relative_to(root).parts[:-1]):
            package = name.partition(".")[0]
            if package == "wildlab" or package in sys.stdlib_module_names:
                continue
            if not {canonicalize_name(provider) for provider in providers.get(package, [package])} & declared:
                found.add(f"{path.relative_to(root)}:{line}: {package}")
    return sorted(found)


def source_files(root: Path) -> list[Path]:
    folders = ("wildlab", "tests", "benchmarks", "tools", "notebooks", "data")
    kinds = {".py", ".sh", ".ipynb", ".toml", ".md"}
    inside = [path for folder in folders for path in (root / folder).rglob("*") if path.suffix in kinds]
    top = [root / "Makefile", root / "README.md", root / "pyproject.toml"]
    hidden = {".ipynb_checkpoints", "fetched"}
    return sorted(path for path in inside + top if path.is_file() and not hidden & set(path.parts))


def too_long(root: Path) -> list[str]:
    python = [path for path in source_files(root) if path.suffix == ".py"]
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in python}
    return [f"{path.relative_to(root)}: {n} lines" for path, n in lengths.items() if n > LONGEST_FILE]


@pytest.mark.slow
def test_rooms_import_only_what_lies_below():
    assert violations(paths.ROOT) == []


@pytest.mark.slow
def test_nothing_imports_in_a_circle():
    graph = import_graph(paths.ROOT)
    assert "wildlab.geometry.frames" in graph["wildlab.geometry.camera"]
    assert circles(graph) == []
    assert circles(folder_graph(graph)) == []


def shown_by_trial(tree: ast.Module, cases: set[str]) -> set[str]:
    """What a case's trial uses of the rooms that show: kept numbers of a seed do not follow changes there."""
    shown, parts = set(), {}
    for node in tree.body:
        if isinstance(node, ast.ImportFrom):
            _, room, *rest = [*str(node.module).split("."), ""]
            if room in ("reporting", "messages") or (room == "studies" and rest[:1] and rest[0] not in cases):
                shown |= {one.asname or one.name for one in node.names if one.name not in cases}
        names = [one for one in ast.walk(node) if isinstance(one, ast.Name)]
        stored = {one.id for one in names if isinstance(one.ctx, ast.Store)}
        asked = {one.id for one in names} - (stored if hasattr(node, "body") else set())
        parts |= {key: asked for key in ({node.name} if hasattr(node, "name") else stored)}
    used, waiting = set(), {"trial"}
    while waiting:
        used |= waiting
        waiting = set().union(*(parts.get(one, set()) for one in waiting)) - used
    return used & shown


def test_a_trial_uses_nothing_that_only_shows():
    folder = paths.PACKAGE / "studies"
    cases = {path.stem.replace("-", "_") for path in (paths.DATA / "studies").glob("*.toml")}
    for case in cases:
        if (folder / f"{case}.py").is_file():
            assert not shown_by_trial(parsed(folder / f"{case}.py"), cases), case
    found = shown_by_trial(
        ast.parse("from wildlab.reporting.x import a\ndef b(): a()\ndef trial(): b()"), cases
    )
    assert found == {"a"}


@pytest.mark.slow
def test_what_is_imported_is_asked_for():
    assert undeclared(paths.ROOT) == []


def test_the_rules_cover_what_is_there():
    entries = (paths.ROOT / "wildlab").iterdir()
    there = {path.stem for path in entries if path.is_dir() or path.suffix == ".py"} - {"__pycache__"}
    assert {"geometry", "flight", "reporting", "studies", "runner"} <= there <= set(MAY_IMPORT)


def test_files_stay_short():
    assert too_long(paths.ROOT) == []


def test_no_copyleft_in_the_lock():
    names = {pin.name.lower() for pin in doctor.read_lock(paths.LOCK)}
    assert names
    assert not names & {name.lower() for name in COPYLEFT}
    for name in sorted(names):
        try:
            about = metadata.metadata(name).json
        except metadata.PackageNotFoundError:
            continue  # the doctor's tests say so where it should be here
        fields = [about.get("license_expression", ""), about.get("license", "")[:60]]
        fields += about.get("classifier", [])
        licence = " ".join(str(field) for field in fields if "Python ::" not in str(field))
        # The lesser GPL (LGPL) does not reach what merely imports a package.
        assert not re.search(r"\bA?GPL|GNU (Affero )?General", licence), f"{name}: {licence}"


@pytest.mark.parametrize(
    ("file", "source", "problem"),
    [
        ("geometry/a.py", "from wildlab.flight.store import load_flight", "geometry may not import flight"),
        ("geometry/a.py", "def f():\n    import wildlab.flight", "a.py:2: geometry may not import flight"),
        ("geometry/a.py", "import importlib\nimportlib.import_module('wildlab.flight')", "import flight"),
        ("attic/a.py", "x = 1", "the room attic is not in MAY_IMPORT"),
        ("flight/a.py", "from IPython.display import display", "know about notebooks"),
        ("studies/autoferry.py", "import stonesoup.tracker", "is an oracle"),
        ("detection/a.py", "from ultralytics import YOLO", "copyleft"),
        ("flight/a.py", "eval('1')", "eval()"),
        ("flight/a.py", "import pandas as pd\npd.read_pickle('x')", "read_pickle()"),
        ("flight/a.py", "import subprocess\nsubprocess.run('ls', shell=True)", "shell=True"),
    ],
)
def test_a_breach_is_found(tmp_path, file, source, problem):
    path = tmp_path / "wildlab" / file
    path.parent.mkdir(parents=True)
    path.write_text(source, encoding="utf-8")
    found = violations(tmp_path)
    assert len(found) == 1, found
    assert problem in found[0]
