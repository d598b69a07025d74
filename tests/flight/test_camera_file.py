"""A camera's own file: it comes back as it was written, a recipe takes it, and a wrong one is a sentence."""

import re

import pytest

from tests.flight.recipe.test_recipe_example import README
from wildlab.errors import WildlabError
from wildlab.files import sha256
from wildlab.flight.camera_file import CameraFile, read_camera, write_camera
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import load_flight

CONTENT = {
    "camera": {
        "name": "Tau2", "width_px": 640, "height_px": 512, "fx_px": 1159.2, "fy_px": 1167.8, "cx_px": 313.0,
        "cy_px": 265.0, "k1": -0.1,
    },
    "board": {"pattern": "chessboard", "columns": 9, "rows": 6, "spacing_m": 0.025},
    "evidence": {"images": 30, "views": 28, "points": 1512, "lens": "k1", "rms_px": 0.3, "covered": 0.9},
    "covariance": ((4.0,),),
    "parameter": ({"name": "k1", "value": -0.1, "sd": 0.01, "low": -0.12, "high": -0.08},),
    "view": ({"name": "a.png", "rms_px": 0.3, "inverted": True},),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    """The example of the recipes' README, its camera in a file."""
    for name, text in re.findall(r"`(\w+\.csv)`,.*?```csv\n(.*?)```", README, re.DOTALL):
        (tmp_path / name).write_text(text, encoding="utf-8")
    recipe, *_ = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    recipe = re.sub(r"\[camera\].*?\n\n", "", recipe, count=1, flags=re.DOTALL)
    (tmp_path / "recipe.toml").write_text(f'camera = "camera.toml"\n{recipe}', encoding="utf-8")
    write_camera(CameraFile.model_validate(CONTENT), tmp_path / "camera.toml")
    return tmp_path


def test_it_comes_back_as_it_was_written(tmp_path):
    content = CameraFile.model_validate(CONTENT)
    write_camera(content, tmp_path / "camera.toml")
    assert read_camera(tmp_path / "camera.toml") == content


def test_a_recipe_takes_it(folder):
    import_flight(folder / "recipe.toml", None, folder / "flight")
    manifest = load_flight(folder / "flight").manifest
    camera = manifest.geometry_camera()
    assert (camera.fx, camera.cy, camera.distortion[0]) == (1159.2, 265.0, -0.1)
    assert manifest.camera.name == "Tau2"
    hashes = {source.file: source.sha256 for source in manifest.sources}
    assert hashes["camera.toml"] == sha256(folder / "camera.toml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("fx_px = 1159.2", "fx_px = -1.0", "is -1 px"),
        ("[[4.0]]", "[[4.0, 1.0]]", "covariance"),
        ("cy_px", "cz_px", "camera.cz_px"),
        ("format = 1", "format = 2", "camera.toml, format"),
        ("[board]", "[board", "is not valid TOML"),
    ],
)
def test_a_wrong_one_is_a_sentence(folder, old, new, said):
    path = folder / "camera.toml"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(WildlabError) as error:
        import_flight(folder / "recipe.toml", None, folder / "flight")
    assert said in str(error.value) and not (folder / "flight").exists()


def test_one_that_is_not_there_and_one_that_lies_elsewhere_are_sentences(folder):
    recipe = folder / "recipe.toml"
    (folder / "camera.toml").rename(folder / "other.toml")
    with pytest.raises(WildlabError, match="no such file"):
        import_flight(recipe, None, folder / "flight")
    recipe.write_text(recipe.read_text().replace('"camera.toml"', '"../camera.toml"'))
    with pytest.raises(WildlabError, match="leaves the folder"):
        import_flight(recipe, None, folder / "flight")
    recipe.write_text(recipe.read_text().replace("camera =", "camera_file ="))
    with pytest.raises(WildlabError, match="Write camera"):
        import_flight(recipe, None, folder / "flight")
