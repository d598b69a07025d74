"""`wildlab calibrate` and `wildlab evaluate --calibration`, through the real command."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import wildlab
from tests.analysis.survey_twin import Survey, simulate
from tests.commands import refuse, succeed
from tests.flight.checks.test_mistakes_named import euler
from tests.sound_flights import simulate_sound_flight
from wildlab.analysis.accuracy import corrected_flight
from wildlab.analysis.georeference import truth_of
from wildlab.analysis.tracks.tracker import read_inputs
from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import parse_learnt, read_learnt, write_calibration
from wildlab.flight.checks.check import find
from wildlab.flight.checks.findings import Finding
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import load_flight, save_flight
from wildlab.messages.catalogue import Message, load_texts
from wildlab.paths import DATA
from wildlab.runner.evaluate import evaluate_flight


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Flights: one with a tilt that is wrong, another camera's, one without truth, one too short."""
    into = tmp_path_factory.mktemp("flights")
    tilted = simulate(Survey(tilt_deg=5.0, images=18))
    save_flight(tilted, into / "tilted")
    tilted.manifest = replace_in_manifest(tilted.manifest, {"camera": {"fx_px": 2600.0}})
    save_flight(tilted, into / "other")
    short = simulate(Survey(images=5))
    save_flight(short, into / "short")
    del short.tables["truth"]
    save_flight(short, into / "untrue")
    return into


@pytest.mark.slow
def test_what_is_learnt_is_written_and_of_one_camera_alone(folder, tmp_path):
    succeed("calibrate", folder / "tilted", "--out", tmp_path / "c.toml")
    kept = read_learnt(tmp_path / "c.toml")
    assert {"tilt"} <= {one.name for one in kept.parameter}
    assert "--overwrite" in refuse("calibrate", folder / "tilted", "--out", tmp_path / "c.toml")
    assert read_learnt(tmp_path / "c.toml") == kept
    assert "fx_px" in refuse(
        "evaluate", folder / "other", "--calibration", tmp_path / "c.toml", "--out", tmp_path / "reports"
    )
    refuse("evaluate", folder / "untrue", "--calibration", tmp_path / "c.toml", "--out", tmp_path / "reports")
    assert not (tmp_path / "reports").exists()


def learn(monkeypatch, gain=None):
    """Have the command find no cause that is certain, or one with this gain, and write nothing."""
    found = SimpleNamespace(gain=gain, parameter=()), SimpleNamespace(winner=SimpleNamespace(name="clock"))
    monkeypatch.setattr("wildlab.analysis.accuracy.learn_flight", lambda *_: found)
    monkeypatch.setattr("wildlab.flight.calibration_files.write_calibration", lambda *_: None)
    monkeypatch.setattr("wildlab.reporting.georeferencing.cause_message", lambda _: Message("cause-none"))


@pytest.mark.parametrize("certain", [False, True])
def test_a_file_that_corrects_nothing_says_so(folder, tmp_path, monkeypatch, certain):
    gain = SimpleNamespace(without_m=3.0, with_m=1.0, low_m=1.0, high_m=3.0)
    learn(monkeypatch, gain if certain else None)
    out = succeed("calibrate", folder / "short", "--out", tmp_path / "c.toml")
    texts = (load_texts("terminal"), "calibrate-nothing"), (load_texts("georeferencing"), "cause-none")
    assert [text.answers[key] in out for text, key in texts] == [not certain] * 2


@pytest.mark.slow
def test_logs_that_contradict_each_other_teach_nothing(folder, tmp_path):
    flight = load_flight(folder / "tilted")
    nav = flight.nav["logged"]
    nav["down_m"] *= 3.28084
    save_flight(flight, tmp_path / "feet")
    assert "contradict" in refuse("calibrate", tmp_path / "feet", "--out", tmp_path / "c.toml")
    assert not (tmp_path / "c.toml").exists()


def test_too_few_images_and_files_that_are_not_there_are_sentences(folder, tmp_path):
    assert "5 images" in refuse("calibrate", folder / "short", "--out", tmp_path / "c.toml")
    assert not (tmp_path / "c.toml").exists()
    assert "no such file" in refuse("evaluate", folder / "tilted", "--calibration", tmp_path / "none.toml")


def example_recipe(into):
    """The worked example of the recipes' README, as files."""
    text = (DATA / "recipes" / "README.md").read_text(encoding="utf-8")
    for name, table in re.findall(r"`(\w+\.csv)`,.*?```csv\n(.*?)```", text, re.DOTALL):
        (into / name).write_text(table, encoding="utf-8")
    recipe, *_ = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    (into / "recipe.toml").write_text(recipe, encoding="utf-8")
    return into / "recipe.toml"


