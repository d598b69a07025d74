"""Frames out of folders, cards and files: what they measure, where they are valid, what bad ones say."""

import io
import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.annotation import write_images
from wildlab.errors import WildlabError
from wildlab.flight.readers.frames import open_frames, read_image
from wildlab.flight.readers.frames.image import (
    Planck,
    gather_pieces,
    images_below,
    open_image,
    read_records,
    segments_of,
    to_kelvin,
)
from wildlab.flight.readers.frames.scene import find_clipped, find_no_data, find_overlay
from wildlab.replay.images import read_shots


def scene(seed: int = 1, shape: tuple[int, int] = (96, 128)) -> np.ndarray:
    """Uneven ground."""
    rng = np.random.default_rng(seed)
    rough = cv2.GaussianBlur(rng.normal(0, 1, shape), (0, 0), 6)
    return np.clip(120 + 400 * rough + rng.normal(0, 3, shape), 20, 230).astype(np.uint8)


def write(path: Path, image: np.ndarray) -> Path:
    assert cv2.imwrite(str(path), image)
    return path


def fff(counts: np.ndarray, *, as_png: bool = False, swapped: bool = False) -> bytes:
    """Records of FLIR as a camera would write them."""
    height, width = counts.shape
    if as_png:
        stored = counts.byteswap() if swapped else counts
        body = cv2.imencode(".png", stored)[1].tobytes()
    else:
        body = counts.astype("<u2").tobytes()
    raw = struct.pack("<HHH", 2, width, height).ljust(32, b"\0") + body
    camera = bytearray(0x400)
    struct.pack_into("<H", camera, 0, 2)
    struct.pack_into("<fff", camera, 0x58, PLANCK.R1, PLANCK.B, PLANCK.F)
    struct.pack_into("<if", camera, 0x308, int(PLANCK.O), PLANCK.R2)
    head = b"FFF\0" + b"made".ljust(16, b"\0") + struct.pack(">III", 100, 64, 2)
    head = head.ljust(64, b"\0")
    at = 64 + 2 * 32
    for kind, data in ((1, raw), (32, bytes(camera))):
        head += struct.pack(">HHIIII", kind, 0, 0, 0, at, len(data)).ljust(32, b"\0")
        at += len(data)
    return head + raw + bytes(camera)


def as_jpeg(records: bytes, piece: int = 60_000) -> bytes:
    """A JPEG that carries records in pieces."""
    picture = cv2.imencode(".jpg", np.full((8, 8), 90, np.uint8))[1].tobytes()
    parts = [records[at : at + piece] for at in range(0, len(records), piece)]
    segments = b"".join(
        b"\xff\xe1"
        + struct.pack(">H", len(part) + 10)
        + b"FLIR\0\x01"
        + bytes([number, len(parts) - 1])
        + part
        for number, part in enumerate(parts)
    )
    return picture[:2] + segments + picture[2:]


def pieces(jpeg: bytes) -> bytes:
    return gather_pieces(segments_of(open_image(io.BytesIO(jpeg))))


PLANCK = Planck(17096.453125, 0.0480848, 1428.0, 1.0, -370.0)


def test_temperatures_are_those_of_plancks_law(tmp_path):
    kelvin = np.linspace(280, 320, 64 * 48).reshape(48, 64)
    counts = PLANCK.R1 / (PLANCK.R2 * (np.exp(PLANCK.B / kelvin) - PLANCK.F)) - PLANCK.O
    assert np.abs(to_kelvin(np.rint(counts).astype(np.uint16), PLANCK) - kelvin).max() < 0.02
    records = fff(np.rint(counts).astype(np.uint16))
    (tmp_path / "a.fff").write_bytes(records)
    (tmp_path / "b.jpg").write_bytes(as_jpeg(records, piece=1000))
    for frame in open_frames(tmp_path):
        assert frame.unit == "kelvin" and frame.polarity == "white-hot"
        assert np.abs(frame.image - kelvin).max() < 0.02


def test_records_that_lie_or_lack_a_piece_are_sentences():
    counts = np.full((20, 30), 3000, np.uint16)
    whole = fff(counts)
    assert "cut off" in str(read_records(whole[:700]))
    lying = whole.replace(struct.pack("<HHH", 2, 30, 20), struct.pack("<HHH", 2, 60000, 60000))
    assert "claims 60000 x 60000 pixels" in str(read_records(lying))
    jpeg = as_jpeg(whole, piece=500)
    assert pieces(jpeg) == whole
    first = jpeg.index(b"FLIR\0\x01\x01")
    assert pieces(jpeg[:first] + b"NONE\0" + jpeg[first + 5 :]) == b""


@pytest.mark.parametrize(
    ("name", "celsius"), [("FLIR_AX8.jpg", 24.75), ("FLIR.jpg", 26.21), ("DJI_XTR.jpg", 26.32)]
)
def test_medians_of_real_files_are_those_of_exiftools_constants(shared_data, name, celsius):
    frame = read_image(shared_data("imagery", "rjpeg_samples", name))
    assert frame.unit == "kelvin" and frame.valid.all()
    assert round(float(np.median(frame.image)) - 273.15, 2) == celsius


