"""Which reports can be shared, and what is advised in place of one that cannot."""

from __future__ import annotations

from pathlib import Path

import pytest

from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.sharing.reports import sources_of


def test_only_reports_that_are_there_are_advised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    reports = tmp_path / "reports"
    for name in ("kifaru-ridge", "kifaru-ridge-many"):
        (reports / name).mkdir(parents=True)
        (reports / name / "report.html").write_text("<p>x</p>", encoding="utf-8")
        write_json(reports / name / "status.json", {"state": "done"})
        flight = {"name": "kifaru-ridge", "kind": "logged", "files": {"nav": "x"}}
        write_json(reports / name / "provenance.json", {"flight": flight, "parameters": {}})

    def advice(name: str) -> str:
        with pytest.raises(WildlabError) as caught:
            sources_of(reports / name, {})
        return caught.value.fix

    assert advice("kifaru-ridge-many").endswith("wildlab share reports/kifaru-ridge")
    (reports / "kifaru-ridge").rename(reports / "kifaru-ridge-overview")
    for name in ("kifaru-ridge-many", "kifaru-ridge"):
        assert advice(name).endswith("wildlab share reports/kifaru-ridge-overview")
    write_json(reports / "kifaru-ridge-overview" / "status.json", {"state": "failed"})
    assert "wildlab evaluate" in advice("kifaru-ridge-many")
    assert "wildlab share" not in advice("kifaru-ridge-many") + advice("kifaru-ridge")
