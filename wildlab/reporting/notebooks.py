"""Executed notebooks: read, looked through, and made fit to be passed on.

A report is there to be passed on. Paths name users and machines, so they are cut down to what is inside the
project; the executed notebook gets relative paths in place of those it ran with, and can be run again from
where it lies.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Mapping
from functools import lru_cache
from html import unescape
from pathlib import Path
from typing import Any

import nbformat

from wildlab.errors import WildlabError
from wildlab.paths import PACKAGE, ROOT


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


_HEADING = re.compile(r"^#{1,6}\s+(.+?)\s*#*$", re.M)
_SHOWN_HEADING = re.compile(r"<h[1-6][^>]*>(.*?)</h[1-6]>", re.S)
_TAG = re.compile(r"<[^>]+>")
#: The tag of the cell with what a run was given.
INJECTED = "injected-parameters"
#: The tag of the cells in which papermill says where a run stopped.
_ERROR_MARK = "papermill-error-cell-tag"
_KERNEL_CELL = re.compile(r"(/[\w.+@-]+)*/ipykernel_\d+/\d+\.py")
_ANSI = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")


def _assigned(parameters: Mapping[str, Any]) -> str:
    given = (f"{name} = {value!r}" for name, value in parameters.items())
    return "\n".join(["# What this run was given", *given])


def clean_text(text: str, folders: dict[str, str] | None = None) -> str:
    """``text`` with this machine's folders cut out.

    Parameters
    ----------
    folders
        What else to replace, before all: folder -> what stands for it.
    """
    text = _ANSI.sub("", text)
    if "ipykernel_" in text:
        text = _KERNEL_CELL.sub("[cell]", text)
    pattern, known = _folders_of(tuple((folders or {}).items()))
    return pattern.sub(lambda match: known[match[0]], text)


@lru_cache(maxsize=32)
def _folders_of(folders: tuple[tuple[str, str], ...]) -> tuple[re.Pattern[str], dict[str, str]]:
    """What finds folders of this machine and those given, and what stands for each spelling."""
    known = dict(folders)
    known |= {sys.prefix: "[environment]", sys.base_prefix: "[python]", str(ROOT or PACKAGE): "[wildlab]"}
    home = str(Path.home())
    known |= {tempfile.gettempdir(): "[temporary]"} | ({home: "~"} if len(home) > 1 else {})
    found = {str(Path(folder).resolve()): word for folder, word in known.items()} | known
    # Longest first: the environment may lie inside the project, and the project inside the home folder.
    # Square brackets, because some of this text is HTML already.
    spellings = sorted((one for one in found if len(one) > 1), key=len, reverse=True)
    # A full stop behind it ends a sentence, and one before a letter goes on with the name.
    return re.compile(rf"(?:{'|'.join(map(re.escape, spellings))})(?![\w-]|\.\w)"), found


def clean_notebook(
    notebook: nbformat.NotebookNode, parameters: dict[str, Any], folders: dict[str, str]
) -> nbformat.NotebookNode:
    """A copy of an executed notebook that can be passed on.

    Parameters
    ----------
    parameters
        What the cell of injected parameters shall say instead (relative folders).
    folders
        As in `clean_text`.
    """
    copy: nbformat.NotebookNode = nbformat.from_dict(_clean(dict(notebook), folders))
    copy.metadata.pop("papermill", None)
    copy.cells = [cell for cell in copy.cells if _ERROR_MARK not in cell.metadata.get("tags", [])]
    for cell in copy.cells:
        cell.metadata.pop("papermill", None)
        cell.metadata.pop("execution", None)
        if INJECTED in cell.metadata.get("tags", []):
            cell.source = _assigned(parameters)
    return copy


def _clean(value: Any, folders: dict[str, str]) -> Any:
    if isinstance(value, str):
        return clean_text(value, folders)
    if isinstance(value, dict):
        return {key: _clean(entry, folders) for key, entry in value.items()}
    if isinstance(value, list):
        return [_clean(entry, folders) for entry in value]
    return value


def step_of(notebook: Any, cell_index: int | None) -> str:
    """The heading under which a cell stands: the last one above it, in markdown or shown by a report."""
    heading = ""
    for cell in notebook.cells[: len(notebook.cells) if cell_index is None else cell_index + 1]:
        if cell.cell_type == "markdown":
            found = _HEADING.findall(cell.source)
        else:
            shown = [output.get("data", {}).get("text/html", "") for output in cell.get("outputs", [])]
            found = [_plain(text) for html in shown for text in _SHOWN_HEADING.findall(html)]
        heading = found[-1] if found else heading
    return heading


def _plain(html: str) -> str:
    return unescape(_TAG.sub("", html)).strip()
