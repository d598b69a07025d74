"""A papermill engine that runs a notebook's cells in this process, in a shell of IPython's, without a kernel.

A kernel is a second process that imports everything once more, which took most of the time of a short page.
What cells print, show and raise is kept as a kernel would have sent it.
"""

from __future__ import annotations

import base64
import contextlib
import io
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import nbformat
import papermill
from IPython.core.displayhook import DisplayHook
from IPython.core.displaypub import DisplayPublisher
from IPython.core.interactiveshell import InteractiveShell
from papermill.engines import Engine, NotebookExecutionManager, papermill_engines
from papermill.exceptions import PapermillExecutionError
from traitlets.config import Config

from wildlab.reporting.notebook_pages import write_notebook

#: Its name among papermill's engines.
IN_PROCESS = "wildlab-in-process"


class CellError(Exception):
    """A cell raised; ``name`` and ``message`` of what, and the lines of the traceback."""

    def __init__(self, name: str, message: str, lines: list[str]) -> None:
        super().__init__(f"{name}: {message}")
        self.name, self.message, self.lines = name, message, lines


class ShellEngine(Engine):  # type: ignore[misc]
    """Cells one after the other, until one raises; see papermill on engines."""

    @classmethod
    def execute_managed_notebook(
        cls,
        nb_man: NotebookExecutionManager,
        kernel_name: str,
        *,
        before_cell: Callable[[nbformat.NotebookNode, int], None],
        **_: Any,
    ) -> None:
        outputs: list[Any] = []
        shell = _shell(outputs)
        try:
            _run_cells(shell, outputs, nb_man, before_cell)
        finally:
            # Whatever else this process does, it is no notebook any more.
            shell.restore_sys_module_state()
            type(shell).clear_instance()


papermill_engines.register(IN_PROCESS, ShellEngine)


def execute_notebook(
    notebook: nbformat.NotebookNode,
    folder: Path,
    into: Path | None = None,
    parameters: Mapping[str, Any] | None = None,
    on_cell: Callable[[int, int, Collection[str]], None] = lambda index, count, tags: None,
) -> nbformat.NotebookNode:
    """Run the cells of a notebook by papermill, one after the other, until one raises.

    Parameters
    ----------
    notebook
        As it was written.
    folder
        That its cells run in.
    into
        The file that the executed notebook is written to, as far as it came; None for none.
    parameters
        What a cell below the one tagged ``parameters`` sets; plain values.
    on_cell
        Called before each cell with its index, how many there are, and its tags.

    Returns
    -------
    NotebookNode
        With what the cells have printed, shown and raised.

    Raises
    ------
    CellError
        Of the cell that raises, or that cannot show its value.
    """
    # Whatever kernel it was last saved with: its cells run in this process.
    notebook.metadata["kernelspec"] = {"name": "python3", "language": "python", "display_name": "Python 3"}
    count = len(notebook.cells) + bool(parameters)  # papermill adds a cell with them
    ran = [notebook]

    def before_cell(running: nbformat.NotebookNode, index: int) -> None:
        ran[0] = running
        if into is not None:
            write_notebook(into, running)
        on_cell(index, count, running.cells[index].metadata.get("tags", ()))

    try:
        ran[0] = papermill.execute_notebook(
            notebook,
            None,  # papermill would leave half a file where this process is ended as it writes
            parameters=dict(parameters or {}),
            kernel_name="python3",
            language="python",
            engine_name=IN_PROCESS,
            progress_bar=False,
            cwd=str(folder),
            before_cell=before_cell,
        )
    except PapermillExecutionError as error:
        raise CellError(str(error.ename), str(error.evalue), list(error.traceback)) from None
    finally:
        if into is not None:
            write_notebook(into, ran[0])
    return ran[0]


def _run_cells(
    shell: InteractiveShell,
    outputs: list[Any],
    nb_man: NotebookExecutionManager,
    before_cell: Callable[[nbformat.NotebookNode, int], None],
) -> None:
    for index, cell in enumerate(nb_man.nb.cells):
        nb_man.cell_start(cell, index)
        before_cell(nb_man.nb, index)
        if cell.cell_type == "code":
            with _streams_into(outputs):
                result = shell.run_cell(cell.source, store_history=True)
            cell.outputs, cell.execution_count = outputs[:], shell.execution_count - 1
            outputs.clear()
            # What fails to show itself is an error, though the cell goes on.
            if not result.success or any(one.output_type == "error" for one in cell.outputs):
                nb_man.cell_exception(cell, cell_index=index)
        nb_man.cell_complete(cell, cell_index=index)
        if nb_man.nb.metadata.papermill["exception"]:
            return


def _shell(outputs: list[Any]) -> InteractiveShell:
    """A new shell whose ``outputs`` are what is shown and raised."""

    class Publisher(DisplayPublisher):
        def publish(self, data: Any, metadata: Any = None, *_: Any, **__: Any) -> None:
            outputs.append(nbformat.v4.new_output("display_data", data=_plain(data), metadata=metadata or {}))

    class Hook(DisplayHook):
        def write_output_prompt(self) -> None:
            """A notebook shows none."""

        def finish_displayhook(self) -> None:
            """Nor an empty line."""

        def write_format_data(self, format_dict: Any, md_dict: Any = None) -> None:
            outputs.append(
                nbformat.v4.new_output(
                    "execute_result",
                    data=_plain(format_dict),
                    metadata=md_dict or {},
                    execution_count=self.prompt_count,
                )
            )

    class Shell(InteractiveShell):
        def _showtraceback(self, etype: Any, evalue: Any, stb: list[str]) -> None:
            outputs.append(
                nbformat.v4.new_output("error", ename=etype.__name__, evalue=str(evalue), traceback=stb)
            )

    # No history of commands on the reader's disk, and tracebacks without the escapes of a terminal.
    config = Config({"HistoryManager": {"enabled": False}, "InteractiveShell": {"colors": "nocolor"}})
    return Shell.instance(config=config, display_pub_class=Publisher, displayhook_class=Hook)


def _plain(data: dict[str, Any]) -> dict[str, Any]:
    """By kind; bytes as base64."""
    return {
        kind: base64.b64encode(value).decode("ascii") if isinstance(value, bytes) else value
        for kind, value in data.items()
    }


class _Stream(io.TextIOBase):
    """Text that is written becomes outputs; what goes to one stream in one go is one."""

    def __init__(self, name: str, outputs: list[Any]) -> None:
        self.name, self.outputs = name, outputs

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        last = self.outputs[-1] if self.outputs else None
        if last is not None and last.output_type == "stream" and last.name == self.name:
            last.text += text
        elif text:
            self.outputs.append(nbformat.v4.new_output("stream", name=self.name, text=text))
        return len(text)


@contextlib.contextmanager
def _streams_into(outputs: list[Any]) -> Iterator[None]:
    stdout, stderr = _Stream("stdout", outputs), _Stream("stderr", outputs)
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        yield
