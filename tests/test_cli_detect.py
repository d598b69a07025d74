"""`wildlab detect`, through the real command: folders, bad images, labels, fits, and going on."""

import json
import os
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from tests.analysis.test_detect import folder, picture
from tests.commands import call, refuse, succeed
from tests.test_cli_camera import huge_png
from wildlab.flight.store import save_flight
from wildlab.simulation.twins import simulate_twin


def test_a_folder_with_bad_images_leaves_tables_and_pictures(tmp_path):
    path = folder(tmp_path / "in")
    (path / "cut.png").write_bytes((path / "000.png").read_bytes()[:200])
    os.mkfifo(path / "pipe.jpg")
    code, out, err = call("detect", path, "--out", tmp_path / "out", "--labels", path / "labels.csv")
    assert code == 0, err
    assert "F1 1.00" in out and "cut.png" in err and "pipe.jpg" in err
    assert len(list((tmp_path / "out" / "overlays").glob("*.jpg"))) == 6
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert str(tmp_path) not in page
    assert cv2.imread(str(tmp_path / "out" / "overlays" / "000.jpg")).shape == (96, 128, 3)
    assert len(pd.read_csv(tmp_path / "out" / "detections.csv")) == 12


def test_results_go_neither_among_the_images_nor_over_those_of_others(tmp_path):
    path, other = folder(tmp_path / "in"), folder(tmp_path / "other")
    assert "among" in refuse("detect", path, "--out", path)
    assert not (path / "detections.csv").exists()
    succeed("detect", path, "--out", tmp_path / "out")
    before = (tmp_path / "out" / "detections.csv").read_bytes()
    assert str(tmp_path) not in (tmp_path / "out" / "result.json").read_text(encoding="utf-8")
    assert "another folder" in refuse("detect", other, "--out", tmp_path / "out")
    assert (tmp_path / "out" / "detections.csv").read_bytes() == before


def test_what_was_missed_and_invented_is_on_sheets(tmp_path):
    path = folder(tmp_path / "in")
    cv2.imwrite(str(path / "000.png"), picture([(30, 60), (100, 70)], 0))
    out = succeed(
        "detect", path, "--out", tmp_path / "out", "--labels", path / "labels.csv", "--json", "--overlays", 2
    )
    result = json.loads(out)
    assert result["pictures"] == {"overlays": 2, "found": 11, "missed": 1, "invented": 1}
    assert (result["judged"]["found"], result["judged"]["f1"]["estimate"]) == (11, round(22 / 24, 4))
    assert (tmp_path / "out" / "missed.jpg").is_file() and (tmp_path / "out" / "invented.jpg").is_file()


def test_lengths_come_from_the_distance(tmp_path):
    path, into = folder(tmp_path / "in"), ("--out", tmp_path / "out")
    thresholds = {}
    for distance in (50, 100):
        succeed("detect", path, *into, "--distance", distance, "--focal", 1000)
        found = json.loads((tmp_path / "out" / "thresholds.json").read_text())
        thresholds[distance] = found["thresholds"]
    assert thresholds[50]["largest_px"] == 4 * thresholds[100]["largest_px"] == 900
    assert thresholds[50]["window_px"] > thresholds[100]["window_px"]
    assert "together" in refuse("detect", path, *into, "--distance", 50)
    fit = ("--fit", path / "labels.csv")
    assert "a fit" in refuse("detect", path, *into, "--distance", 50, "--focal", 900, *fit)


def test_a_flight_gives_its_images_and_their_times(tmp_path):
    twin = simulate_twin("large-ship", 1)
    save_flight(twin, tmp_path / "flight")
    assert "'images'" in refuse("detect", tmp_path / "flight", "--out", tmp_path / "out")
    (tmp_path / "flight" / "images").mkdir()
    name = str(twin.frames["frame_id"].iloc[3])
    cv2.imwrite(str(tmp_path / "flight" / "images" / f"{name}.png"), picture([(30, 60)], 0))
    succeed("detect", tmp_path / "flight", "--out", tmp_path / "out")
    frame = pd.read_csv(tmp_path / "out" / "frames.csv").iloc[0]
    assert str(frame["frame_id"]) == name
    time = frame["time_s"]
    assert time == pytest.approx(twin.frames["time_s"].iloc[3] + twin.manifest.clocks.camera_offset_s)


