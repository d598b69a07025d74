"""Broken and hostile images: what their headers claim is not believed, and nothing ends in a traceback."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.flight.readers import made_up_photos as made
from tests.flight.readers.test_photos import column, said
from wildlab.flight.readers.photos.folder import read_photos


@pytest.mark.parametrize(
    ("packet", "problem"),
    [
        (b'<!DOCTYPE x [<!ENTITY a "b">]><x:xmpmeta>&a;</x:xmpmeta>', "document type"),
        (b"<x>" * 200 + b"</x>" * 200, "nested too deeply"),
    ],
)
def test_xmp_that_is_refused(tmp_path, packet, problem):
    made.write(tmp_path, "a.jpg", xmp=packet)
    assert problem in said(read_photos(tmp_path))


def test_xmp_that_is_no_xml_any_more_is_read_as_far_as_it_goes(tmp_path):
    whole = made.dji(1)["xmp"]
    cut = whole[: whole.find(b"drone-dji:FlightRollDegree")]
    undeclared = whole.replace(made.DJI.encode(), b"")
    for number, packet in enumerate((cut + b">", undeclared)):
        made.write(tmp_path, f"{number}.jpg", xmp=packet)
    log = read_photos(tmp_path)
    assert column(log, "pitch_world_deg") == [-89.9] * 2


def test_a_claim_of_ten_gigabytes_is_not_believed(tmp_path):
    # A tag of EXIF that claims as much, a TIFF with such a tag, and a PNG of as many pixels.
    entry = struct.pack("<HHII", 0x010F, 2, 0xFFFFFFF0, 26)
    tiff = b"II*\0" + struct.pack("<IH", 8, 1) + entry + struct.pack("<I", 0) + b"abc"
    (tmp_path / "a.jpg").write_bytes(made.jpeg(more=made.segment(0xE1, b"Exif\0\0" + tiff)))
    (tmp_path / "b.tif").write_bytes(tiff)
    head = b"IHDR" + struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    (tmp_path / "c.png").write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + b"\0\0\0\0")
    (tmp_path / "d.jpg").write_bytes(b"\xff\xd8\xff\xe1\xff\xff" + b"Exif\0\0" + tiff)
    (tmp_path / "e.jpg").write_bytes(b"")
    log = read_photos(tmp_path)
    assert column(log, "use") == [0.0] * 5
    assert column(log, "width_px")[2] == 100_000


def test_a_large_file_is_not_read_beyond_its_headers(tmp_path, monkeypatch):
    made.write(tmp_path, "a.jpg", **made.dji(1))
    with (tmp_path / "a.jpg").open("ab") as stream:
        stream.truncate(20 << 30)  # a hole
    taken = []
    plain = Path.open

    class Counting:
        def __init__(self, stream: Any) -> None:
            self.stream = stream

        def __enter__(self) -> Counting:
            return self

        def __exit__(self, *_: object) -> None:
            self.stream.close()

        def __getattr__(self, name: str) -> Any:
            return getattr(self.stream, name)

        def read(self, size: int) -> bytes:
            taken.append(size)
            return bytes(self.stream.read(size))

    monkeypatch.setattr(Path, "open", lambda self, mode: Counting(plain(self, mode)))
    assert column(read_photos(tmp_path), "use") == [1.0]
    assert sum(taken) < 100_000


def test_names_stay_names(tmp_path):
    names = ["<img src=x onerror=alert(1)>.jpg", "=cmd|'x'!A1.jpg", "a\udcff.jpg"]
    for name in names:
        made.write(tmp_path, name, exif=made.exif_of({0x010F: "<b>\x1b[31mMake", 0x0110: "=1+1"}))
    log = read_photos(tmp_path)
    assert set(column(log, "file")) == {*names[:2], "a\\udcff.jpg"}
    assert all(name.isprintable() for name in column(log, "camera"))


def test_cut_and_spoilt_images_end_in_no_traceback(tmp_path):
    whole = made.jpeg(**made.dji(1, RtkFlag=50, UTCAtExposure="2024-06-12T09:30:01.123456"))
    random = np.random.default_rng(14)
    for number, data in enumerate((whole, made.tiff(made.dji(1)["exif"]))):
        folder = tmp_path / str(number)
        folder.mkdir()
        ending = ("jpg", "tif")[number]
        head = len(data) if number else data.find(b"\xff\xda")
        for place in random.integers(0, head, 50):
            (folder / f"cut{place}.{ending}").write_bytes(data[:place])
        for at in range(50):
            spoilt = np.frombuffer(data, np.uint8).copy()
            spoilt[random.integers(0, head, 100 if at % 2 else 3)] = random.integers(0, 256, 1)
            (folder / f"flip{at}.{ending}").write_bytes(spoilt.tobytes())
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            log = read_photos(folder)
        part = log.parts["photos"]
        for name in ("latitude_deg", "longitude_deg"):
            assert np.isfinite(part.columns[name][part.used]).all()
        assert log.lost
