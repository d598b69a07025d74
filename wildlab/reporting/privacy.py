"""Keeping this machine and its people out of what a run leaves behind.

A report is there to be passed on. Paths name users and machines, so they are cut down to what is inside the
project; the executed notebook gets relative paths in place of those it ran with, and can be run again from
where it lies.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildlab.paths import PACKAGE, ROOT

if TYPE_CHECKING:
    from nbformat import NotebookNode

_KERNEL_CELL = re.compile(r"(/[\w.+@-]+)*/ipykernel_\d+/\d+\.py")
_ANSI = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
_ERROR_MARK = "papermill-error-cell-tag"


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
    known = dict(folders or {})
    known |= {sys.prefix: "[environment]", sys.base_prefix: "[python]", str(ROOT or PACKAGE): "[wildlab]"}
    home = str(Path.home())
    known |= {tempfile.gettempdir(): "[temporary]"} | ({home: "~"} if len(home) > 1 else {})
    # Longest first: the environment may lie inside the project, and the project inside the home folder.
    # Square brackets, because some of this text is HTML already.
    for folder in sorted(known, key=len, reverse=True):
        for spelling in {folder, str(Path(folder).resolve())}:
            if len(spelling) > 1:
                # A full stop behind it ends a sentence, and one before a letter goes on with the name.
                whole = re.escape(spelling) + r"(?![\w-]|\.\w)"
                text = re.sub(whole, known[folder].replace("\\", r"\\"), text)
    return text


def clean_notebook(
    notebook: NotebookNode, parameters: dict[str, Any], folders: dict[str, str]
) -> NotebookNode:
    """A copy of an executed notebook that can be passed on.

    Parameters
    ----------
    parameters
        What the cell of injected parameters shall say instead (relative folders).
    folders
        As in `clean_text`.
    """
    from papermill.translators import papermill_translators

    from wildlab.reporting.notebook_file import nbformat

    copy: NotebookNode = nbformat.from_dict(_clean(dict(notebook), folders))
    copy.metadata.pop("papermill", None)
    copy.cells = [cell for cell in copy.cells if _ERROR_MARK not in cell.metadata.get("tags", [])]
    for cell in copy.cells:
        cell.metadata.pop("papermill", None)
        cell.metadata.pop("execution", None)
        if "injected-parameters" in cell.metadata.get("tags", []):
            translator: Any = papermill_translators.find_translator("python3", "python")
            cell.source = translator.codify(parameters, "What this run was given")
    return copy


def _clean(value: Any, folders: dict[str, str]) -> Any:
    if isinstance(value, str):
        return clean_text(value, folders)
    if isinstance(value, dict):
        return {key: _clean(entry, folders) for key, entry in value.items()}
    if isinstance(value, list):
        return [_clean(entry, folders) for entry in value]
    return value
