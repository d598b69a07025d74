"""Still images as hostile input: what they claim is looked at before they are unpacked."""

import struct

import cv2
import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.readers.stills import claimed_size, read_still, still_files

IMAGE = np.arange(12 * 20, dtype=np.uint8).reshape(12, 20)


@pytest.mark.parametrize("ending", [".png", ".jpg", ".tif", ".bmp"])
def test_size_and_pixels_come_out(tmp_path, ending):
    path = tmp_path / f"a{ending}"
    cv2.imwrite(str(path), IMAGE)
    assert claimed_size(path.read_bytes()) == (20, 12)
    assert read_still(path).shape == (12, 20)


def test_counts_stay_counts_and_colours_are_red_green_blue(tmp_path):
    counts = IMAGE.astype(np.uint16) + 7000
    cv2.imwrite(str(tmp_path / "a.tif"), counts)
    np.testing.assert_array_equal(read_still(tmp_path / "a.tif"), counts)
    red = np.zeros((4, 5, 3), np.uint8)
    red[..., 2] = 200  # OpenCV writes blue, green, red
    cv2.imwrite(str(tmp_path / "b.png"), red)
    assert read_still(tmp_path / "b.png")[0, 0].tolist() == [200, 0, 0]
    cv2.imwrite(str(tmp_path / "c.png"), np.dstack([red, np.full((4, 5), 9, np.uint8)]))
    assert read_still(tmp_path / "c.png")[0, 0].tolist() == [200, 0, 0]


def test_a_large_claim_is_refused_before_it_is_unpacked(tmp_path):
    cv2.imwrite(str(tmp_path / "a.bmp"), IMAGE)
    data = bytearray((tmp_path / "a.bmp").read_bytes())
    data[18:26] = struct.pack("<ii", 40000, -30000)
    (tmp_path / "a.bmp").write_bytes(data)
    with pytest.raises(WildlabError, match="claims to be 40000 x 30000 pixels"):
        read_still(tmp_path / "a.bmp")


NO_IMAGES = (
    *(b"", b"GIF89a", b"\xff\xd8", b"\xff\xd8\xff\xe0\0\0" * 9, b"II*\0\xff\xff\xff\xff"),
    *(b"\x89PNG\r\n\x1a\n", b"BM", b"MM\0*" + b"\0" * 40),
)


@pytest.mark.parametrize("data", NO_IMAGES)
def test_what_is_no_image_is_a_sentence(tmp_path, data):
    path = tmp_path / "a.png"
    path.write_bytes(data)
    with pytest.raises(WildlabError, match=r"is empty|is no PNG|claims to be|is damaged"):
        read_still(path)


def test_one_that_is_cut_off_is_a_sentence(tmp_path):
    for ending in (".png", ".jpg", ".tif", ".bmp"):
        path = tmp_path / f"a{ending}"
        cv2.imwrite(str(path), np.random.default_rng(1).integers(0, 255, (60, 80), np.uint8))
        path.write_bytes(path.read_bytes()[:-2000])
        with pytest.raises(WildlabError, match=r"is damaged or cut off|is no PNG"):
            read_still(path)


def test_folders_are_read_in_order_and_once(tmp_path):
    for name in ("b.png", "a.JPG", "c.txt", "a.tif"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "d.png").mkdir()
    found = still_files([tmp_path, tmp_path / "b.png"])
    assert [one.name for one in found] == ["a.JPG", "a.tif", "b.png"]


def test_one_that_is_not_there_and_a_pipe_are_sentences(tmp_path):
    import os

    with pytest.raises(WildlabError, match="there is no such file"):
        read_still(tmp_path / "none.png")
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(WildlabError, match="is a named pipe"):
        read_still(tmp_path / "pipe.png")
