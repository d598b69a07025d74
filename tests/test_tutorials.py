"""Tutorials: how they are written, checked on their text; and, slowly, that they run and become pages."""

from __future__ import annotations

import ast
import base64
import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest
from bs4 import BeautifulSoup

from tests.notebooks import write
from wildlab.errors import WildlabError
from wildlab.paths import NOTEBOOKS, ROOT
from wildlab.reporting.figures import FULL_SIZE, WIDTH, new_figure, with_alt
from wildlab.reporting.notebook_pages import tutorial_page
from wildlab.runner import tutorials

TUTORIALS = tutorials.tutorial_notebooks()
MOST_LINES = 10
PACKAGES = {"numpy", "pandas", "matplotlib"}
#: Rooms below the face; those without a list of what they offer may be looked into by file.
ROOMS = (
    "replay",
    "geometry",
    "flight",
    "navigation",
    "tracking",
    "simulation",
    "evaluation",
    "analysis",
    "reporting",
)


def cells(notebook: Path, kind: str) -> Iterator[str]:
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == kind:
            yield "".join(cell["source"])


def strange_imports(code: str) -> list[str]:
    """What is imported besides the public names of wildlab, numpy, pandas, matplotlib and Python's own."""
    found: list[str] = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names if not _allowed(alias.name)]
        elif isinstance(node, ast.ImportFrom):
            module = str(node.module)
            found += [f"{module}.{one.name}" for one in node.names if not _allowed(module, one.name)]
    return found


def _allowed(module: str, name: str = "") -> bool:
    first, *rest = module.split(".")
    if first != "wildlab":
        return first in PACKAGES | set(sys.stdlib_module_names)
    if rest and rest[0] not in ROOMS:
        return False
    if not name:
        return len(rest) < 2
    room = importlib.import_module(".".join([first, *rest[:1]]))
    offered = getattr(room, "__all__", None)
    return name in offered if offered is not None and len(rest) < 2 else not name.startswith("_")


@pytest.mark.parametrize("notebook", TUTORIALS, ids=lambda path: path.stem)
def test_how_a_tutorial_is_written(notebook):
    code = list(cells(notebook, "code"))
    lengths = [len([line for line in source.splitlines() if line.strip()]) for source in code]
    assert max(lengths) <= MOST_LINES, code[lengths.index(max(lengths))]
    assert [name for source in code for name in strange_imports(source)] == []
    assert any("with_alt(" in source for source in code), "no picture"
    assert tutorials.title_of(notebook) != notebook.stem


# -- the page


def executed(*outputs: dict[str, Any], source: str = "x = 1\n\ny = 2") -> nbformat.NotebookNode:
    """A tutorial of one heading and one cell that showed this."""
    made = [nbformat.from_dict({**({"metadata": {}} if "data" in one else {}), **one}) for one in outputs]
    cell = nbformat.v4.new_code_cell(source, outputs=made)
    return nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("# Title"), cell])


def picture(alt: str = "A line.") -> dict[str, Any]:
    data, about = with_alt(new_figure(4.0, 3.0)[0], "x")._repr_png_()
    encoded = base64.b64encode(data).decode()
    return {
        "output_type": "display_data",
        "data": {"image/png": encoded, "text/plain": "<Figure>"},
        "metadata": {"image/png": about | {"alt": alt}},
    }


