"""CPTV: a writer made from the format's description; what is read of its files, and of broken ones."""

import gzip
import struct
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.readers.frames import open_frames
from wildlab.flight.readers.frames.cptv import read_cptv, unpack_bits


def field(code: str, content: bytes) -> bytes:
    return bytes([len(content)]) + code.encode() + content


def section(letter: str, fields: list[bytes]) -> bytes:
    return letter.encode() + bytes([len(fields)]) + b"".join(fields)


def header(
    width: int = 16, height: int = 12, compression: int = 1, extra: list[bytes] | None = None
) -> bytes:
    fields = [
        field("T", struct.pack("<Q", 1)),
        field("X", struct.pack("<I", width)),
        field("Y", struct.pack("<I", height)),
        field("C", bytes([compression])),
        field("D", b"trap"),
        field("?", b"a field of later"),
    ]
    return b"CPTV\x02" + section("H", fields + (extra or []))


def snake(image: np.ndarray) -> list[int]:
    """Pixels in the order in which they are stored: to the right, back to the left, ..."""
    return [int(one) for number, row in enumerate(image) for one in (row[::-1] if number % 2 else row)]


def frame(
    image: np.ndarray, before: np.ndarray, width: int, clock: int = 5000, extra: list[bytes] | None = None
) -> bytes:
    """One frame, bit by bit, in plain Python."""
    change = [now - then for now, then in zip(snake(image), snake(before), strict=True)]
    steps = [after - one for one, after in pairwise(change)]
    bits = "".join(format(step & (2**width - 1), f"0{width}b") for step in steps)
    packed = int(bits.ljust(-(-len(bits) // 8) * 8, "0"), 2).to_bytes(-(-len(bits) // 8), "big")
    content = struct.pack("<i", change[0]) + packed
    fields = [
        field("t", struct.pack("<I", clock)),
        field("w", bytes([width])),
        field("f", struct.pack("<I", len(content))),
    ]
    return section("F", fields + (extra or [])) + content


def pictures(count: int = 3, shape: tuple[int, int] = (12, 16), step: int = 3) -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    slope = np.add.outer(np.arange(shape[0]), np.arange(shape[1]))
    return [(3000 + slope + 40 * n + rng.integers(-step, step + 1, shape)).astype(int) for n in range(count)]


def video(images: list[np.ndarray], width: int, **extra: list[bytes]) -> bytes:
    """A whole file, nine frames a second from five seconds after the camera was switched on."""
    parts, before = [header(*images[0].shape[::-1])], np.zeros_like(images[0])
    for number, image in enumerate(images):
        parts.append(frame(image, before, width, 5000 + 111 * number, extra.get(f"at{number}")))
        before = image
    return b"".join(parts)


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(gzip.compress(content))
    return path


@pytest.mark.parametrize("width", [5, 8, 11, 16, 24])
def test_what_was_written_comes_back_whatever_the_width(tmp_path, width):
    images = pictures(step=1) if width == 5 else pictures()
    # The first frame is the difference from nothing: its own steps have to fit too.
    found = list(read_cptv(written(tmp_path / "a.cptv", video(images, width))))
    assert [one.name for one in found] == ["a#000000", "a#000001", "a#000002"]
    assert [one.time for one in found] == [0.0, 0.111, 0.222]
    for one, image in zip(found, images, strict=True):
        assert one.unit == "counts" and one.polarity == "white-hot" and one.image.dtype == np.uint16
        assert np.array_equal(one.image, image)


def test_numbers_are_packed_high_bit_first_with_a_sign():
    assert unpack_bits(bytes([0b0111_1000, 0b1111_0001]), 4, 4).tolist() == [7, -8, -1, 1]
    assert unpack_bits(bytes([0x80, 0x00, 0x01, 0x7F, 0xFF, 0xFE]), 24, 2).tolist() == [1 - 2**23, 2**23 - 2]
    assert unpack_bits(b"", 9, 0).tolist() == []


def test_frames_can_be_entered_anywhere_and_come_through_the_one_iterator(tmp_path):
    images = pictures(6)
    frames = open_frames(written(tmp_path / "a.cptv", video(images, 12)))
    assert [one.name for one in frames.starting_at(4)] == ["a#000004", "a#000005"]
    some = list(frames.some([1, 5]))
    assert np.array_equal(some[1].image, images[5]) and some[1].time == pytest.approx(0.555)
    assert [one.name for one in some] == ["a#000001", "a#000005"]


def test_a_correction_by_the_files_own_clock_and_a_background_picture_are_no_exposures(tmp_path):
    corrected = {f"at{n}": [field("c", struct.pack("<I", 5200))] for n in range(12)}
    found = list(read_cptv(written(tmp_path / "a.cptv", video(pictures(12), 12, **corrected))))
    # 111 ms apart from 5000 ms on: numbers 2 to 10 lie within a second of 5200 ms.
    assert [number for number, one in enumerate(found) if not one.usable] == list(range(2, 11))
    assert "0.1 s before" in found[3].problem
    path = written(tmp_path / "b.cptv", video(pictures(2), 12, at0=[field("g", b"\1")]))
    first, second = read_cptv(path)
    assert not first.usable and second.usable
    assert np.array_equal(second.image, pictures(2)[1])


def test_counts_run_over_as_numbers_of_sixteen_bits_do(tmp_path):
    low, high = np.full((12, 16), 5), np.full((12, 16), 65530)
    low[0, 0], high[0, 0] = 9, 65000
    path = written(
        tmp_path / "a.cptv", header() + frame(low, np.zeros_like(low), 12) + frame(high - 65536, low, 12)
    )
    assert np.array_equal(list(read_cptv(path))[1].image, high)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"RIFF", "does not begin"),
        (b"CPTV\x03", "version 3"),
        (header()[:30], "cut off"),
        (header(70_000, 70_000), "70,000 x 70,000"),
        (header(0, 5), "0 x 5"),
        (header(compression=7), "compression 7"),
        (b"CPTV\x02F\x00", "b'F'"),
    ],
)
def test_headers_that_cannot_be_are_refused(tmp_path, content, said):
    with pytest.raises(WildlabError, match=said):
        open_frames(written(tmp_path / "a.cptv", content))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda content: content[:-9], "cut off"),
        (lambda content: content + b"Z", "b'Z'"),
        (lambda content: content.replace(b"\x01w\x0c", b"\x01w\x63"), "99 bits"),
        (
            lambda content: content.replace(b"\x04f" + struct.pack("<I", 4 + 287), b"\x04f\xff\xff\xff\x7f"),
            "2,147,483,647 bytes",
        ),
    ],
)
def test_damage_further_on_is_a_last_frame_with_a_sentence(tmp_path, change, said):
    found = list(read_cptv(written(tmp_path / "a.cptv", change(video(pictures(), 12)))))
    assert said in found[-1].problem and all(one.usable for one in found[:-1])


def test_files_cut_anywhere_end_in_a_sentence_and_never_in_a_trace(tmp_path):
    whole = gzip.compress(video(pictures(2), 12))
    for cut in range(0, len(whole), 7):
        (tmp_path / "a.cptv").write_bytes(whole[:cut])
        try:
            found = list(read_cptv(tmp_path / "a.cptv"))
        except WildlabError as error:
            assert "damaged" in error.problem or "does not begin" in error.problem
        else:
            assert not found[-1].usable
