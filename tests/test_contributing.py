"""The walk of CONTRIBUTING.md through adding a filter, done as it stands there."""

from __future__ import annotations

import re
import textwrap

import pytest

import wildlab.tracking
from wildlab.paths import ROOT


@pytest.mark.skipif(ROOT is None, reason="CONTRIBUTING.md stands in a checkout")
def test_the_filter_of_the_walk_passes_its_own_test(tmp_path, monkeypatch):
    assert ROOT is not None
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    walk = text[text.index("\n## A filter\n") :]
    blocks = [textwrap.dedent(block) for block in re.findall(r"( {3}```python\n.*?) {3}```\n", walk, re.S)]
    code, test = (block.split("\n", 1)[1] for block in blocks[:2])
    (tmp_path / "steady.py").write_text(code, encoding="utf-8")
    monkeypatch.setattr(wildlab.tracking, "__path__", [*wildlab.tracking.__path__, str(tmp_path)])
    names: dict[str, object] = {}
    exec(compile(test, "CONTRIBUTING.md", "exec"), names)  # noqa: S102 - this repository's own text
    checks = [value for name, value in names.items() if name.startswith("test_")]
    assert len(checks) == 1 and callable(checks[0])
    checks[0]()