def test_real_files_of_other_kinds(shared_data):
    fff_frame = read_image(shared_data("imagery", "flirpy", "frame_000000.fff"))
    assert fff_frame.unit == "kelvin" and fff_frame.image.shape == (512, 640)
    tiff = read_image(shared_data("imagery", "flirpy", "example_radiometric.tiff"))
    assert tiff.unit == "counts" and tiff.image.dtype == np.uint16 and np.median(tiff.image) == 6994
    bordered = read_image(shared_data("imagery", "bambi_gatter", "thermal", "17_19345.jpg"))
    assert 0.75 < bordered.valid.mean() < 0.85 and not bordered.valid[:70].any() and bordered.valid[512, 512]


def claims(width: int, height: int) -> bytes:
    """A PNG whose header claims a size."""
    body = b"IHDR" + struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    chunk = struct.pack(">I", 13) + body + struct.pack(">I", zlib.crc32(body))
    return (
        b"\x89PNG\r\n\x1a\n" + chunk + struct.pack(">I", 0) + b"IEND" + struct.pack(">I", zlib.crc32(b"IEND"))
    )


def test_bad_images_are_sentences_and_the_rest_goes_on(tmp_path):
    good = [write(tmp_path / f"good{number}.png", scene(number)).name for number in range(3)]
    for ending in ("jpg", "png", "tiff"):
        data = cv2.imencode(f".{ending}", scene(7))[1].tobytes()
        (tmp_path / f"cut.{ending}").write_bytes(data[: len(data) // 2])
    (tmp_path / "empty.jpg").write_bytes(b"")
    (tmp_path / "huge.png").write_bytes(claims(32768, 16384))
    (tmp_path / "text.jpg").write_text("no image")
    write(tmp_path / "black.png", np.zeros((96, 128), np.uint8))
    write(tmp_path / "small.png", scene(5, (50, 60)))
    write(tmp_path / "white.png", np.where(scene(6) > 60, 255, scene(6)).astype(np.uint8))
    os.mkfifo(tmp_path / "pipe.png")
    found = {frame.name: frame.problem for frame in open_frames(tmp_path)}
    assert len(found) == 13
    words = {"huge.png": "100,000,000 pixels", "small.png": "60 x 50", "white.png": "saturated"}
    assert all(word in found[name] for name, word in words.items())
    assert [name for name, problem in found.items() if not problem] == good


def test_damage_is_a_sentence_and_nothing_on_the_terminal(capfd, tmp_path):
    rng = np.random.default_rng(1)
    data = {ending: cv2.imencode(ending, scene())[1].tobytes() for ending in (".png", ".tiff")}
    for number in range(60):
        ending = (".png", ".tiff")[number % 2]
        broken = bytearray(data[ending])
        at = int(rng.integers(30, 120 if number % 3 else len(broken) - 20))
        broken[at] ^= 0x55
        (tmp_path / f"{number}{ending}").write_bytes(bytes(broken))
    frames = list(open_frames(tmp_path))
    assert len(frames) == 60
    assert all(one.problem for one in frames if one.name.endswith(".png"))
    assert capfd.readouterr().err == ""


def test_a_letterbox_and_a_curved_border_are_masked_and_a_dark_wood_is_not():
    image = scene()
    image[:12] = 0
    rows, columns = np.ogrid[:96, :128]
    curved = (columns - 64) ** 2 + (rows - 48) ** 2 * 0.2 > 60**2
    image[curved] = 0
    image[40:60, 50:80] = 0
    image[90:, 60:70] = 0
    found = find_no_data(image)
    assert found[:12].all() and found[curved].all()
    assert not found[40:60, 50:80].any() and not found[91:, 62:68].all()
    empty = (curved | (rows < 12)).astype(np.uint8)
    assert not found[cv2.dilate(empty, np.ones((11, 11), np.uint8)) == 0].any()


def test_clipped_sky_is_masked_and_a_clipped_animal_is_not():
    image = scene()
    image[80:] = 255
    image[20:26, 30:40] = 255
    found = find_clipped(image)
    assert found[84:].all() and not found[20:26, 30:40].any()


def test_burnt_in_text_is_masked_where_the_scene_moves():
    def write_on(image: np.ndarray) -> np.ndarray:
        return cv2.putText(image, "25 C", (5, 90), cv2.FONT_HERSHEY_SIMPLEX, 0.5, 255, 1)

    frames = [write_on(scene(number)) for number in range(8)]
    written = write_on(np.zeros((96, 128), np.uint8))
    found = find_overlay(frames)
    assert found is not None and found[written > 0].mean() > 0.9
    assert found[:70].mean() < 0.01
    assert find_overlay([frames[0]] * 8) is None and find_overlay(frames[:4]) is None


def test_a_video_gives_its_frames_with_times_and_can_be_entered_anywhere(tmp_path):
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (128, 96))
    for number in range(12):
        writer.write(cv2.cvtColor(scene(number), cv2.COLOR_GRAY2BGR))
    writer.release()
    clip = open_frames(path)
    frames = list(clip)
    assert len(clip) == len(frames) == 12 and frames[3].name == "clip#000003"
    assert frames[3].time == pytest.approx(0.3) and frames[3].unit == "grey"
    assert [one.name for one in clip.some([11, 2])] == [frames[2].name, frames[11].name]
    later = list(clip.starting_at(9))
    assert [one.name for one in later] == [one.name for one in frames[9:]]
    assert (later[0].image == frames[9].image).all()


def test_a_playlist_that_calls_itself_a_video_is_refused(tmp_path):
    path = tmp_path / "list.mp4"
    path.write_text("#EXTM3U\n/etc/passwd\n")
    with pytest.raises(WildlabError, match="does not begin"):
        open_frames(path)


def test_kinds_of_numbers(tmp_path):
    kelvin = (280 + scene() / 10).astype(np.float32)
    kelvin[3, 4] = np.nan
    colour = np.stack([scene(1), scene(2), scene(3)], axis=2)
    write(tmp_path / "kelvin.tiff", kelvin)
    write(tmp_path / "colour.png", colour)
    write(tmp_path / "deep.png", colour.astype(np.uint16) * 200)
    write(tmp_path / "counts.png", scene().astype(np.uint16) * 200)
    write(tmp_path / "share.tiff", (scene() / 255).astype(np.float32))
    found = {one.name.partition(".")[0]: one for one in open_frames(tmp_path)}
    assert [found[name].unit for name in ("kelvin", "colour", "counts")] == ["kelvin", "colour", "counts"]
    assert not found["kelvin"].valid[3, 4] and found["kelvin"].valid.mean() > 0.99
    assert (found["colour"].image == colour[..., ::-1]).all() and found["counts"].image.dtype == np.uint16
    assert found["deep"].problem and found["share"].problem


def dji_jpeg(counts: np.ndarray, size: tuple[int, int], make: bytes = b"Exif\0\0DJI") -> bytes:
    """A JPEG with a preview of that size and raw numbers in APP3, as DJI's own cameras write them."""
    preview = cv2.imencode(".jpg", scene(3, size))[1].tobytes()
    raw = counts.astype("<u2").tobytes()
    parts = [(0xE1, make), *((0xE3, raw[at : at + 65_533]) for at in range(0, len(raw), 65_533))]
    head = b"".join(b"\xff" + bytes([kind]) + struct.pack(">H", len(part) + 2) + part for kind, part in parts)
    return preview[:2] + head + preview[2:]


def test_djis_own_thermal_data_are_counts_or_the_preview_and_it_is_said_which(tmp_path):
    counts = (20_000 + 4 * scene(4, (200, 256)).astype(np.int64)).astype(np.uint16)
    (tmp_path / "a.jpg").write_bytes(dji_jpeg(counts, (200, 256)))
    (tmp_path / "b.jpg").write_bytes(dji_jpeg(counts, (100, 128)))
    (tmp_path / "c.jpg").write_bytes(dji_jpeg(counts, (200, 256), make=b"Exif\0\0other"))
    raw, preview, other = (read_image(tmp_path / f"{name}.jpg") for name in "abc")
    assert raw.unit == "counts" and np.array_equal(raw.image, counts) and raw.polarity == "white-hot"
    assert preview.unit == "grey" and preview.image.shape == (100, 128)
    assert preview.note and other.unit == "grey" and other.note == ""
    assert open_frames(tmp_path / "a.jpg").kept.notes == (raw.note,)


def card(folder: Path) -> Path:
    write_images(folder / "100CANON", "IMG_1.png", "IMG_2.png", "IMG_9.png")
    write_images(folder / "101CANON", "IMG_3.png")
    write_images(folder / ".trash", "IMG_1.png")
    return folder


def test_frames_are_found_by_their_names_in_any_folder_below(tmp_path):
    there = card(tmp_path / "DCIM")
    for ids in (["IMG_1", "IMG_2", "IMG_3"], ["IMG_1.png", "IMG_2.png", "IMG_3.png"]):
        found = [one.relative_to(there).as_posix() for one in images_below(there, ids)]
        assert found == ["100CANON/IMG_1.png", "100CANON/IMG_2.png", "101CANON/IMG_3.png"]
        assert [one.name for one in open_frames(there, ids=ids).files] == [Path(one).name for one in found]
    assert sorted(read_shots(there, ["IMG_3", "no such", "IMG_1"], None).by_row) == [0, 2]
    assert images_below(there, ["DJI_1"]) == []
    with pytest.raises(WildlabError, match="no images"):
        open_frames(there, ids=["DJI_1"])
