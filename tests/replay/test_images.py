"""Pictures of a replay: only their pixels are left, in so many bytes, of the right frames."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PIL import Image

from wildlab.replay import images as shots
from wildlab.replay.images import frames_of, read_shots


def picture(path: Path, level: int, size: tuple[int, int] = (64, 48)) -> None:
    exif = Image.Exif()
    exif[0x010E] = "SECRET PLACE"
    exif.get_ifd(0x8825)[2] = (58.0, 39.0, 43.2)
    rng = np.random.default_rng(level)
    pixels = (level + rng.integers(-12, 13, size[::-1])).astype(np.uint8)
    Image.fromarray(pixels).save(path, exif=exif, comment=b"SECRET WORDS")


def test_pixels_alone_come_along_and_stand_at_their_frames(tmp_path):
    for i in range(3):
        picture(tmp_path / f"IMG_{i}.JPG", 40 + 80 * i)
    found = read_shots(tmp_path, ["IMG_2", "IMG_0.JPG", "other"], (64, 48))
    assert sorted(found.by_row) == [0, 1]
    levels = {}
    for row, shot in found.by_row.items():
        assert b"SECRET" not in shot and b"Exif" not in shot
        levels[row] = int(np.median(cv2.imdecode(np.frombuffer(shot, np.uint8), 0)))
    assert levels[0] == pytest.approx(200, abs=3) and levels[1] == pytest.approx(40, abs=3)


def test_images_of_another_shape_or_broken_ones_are_told(tmp_path):
    picture(tmp_path / "a.jpg", 90)
    picture(tmp_path / "b.jpg", 91)
    picture(tmp_path / "c.jpg", 92, (48, 64))
    (tmp_path / "d.jpg").write_bytes(b"\xff\xd8 no image")
    found = read_shots(tmp_path, ["a", "b", "c", "d"], (64, 48))
    assert sorted(found.by_row) == [0, 1]
    assert len(found.lacks) == 2 and any("48 x 64" in one for one in found.lacks)


def test_all_of_them_fit(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    for i in range(12):
        noise = rng.integers(0, 255, (480, 640)).astype(np.uint8)
        cv2.imwrite(str(tmp_path / f"{i:02}.png"), cv2.GaussianBlur(noise, (0, 0), 2))
    monkeypatch.setattr(shots, "MOST_BYTES", 120_000)
    monkeypatch.setattr(shots, "MOST_PICTURES", 8)
    seen: list[tuple[int, int]] = []
    ids = [f"{i:02}" for i in range(12)]
    found = read_shots(tmp_path, ids, (640, 480), {5, 6}, lambda done, of: seen.append((done, of)))
    # The first and last of all, half of them where something was seen.
    assert sorted(found.by_row) == [0, 4, 5, 6, 7, 11] and "6 of 12" in found.lacks[0]
    assert sum(map(len, found.by_row.values())) <= 120_000 and seen[-1] == (6, 6)


def test_images_in_the_flight_s_folder_stand_at_the_rows_that_name_them(tmp_path):
    flight = SimpleNamespace(folder=tmp_path)
    assert frames_of(flight, ["a"]) == {}
    (tmp_path / "images").mkdir()
    assert frames_of(flight, ["a"]) == {}
    for name, level in (("a", 60), ("b", 180)):
        picture(tmp_path / "images" / f"{name}.png", level)
    found = frames_of(flight, ["c", "b", "a.png"])
    levels = {row: float(np.median(image)) for row, image in found.items()}
    assert levels == pytest.approx({1: 180, 2: 60}, abs=3)
    assert frames_of(SimpleNamespace(folder=None), ["a"]) == {}
