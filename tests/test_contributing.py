"""Walks of CONTRIBUTING.md, through adding a filter and a log format, done as they stand there."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import pytest

import wildlab.tracking
from wildlab.flight import readers
from wildlab.paths import ROOT

pytestmark = pytest.mark.skipif(ROOT is None, reason="CONTRIBUTING.md stands in a checkout")


def blocks_of(title):
    """The Python of the walk under that title, block by block."""
    assert ROOT is not None
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    walk = text[text.index(f"\n## {title}\n") + 1 :].split("\n## ")[0]
    blocks = [textwrap.dedent(block) for block in re.findall(r"( {3}```python\n.*?) {3}```\n", walk, re.S)]
    return [block.split("\n", 1)[1] for block in blocks]


def test_the_format_of_the_walk_is_recognised_and_read(tmp_path, monkeypatch):
    (tmp_path / "spaced.py").write_text(blocks_of("A log format")[0], encoding="utf-8")
    monkeypatch.setattr(readers, "__path__", [*readers.__path__, str(tmp_path)])
    monkeypatch.setitem(readers.FORMATS, "spaced", readers.Format("spaced", "spaced numbers"))
    rows = [f"{1.6e9 + k} {63.0 + 1e-5 * k} 10.0 {30.0 + k}" for k in range(20)]
    data = "\n".join([*rows, "torn"]).encode()
    assert readers.recognise(data) == "spaced"
    log = readers.read_log(Path("x"), data, "spaced")
    assert log.parts["gnss"].columns["height_sea_m"].tolist() == [30.0 + k for k in range(20)] and log.lost


def test_the_filter_of_the_walk_passes_its_own_test(tmp_path, monkeypatch):
    code, test = blocks_of("A filter")[:2]
    (tmp_path / "steady.py").write_text(code, encoding="utf-8")
    monkeypatch.setattr(wildlab.tracking, "__path__", [*wildlab.tracking.__path__, str(tmp_path)])
    names: dict[str, object] = {}
    exec(compile(test, "CONTRIBUTING.md", "exec"), names)  # noqa: S102 - this repository's own text
    checks = [value for name, value in names.items() if name.startswith("test_")]
    assert len(checks) == 1 and callable(checks[0])
    checks[0]()
