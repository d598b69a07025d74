"""What can be said against a run before it starts: the notebook and its parameters."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.reporting.notebook_file import read_notebook


def plain_parameters(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as papermill can hand them on: str, int, float, bool, None, and lists of these.

    Raises
    ------
    WildlabError
        If one is something else.
    """
    return {name: _plain(value, name) for name, value in parameters.items()}


def _plain(value: Any, name: str) -> Any:
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, (os.PathLike,)):
        return os.fspath(value)
    if isinstance(value, np.generic):
        return _plain(value.item(), name)
    if isinstance(value, (int, float)):
        return value
    if isinstance(value, np.ndarray):
        return _plain(value.tolist(), name)
    if isinstance(value, (list, tuple)):
        return [_plain(entry, name) for entry in value]
    raise WildlabError(
        f"the parameter {name!r} is of type {type(value).__name__}",
        "give text, numbers, true/false or a list of these",
    )


def check_notebook(notebook: Path, parameters: Sequence[str]) -> int:
    """Refuse a notebook that would not do as it is told; the number of cells of one that will.

    Raises
    ------
    WildlabError
        If the notebook is absent or not one, has no or several cells tagged ``parameters``, or does not
        know one of the parameters. papermill lets all of these pass.
    """
    import papermill

    if not notebook.is_file():
        raise WildlabError(
            "there is no such notebook", "restore it, or name another in studies.toml", file=notebook.name
        )
    node = read_notebook(notebook)
    tagged = sum("parameters" in cell.metadata.get("tags", []) for cell in node.cells)
    if tagged != 1:
        raise WildlabError(
            f"the notebook has {tagged} cells tagged `parameters`", "tag exactly one", file=notebook.name
        )
    node.metadata["kernelspec"] = {"name": "python3", "language": "python", "display_name": "Python 3"}
    known = papermill.inspect_notebook(node)
    for name in parameters:
        if name not in known:
            raise WildlabError(
                f"the notebook has no parameter {name!r}",
                f"it has: {', '.join(known)}; add it to its parameters cell, or take it out of studies.toml",
                file=notebook.name,
            )
    return len(node.cells)
