"""`wildlab plan`, through the real command: files for the pilot, a page that tells no place, sentences."""

import json
import re

import pytest

from tests.flight.test_area import LAT, LON, collection, feature, polygon
from tests.flight.test_mission_writers import check_plan, read_wpl
from tests.pipeline.test_plan import FIELD
from wildlab import cli

SHEET = ("--image", "640x512", "--view", "45")


def call(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        cli.main(["plan", *[str(one) for one in arguments]])
    out, err = capsys.readouterr()
    return ended.value.code, out, err


@pytest.fixture
def area(tmp_path):
    path = tmp_path / "fence.geojson"
    path.write_text(json.dumps(collection(feature(polygon(FIELD), name="Wolf <script>"))), encoding="utf-8")
    return path


def test_a_plan_leaves_files_and_a_page_that_tells_no_place(capsys, area, tmp_path):
    into = tmp_path / "out"
    code, out, err = call(capsys, area, *SHEET, "--height", 60, "--battery", 9, "--into", into)
    assert code == 0, err
    names = sorted(one.name for one in into.iterdir())
    flights = [one for one in names if one.endswith(".waypoints")]
    assert names == sorted(["plan.geojson", "plan.kml", "report.html", "result.json", *flights,
                            *(one.replace(".waypoints", ".plan") for one in flights)])  # fmt: skip
    for one in flights:
        rows = read_wpl((into / one).read_text())
        items = check_plan(json.loads((into / one.replace(".waypoints", ".plan")).read_text()))
        assert len(rows) == len(items) + 1
        points = rows[rows[:, 3] == 16][1:]
        assert abs(points[:, 8] - LAT).max() < 0.006 and abs(points[:, 9] - LON).max() < 0.006
    said = json.loads((into / "result.json").read_text())
    assert said["height_m"] == 60 and sorted(said["places"]) == sorted(
        set(names) - {"report.html", "result.json"}
    )
    page = (into / "report.html").read_text()
    for hidden in (page, (into / "result.json").read_text(), out):
        text = re.sub(r"data:image/png;base64,[^\"]+", "", hidden)
        assert "58.6" not in text and "16.4" not in text and str(tmp_path) not in text.replace(str(into), "")
    assert "Wolf &lt;script&gt;" in page and "withheld" in page
    assert "Exact positions are in " in err and all(one in err for one in flights)
    assert out.splitlines()[-1].endswith("report.html")


def test_the_page_tells_the_place_where_it_may(capsys, area, tmp_path):
    code, _, err = call(capsys, area, *SHEET, "--into", tmp_path / "out", "--exact")
    assert code == 0 and "report.html: keep these to the pilot" in err
    assert "n begins at 58.66" in (tmp_path / "out" / "report.html").read_text()


def test_a_folder_is_replaced_only_when_asked(capsys, area, tmp_path):
    into = tmp_path / "out"
    assert call(capsys, area, *SHEET, "--battery", 5, "--height", 40, "--into", into)[0] == 0
    before = len(list(into.glob("*.plan")))
    code, _, err = call(capsys, area, *SHEET, "--into", into)
    assert code == 2 and "there is a plan already" in err and len(list(into.glob("*.plan"))) == before > 1
    (into / "mine.txt").write_text("kept")
    assert call(capsys, area, *SHEET, "--into", into, "--overwrite")[0] == 0
    assert len(list(into.glob("*.plan"))) == 1 and (into / "mine.txt").read_text() == "kept"
    other = tmp_path / "other"
    other.mkdir()
    (other / "photo.jpg").write_text("x")
    code, _, err = call(capsys, area, *SHEET, "--into", other, "--overwrite")
    assert code == 2 and "holds other things (photo.jpg)" in err


def test_json_is_what_is_in_the_file(capsys, area, tmp_path):
    code, out, _ = call(capsys, area, *SHEET, "--into", tmp_path / "out", "--json")
    assert code == 0 and json.loads(out) == json.loads((tmp_path / "out" / "result.json").read_text())


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((), "nothing says what the camera sees"),
        (("--image", "640x512"), "nothing says what the camera sees"),
        (("--image", "640", "--view", "45"), "is not two numbers: write 640x512"),
        (("--image", "0x512", "--view", "45"), "an image of 0 x 512 pixels"),
        (("--image", "640x512", "--view", "200"), "a field of view of 200 degrees"),
        (("--image", "640x512", "--focal", "nan"), "a focal length of nan px"),
        ((*SHEET, "--camera", "x.toml"), "the camera is described twice"),
        (("--camera", "none.toml"), "there is no such file"),
        ((*SHEET, "--height", "-5"), "--height: a value of -5"),
        ((*SHEET, "--speed", "nan"), "--speed: a value of nan"),
        ((*SHEET, "--tilt", "-20"), "sees no ground near enough"),
        ((*SHEET, "--wind", "11", "--wind-from", "0"), "against an airspeed of 10 m/s"),
        ((*SHEET, "--battery", "1"), "one row with the way there and back"),
        ((*SHEET, "--home", "0,0"), "km from the areas"),
    ],
)
def test_wrong_use_is_a_sentence_and_leaves_nothing(capsys, area, tmp_path, given, said):
    code, out, err = call(capsys, area, *given, "--into", tmp_path / "out")
    assert code == 2 and said.lower() in err.lower() and "Traceback" not in err and not out
    assert not (tmp_path / "out").exists()


def test_a_calibrated_camera_is_taken(capsys, area, tmp_path):
    from wildlab.flight.camera_file import BoardPart, CameraFile, EvidencePart, write_camera
    from wildlab.flight.manifest import CameraPart

    content = CameraFile(
        camera=CameraPart(name="a", width_px=640, height_px=512, fx_px=800, fy_px=800, cx_px=320, cy_px=256),
        board=BoardPart(pattern="chessboard", columns=9, rows=6, spacing_m=0.03),
        evidence=EvidencePart(images=20, views=20, points=1080, lens="none", rms_px=0.3, covered=0.9),
    )
    write_camera(content, tmp_path / "camera.toml")
    code, out, err = call(
        capsys, area, "--camera", tmp_path / "camera.toml", "--height", 60, "--into", tmp_path / "o", "--json"
    )
    assert code == 0, err
    assert json.loads(out)["strip_m"] == pytest.approx(60 * 639 / 800, abs=0.01)