def test_a_turn_that_viewers_make_is_not_made(tmp_path):
    path = tmp_path / "in"
    path.mkdir()
    for number in range(2):
        seen = picture([(40, 30)], number)
        exif = Image.Exif()
        exif[0x0112] = 6
        Image.fromarray(seen).save(path / f"{number}.jpg", exif=exif, quality=98)
    succeed("detect", path, "--out", tmp_path / "out")
    assert pd.read_csv(tmp_path / "out" / "frames.csv")["width_px"].tolist() == [128, 128]


def hostile(path):
    """A folder of three sound images and of whatever else may lie there, and the names of all that."""
    path.mkdir()
    rng = np.random.default_rng(1)
    ground = 20 * cv2.GaussianBlur(rng.normal(0, 1, (96, 400)), (0, 0), 9)
    for number, name in enumerate(("000.png", "ünï – 鹿.png", "new\nline.png")):
        at = 30 * number
        image = picture([(30 + at, 60)], number) + 10 * ground[:, at : at + 128]
        encoded = cv2.imencode(".png", np.clip(image, 1, 250).astype(np.uint8))[1].tobytes()
        (path / name).write_bytes(encoded)
        whole = encoded
    jpeg = cv2.imencode(".jpg", image)[1].tobytes()
    (path / "cut.png").write_bytes(whole[:200])
    (path / "cut.jpg").write_bytes(jpeg[: len(jpeg) // 2])
    (path / "zero.png").write_bytes(b"")
    (path / "text.png").write_text("no image")
    (path / "huge.png").write_bytes(huge_png())
    cv2.imwrite(str(path / "black.png"), np.zeros((96, 128), np.uint8))
    cv2.imwrite(str(path / "full.png"), np.where(rng.random((96, 128)) < 0.8, 255, 90).astype(np.uint8))
    cv2.imwrite(str(path / "small.png"), image[:50, :60])
    (path / "loop.png").symlink_to("loop.png")
    (path / "gone.png").symlink_to("nowhere.png")
    (path / "device.png").symlink_to("/dev/zero")
    (path / "folder.png").mkdir()
    os.mkfifo(path / "pipe.png")
    (path / os.fsdecode(b"raw\xff\x1b.png")).write_bytes(whole[:99])
    (path / "secret.png").write_bytes(whole)
    (path / "secret.png").chmod(0)
    names = "cut zero text huge black full small loop gone device folder pipe"
    hostile = {f"{name}.png" for name in names.split()} | {"cut.jpg", "raw\\udcff\x1b.png"}
    if os.geteuid():  # nothing is secret from the superuser
        return path, hostile | {"secret.png"}
    (path / "secret.png").unlink()
    return path, hostile


def test_whatever_lies_in_the_folder_is_counted(tmp_path):
    path, names = hostile(tmp_path / "in")
    out = succeed("detect", path, "--out", tmp_path / "out", "--json")
    result = json.loads(out)
    assert result["frames"] == {"all": 3 + len(names), "usable": 3, "kept": 0}
    assert set(dict(result["problems"])) == names
    assert set(pd.read_csv(tmp_path / "out" / "frames.csv")["frame_id"]) >= {"ünï – 鹿.png", "new\nline.png"}
    assert len(list((tmp_path / "out" / "overlays").glob("*.jpg"))) == 3
    # In a terminal ten are told, with no sign in them that it would obey, and the others are counted.
    code, _, err = call("detect", path, "--out", tmp_path / "out")
    lines = err.splitlines()
    assert code == 0 and len(lines) == 11 and "\x1b" not in err and f"{len(names) - 10} more" in lines[-1]


@pytest.mark.slow
def test_control_c_in_the_middle_loses_nothing_that_was_finished(tmp_path):
    path = folder(tmp_path / "in", 150)

    def command(into):
        arguments = ["detect", str(path), "--out", str(tmp_path / into), "--overlays", "0"]
        return [sys.executable, "-m", "wildlab.cli", *arguments]

    # Where the tests run in the background of a shell, the interrupt is ignored by all that they start.
    running = subprocess.Popen(
        command("out"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    parts = tmp_path / "out" / "parts"
    while running.poll() is None and len(list(parts.glob("*.json"))) < 2:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 130 and "Traceback" not in err
    kept = 25 * len(list(parts.glob("*.json")))
    assert 50 <= kept < 150 and not (tmp_path / "out" / "detections.csv").exists()
    again = subprocess.run(command("out"), capture_output=True, text=True, check=True)
    assert f"{kept} frames" in again.stdout
    subprocess.run(command("whole"), capture_output=True, check=True)
    at_once, in_two = ((tmp_path / into / "detections.csv").read_bytes() for into in ("whole", "out"))
    assert at_once == in_two
