"""Small notebooks to run, executed ones to show, and a browser without a network."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest

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


def find_chromium() -> str | None:
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
    return os.environ.get("WILDLAB_CHROMIUM") or next(filter(None, map(shutil.which, names)), None)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    program = find_chromium()
    if program is None:
        pytest.skip("needs Chromium: install it, or name one in WILDLAB_CHROMIUM")
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (the extra `dev`)")
    with playwright.sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def faults(browser: Any) -> Callable[[Path], list[str]]:
    """``faults(page.html)`` opens a page offline, wide and narrow, and lists what is wrong with it."""

    def look(path: Path) -> list[str]:
        found = [] if path.stat().st_size <= 5_000_000 else ["larger than 5 MB"]
        return found + [fault for width in (1200, 360) for fault in _faults_at(browser, path.as_uri(), width)]

    return look


def _faults_at(browser: Any, address: str, width: int) -> list[str]:
    found: list[str] = []
    context = browser.new_context(viewport={"width": width, "height": 800}, offline=True)
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: found.append(f"console: {message.text}"))
    page.on("pageerror", lambda error: found.append(f"error: {error}"))
    page.on("dialog", lambda dialog: found.append(f"dialog: {dialog.message}"))
    page.goto(address)
    page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    found += [f"asks for {url[:80]}" for url in asked if url != address and not url.startswith("data:")]
    wide = page.evaluate("document.documentElement.scrollWidth")
    if wide > width:
        found.append(f"{wide} px wide on a screen of {width}")
    if page.evaluate("[...document.images].some(one => !one.alt.trim() || !one.naturalWidth)"):
        found.append("a picture without alt text, or broken")
    if page.evaluate("document.documentElement.lang") != "en":
        found.append("no language")
    context.close()
    return found
