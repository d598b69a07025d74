"""Reading notebooks; whoever needs nbformat takes it from here."""

from __future__ import annotations

import sys
from pathlib import Path

# nbformat checks notebooks with jsonschema, which builds a grammar of internationalised addresses when it is
# imported. That takes seconds, in every process that reads a notebook; no notebook's schema asks for such an
# address, and jsonschema does without the package where it is not installed.
sys.modules.setdefault("rfc3987_syntax", None)  # type: ignore[arg-type]

import nbformat  # noqa: E402

from wildlab.errors import WildlabError  # noqa: E402

__all__ = ["nbformat", "read_notebook"]


def read_notebook(path: Path) -> nbformat.NotebookNode:
    """Read a notebook.

    Raises
    ------
    WildlabError
        If it is not one.
    """
    try:
        notebook: nbformat.NotebookNode = nbformat.read(path, as_version=4)
        return notebook
    except Exception as error:  # nbformat raises its own, json's and jsonschema's errors
        raise WildlabError(
            f"this is not a notebook ({type(error).__name__})", "restore the file", file=path.name
        ) from error
