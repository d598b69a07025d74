"""Clicks and boxes of other programs: the same pixels out of each, and a sentence for whatever is wrong."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.flight.readers import made_up_photos as made
from tests.flight.readers.tracks import near
from wildlab.errors import WildlabError
from wildlab.flight.readers import read_folder, read_log
from wildlab.flight.readers.labels import clicks_sniff
from wildlab.flight.readers.log import RawLog

HERE = Path("clicks")
#: Image, name, left, top, width, height.
BOXES = [("a.jpg", "A1", 10.0, 20.0, 4.0, 6.0), ("b.jpg", "B <b>", 0.0, 0.5, 100.0, 50.5)]
SIZES = {"a.jpg": (200.0, 100.0), "b.jpg": (200.0, 100.0)}


def read(path: Path, data: bytes) -> RawLog:
    return read_log(path, data, "clicks")


def column(log: RawLog, name: str) -> list[Any]:
    return list(log.parts["clicks"].columns[name])


def check_boxes(log: RawLog, *, stems: bool = False) -> None:
    images, names, left, top, width, height = zip(*BOXES, strict=True)
    assert column(log, "name") == list(names)
    assert column(log, "image") == [one.removesuffix(".jpg") if stems else one for one in images]
    u, v, w, h = map(np.array, (left, top, width, height))
    columns = log.parts["clicks"].columns
    near(columns, 1e-3, u_px=u + w / 2, v_px=v + h / 2)
    near(columns, 1e-3, box_u_px=u, box_v_px=v, box_width_px=w, box_height_px=h)
    assert log.parts["clicks"].used.all()


COCO = b"""{
  "images": [{"id": 0, "file_name": "a.jpg"}, {"id": 1, "file_name": "b.jpg"}],
  "categories": [{"id": 0, "name": "A1"}, {"id": 1, "name": "B <b>"}],
  "annotations": [
    {"id": 0, "image_id": 0, "category_id": 0, "bbox": [10, 20, 4, 6]},
    {"id": 1, "image_id": 1, "category_id": 1, "bbox": [0, 0.5, 100, 50.5]}
  ]
}"""
MEGADETECTOR = b"""{
  "detection_categories": {"0": "A1", "1": "B <b>"},
  "images": [
    {"file": "a.jpg", "detections": [{"category": "0", "conf": 0.5, "bbox": [0.05, 0.2, 0.02, 0.06]}]},
    {"file": "b.jpg", "detections": [{"category": "1", "conf": 0.5, "bbox": [0, 0.005, 0.5, 0.505]}]}
  ]
}"""
CVAT = b"""<?xml version="1.0" encoding="utf-8"?><annotations><version>1.1</version><meta><task/></meta>
<image id="0" name="a.jpg" width="200" height="100">
  <box label="A1" occluded="0" xtl="10" ytl="20" xbr="14" ybr="26" z_order="0"></box></image>
<image id="1" name="b.jpg" width="200" height="100">
  <box label="B &lt;b>" occluded="0" xtl="0" ytl="0.5" xbr="100" ybr="51" z_order="0"></box></image>
