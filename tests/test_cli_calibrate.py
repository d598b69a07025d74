"""`wildlab calibrate` and `wildlab evaluate --calibration`, through the real command."""

import re
from types import SimpleNamespace

import pytest

from tests.pipeline.survey_twin import Survey, simulate
from wildlab import cli
from wildlab.errors import WildlabError
from wildlab.evaluation.runs import Interval
from wildlab.flight.learnt import parse_learnt, read_learnt, write_learnt
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import load_flight, save_flight
from wildlab.paths import DATA
from wildlab.runner.evaluate import evaluate_flight


def call(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        cli.main([str(one) for one in arguments])
    out, err = capsys.readouterr()
    return ended.value.code, out, err


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


def test_what_is_learnt_is_written_and_of_one_camera_alone(capsys, folder, tmp_path):
    code, _, err = call(capsys, "calibrate", folder / "tilted", "--into", tmp_path / "c.toml")
    assert code == 0, err
    kept = read_learnt(tmp_path / "c.toml")
    assert {"tilt"} <= {one.name for one in kept.parameter}
    code, _, err = call(capsys, "calibrate", folder / "tilted", "--into", tmp_path / "c.toml")
    assert code == 2 and "--overwrite" in err
    assert read_learnt(tmp_path / "c.toml") == kept
    code, _, err = call(capsys, "evaluate", folder / "other", "--calibration", tmp_path / "c.toml",
                        "--out", tmp_path / "reports")  # fmt: skip
    assert code == 2 and "fx_px" in err
    code, _, err = call(capsys, "evaluate", folder / "untrue", "--calibration", tmp_path / "c.toml",
                        "--out", tmp_path / "reports")  # fmt: skip
    assert code == 2
    assert not (tmp_path / "reports").exists()


def test_causes_that_are_inseparable_are_named_and_not_written(capsys, folder, tmp_path, monkeypatch):
    """A small tilt of a camera in level flight: position and clock explain it, too."""
    gain = SimpleNamespace(with_=2.0, counts=True, gain=Interval(1.0, 0.4, 1.6))
    winner = SimpleNamespace(causes=("clock",), name="clock", gain=gain)
    rival = SimpleNamespace(causes=("boresight",), gain=SimpleNamespace(with_=2.1, counts=True))
    for rivals in ((rival,), ()):
        found = SimpleNamespace(winner=winner, rivals=rivals, models=[winner, *rivals])
        learnt = SimpleNamespace(gain=None, parameter=())
        monkeypatch.setattr("wildlab.pipeline.learn.learn_flight", lambda *_, f=(learnt, found): f)
        monkeypatch.setattr("wildlab.flight.learnt.write_learnt", lambda *_: None)
        code, out, _ = call(capsys, "calibrate", folder / "tilted", "--into", tmp_path / "c.toml")
        assert code == 0 and ("boresight" in out) == bool(rivals)


def test_logs_that_contradict_each_other_teach_nothing(capsys, folder, tmp_path):
    flight = load_flight(folder / "tilted")
    nav = flight.nav["logged"]
    nav["down_m"] *= 3.28084
    save_flight(flight, tmp_path / "feet")
    code, _, err = call(capsys, "calibrate", tmp_path / "feet", "--into", tmp_path / "c.toml")
    assert code == 2 and "contradict" in err
    assert not (tmp_path / "c.toml").exists()


def test_too_few_images_and_files_that_are_not_there_are_sentences(capsys, folder, tmp_path):
    code, _, err = call(capsys, "calibrate", folder / "short", "--into", tmp_path / "c.toml")
    assert code == 2 and "5 images" in err and not (tmp_path / "c.toml").exists()
    code, _, err = call(capsys, "evaluate", folder / "tilted", "--calibration", tmp_path / "none.toml")
    assert code == 2 and "no such file" in err


def example_recipe(into):
    """The worked example of the recipes' README, as files."""
    text = (DATA / "recipes" / "README.md").read_text(encoding="utf-8")
    for name, table in re.findall(r"`(\w+\.csv)`,.*?```csv\n(.*?)```", text, re.DOTALL):
        (into / name).write_text(table, encoding="utf-8")
    recipe, *_ = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    (into / "recipe.toml").write_text(recipe, encoding="utf-8")
    return into / "recipe.toml"


@pytest.mark.slow
def test_a_flight_imported_with_a_calibration_keeps_it_and_is_judged_with_it(
    capsys, folder, tmp_path, monkeypatch
):
    code, _, err = call(capsys, "calibrate", folder / "tilted", "--into", tmp_path / "c.toml")
    assert code == 0, err
    recipe = example_recipe(tmp_path)
    code, _, err = call(
        capsys, "import", recipe, "--into", tmp_path / "f", "--calibration", tmp_path / "c.toml"
    )
    assert code == 2 and "another camera" in err and not (tmp_path / "f").exists()
    assert call(capsys, "import", recipe, "--into", tmp_path / "f")[0] == 0
    flight, learnt = load_flight(tmp_path / "f"), read_learnt(tmp_path / "c.toml")
    # The same learnt values, of this flight's own camera.
    mine = learnt.model_copy(update={"camera": flight.manifest.camera, "mount": flight.manifest.mount})
    write_learnt(mine, tmp_path / "mine.toml")
    code, _, err = call(
        capsys,
        "import",
        recipe,
        "--into",
        tmp_path / "f",
        "--calibration",
        tmp_path / "mine.toml",
        "--overwrite",
    )
    assert code == 0, err
    kept = load_flight(tmp_path / "f")
    assert kept.calibration is not None and read_learnt(kept.calibration) == mine
    assert call(capsys, "import", recipe, "--into", tmp_path / "f", "--overwrite")[0] == 0
    assert load_flight(tmp_path / "f").calibration is None

    jobs = []
    kept = "wildlab.runner.evaluate.run_all"
    monkeypatch.setattr(kept, lambda groups, *_, **__: jobs.extend(groups[0]) or [])
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


@pytest.mark.parametrize("low", [0.1, -0.1])
def test_nothing_is_not_said_to_gain_nothing_where_something_does(capsys, folder, tmp_path, monkeypatch, low):
    """Nothing may be as likely as the best while some model gains for certain."""
    model = SimpleNamespace(causes=("height",), gain=SimpleNamespace(counts=low > 0))
    learnt = SimpleNamespace(gain=None, parameter=())
    nothing = SimpleNamespace(causes=(), gain=SimpleNamespace(gain=Interval(0.0, 0.0, 0.0)))
    found = SimpleNamespace(models=[model], winner=nothing, rivals=())
    monkeypatch.setattr("wildlab.pipeline.learn.learn_flight", lambda *_: (learnt, found))
    monkeypatch.setattr("wildlab.flight.learnt.write_learnt", lambda *_: None)
    code, out, _ = call(capsys, "calibrate", folder / "tilted", "--into", tmp_path / "c.toml")
    assert code == 0 and ("for certain" in out) == (low < 0)
