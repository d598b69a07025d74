"""Copies of what `wildlab track --many` makes: drawn again, told the same, and nothing of who or where.

Reports are made by stand-ins that print all that they are given; one slow test runs the true notebooks.
"""

from __future__ import annotations

import base64
import re
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes

import pytest
from bs4 import BeautifulSoup

from tests.analysis.robots import robot_flight
from tests.sharing.left import everything, leave_report
from tests.sharing.test_share import assert_no_copy
from wildlab.errors import RunFailed
from wildlab.flight.manifest import read_settings
from wildlab.flight.store import Flight, load_flight, save_flight
from wildlab.reporting.metrics import metric
from wildlab.runner.evaluate import MANY_NOTEBOOK as NOTEBOOK
from wildlab.runner.evaluate import track_many
from wildlab.runner.scheduling import Outcome
from wildlab.sharing import generalisation as neutral
from wildlab.sharing import recomputation as redrawn
from wildlab.sharing.share import share

HERE = {"latitude_deg": -24.873165, "longitude_deg": 31.486297, "height_m": 317.43}
SECRETS = (
    *("kifaru", "letaba", "thandi", "mokoro", "skukuza", "shingwedzi", "canoe", "pafuri", "olifants"),
    *("kestrel", "masorini", "873165", "486297", "317.43", "2023-09-17", "7198", "7200", "settings.toml"),
)
TOLD = """
[sensors."Letaba mast"]
clock_offset_s = 7198.5
[sensors."Letaba mast".noise]
range_m = 0.5
azimuth_deg = 0.3
[sensors."Pafuri post".noise]
range_m = 1.5
[targets]
acceleration_m_s_sqrt_s = 0.15
start_speed_m_s = 1.0
[[targets.many.hulls]]
name = "Shingwedzi canoe"
length_m = 4.0
beam_m = 1.0
[[targets.many.hulls]]
name = "Skukuza ferry"
length_m = 9.0
beam_m = 3.0
"""


def telling(seconds: float = 12.0) -> Flight:
    """Of a robot: its sensor, its target, its kinds of hulls, its clock and its place tell of somewhere."""
    hulls = [{"name": "Thandis mokoro", "length_m": 4.0}, {"name": "Skukuza ferry", "length_m": 9.0}]
    flight = robot_flight(
        3,
        name="kifaru-drift",
        sensor="Letaba mast",
        seconds=seconds,
        clutter=1,
        manifest={
            "locations": {"category": 2},
            "origin": HERE,
            "platform": {"name": "Kestrel of Olifants"},
            "time": {"kind": "utc", "epoch": "2023-09-17T12:00:00Z"},
            "sensors": {"Letaba mast": {"clock_offset_s": 7198.5}},
            "targets": {"many": {"hulls": hulls}},
        },
    )
    frames = flight.table("frames")
    tables = flight.tables | {"frames": frames.assign(time_s=frames["time_s"] - 7198.5)}
    for name in ("detections", "truth"):
        tables[name] = tables[name].replace({"target_id": {"boat": "Masorini"}})
    return replace(flight, tables=tables, nav={"Kestrel-log": flight.nav["own"]})


