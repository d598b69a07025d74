"""`wildlab camera`, through the real command: from image files to a camera file, and every refusal."""

import json
import re
import struct
import zlib

import cv2
import numpy as np
import pytest

from tests.test_cli_calibrate import call
from wildlab.detection.boards import Board
from wildlab.flight.camera_file import read_camera
from wildlab.geometry.camera import Camera
from wildlab.simulation.boards import board_image, board_views

CAMERA = Camera(320, 256, 420.0, 424.0, 156.0, 131.0, 0.0, (-0.15, 0.0, 0.0, 0.0, 0.0))
BOARD = Board("chessboard", 7, 5, 0.03)


@pytest.fixture(scope="module")
def boards(tmp_path_factory):
    """Ten images of a light-on-dark board."""
    into = tmp_path_factory.mktemp("boards")
    rng = np.random.default_rng(1)
    views = board_views(rng, CAMERA, BOARD.points, 10)
    for i, (R, t) in enumerate(zip(*views, strict=True)):
        image = board_image(CAMERA, R, t, BOARD.points, BOARD.spacing, warm=60.0, cold=190.0)
        image = cv2.GaussianBlur(image, (0, 0), 0.6) + rng.normal(0, 1.5, image.shape)
        cv2.imwrite(str(into / f"{i}.png"), np.clip(image, 0, 255).astype(np.uint8))
    return into


@pytest.fixture
def copy(boards, tmp_path):
    into = tmp_path / "boards"
    into.mkdir()
    for path in boards.iterdir():
        (into / path.name).write_bytes(path.read_bytes())
    return into


def run(capsys, *arguments, square="30mm", board="7x5"):
    return call(capsys, "camera", *arguments, "--board", board, "--square", square)


def test_the_camera_comes_out_and_is_written(capsys, boards, tmp_path):
    code, out, err = run(capsys, boards, "--into", tmp_path / "camera.toml", "--name", "Tau2")
    assert code == 0, err
    kept = read_camera(tmp_path / "camera.toml")
    views = kept.evidence.views
    assert views >= 8 and out.startswith(f"The board is in {views} of 10 images.")
    assert f"{views} views make wide intervals" in out and "95 % interval" in out
    assert kept.camera.name == "Tau2" and kept.board.spacing_m == 0.03
    assert kept.evidence.lens == "k1" and kept.evidence.rms_px < 0.2
    before = (tmp_path / "camera.toml").read_bytes()
    code, _, err = run(capsys, boards, "--into", tmp_path / "camera.toml", "--lens", "none")
    assert code == 2 and "this file is there already" in err and "add --overwrite" in err
    assert (tmp_path / "camera.toml").read_bytes() == before
    truth = {"fx": 420.0, "fy": 424.0, "cx": 156.0, "cy": 131.0, "k1": -0.15}
    for one in kept.parameter:
        assert abs(one.value - truth[one.name]) < 4 * one.sd


