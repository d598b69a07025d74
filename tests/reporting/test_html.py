"""The page of a report: what it promises is examined, and what comes out of a log stays text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import nbformat
import pandas as pd
import pytest

from tests.notebooks import notebook, shown
from wildlab.errors import WildlabError
from wildlab.reporting import html
from wildlab.reporting.failure import failure_page
from wildlab.reporting.figures import new_figure
from wildlab.reporting.notebook_file import read_notebook
from wildlab.reporting.page import page
from wildlab.reporting.report import Report, open_report

HOSTILE = "<script>alert(1)</script>\"'\n<img src=x onerror=alert(2)>"


def hostile_report() -> Report:
    """Everything a report can show, with a name that tries to break out of every part of it."""
    report = open_report(study="test", kind="logged", flight=HOSTILE, seed=1)
    report.head(f"Title {HOSTILE}", HOSTILE)
    report.summary([HOSTILE, HOSTILE], level="warn", verdict=(HOSTILE, HOSTILE))
    report.alert(HOSTILE, [HOSTILE] * 5)
    report.tiles([(HOSTILE, HOSTILE)] * 4)
    report.section(HOSTILE, HOSTILE)
    report.subsection(HOSTILE)
    report.points([HOSTILE, "w" * 300], ordered=True)
    for width in (5.0, 9.0):
        fig, ax = new_figure(width, 3)
        ax.plot([0, 1], [0, 1])
        report.figure(fig, name=f"figure-{width:.0f}", alt=HOSTILE, caption=HOSTILE)
    wide = pd.DataFrame({HOSTILE: [HOSTILE, None], **{f"column {i}": [i, i / 3] for i in range(12)}})
    report.table(wide, caption=HOSTILE, fold=HOSTILE)
    report.math(r"\epsilon_k = \tilde{x}_k^\top P_k^{-1} \tilde{x}_k " + "+ a_{k} b_{k} " * 30)
    report.limits([HOSTILE])
    report.method(f"{HOSTILE}\n\nwith $R_{{nb}}$")
    return report


def test_hostile_names_stay_text(tmp_path: Path, faults: Callable[[Path], list[str]]) -> None:
    whole = html.report_page(shown(hostile_report()), study=HOSTILE)
    assert "<script" not in whole and "<img src=x" not in whole
    path = tmp_path / "report.html"
    path.write_text(whole, encoding="utf-8")
    assert faults(path) == []


@pytest.mark.parametrize(
    ("text", "theses"),
    [("H 5.6.1", "H"), ("H (7.35) and F tables 3.1", "HF"), ("the matrix H, the force F, H2O, CH 4", "")],
)
def test_a_report_names_the_theses_that_it_cites(text: str, theses: str) -> None:
    report = open_report(study="test", kind="twin", seed=1)
    report.head("Title")
    report.text(text)
    whole = html.report_page(shown(report), study="test", footer="<p>made</p>")
    footer = whole.partition("<footer>")[2]
    assert ("Helgesen" in footer, "Flodell" in footer) == ("H" in theses, "F" in theses)


def test_failure_page_opens_offline_and_stays_text(
    tmp_path: Path, faults: Callable[[Path], list[str]]
) -> None:
    status = {"study": HOSTILE, "reason": HOSTILE, "seconds": 3.0}
    path = tmp_path / "report.html"
    path.write_text(
        failure_page(status, title=HOSTILE, step=HOSTILE, details=HOSTILE * 50, again=HOSTILE),
        encoding="utf-8",
    )
    assert "<script" not in path.read_text(encoding="utf-8")
    assert faults(path) == []


def test_code_prints_warnings_and_parameters_are_left_out() -> None:
    node = notebook("secret = 1")
    outputs = [
        nbformat.v4.new_output("stream", name="stderr", text="a warning"),
        nbformat.v4.new_output("stream", name="stdout", text="a print"),
        nbformat.v4.new_output("execute_result", {"text/plain": "a value"}),
        nbformat.v4.new_output("display_data", {"text/html": "<h1>Shown</h1>", "text/plain": "x"}),
    ]
    node.cells[1].outputs = outputs
    node.cells[0].outputs = [nbformat.v4.new_output("display_data", {"text/html": "<p>parameters</p>"})]
    body = html.notebook_body(node)
    assert body == "<h1>Shown</h1>"


def test_markdown_cells_have_their_maths_translated_and_their_html_escaped() -> None:
    body = html.notebook_body(notebook("# Title with $x_1 < 2$\n\n$$y$$\n\n<script>alert(1)</script>"))
    assert body.count("<math") == 2 and "$" not in body and "<script" not in body and "¶" not in body


def test_page_says_what_browsers_may_do() -> None:
    whole = page(title="a <b>", body="<h1>a</h1>")
    assert "default-src 'none'; img-src data:; style-src 'unsafe-inline'" in whole
    assert (
        '<html lang="en">' in whole and "<title>a &lt;b&gt;</title>" in whole and 'name="viewport"' in whole
    )
    html.examine(whole, "study")


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("<h1>a</h1><script>1</script>", "<script>"),
        ("<h1>a</h1><iframe></iframe>", "<iframe>"),
        ('<h1>a</h1><meta http-equiv="refresh" content="0">', "<meta>"),
        ('<h1>a</h1><p onclick="x()">b</p>', "'onclick'"),
        ('<h1>a</h1><img alt="b" src="https://example.org/a.png">', "'https://example.org"),
        ('<h1>a</h1><img alt="b" src="figures/a.png">', "'figures/a.png'"),
        ('<h1>a</h1><a href=" JavaScript:x()">b</a>', "link runs"),
        ('<h1>a</h1><p style="background:url(//example.org)">b</p>', "style"),
        ("<h1>a</h1><style>@import 'x'</style>", "style"),
        ('<h1>a</h1><img src="data:image/png;base64,AA==">', "alt"),
        ('<h1>a</h1><img alt="  " src="data:image/png;base64,AA==">', "alt"),
        ("<h2>a</h2><h1>b</h1>", "precedes"),
        ("<p>a</p>", "has 0"),
        ("<h1>a</h1><h1>b</h1>", "has 2"),
        ("<h1>a</h1><h3>b</h3>", "level 3"),
        ("<h1>a</h1>" + "x" * 5_000_000, "5 MB"),
    ],
)
def test_a_page_that_breaks_a_promise_is_refused(body: str, sentence: str) -> None:
    with pytest.raises(WildlabError, match=f"report.html: .*{sentence}"):
        html.examine(page(title="a", body=body), "study")


def test_a_file_that_is_no_notebook_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.ipynb").write_text("{}")
    with pytest.raises(WildlabError, match=r"a\.ipynb: this is not a notebook"):
        read_notebook(tmp_path / "a.ipynb")


@pytest.mark.parametrize("to", ["ledger.html", "a-b/report.html#x", "100%25/report.html"])
def test_pages_of_the_folder_may_lead_to_one_another(to: str) -> None:
    whole = page(title="a", body=f'<h1>a</h1><a href="{to}">x</a>')
    html.examine(whole, "index", alone=False)
    with pytest.raises(WildlabError, match="mailed alone"):
        html.examine(whole, "study")
    for away in ("//host/x", "/etc/x", "http://host/x", "file:x", "a b", "javascript:x", ""):
        with pytest.raises(WildlabError):
            html.examine(whole.replace(to, away), "index", alone=False)