def leave(folder: Path, flight: Path, body: str, notebook: str = "overview.ipynb", **told: Any) -> Outcome:
    subjects = ("all", "target-1") if notebook == NOTEBOOK else ("logged-pose",)
    numbers = [metric(name="error", subject=one, value=3.25, unit="m") for one in subjects]
    leave_report(folder, flight, body, metrics=numbers, parameters=told, notebook=notebook)
    return Outcome(folder.name, "done", 1.0, "", folder)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a flight, an overview and a report on many targets."""
    folder = tmp_path_factory.mktemp("kept")
    flight, reports = folder / "flights" / "kifaru-drift", folder / "reports"
    save_flight(telling(), flight)
    leave(reports / "kifaru-drift-overview", flight, everything(flight))
    told = {"settings": TOLD, "sensors": ["Letaba mast"], "source": "Kestrel-log"}
    leave(reports / "kifaru-drift-many", flight, everything(flight), NOTEBOOK, **told)
    return folder


@pytest.fixture
def made(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same for each test; stand-ins make reports on copies."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(kept, tmp_path, dirs_exist_ok=True)

    def evaluate(folder: Path, *, source: str | None, reports: Path, **_: Any) -> list[Outcome]:
        assert source is None
        return [leave(reports / f"{load_flight(folder).name}-overview", folder, everything(folder))]

    def follow(
        folder: Path, *, settings: Path, sensors: Any, source: str, reports: Path, **_: Any
    ) -> Outcome:
        copy = load_flight(folder)
        assert source in copy.nav and set(sensors) == set(copy.manifest.sensors) == {"sensor-1"}
        assert set(read_settings(settings).sensors) == {"sensor-1"}
        shown = everything(folder, settings.read_text(encoding="utf-8"), *sensors)
        return leave(reports / f"{copy.name}-many", folder, shown, NOTEBOOK)

    monkeypatch.setattr(redrawn, "evaluate_flight", evaluate)
    monkeypatch.setattr(redrawn, "track_many", follow)
    return tmp_path


def test_a_report_on_many_targets_is_a_part_and_tells_nothing(made):
    copy = share(made / "reports" / "kifaru-drift-many")
    text = copy.file.read_text(encoding="utf-8")
    for secret in SECRETS:
        assert secret not in text.casefold(), secret
    parts = [one.get_text() for one in BeautifulSoup(text, "html.parser").select("nav li")]
    assert parts == ["overview.ipynb", NOTEBOOK]
    # Of the overview one number, of the other two: those of its subjects are no names.
    assert "All 3 numbers" in text
    # What the filter is told is there, and what was left of a clock's offset.
    assert "kind B" in text and "length_m = 9.0" in text and "clock_offset_s = -1.5" in text
    lines = "\n".join(copy.lines)
    assert "'Pafuri post'" in lines and "'Thandis mokoro'" in lines


def hulls_left(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the settings, or of the flight, whichever has the name."""
    clean = neutral.neutral_hulls
    monkeypatch.setattr(neutral, "neutral_hulls", lambda one: None if name in str(one) else clean(one))


def settings_left(monkeypatch: pytest.MonkeyPatch) -> None:
    clean = redrawn.track_many

    def careless(*given: Any, reports: Path, **told: Any) -> Outcome:
        outcome = clean(*given, reports=reports, **told)
        file = reports / "flight-many" / "report.html"
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("</main>", "<p>Pafuri post: 1.5 m</p></main>"), encoding="utf-8")
        return outcome

    monkeypatch.setattr(redrawn, "track_many", careless)


@pytest.mark.parametrize(
    ("broken", "found"),
    [
        (partial(hulls_left, "Shingwedzi"), "Shingwedzi"),
        (partial(hulls_left, "andi"), "thandis"),
        (settings_left, "Pafuri"),
    ],
)
def test_a_name_that_is_left_in_is_found_and_there_is_no_copy(
    broken,
    found,
    made,
    monkeypatch,
):
    broken(monkeypatch)
    with pytest.raises(RunFailed, match=rf"(?i)no copy.*{found}"):
        share(made / "reports" / "kifaru-drift-many")
    assert_no_copy(made)


def unpacked(data: bytes) -> bytes:
    """A page with all that is packed inside of its addresses."""
    packed = re.findall(rb'data:[^;,"]*(?:;charset=[^;,"]*)?(;base64)?,([^"\'\s>)]*)', data)
    inside = [base64.b64decode(one) if coded else unquote_to_bytes(one.decode()) for coded, one in packed]
    return b"\n".join([data, *inside])


@pytest.mark.slow
def test_the_true_report_on_many_targets(tmp_path, monkeypatch):
    """Through the notebooks, twice: the sender's own numbers, no secret in any byte, the same bytes."""
    monkeypatch.chdir(tmp_path)
    flight = tmp_path / "flights" / "kifaru-drift"
    save_flight(telling(40.0), flight)
    file = tmp_path / "settings.toml"
    file.write_text(TOLD, encoding="utf-8")
    reports = tmp_path / "reports"
    track_many(flight, settings=file, sensors=("Letaba mast",), reports=reports)
    one, other = (share(reports / "kifaru-drift-many", out=tmp_path / name) for name in ("a.html", "b.html"))
    data = one.file.read_bytes()
    assert data == other.file.read_bytes()
    whole = unpacked(data).lower()
    assert whole.count(b"ihdr") >= 3 and b"track,from" in whole.replace(b'"', b"")
    assert b"sensor-1" in whole and b"kind a 4 m, kind b 9 m" in whole
    for secret in SECRETS:
        assert secret.encode() not in whole, secret
    lines = "\n".join(one.lines)
    assert "-many: " not in lines and not re.search(r'To "Who is where', lines), lines
