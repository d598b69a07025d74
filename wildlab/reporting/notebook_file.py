"""Reading notebooks; whoever needs nbformat takes it from here."""

from __future__ import annotations

from pathlib import Path

import nbformat

from wildlab.errors import WildlabError

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
