"""A report that is not as it was written is told by its digests, and nothing of it is shown."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.reporting.test_html import shown as notebook_of
from tests.runner.test_ledger import a_study, published, ran
from tests.sharing.canary import canary
from wildlab import cli
from wildlab.errors import WildlabError
from wildlab.flight.store import load_flight, save_flight
from wildlab.reporting import notebook_pages as html
from wildlab.reporting.metrics import metric
from wildlab.reporting.report import open_report
from wildlab.runner.evaluate import compare_flights
from wildlab.runner.job import FILES
from wildlab.runner.ledger import own_flights
from wildlab.runner.provenance import changed_notice, footer, provenance_of_flight, verify_report
from wildlab.runner.seeds import SeedWork, read_seed, write_seed
from wildlab.runner.status import as_plain, misfits, read_status, seal, study_status
from wildlab.sharing.recomputation import sources_of

NUMBERS = [metric("rmse", f"part-{n}", 1.5 + n / 7, "m", n=20, low=0.5, high=9.0) for n in range(12)]
VALUES = {"rmse": 1.25, "nees": 2.5}


@pytest.fixture
def report(tmp_path: Path) -> Path:
    """What a run of a study with two kept seeds left."""
    folder = ran(tmp_path / "reports", *NUMBERS)
    work = SeedWork(tmp_path / "reports", "s", "case", {"a": 1}, "", "k" * 64, (2, 3))
    for seed in work.seeds:
        write_seed(work, seed, VALUES)
    about = {"flight": None, "parameters": {}, "seeds": work.provenance()}
    (folder / "provenance.json").write_text(json.dumps(about))
    (folder / "figures").mkdir()
    (folder / "figures" / "a.png").write_bytes(b"picture")
    status = json.loads((folder / "status.json").read_text())
    seal(folder, status, FILES)
    return folder


def shown(report: Path) -> Any:
    return as_plain(study_status(a_study(), report.parent, published(report.parent.parent / "published")))


def flipped(path: Path, place: int, bit: int) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)


def test_the_lowest_bit_of_every_leading_digit_is_noticed(report):
    path = report / "metrics.json"
    whole = path.read_bytes()
    places = [match.start() for match in re.finditer(rb"(?<![\d.])\d", whole)]
    assert len(places) > 40
    before = shown(report)
    assert before["state"] == "done"
    for place in places:
        flipped(path, place, 0)
        now = shown(report)
        assert now["state"] == "damaged" and "metrics.json" in now["reason"]
        assert all(one["here"] is None for one in now["published"])
        path.write_bytes(whole)
    assert shown(report) == before


@pytest.mark.parametrize("name", ["status.json", "metrics.json", "provenance.json", "report.html"])
def test_any_flipped_bit_is_noticed_or_changes_nothing(report, name):
    random = np.random.default_rng(5)
    path = report / name
    whole, before = path.read_bytes(), shown(report)
    noticed = 0
    for _ in range(80):
        flipped(path, int(random.integers(len(whole))), int(random.integers(8)))
        now = shown(report)
        noticed += now["state"] in ("damaged", "broken off")
        assert now["state"] in ("damaged", "broken off") or now == before
        path.write_bytes(whole)
    assert noticed > 60


def test_a_flipped_bit_of_a_kept_seed_is_noticed_or_changes_nothing(report):
    random = np.random.default_rng(6)
    work = SeedWork(report.parent, "s", "case", {"a": 1}, "", "k" * 64, (2, 3))
    path = work.folder / "2.json"
    whole = path.read_bytes()
    for _ in range(80):
        flipped(path, int(random.integers(len(whole))), int(random.integers(8)))
        assert read_seed(work, 2) in (None, VALUES)
        path.write_bytes(whole)
    assert verify_report(report).misfits == ()
    write_seed(work, 2, VALUES | {"rmse": 1.5})  # whole, and of another run
    (one,) = verify_report(report).misfits
    assert one.file == str(path) and one.field == "seed 2" and "wildlab run s" in one.fix


def call(capsys: Any, *arguments: str) -> tuple[Any, str, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main(list(arguments))
    out, err = capsys.readouterr()
    return ended.value.code, out, err


def test_verify_says_what_does_not_fit(report, capsys):
    code, out, _ = call(capsys, "verify", str(report))
    assert code == 0 and "No misfits" in out and "2 kept seeds" in out
    (report / "figures" / "a.png").unlink()
    flipped(report / "report.html", 0, 0)
    code, out, _ = call(capsys, "verify", "--json", str(report))
    said = json.loads(out)
    assert code == 1 and not said["fits"]
    assert {(Path(one["file"]).name, one["field"]) for one in said["misfits"]} == {
        ("a.png", "files.figures/a.png"), ("report.html", "files.report.html"),
    }  # fmt: skip
    assert all(one["fix"] for one in said["misfits"])
    assert call(capsys, "verify", str(report.parent))[0] == 2
    (report / "status.json").write_text(json.dumps({"state": "done", "seconds": 1.0}))
    code, out, _ = call(capsys, "verify", str(report))
    assert code == 1 and "has no digests" in out.lower()


def test_what_does_not_fit_is_left_out_and_named(report):
    reports = report.parent
    for end in ("-overview", ""):
        folder = reports / f"tuesday{end}"
        folder.mkdir()
        (folder / "report.html").write_text("<p>report</p>")
        flight = {"name": "tuesday", "kind": "logged", "files": {"frames.parquet": "0" * 64}}
        (folder / "provenance.json").write_text(json.dumps({"flight": flight, "parameters": {}}))
        seal(folder, {"state": "done", "seconds": 1.0, "finished": "2026-01-01"}, FILES)
    flipped(reports / "tuesday" / "provenance.json", 0, 0)
    (own,) = own_flights(reports, ["s"])
    assert {one.about: one.state for one in own.reports} == {"overview": "done", "georeferencing": "damaged"}
    (source,), left_out = sources_of(reports / "tuesday-overview", {})
    assert [one.name for one in source.folders] == ["tuesday-overview"]
    assert len(left_out) == 1 and "provenance.json is not as the run wrote it" in left_out[0]
    with pytest.raises(WildlabError, match=r"provenance\.json is not as the run wrote it"):
        sources_of(reports / "tuesday", {})
    with pytest.raises(WildlabError, match=r"provenance\.json is not as the run wrote it"):
        compare_flights([reports / "tuesday", reports / "tuesday-overview"], reports=reports)


def test_a_status_cannot_lose_its_digests_by_one_bit(report):
    status = json.loads((report / "status.json").read_text())
    for key in ("files", "digest"):
        (report / "status.json").write_text(json.dumps({k: v for k, v in status.items() if k != key}))
        assert read_status(report)["state"] == "damaged"
        assert misfits(report, {k: v for k, v in status.items() if k != key})


def test_a_changed_manifest_is_told_in_the_report(tmp_path):
    folder = tmp_path / "flight"
    save_flight(canary(imu=False), folder)
    about: dict[str, Any] = {
        "flight": provenance_of_flight(folder),
        "parameters": {},
        "seed": None,
        "made": "2026",
    }
    about |= {"wildlab": {"commit": None, "version": "0", "note": ""}, "lock": {"sha256": None}}
    about |= {"notebook": {"sha256": "0" * 64}}
    assert changed_notice(about) == "" and "changed" not in footer(about)
    path = folder / "flight.toml"
    path.write_text(f"# {path.read_text()}".replace("# ", "# by hand\n", 1))
    load_flight(folder)
    about["flight"] = provenance_of_flight(folder)
    assert "flight.toml" in changed_notice(about) and "changed" in footer(about)
    report = open_report(study="test", kind="logged", seed=1)
    report.head("Title")
    report.summary(["An answer."])
    page = html.report_page(notebook_of(report), study="test", alert=changed_notice(about))
    assert page.index("</h1>") < page.index("flight.toml of") and "data-part" not in page


def test_a_flight_is_told_by_its_tables_and_not_by_its_images(tmp_path):
    told = {"flight.toml", "truth.parquet", "nav/mekf.parquet"}
    for name in (*told, "images/a.png", "images/deeper/b.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(name.encode())
    assert set(provenance_of_flight(tmp_path)["files"]) == {
        "flight.toml",
        "truth.parquet",
        "nav/mekf.parquet",
    }