</annotations>"""
CORNERS = (
    b"file\ttarget\tx_min\ty_min\tx_max\ty_max\na.jpg\tA1\t10\t20\t14\t26\nb.jpg\tB <b>\t0\t0.5\t100\t51"
)
SIZES_CSV = b"image,name,x,y,w,h\na.jpg,A1,10,20,4,6\nb.jpg,B <b>,0,0.5,100,50.5"
OTHER_NAMES = (
    b"Filename;Label;left_px;top_px;width_px;height_px\na.jpg;A1;10;20;4;6\nb.jpg;B <b>;0;0.5;100;50.5"
)


SIZE_IN_WORDS = COCO.replace(b'"a.jpg"', b'"a.jpg", "width": "200", "height": null')


@pytest.mark.parametrize("data", [COCO, SIZE_IN_WORDS, CVAT, CORNERS, SIZES_CSV, OTHER_NAMES])
def test_boxes_out_of_every_format(data):
    assert clicks_sniff(data[:8192])
    check_boxes(read(HERE, data))


def test_shares_of_an_image_want_its_size(tmp_path):
    assert clicks_sniff(MEGADETECTOR)
    log = read(tmp_path / "md.json", MEGADETECTOR)
    assert column(log, "score") == [0.5, 0.5]
    assert column(log, "why") == ["no place in the image"] * 2
    assert any("2 of 2" in one for one in log.notes)


def write_yolo(folder: Path, classes: Path) -> None:
    for at, (name, _, u, v, w, h) in enumerate(BOXES):
        line = f"{at} {(u + w / 2) / 200} {(v + h / 2) / 100} {w / 200} {h / 100}\n"
        (folder / name).with_suffix(".txt").write_text(line, encoding="utf-8")
    (classes / "classes.txt").write_text("".join(f"{one[1]}\n" for one in BOXES), encoding="utf-8")


@pytest.mark.parametrize("layout", [("", ""), ("images", "labels"), ("images/train", "labels/train")])
def test_sizes_of_images_beside_labels(tmp_path, layout):
    images, labels = (tmp_path / one for one in layout)
    for folder in (images, labels):
        folder.mkdir(parents=True, exist_ok=True)
    for name in SIZES:
        made.write(images, name, size=(200, 100))
    write_yolo(labels, tmp_path)
    check_boxes(read_folder(labels, "clicks-yolo")[0], stems=True)
    # MegaDetector names images with their folders, and a file may name what lies elsewhere.
    check_boxes(read(images / "md.json", MEGADETECTOR))
    above = MEGADETECTOR.replace(b"a.jpg", b"../../../a.jpg").replace(b"b.jpg", b"/etc/b.jpg")
    log = read(images / "md.json", above)
    assert column(log, "u_px") == pytest.approx([12.0, 50.0])
    deep = MEGADETECTOR.replace(b'"a.jpg', b'"images/a.jpg').replace(b'"b.jpg', b'"images\\\\b.jpg')
    assert read(tmp_path / "md.json", deep).parts["clicks"].used.all()


def test_points():
    log = read(HERE, b'image,name,u_px,v_px\na.jpg,007,1.5,-0.5\n"b,c.jpg",,3,4\nd.jpg,X,,\ne.jpg,Y,1,z\n')
    assert column(log, "image") == ["a.jpg", "b,c.jpg", "e.jpg"]
    assert column(log, "name") == ["007", "", "Y"]
    assert column(log, "u_px")[:2] == [1.5, 3.0]
    assert np.isnan(column(log, "box_u_px")).all()
    assert column(log, "why") == ["", "", "no place in the image"]
    assert log.parts["clicks"].rows.tolist() == [2, 3, 5]
    comma = read(HERE, b"image;marker;u;v\na.jpg;A;1,5;2,25\n")
    assert (column(comma, "u_px"), column(comma, "v_px")) == ([1.5], [2.25])


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"image,name\na.jpg,A\n", "say where"),
        (b"name,u,v\nA,1,2\n", "names the image"),
        (b"image,u,v\na.jpg,,\n", "marks nothing"),
        (b"image,x,y,w,h\na.jpg,0.1,0.2,0.1,0.1\n", "shares"),
        (b"{}", "no format"),
        (b"[[[", "begins like"),
        (b"<annotations><image name='a'></image></annotations>", "no box"),
        (b"<annotations>", "is not readable XML"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><annotations>&b;</annotations>', "document type"),
        (b'{"images": [{"id": 1, "file_name": "a"}], "annotations": [], "categories": []}', "marks nothing"),
    ],
)
def test_what_is_refused(data, problem):
    with pytest.raises(WildlabError, match=problem):
        read(HERE, data)


@pytest.mark.parametrize(
    "head", [b"", b"\x00\xff", b"{}", b'{"type": "Point"}', b"<kml>", b"time,u,v\n", b"image,note\n"]
)
def test_what_is_not_recognised(head):
    assert not clicks_sniff(head)