@pytest.mark.slow
def test_as_json_with_a_view_that_disagrees(capsys, copy):
    moved = cv2.imread(str(copy / "3.png"), 0)
    squeezed = np.full((256, 320), 120, np.uint8)
    squeezed[:200] = cv2.resize(moved, (320, 200))
    cv2.imwrite(str(copy / "3.png"), squeezed)
    (copy / "bad.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"\0" * 40)
    code, out, err = run(capsys, copy, "--json")
    assert code == 0, err
    found = json.loads(out)
    assert found["odd"] == ["3.png"] and found["left_out"][0]["name"] == "bad.png"
    assert any(
        "3.png" in one and "disagrees" in one and "--without 3.png" in one for one in found["sentences"]
    )
    code, out, _ = run(capsys, copy, "--json", "--without", "3.png")
    again = json.loads(out)
    assert again["odd"] == [] and again["evidence"]["views"] == found["evidence"]["views"] - 1
    assert again["evidence"]["rms_px"] < 0.5 * found["evidence"]["rms_px"]


def test_no_board_and_too_few_are_sentences(capsys, boards, tmp_path):
    code, _, err = run(capsys, boards / "0.png", boards / "1.png", board="9x6")
    assert code == 2 and "a board of 9 x 6 inner corners is in none of the 2 images" in err
    assert "--staggered" not in err
    code, _, err = call(capsys, "camera", boards / "0.png", "--circles", "4x11", "--square", "20mm")
    assert code == 2 and "4 x 11 circles is in none of the 1 images" in err and "add --staggered" in err
    code, _, err = run(capsys, boards / "0.png", boards / "1.png", "--into", tmp_path / "camera.toml")
    assert code == 2 and "is in 2 of 2 images, and at least 4 are needed" in err
    assert not (tmp_path / "camera.toml").exists()


def test_mixed_sizes_are_a_sentence(capsys, copy):
    cv2.imwrite(str(copy / "5.png"), np.tile(np.arange(60, 180, dtype=np.uint8), (100, 1)))
    code, out, err = run(capsys, copy, "--lens", "k1")
    assert code == 0 and " of 10 images" in out.splitlines()[0]
    assert "5.png: It has 120 x 100 pixels, and most of the images have 320 x 256." in err
    for n in range(4):
        cv2.imwrite(str(copy / f"{n}.png"), np.tile(np.arange(60, 180, dtype=np.uint8), (100, 1)))
    code, _, err = run(capsys, copy)
    assert code == 2 and re.search(r"has (120 x 100|320 x 256) pixels, 5 of 10 images have", err)
    assert "the images of each size by themselves" in err


def test_coded_boards_are_refused(capsys, tmp_path):
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    coded = cv2.aruco.CharucoBoard((8, 6), 0.03, 0.022, family).generateImage((420, 320), marginSize=20)
    cv2.imwrite(str(tmp_path / "coded.png"), coded)
    code, _, err = run(capsys, tmp_path / "coded.png")
    assert code == 2 and "coded.png: shows a coded board" in err and "plain chessboard" in err


def huge_png():
    head = struct.pack(">IIBBBBB", 32000, 32000, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + struct.pack(">I", 13)
        + b"IHDR"
        + head
        + struct.pack(">I", zlib.crc32(b"IHDR" + head))
    )


def test_hostile_images_are_said_and_the_rest_goes_on(capsys, copy):
    whole = (copy / "0.png").read_bytes()
    (copy / "cut.png").write_bytes(whole[: len(whole) // 2])
    jpeg = cv2.imencode(".jpg", cv2.imread(str(copy / "0.png"), 0))[1].tobytes()
    (copy / "cut.jpg").write_bytes(jpeg[: len(jpeg) // 2])
    (copy / "huge.png").write_bytes(huge_png())
    (copy / "empty.png").write_bytes(b"")
    (copy / "text.jpg").write_text("no image")
    cv2.imwrite(str(copy / "black.png"), np.zeros((256, 320), np.uint8))
    cv2.imwrite(str(copy / "white.png"), np.full((256, 320), 255, np.uint8))
    code, out, err = run(capsys, copy, "--lens", "k1")
    assert code == 0, err
    assert " of 17 images" in out.splitlines()[0]
    for name in ("cut.png", "cut.jpg", "huge.png", "empty.png", "text.jpg", "black.png", "white.png"):
        line = next(one for one in err.splitlines() if one.startswith(f"{name}: "))
        assert line.endswith(".") and len(line) > len(name) + 10


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.png", "--board", "7x5", "--square", "30mm"], "there is no such file or folder"),
        (["{}", "--board", "7x5", "--square", "30mm"], "there are no images in this folder"),
        (["{}", "--board", "7by5", "--square", "30mm"], "write 9x6"),
        (["{}", "--board", "7x5", "--square", "30"], "write 25mm"),
        (["{}", "--board", "7x5", "--circles", "4x11", "--square", "30mm"], "either --board or --circles"),
        (["{}", "--square", "30mm"], "either --board or --circles"),
        (["{}", "--board", "7x5", "--staggered", "--square", "30mm"], "--staggered is for --circles"),
        ([__file__, "--board", "2x5", "--square", "30mm"], "3 to 100 inner corners"),
    ],
)
def test_wrong_use_is_a_sentence(capsys, tmp_path, arguments, said):
    code, _, err = call(capsys, "camera", *[one.format(tmp_path) for one in arguments])
    assert code == 2 and said in err


def test_leaving_out_what_is_not_there_is_a_sentence(capsys, boards):
    code, _, err = run(capsys, boards, "--without", "x.png")
    assert code == 2 and "'x.png' is to be left out, and is not among the images" in err


def test_help_has_an_example(capsys):
    code, out, _ = call(capsys, "camera", "--help")
    assert code == 0 and "wildlab camera boards/ --board 9x6 --square 25mm --into camera.toml" in out


@pytest.mark.slow
def test_opencv_s_own_images(capsys, shared_data, tmp_path):
    """Half a minute. The published estimate has an error of .3926 px and fx = fy = 535.9."""
    code, _, err = run(capsys, shared_data("calibration", "opencv_left"), "--into", tmp_path / "left.toml",
                         "--lens", "full", board="9x6", square="25mm")  # fmt: skip
    assert code == 0, err
    kept = read_camera(tmp_path / "left.toml")
    assert kept.evidence.views == 13 and kept.evidence.rms_px <= 0.393
    fx = next(one for one in kept.parameter if one.name == "fx")
    assert abs(fx.value - 535.916) < 6


@pytest.mark.slow
def test_a_thermal_board_light_on_dark(capsys, shared_data, tmp_path):
    """Two minutes: 43 images without a licence, so only the test looks at them. Some show half a board, or
    shadows across it."""
    folder = shared_data("calibration", "thermal_chessboard")
    code, out, err = run(capsys, folder, "--into", tmp_path / "c.toml", board="8x7", square="50mm")
    assert code == 0, err
    kept = read_camera(tmp_path / "c.toml")
    assert kept.evidence.images == 43 and kept.evidence.views >= 22
    assert kept.evidence.rms_px < 0.6
    assert f"The board is in {kept.evidence.views} of 43 images" in out
    assert err.count("the whole board is not to be seen in it.") == 43 - kept.evidence.views
    # Pixels are square, and the two focal lengths are found apart.
    fx, fy = ((one.value, one.high - one.low) for one in kept.parameter[:2])
    assert abs(fx[0] - fy[0]) < fx[1] + fy[1]
