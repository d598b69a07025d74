"""Small notebooks to run, and executed ones to show."""

from __future__ import annotations

from pathlib import Path

import nbformat

from wildlab.reporting.report import Report

PARAMETERS = 'study = ""\nflight = ""\nseed = 0\nout = ""\nexpected_prefix = ""'
OPEN = (
    "from wildlab.reporting.report import open_report\n"
    'report = open_report(study=study, kind="computed", flight=flight, seed=seed, out=out, '
    "expected_prefix=expected_prefix)"
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
