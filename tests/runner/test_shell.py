"""Cells that run in this process leave what a kernel of Jupyter would have left."""

from __future__ import annotations

import os
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import connection
from pathlib import Path
from typing import Any

import nbformat
import papermill
import pytest
from IPython.core.getipython import get_ipython

from wildlab.runner.processes import ONE_THREAD, start_process
from wildlab.runner.shell import CellError, execute_notebook

CELLS = [
    "print('one')\nprint('two')",
    "import sys\nprint('a warning', file=sys.stderr)",
    "from IPython.display import HTML, Image, display\ndisplay(HTML('<b>bold</b>'))\n1 + 1",
    "display(Image(data=b'\\x89PNG', format='png'))",
    "display('first')\nprint('between'); None",
    "for k in range(20): print('x' * 70)",
    "x = 5",
    "_ + 1",
    "class Dot:\n    __repr__ = lambda self: 'a dot'\n    _repr_png_ = lambda self: b'\\x89PNG'\nDot()",
    "import asyncio\nawait asyncio.sleep(0)\nx;",
    "# only words",
]


def execute(cells: list[str], where: Path, **parameters: Any) -> Any:
    return execute_notebook(written(cells), where, where / "ours.ipynb", parameters)


def written(cells: list[str]) -> Any:
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    notebook.cells.insert(1, nbformat.v4.new_markdown_cell("# Words"))
    return notebook


def execute_by_kernel(cells: list[str], where: Path) -> Any:
    return papermill.execute_notebook(
        written(cells), None, kernel_name="python3", language="python", progress_bar=False, cwd=where
    )


def outputs(notebook: Any) -> list[Any]:
    return [(cell.get("outputs"), cell.get("execution_count")) for cell in notebook.cells]


@pytest.mark.slow
def test_outputs_are_those_of_a_kernel(tmp_path, monkeypatch):
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / ".ipython"))
    # In a thread of their own: a browser's tests may have left a loop running in this one.
    with ThreadPoolExecutor(1) as thread:
        ours, theirs = (thread.submit(run, CELLS, tmp_path).result() for run in (execute, execute_by_kernel))
    assert outputs(ours) == outputs(theirs)


def test_a_cell_that_raises_is_the_last(tmp_path, monkeypatch):
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / ".ipython"))
    with pytest.raises(CellError) as raised:
        execute(["y = 1", "y / 0", "print('not reached')"], tmp_path)
    assert raised.value.name == "ZeroDivisionError" and "y / 0" in "".join(raised.value.lines)
    kept = nbformat.read(tmp_path / "ours.ipynb", as_version=4)
    assert "not reached" not in str([cell.get("outputs") for cell in kept.cells])


def test_parameters_and_the_folder_are_the_notebooks_own(tmp_path, monkeypatch):
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / ".ipython"))
    cells = ["import os\nprint(speed, os.getcwd())"]
    main = sys.modules["__main__"]
    notebook = execute(cells, tmp_path, speed=7)
    assert sys.modules["__main__"] is main and get_ipython() is None
    assert f"7 {tmp_path}" in str(outputs(notebook))
    # Another notebook in the same process knows nothing of the first.
    with pytest.raises(CellError, match="NameError"):
        execute(["print(speed)"], tmp_path)


def tell(pipe: connection.Connection, names: list[str]) -> None:
    """Body of a process: what it has in its environment, and whether Ctrl-C would interrupt it."""
    deaf = signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
    pipe.send({"deaf": str(deaf)} | {name: os.environ.get(name) for name in names})


@pytest.mark.parametrize("value", ["first", "second"])
def test_a_process_has_the_environment_of_its_own_start(value, monkeypatch):
    monkeypatch.setenv("TOLD_TO_IT", value)
    ours, theirs = connection.Pipe(duplex=False)
    process = start_process("tells", tell, theirs, ["TOLD_TO_IT", *ONE_THREAD])
    assert ours.poll(60) and ours.recv() == {"deaf": "True", "TOLD_TO_IT": value, **ONE_THREAD}
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
    process.join(20)
    assert process.exitcode == 0


def test_whoever_is_ended_between_two_cells_leaves_a_whole_notebook(tmp_path, monkeypatch):
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / ".ipython"))
    into, seen = tmp_path / "ours.ipynb", []

    def on_cell(index, count, tags):
        kept = nbformat.read(into, as_version=4)
        seen.append((index, [cell.get("execution_count") for cell in kept.cells][:index:2], count))

    with monkeypatch.context() as patch:
        # Nobody but the atomic writer touches the file.
        patch.setattr(
            "papermill.iorw.papermill_io.write", lambda _, path: pytest.fail(path) if path else None
        )
        execute_notebook(written(["x = 1", "x + 1"]), tmp_path, into, {}, on_cell)
    assert seen == [(0, [], 3), (1, [1], 3), (2, [1], 3)]