@pytest.mark.slow
def test_a_flight_imported_with_a_calibration_keeps_it_and_is_judged_with_it(folder, tmp_path, monkeypatch):
    succeed("calibrate", folder / "tilted", "--out", tmp_path / "c.toml")
    recipe = example_recipe(tmp_path)
    assert "another camera" in refuse(
        "import", recipe, "--out", tmp_path / "f", "--calibration", tmp_path / "c.toml"
    )
    assert not (tmp_path / "f").exists()
    succeed("import", recipe, "--out", tmp_path / "f")
    flight, learnt = load_flight(tmp_path / "f"), read_learnt(tmp_path / "c.toml")
    # The same learnt values, of this flight's own camera.
    mine = learnt.model_copy(update={"camera": flight.manifest.camera, "mount": flight.manifest.mount})
    write_calibration(mine, tmp_path / "mine.toml")
    succeed("import", recipe, "--out", tmp_path / "f", "--calibration", tmp_path / "mine.toml", "--overwrite")
    kept = load_flight(tmp_path / "f")
    assert kept.calibration is not None and read_learnt(kept.calibration) == mine
    succeed("import", recipe, "--out", tmp_path / "f", "--overwrite")
    assert load_flight(tmp_path / "f").calibration is None

    jobs = []
    kept = "wildlab.runner.evaluate.run_all"
    monkeypatch.setattr(kept, lambda given, *_, **__: jobs.extend(given) or [])
    save_flight(load_flight(folder / "tilted"), tmp_path / "g", calibration=learnt)
    save_flight(load_flight(tmp_path / "g"), tmp_path / "h")
    for name, expected in (("g", True), ("h", True), ("tilted", False)):
        jobs.clear()
        evaluate_flight(tmp_path / name if expected else folder / name, reports=tmp_path / "reports")
        assert (
            (parse_learnt(jobs[0].parameters["calibration"]) == learnt)
            if expected
            else ("calibration" not in jobs[0].parameters)
        )
    text = (tmp_path / "g" / "calibration.toml").read_text().replace("tilt", "roll", 1)
    (tmp_path / "g" / "calibration.toml").write_text(text)
    with pytest.raises(WildlabError, match="SHA-256"):
        load_flight(tmp_path / "g")


@pytest.mark.slow
def test_a_kept_calibration_moves_points_and_tracks_as_the_corrections_by_hand_do(folder, tmp_path):
    """A tilt of 5 degrees that the flight keeps, against the same tilt written into the manifest."""
    succeed("calibrate", folder / "tilted", "--out", tmp_path / "c.toml")
    learnt = read_learnt(tmp_path / "c.toml")
    flight = load_flight(folder / "tilted")
    save_flight(flight, tmp_path / "kept", calibration=learnt)
    kept = load_flight(tmp_path / "kept")
    by_hand = corrected_flight(flight, None, learnt)
    truth = truth_of(flight, wildlab.georeference(flight).table)[:, :2]
    off = {}
    for name, one in (("logged", flight), ("kept", kept), ("by hand", by_hand)):
        points = wildlab.georeference(one).table[["north_m", "east_m"]].to_numpy()
        off[name] = np.hypot(*(points - truth).T).mean()
    assert off["kept"] < 0.5 * off["logged"]
    assert off["kept"] == pytest.approx(off["by hand"], rel=1e-6)
    one, other, logged = (read_inputs(flight, source=None).sensors for flight in (kept, by_hand, flight))
    for name, inputs in one.items():
        R = inputs.scans.poses.R_nc
        assert np.allclose(R, other[name].scans.poses.R_nc, atol=1e-12)
        assert not np.allclose(R, logged[name].scans.poses.R_nc, atol=0.01)


@pytest.mark.slow
def test_poses_that_a_check_doubts_teach_only_when_asked_to(tmp_path, monkeypatch):
    """Roll and pitch exchanged: a warning, since the nose of an aircraft may point elsewhere."""
    flight = simulate_sound_flight("fixed wing", 1)
    alone = replace(flight, tables={name: flight.tables[name] for name in ("frames", "detections", "truth")})
    wrong = euler("nav/autopilot", lambda e: e[:, [1, 0, 2]])(alone)
    save_flight(wrong, tmp_path / "wrong")
    learn(monkeypatch)
    call = ("calibrate", tmp_path / "wrong", "--out", tmp_path / "c.toml")
    assert "--despite-warnings" in refuse(*call)
    succeed(*call, "--despite-warnings")


@pytest.mark.slow
def test_a_clock_that_a_check_finds_off_is_what_is_to_be_learnt(tmp_path, monkeypatch):
    flight = simulate_sound_flight("fixed wing", 1)
    frames = flight.table("frames")
    late = replace(flight, tables={**flight.tables, "frames": frames.assign(time_s=frames["time_s"] + 2.0)})
    assert {("clock of the camera",)} <= {one.causes for one in find(late, plain=False)}
    save_flight(late, tmp_path / "late")
    learn(monkeypatch)
    succeed("calibrate", tmp_path / "late", "--out", tmp_path / "c.toml")


@pytest.mark.parametrize(
    ("causes", "learns"),
    [
        (("clock of the camera", "camera turned"), True),
        (("clock of the camera", "attitude: sign of roll"), False),
        ((), False),
    ],
)
def test_only_what_is_estimated_better_may_be_found_by_a_check(folder, tmp_path, monkeypatch, causes, learns):
    learn(monkeypatch)
    found = Finding("problem", "nav/logged", "", "points-missed", {"metres": 9.0, "angle": 9.0}, causes)
    monkeypatch.setattr("wildlab.flight.checks.check.find", lambda *_, **__: [found])
    call = ("calibrate", folder / "short", "--out", tmp_path / "c.toml")
    assert succeed(*call) if learns else "contradict" in refuse(*call)
