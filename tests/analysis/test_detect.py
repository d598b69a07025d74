"""Detection over folders: what is written, what is kept when it is broken off, what it is worth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from tests.analysis.test_detection_part_fit import sample
from tests.refused import refused
from wildlab.analysis import detectors as subject
from wildlab.analysis.detection_command import samples_of
from wildlab.analysis.detection_fit import fit_shapes, fit_thresholds
from wildlab.analysis.detection_scores import judge_detections
from wildlab.analysis.detectors import (
    detect_frame,
    read_thresholds,
    run_detection,
    write_thresholds,
)
from wildlab.detection.contrast import Contrast, Shape
from wildlab.detection.floating import FloatingThresholds
from wildlab.evaluation.intervals import Interval
from wildlab.flight.readers.frames import open_frames, read_image
from wildlab.flight.readers.labels import read_labels


def picture(places: list[tuple[int, int]], seed: int, size: int = 5, warmer: int = 60) -> np.ndarray:
    rng = np.random.default_rng(seed)
    image = rng.normal(100, 2, (96, 128))
    for u, v in places:
        image[v - size // 2 : v + size // 2 + 1, u - size // 2 : u + size // 2 + 1] += warmer
    return np.clip(image, 0, 255).astype(np.uint8)


def folder(path: Path, count: int = 6) -> Path:
    """Frames with two animals each, one of them moving; and their labels."""
    path.mkdir()
    rows = []
    for number in range(count):
        places = [(20 + 10 * (number % 9), 30), (100, 70)]
        cv2.imwrite(str(path / f"{number:03d}.png"), picture(places, number))
        rows += [(f"{number:03d}.png", u - 2.5, v - 2.5, 5, 5, f"scene {number // 2}") for u, v in places]
    pd.DataFrame(rows, columns=["image", "x", "y", "w", "h", "scene"]).to_csv(
        path / "labels.csv", index=False
    )
    return path


def test_tables_hold_what_was_put_in(tmp_path):
    frames = open_frames(folder(tmp_path / "in"))
    done = run_detection(frames, tmp_path / "out", "contrast", Contrast())
    assert len(done.detections) == 12 and len(done.frames) == 6 and done.kept == 0
    read = pd.read_csv(tmp_path / "out" / "detections.csv")
    assert np.allclose(read["u_px"], pd.read_parquet(tmp_path / "out" / "detections.parquet")["u_px"])
    moving = read[read["v_px"] < 50].sort_values("frame_id")
    assert np.allclose(moving["u_px"], 20 + 10 * np.arange(6), atol=0.3)
    assert (read["kind"] == "pixel").all() and (read["touches_border"] == 0).all()
    assert (read["cov_uu_px2"] * read["cov_vv_px2"] > read["cov_uv_px2"] ** 2).all()


def test_a_run_that_was_broken_off_goes_on_and_gives_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(subject, "PART", 4)
    frames = open_frames(folder(tmp_path / "in", 11))
    whole = run_detection(frames, tmp_path / "whole", "contrast", Contrast())
    seen = []

    def stop(done: int) -> None:
        seen.append(done)
        if done == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_detection(frames, tmp_path / "out", "contrast", Contrast(), stop)
    assert not (tmp_path / "out" / "detections.csv").exists()
    looked = []
    true = subject.detect_frame
    monkeypatch.setattr(subject, "detect_frame", lambda f, *rest: looked.append(f.name) or true(f, *rest))
    done = run_detection(frames, tmp_path / "out", "contrast", Contrast(), seen.append)
    assert done.kept == 4 and looked[0] == "004.png" and len(looked) == 7 and seen[-1] == 11
    pd.testing.assert_frame_equal(done.detections, whole.detections)
    pd.testing.assert_frame_equal(done.frames, whole.frames)
    # Other thresholds, or a damaged part: computed again.
    assert run_detection(frames, tmp_path / "out", "contrast", Contrast(peak=10)).kept == 0
    (tmp_path / "out" / "parts" / "000000.parquet").write_bytes(b"broken")
    assert run_detection(frames, tmp_path / "out", "contrast", Contrast(peak=10)).kept == 0


def test_frames_that_cannot_be_used_stay_in_the_denominator(tmp_path):
    path = folder(tmp_path / "in")
    (path / "002.png").write_bytes((path / "002.png").read_bytes()[:300])
    (path / "005.png").unlink()
    cv2.imwrite(str(path / "009.png"), picture([(50, 50)], 9))
    done = run_detection(open_frames(path), tmp_path / "out", "contrast", Contrast())
    judged = judge_detections(done.detections, done.frames, read_labels(path / "labels.csv"))
    assert (judged.rates.found, judged.rates.invented, judged.rates.missed) == (8, 0, 2)
    assert (judged.frames, judged.without_labels, judged.unusable, judged.absent) == (5, 1, 1, ("005.png",))
    assert sorted(judged.things["verdict"].unique()) == ["found", "missed"]


def test_thresholds_are_judged_where_they_were_not_chosen():
    """Two clips whose animals differ in size: what suits one misses the other, and the fit has to say so."""
    rng = np.random.default_rng(1)
    samples = []
    for number in range(8):
        size = 3 if number % 2 else 13
        u, v = int(rng.integers(20, 100)), int(rng.integers(20, 70))
        box = [u - size / 2, v - size / 2, size, size]
        samples.append(sample(number, picture([(u, v)], number, size), [box], f"clip {number % 2}"))
    small, large = Contrast(smallest_px=5, largest_px=40), Contrast(smallest_px=60, largest_px=900)
    fitted = fit_thresholds("contrast", samples, tried=[small, large])
    assert fitted.held_out.f1.estimate == 0 and fitted.inside.f1.estimate > 0.5
    assert fitted.chosen == {"clip 0": small, "clip 1": large}
    both = fit_thresholds("contrast", samples, tried=[Contrast(smallest_px=5, largest_px=900), small, large])
    assert both.held_out.f1.estimate == 1.0 and both.thresholds.largest_px == 900
    with refused("of 1 group"):
        fit_thresholds("contrast", samples[::2], tried=[small])


def test_samples_keep_groups_and_stretches_of_a_clip_together(tmp_path):
    path = folder(tmp_path / "in", 8)
    grouped = samples_of(open_frames(path), read_labels(path / "labels.csv", group="scene"))
    assert [one.group for one in grouped] == [f"scene {n // 2}" for n in range(8)]
    clip, labels = tmp_path / "a.avi", tmp_path / "l.csv"
    writer = cv2.VideoWriter(str(clip), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (128, 96))
    for number in range(40):
        writer.write(cv2.cvtColor(picture([(50, 50)], number), cv2.COLOR_GRAY2BGR))
    writer.release()
    pd.DataFrame({"frame0": range(40), "x": 48, "y": 48, "w": 5, "h": 5}).to_csv(labels)
    stretches = [one.group for one in samples_of(open_frames(clip), read_labels(labels))]
    assert len(set(stretches)) == 10 and stretches == sorted(stretches, key=stretches.index)


def test_thresholds_come_back_from_their_file(tmp_path):
    write_thresholds(tmp_path / "t.json", "contrast", Contrast(peak=7))
    assert read_thresholds(tmp_path / "t.json", "contrast") == Contrast(peak=7)
    for kept in (FloatingThresholds(largest_area=None), FloatingThresholds(largest_area=900.0)):
        write_thresholds(tmp_path / "f.json", "floating", kept)
        assert read_thresholds(tmp_path / "f.json", "floating") == kept
    with refused("'contrast'"):
        read_thresholds(tmp_path / "t.json", "warm")
    (tmp_path / "t.json").write_text("[]")
    with refused("no thresholds"):
        read_thresholds(tmp_path / "t.json", "contrast")
    with refused("'magic'"):
        detect_frame(read_image(tmp_path / "none.png"), "magic", Contrast())


@pytest.mark.slow
def test_a_classifier_of_shapes_learns_what_a_size_cannot_tell(tmp_path):
    """Animals and fence posts of the same area and warmth: the one is round, the other long."""
    samples = []
    for number in range(10):
        rng = np.random.default_rng(number)
        image = rng.normal(100, 2, (160, 200))
        boxes = []
        for u, w, h in ((30, 7, 7), (70, 16, 3), (110, 7, 7), (150, 16, 3)):
            v = 40 + int(rng.integers(0, 80))
            image[v - h // 2 : v - h // 2 + h, u - w // 2 : u - w // 2 + w] += 60
            boxes.append([u - w / 2, v - h / 2, w, h])
        grey = np.clip(image, 0, 255).astype(np.uint8)
        samples.append(sample(number, grey, boxes[::2], f"clip {number // 2}"))
    fitted = fit_shapes(samples)
    assert fitted.held_out.f1.estimate > 0.95 > 0.8 > fitted.defaults.f1.estimate
    again = detect_frame(samples[0].frame, "shape", fitted.thresholds)
    assert len(again) == 2 and (again.score >= fitted.thresholds.least).all()
    write_thresholds(tmp_path / "t.json", "shape", fitted.thresholds)
    assert read_thresholds(tmp_path / "t.json", "shape") == fitted.thresholds
    with refused("0 weights"):
        detect_frame(samples[0].frame, "shape", Shape())


@pytest.mark.slow
def test_stated_ellipses_are_held_against_the_middle_of_labels(tmp_path):
    count, covariance = 400, np.array([[4.0, 1.0], [1.0, 2.0]])
    off = np.random.default_rng(8).multivariate_normal([0, 0], covariance, count)
    frames = pd.DataFrame({"frame_id": [f"{n}.png" for n in range(count)]})
    table = frames.assign(
        u_px=50 + off[:, 0], v_px=40 + off[:, 1], left_px=45.0, top_px=35.0, width_px=10.0, height_px=10.0,
        score=1.0, cov_uu_px2=4.0, cov_uv_px2=1.0, cov_vv_px2=2.0,
    )  # fmt: skip
    labels = frames.rename(columns={"frame_id": "image"}).assign(x=46, y=34, w=8, h=12)
    labels.to_csv(tmp_path / "l.csv", index=False)

    def ellipse(table: pd.DataFrame) -> Interval | None:
        seen = frames.assign(width_px=128, height_px=96, problem=None)
        return judge_detections(table, seen, read_labels(tmp_path / "l.csv")).ellipse

    honest = ellipse(table)
    assert honest is not None and honest.low < 0.9 < honest.high
    small = ellipse(table.assign(cov_uu_px2=1.0, cov_uv_px2=0.0, cov_vv_px2=1.0))
    # 4.6 = -2 ln 0.1: within a circle of that squared radius.
    expected = float((np.sum(off**2, axis=1) <= 4.605).mean())
    assert small is not None and abs(small.estimate - expected) < 1e-9 and small.high < 0.9
    assert ellipse(table.drop(columns=["cov_uv_px2"])) is None
