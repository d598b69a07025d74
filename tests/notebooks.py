"""Small notebooks to run, and executed ones to show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat

from wildlab.paths import NOTEBOOKS
from wildlab.reporting.report import Report
from wildlab.runner.shell import execute_notebook

PARAMETERS = 'study = ""\nflight = ""\nseed = 0\nout = ""'
OPEN = (
    "from wildlab.reporting.report import open_report\n"
    'report = open_report(study=study, kind="computed", flight=flight, seed=seed, out=out)'
)
Cell = str | tuple[str, ...]


def notebook(*cells: Cell, parameters: int = 1, more: str = "") -> nbformat.NotebookNode:
    """A notebook of code cells; one that begins with # and a blank is markdown."""
    node = nbformat.v4.new_notebook()
    for _ in range(parameters):
        cell = nbformat.v4.new_code_cell(f"{PARAMETERS}\n{more}".strip())
        cell.metadata["tags"] = ["parameters"]
        node.cells.append(cell)
    for source in cells:
        make = nbformat.v4.new_markdown_cell if str(source).startswith("# ") else nbformat.v4.new_code_cell
        node.cells.append(make(source))
    return node


def shown(report: Report) -> nbformat.NotebookNode:
    """What a notebook looks like after it has shown this report, without a kernel."""
    node = notebook()
    for part in report.parts:
        output = nbformat.v4.new_output("display_data", {"text/html": part, "text/plain": "part"})
        node.cells.append(nbformat.v4.new_code_cell("report", outputs=[output]))
    return node


def write(folder: Path, name: str, node: nbformat.NotebookNode) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    nbformat.write(node, path)
    return path


def run_here(name: str, **parameters: Any) -> list[dict[str, Any]]:
    """The notebook of that name, run in this process with some of its parameters: what its cells show, by
    kind (``text/html``, ``image/png``)."""
    notebook = nbformat.read(NOTEBOOKS / name, as_version=4)
    executed = execute_notebook(notebook, NOTEBOOKS, parameters=parameters)
    outputs = [output for cell in executed.cells for output in cell.get("outputs", [])]
    return [dict(output["data"]) for output in outputs if "data" in output]
