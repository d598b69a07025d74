"""Which reports can be shared, and what is advised in place of one that cannot."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sharing.left import leave_report
from wildlab.errors import WildlabError
from wildlab.runner.record.digests import seal
from wildlab.runner.track_many import NOTEBOOK
from wildlab.sharing.reports import sources_of


def report(folder: Path, *, notebook: str = "overview.ipynb", tables: str = "x") -> None:
    """One that is done, on a flight of this name."""
    told = {"source": folder.name}
    leave_report(folder, "kifaru-ridge", parameters=told, notebook=notebook, files={"nav": tables})
    seal(folder, {"state": "done"}, ("provenance.json",))


def advice(folder: Path) -> str:
    with pytest.raises(WildlabError) as caught:
        sources_of(folder, {})
    return caught.value.fix


def test_a_report_on_many_targets_goes_with_the_others_whichever_is_named(tmp_path: Path) -> None:
    reports = tmp_path / "reports"
    report(reports / "kifaru-ridge-many", notebook=NOTEBOOK)
    report(reports / "kifaru-ridge-overview")
    for named in ("", "kifaru-ridge-many", "kifaru-ridge-overview"):
        ((source,), left_out) = sources_of(reports / named, {})
        assert [one.name for one in source.folders] == ["kifaru-ridge-overview", "kifaru-ridge-many"]
        assert source.parameters["kifaru-ridge-many"] == {"source": "kifaru-ridge-many"}
        assert source.logged and not left_out


def test_one_on_many_targets_that_is_of_other_tables_does_not_go_along(tmp_path: Path) -> None:
    reports = tmp_path / "reports"
    report(reports / "kifaru-ridge-many", notebook=NOTEBOOK, tables="older")
    report(reports / "kifaru-ridge-overview")
    for named in ("", "kifaru-ridge-overview"):
        (source,), left_out = sources_of(reports / named, {})
        assert [one.name for one in source.folders] == ["kifaru-ridge-overview"]
        assert any("kifaru-ridge-many" in line and "other tables" in line for line in left_out)


def test_what_is_only_called_like_one_on_many_targets_cannot_be_drawn_again(tmp_path: Path) -> None:
    """`wildlab track` leaves the report on one target in whatever folder it is told."""
    reports = tmp_path / "reports"
    report(reports / "kifaru-ridge-many", notebook="tracking.ipynb")
    report(reports / "kifaru-ridge-overview")
    assert "kifaru-ridge-overview" in advice(reports / "kifaru-ridge-many")
    (source,), left_out = sources_of(reports, {})
    assert [one.name for one in source.folders] == ["kifaru-ridge-overview"]
    assert len(left_out) == 1 and "kifaru-ridge-many" in left_out[0]
