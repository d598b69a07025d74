"""`wildlab track`, as it is typed: its report, its tables, and what it refuses."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path

import pandas as pd
import pytest
from click.testing import CliRunner, Result

from tests.pipeline.robots import robot_flight
from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.flight.store import save_flight


def typed(*arguments: str | Path) -> Result:
    return CliRunner().invoke(wildlab, ["track", *map(str, arguments)])


def refused(*arguments: str | Path) -> str:
    result = typed(*arguments)
    assert isinstance(result.exception, WildlabError), result.output
    return str(result.exception)


def kept(folder: Path, **changes: object) -> Path:
    place = folder / str(changes.get("name", "robot"))
    save_flight(robot_flight(**changes), place)  # type: ignore[arg-type]
    return place


def numbers(report: Path) -> dict[tuple[str, str], float]:
    found = json.loads((report / "metrics.json").read_text())["metrics"]
    return {(one["name"], one["subject"]): one["value"] for one in found}


def words(page: str) -> str:
    """What is read on a page, one blank for each tag or break."""
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", page)).split())


@pytest.mark.slow
def test_a_heading_that_is_off_is_seen_through_by_the_command_line_alone(tmp_path: Path) -> None:
    flight = kept(tmp_path, seed=1, heading_off_deg=2.0, heading_sd_deg=2.0)
    result = typed(flight, "--into", tmp_path / "out", "--smooth")
    assert result.exit_code == 0, result.output
    found = numbers(tmp_path / "out")
    assert found["nees", "radar/boat/ekf"] > 20 > 5 > found["nees", "radar/boat/schmidt"]
    page = (tmp_path / "out" / "report.html").read_text()
    text = words(page)
    assert "considered errors ( Schmidt ) is off by" in text and "overconfident" in text
    assert "[uncertainty] of flight.toml" in text and "smoothed" in text
    assert all('alt=""' not in image for image in re.findall(r"<img[^>]*>", page))
    assert str(tmp_path) not in page
    table = pd.read_parquet(tmp_path / "out" / "estimates.parquet")
    assert set(table["filter"]) == {"ekf", "ekf-smoothed", "schmidt", "schmidt-smoothed", "coloured"}
    assert len(pd.read_csv(tmp_path / "out" / "estimates.csv")) == len(table)
    # A folder of one's own gets this report and no list of others.
    assert not (tmp_path / "index.html").exists()


@pytest.mark.slow
def test_tuned_on_one_judged_on_another_and_the_page_says_which(tmp_path: Path) -> None:
    one = kept(tmp_path, seed=1, name="monday", truth=False)
    other = kept(tmp_path, seed=2, name="tuesday", truth=False)
    result = typed(other, "--tune", one, "--into", tmp_path / "out")
    assert result.exit_code == 0, result.output
    text = words((tmp_path / "out" / "report.html").read_text())
    assert "Tuned on the flight monday by the likelihood of its innovations , judged on this one." in text
    assert "cannot be said without the targets' true places" in text
    assert ("nis", "radar/boat/ekf") in numbers(tmp_path / "out")
    assert not any(name == "nees" for name, _ in numbers(tmp_path / "out"))


def test_refusals_in_a_sentence(tmp_path: Path) -> None:
    flight = kept(tmp_path)
    assert "there is no target 'ship'" in refused(flight, "--target", "ship")
    assert "there is no sensor 'sonar'" in refused(flight, "--sensor", "sonar")
    assert "there is no filter 'magic'" in refused(flight, "--filter", "magic")
    assert "not on which flight" in refused(flight, "--against", "truth")
    other = kept(tmp_path, seed=3, name="blind", truth=False)
    assert "has no truth to tune against" in refused(flight, "--tune", other, "--against", "truth")
    copy = kept(tmp_path, name="copy")
    assert "nothing is tuned where it is judged" in refused(flight, "--tune", copy)
    lidar = kept(tmp_path, name="lidar", sensor="lidar")
    assert "has no detections of the sensor 'radar'" in refused(flight, "--tune", lidar)
    settings = tmp_path / "settings.toml"
    settings.write_text("[targets]\nsped = 3\n")
    assert "sped" in refused(flight, "--settings", settings)
    assert "flight.toml" in refused(tmp_path)


def test_a_flight_without_detections_is_refused(tmp_path: Path) -> None:
    flight = robot_flight()
    del flight.tables["detections"]
    save_flight(flight, tmp_path / "empty")
    assert "there are no detections" in refused(tmp_path / "empty")


def test_help_has_an_example() -> None:
    text = typed("--help").output
    assert "wildlab track flights/tuesday" in text and "--tune" in text and "schmidt" in text


@pytest.mark.slow
def test_all_targets_at_once_without_a_name(tmp_path: Path) -> None:
    flight = kept(tmp_path, kind="position", clutter=2, labelled=False)
    result = typed(flight, "--many", "--into", tmp_path / "out")
    assert result.exit_code == 0, result.output
    text = words((tmp_path / "out" / "report.html").read_text())
    assert "The target in reach has a track at" in text and "mostly on nothing" in text
    assert numbers(tmp_path / "out")["tracked", "target-1"] > 0.9
    assert (pd.read_parquet(tmp_path / "out" / "estimates.parquet")["track"] >= 0).all()


@pytest.mark.parametrize(
    "option", [("--tune", "other"), ("--filter", "ekf"), ("--target", "boat"), ("--smooth",)]
)
def test_options_that_do_not_go_with_many(tmp_path: Path, option: tuple[str, ...]) -> None:
    flight = kept(tmp_path, kind="position")
    (tmp_path / "other").mkdir()
    given = [tmp_path / one if one == "other" else one for one in option]
    said = refused(flight, "--many", *given)
    assert f"{option[0]} and --many do not go together" in said
