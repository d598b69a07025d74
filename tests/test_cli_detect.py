"""`wildlab detect`, through the real command: folders, bad images, labels, fits, and going on."""

import json
import os

import cv2
import pandas as pd
import pytest

from tests.pipeline.test_detect import folder, picture
from wildlab import cli


def call(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        cli.main([str(one) for one in arguments])
    out, err = capsys.readouterr()
    return ended.value.code, out, err


def test_a_folder_with_bad_images_leaves_tables_pictures_and_sentences(capsys, tmp_path):
    path = folder(tmp_path / "in")
    (path / "cut.png").write_bytes((path / "000.png").read_bytes()[:200])
    os.mkfifo(path / "pipe.jpg")
    code, out, err = call(capsys, "detect", path, "--into", tmp_path / "out", "--labels", path / "labels.csv")
    assert code == 0, err
    assert out.startswith("12 detections in 6 frames of 8.") and "F1 1.00" in out
    assert "cut.png: The file is cut off" in err and "pipe.jpg: It is a named pipe" in err
    assert len(list((tmp_path / "out" / "overlays").glob("*.jpg"))) == 6
    assert cv2.imread(str(tmp_path / "out" / "overlays" / "000.jpg")).shape == (96, 128, 3)
    assert len(pd.read_csv(tmp_path / "out" / "detections.csv")) == 12


def test_what_was_missed_and_invented_is_on_sheets(capsys, tmp_path):
    path = folder(tmp_path / "in")
    cv2.imwrite(str(path / "000.png"), picture([(30, 60), (100, 70)], 0))
    code, out, _ = call(capsys, "detect", path, "--into", tmp_path / "out", "--labels", path / "labels.csv",
                        "--json", "--overlays", 2)  # fmt: skip
    assert code == 0
    result = json.loads(out)
    assert result["pictures"] == {"overlays": 2, "missed": 1, "invented": 1}
    assert (result["judged"]["found"], result["judged"]["f1"]["estimate"]) == (11, round(22 / 24, 4))
    assert (tmp_path / "out" / "missed.jpg").is_file() and (tmp_path / "out" / "invented.jpg").is_file()


@pytest.mark.slow
def test_a_fit_says_what_it_is_worth_and_its_thresholds_can_be_used_again(capsys, tmp_path):
    path = folder(tmp_path / "in")
    code, out, err = call(capsys, "detect", path, "--into", tmp_path / "out", "--fit", path / "labels.csv",
                          "--group", "scene")  # fmt: skip
    assert code == 0, err
    assert "On frames that thresholds were not chosen from: F1 1.00" in out and "With the defaults" in out
    code, out, err = call(capsys, "detect", path, "--into", tmp_path / "again", "--thresholds",
                          tmp_path / "out" / "thresholds.json", "--labels", path / "labels.csv")  # fmt: skip
    assert code == 0 and "F1 1.00" in out


def test_a_second_run_computes_nothing_again(capsys, tmp_path, monkeypatch):
    from wildlab.pipeline import detect as subject

    monkeypatch.setattr(subject, "PART", 2)
    path = folder(tmp_path / "in")
    assert call(capsys, "detect", path, "--into", tmp_path / "out")[0] == 0
    code, out, _ = call(capsys, "detect", path, "--into", tmp_path / "out")
    assert code == 0 and "6 frames were there" in out


def test_wrong_use_is_a_sentence(capsys, tmp_path):
    path = folder(tmp_path / "in")
    code, _, err = call(capsys, "detect", tmp_path / "none", "--into", tmp_path / "out")
    assert code == 2 and "no such file or folder" in err
    code, _, err = call(capsys, "detect", path, "--into", tmp_path / "out", "--fit", path / "labels.csv",
                        "--thresholds", path / "labels.csv")  # fmt: skip
    assert code == 2 and "leave --fit or --thresholds out" in err.lower()
    code, out, _ = call(capsys, "detect", "--help")
    assert code == 0 and "wildlab detect images --fit labels.csv" in out
