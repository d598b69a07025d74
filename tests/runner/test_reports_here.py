"""The reports that lie in ``reports/`` just now, if any: each opens anywhere, without a network."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from wildlab.paths import REPORTS
from wildlab.reporting.html import examine

PAGES = sorted(REPORTS.glob("*/report.html")) + sorted(REPORTS.glob("*.html"))


@pytest.mark.skipif(not PAGES, reason="no reports here: make reports")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(REPORTS)))
def test_report_opens_offline(page: Path, faults: Callable[[Path], list[str]]) -> None:
    assert faults(page) == []
    examine(page.read_text(encoding="utf-8"), page.parent.name, alone=page.name == "report.html")
