"""Several reports as one page: nothing dead, nothing that runs, nothing of who made it when."""

from __future__ import annotations

from pathlib import Path

import pytest
from bs4 import BeautifulSoup

from wildlab.errors import WildlabError
from wildlab.reporting.page import page
from wildlab.sharing.document import Chapter, joined, read_part

BODY = """<header><h1>How far off &amp; why?</h1></header>
<h2 id="numbers">Numbers</h2>
<p>See <a href="#numbers">above</a>, <a href="#gone">nowhere</a>, <a href="../index.html">the ledger</a>,
<a href="https://example.org/x?y=1">the net</a>,
<a download="a.csv" href="data:text/csv;base64,YQ==">as CSV</a>
and <a href="data:application/geo+json;base64,e30=">as a map</a>.</p>
<!-- by jonas on kestrel -->
<svg viewBox="0 0 9 9" aria-labelledby="t"><title id="t">An arrow</title>
<clipPath id="c"><path d="M0 0"/></clipPath><g clip-path="url(#c)"><use href="#c"/></g></svg>
<script>alert(1)</script><img src="figures/a.png" alt="a" onerror="alert(1)">
<img src="data:image/png;base64,YQ==" alt="b">
<iframe src="x"></iframe><form action="http://x"><input></form>"""
FOOTER = """<p>wildlab 0.1.0 at commit <code>c247ba823b</code> · made 2026-11-23 03:24:15 UTC.</p>
<p>All hashes are in <a href="provenance.json">provenance.json</a> beside this page.</p>
<p>H: H. H. Helgesen, doctoral thesis, 2019.</p>"""


def report(folder: Path, body: str = BODY, style: str = "#numbers { color: red }") -> Path:
    path = folder / "report.html"
    kicker = '<a href="../index.html">wildlab ledger</a> › kifaru-ridge'
    path.write_text(page(title="x", body=body, kicker=kicker, footer=FOOTER, style=style), encoding="utf-8")
    return path


def whole(tmp_path: Path, *, exact: bool = False, times: int = 2) -> str:
    path = report(tmp_path)
    parts = tuple(read_part(path, i, exact=exact) for i in range(1, times + 1))
    return joined(
        [Chapter("A flight, for the public", "It was <b>somewhere</b>.", ("And <i>so</i>.",), parts)], ""
    )


def test_ids_are_each_once_and_links_lead_somewhere(tmp_path: Path) -> None:
    soup = BeautifulSoup(whole(tmp_path), "html.parser")
    ids = [tag["id"] for tag in soup.find_all(id=True)]
    assert len(ids) == len(set(ids)) and "r1-numbers" in ids and "r2-numbers" in ids
    for link in soup.find_all("a"):
        target = str(link["href"])
        assert target.startswith("data:text/csv") or target.removeprefix("#") in ids, target
    assert soup.find("g")["clip-path"] == "url(#r1-c)"  # type: ignore[index]
    assert soup.find("svg")["aria-labelledby"] == "r1-t"  # type: ignore[index]
    assert soup.find("use")["href"] == "#r1-c"  # type: ignore[index]
    assert "#r1-numbers { color: red }" in str(soup.style)


def test_nothing_runs_asks_or_lies_beside(tmp_path: Path) -> None:
    text = whole(tmp_path)
    assert "default-src 'none'" in text
    soup = BeautifulSoup(text, "html.parser")
    assert not soup.find_all(["script", "iframe", "form", "object", "embed", "link", "base"])
    assert not [tag for tag in soup.find_all(True) if any(name.startswith("on") for name in tag.attrs)]
    assert [tag["src"] for tag in soup.find_all(src=True)] == ["data:image/png;base64,YQ=="] * 2
    for secret in [
        "jonas",
        "kestrel",
        "example.org",
        "geo+json",
        "ledger</a>",
        "kifaru-ridge",
        "provenance.json",
    ]:
        assert secret not in text


def test_the_foot_keeps_the_thesis_and_loses_hashes_and_date(tmp_path: Path) -> None:
    text = whole(tmp_path)
    assert "Helgesen" in text
    assert "c247ba823b" not in text and "2026-11-23" not in text
    assert "c247ba823b" in whole(tmp_path, exact=True)


def test_outsiders_are_not_told_what_to_type(tmp_path: Path) -> None:
    body = """<header><h1>x</h1></header>
<p>2 of 9 values are <b>assumed.</b> State them in <code>flight.toml</code>, or with <code>--settings</code>.
All else holds.</p>
<ul><li><code>wildlab check</code> on the flight says which.</li></ul>
<p>1 finding. <code>wildlab check</code> says which.</p>
<p>Is 3.5 m much? <a href="#a">See <code>wildlab georeference</code></a></p>
<p>The filter <code>schmidt</code> is one.</p>
<p>Others count. State <code>others = true</code> in [targets.many]. Down <code>down = 0</code> is.
State <code>reach_m = 60</code>.</p>"""
    path = report(tmp_path, body)
    outside, inside = (
        BeautifulSoup(read_part(path, 1, exact=one).body, "html.parser") for one in (False, True)
    )
    assert len(inside.find_all("code")) > 5 and "--settings" in inside.get_text()
    assert [" ".join(one.get_text().split()) for one in outside.find_all("p")][:5] == [
        "2 of 9 values are assumed. All else holds.",
        "1 finding.",
        "Is 3.5 m much?",
        "The filter schmidt is one.",
        "Others count. Down down = 0 is.",
    ]
    assert not outside.find_all(["ul", "li"]) and "wildlab" not in outside.get_text()


@pytest.mark.parametrize(
    "text", [b"", b"<p>hello</p>", b"<html><body><main>no heading</main></body></html>", b"\xff\xfe\x00"]
)
def test_what_is_no_report_is_refused(text: bytes, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_bytes(text)
    with pytest.raises(WildlabError, match=r"not a report|cannot be read"):
        read_part(tmp_path / "report.html", 1, exact=False)
