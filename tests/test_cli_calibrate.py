"""`wildlab calibrate` and `wildlab evaluate --calibration`, through the real command."""

import json

import pytest

from tests.pipeline.survey_twin import Survey, simulate
from wildlab import cli
from wildlab.flight.learnt import read_learnt
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import save_flight


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


def test_what_is_learnt_is_printed_and_written(capsys, folder, tmp_path):
    code, out, err = call(capsys, "calibrate", folder / "tilted", "--into", tmp_path / "c.toml")
    assert code == 0, err
    assert out.startswith("boresight") and "mean error" in out and "tilt" in out and "95 % interval" in out
    kept = read_learnt(tmp_path / "c.toml")
    assert {"tilt"} <= {one.name for one in kept.parameter}
    code, _, err = call(capsys, "evaluate", folder / "other", "--calibration", tmp_path / "c.toml",
                        "--out", tmp_path / "reports")  # fmt: skip
    assert code == 2 and "another camera: fx_px is 2400 there and 2600 here" in err
    code, _, err = call(capsys, "evaluate", folder / "untrue", "--calibration", tmp_path / "c.toml",
                        "--out", tmp_path / "reports")  # fmt: skip
    assert code == 2 and "a calibration is named, and the georeferencing cannot be judged" in err
    assert not (tmp_path / "reports").exists()


@pytest.mark.slow
def test_as_json(capsys, folder, tmp_path):
    code, out, _ = call(capsys, "calibrate", folder / "tilted", "--into", tmp_path / "c.toml", "--json")
    assert code == 0
    assert json.loads(out)["learnt_on"]["images"] == 18


def test_too_few_images_and_files_that_are_not_there_are_sentences(capsys, folder, tmp_path):
    code, _, err = call(capsys, "calibrate", folder / "short", "--into", tmp_path / "c.toml")
    assert code == 2 and "known in 5 images" in err and not (tmp_path / "c.toml").exists()
    code, _, err = call(capsys, "evaluate", folder / "tilted", "--calibration", tmp_path / "none.toml")
    assert code == 2 and "no such file" in err


def test_help_has_an_example(capsys):
    code, out, _ = call(capsys, "calibrate", "--help")
    assert code == 0 and "wildlab calibrate flights/tuesday --into" in out
    assert "--calibration calibration.toml" in call(capsys, "evaluate", "--help")[1]