@pytest.mark.slow
def test_a_page_shows_code_prints_values_and_pictures(tmp_path, faults):
    table = "<style scoped>td { color: red }</style><table border='1'><tr><td>7</td></tr></table>"
    node = executed(
        {"output_type": "stream", "name": "stdout", "text": "a <pri"},
        {"output_type": "stream", "name": "stdout", "text": "nt>\n"},
        {"output_type": "stream", "name": "stderr", "text": "a warning"},
        {"output_type": "execute_result", "data": {"text/plain": "a value"}, "execution_count": 1},
        {"output_type": "display_data", "data": {"text/html": table, "text/plain": "a table"}},
        picture('A "line" <b>.'),
    )
    whole = tutorial_page(node, name="07-x", footer="<p>made by</p>")
    soup = BeautifulSoup(whole, "html.parser")
    said = [block.get_text() for block in soup.find_all("pre")]
    assert [text.strip() for text in said] == ["x = 1\n\ny = 2", "a <print>", "a value"]
    assert "a warning" not in whole and "scoped" not in whole
    assert soup.img is not None and soup.img["alt"] == 'A "line" <b>.'
    assert (
        soup.img["width"] == f"{4.0 * WIDTH * FULL_SIZE:.0f}" and soup.img.find_parent("figure") is not None
    )
    assert soup.table is not None and soup.table.parent is not None
    assert soup.table.parent["class"] == ["scroll"] and not soup.table.has_attr("border")
    assert soup.find(attrs={"http-equiv": "Content-Security-Policy"}) is not None
    path = tmp_path / "page.html"
    path.write_text(whole, encoding="utf-8")
    assert faults(path) == []


def test_a_page_without_alt_text_or_with_an_error_is_refused():
    with pytest.raises(WildlabError, match="no alt text"):
        tutorial_page(executed(picture(" ")), name="x")
    error = {"output_type": "error", "ename": "ValueError", "evalue": "", "traceback": []}
    with pytest.raises(WildlabError, match=r"x\.ipynb: cell 2 ended in an error"):
        tutorial_page(executed(error), name="x")
    script = {"output_type": "display_data", "data": {"text/html": "<script>1</script>"}}
    with pytest.raises(WildlabError, match="<script>"):
        tutorial_page(executed(script), name="x")


# -- running them

GOOD = "# A title\n\nand text"


def small(folder: Path, **tutorial: str) -> Path:
    """A folder of notebooks with tutorials of one cell."""
    for name, source in tutorial.items():
        node = nbformat.v4.new_notebook(
            cells=[nbformat.v4.new_markdown_cell(GOOD), nbformat.v4.new_code_cell(source)]
        )
        write(folder / "notebooks" / "tutorials", f"{name}.ipynb", node)
    return folder / "notebooks"


@pytest.mark.slow
def test_a_failure_leaves_no_page_and_stops_no_other(tmp_path):
    notebooks, reports = small(tmp_path, good="print(6 * 7)", bad="1 / 0"), tmp_path / "reports"
    (reports / "tutorials").mkdir(parents=True)
    (reports / "tutorials" / "bad.html").write_text("of other code")
    first = {one.name: one for one in tutorials.run_tutorials(reports, notebooks)}
    assert {name: one.state for name, one in first.items()} == {
        "tutorial-bad": "failed",
        "tutorial-good": "done",
    }
    assert "ZeroDivisionError" in first["tutorial-bad"].reason
    assert "ZeroDivisionError" in (reports / "tutorial-bad" / "report.html").read_text(encoding="utf-8")
    assert sorted(path.name for path in (reports / "tutorials").iterdir()) == ["good.html"]
    page = reports / "tutorials" / "good.html"
    assert "42" in page.read_text(encoding="utf-8") and not (reports / "tutorial-good").exists()

    small(tmp_path, bad="print('mended')")
    assert {one.state for one in tutorials.run_tutorials(reports, notebooks)} == {"done"}
    assert not (reports / "tutorial-bad").exists()
    assert "mended" in (reports / "tutorials" / "bad.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_all_run_and_their_pages_have_no_faults(tmp_path, faults):
    outcomes = tutorials.run_tutorials(tmp_path, parallel=2)
    assert [(one.name, one.reason) for one in outcomes if one.state != "done"] == []
    pages = [tmp_path / "tutorials" / f"{path.stem}.html" for path in TUTORIALS]
    for page in pages:
        text = page.read_text(encoding="utf-8")
        soup = BeautifulSoup(text, "html.parser")
        assert soup.find_all("img") and soup.find_all("pre"), page.stem
        assert "$" not in soup.get_text().replace("$ ", ""), f"{page.stem}: a formula is left as it was typed"
        for place in (str(tmp_path), str(ROOT), str(NOTEBOOKS)):
            assert place not in text
        assert faults(page) == [], page.stem
