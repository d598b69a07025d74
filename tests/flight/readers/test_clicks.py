"""Clicks and boxes of other programs: the same pixels out of each, and a sentence for whatever is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.flight.readers import made_up_photos as made
from wildlab.errors import WildlabError
from wildlab.flight.readers.clicks import clicks
from wildlab.flight.readers.logs.log import RawLog
from wildlab.names import csv_cell, from_csv_cell

HERE = Path("clicks")
#: Image, name, left, top, width, height.
BOXES = [("a.jpg", "A1", 10.0, 20.0, 4.0, 6.0), ("b.jpg", "B <b>", 0.0, 0.5, 100.0, 50.5)]
SIZES = {"a.jpg": (200.0, 100.0), "b.jpg": (200.0, 100.0)}


def column(log: RawLog, name: str) -> list[Any]:
    return list(log.parts["clicks"].columns[name])


def check_boxes(log: RawLog, *, stems: bool = False) -> None:
    images = [one[0].removesuffix(".jpg") if stems else one[0] for one in BOXES]
    assert (column(log, "image"), column(log, "name")) == (images, [one[1] for one in BOXES])
    expected = {
        "u_px": [one[2] + one[4] / 2 for one in BOXES],
        "v_px": [one[3] + one[5] / 2 for one in BOXES],
        "box_u_px": [one[2] for one in BOXES],
        "box_v_px": [one[3] for one in BOXES],
        "box_width_px": [one[4] for one in BOXES],
        "box_height_px": [one[5] for one in BOXES],
    }
    for name, values in expected.items():
        assert column(log, name) == pytest.approx(values, abs=1e-3), name
    assert log.parts["clicks"].used.all()


def coco() -> bytes:
    names = [one[1] for one in BOXES]
    return json.dumps(
        {
            "images": [{"id": at, "file_name": one[0]} for at, one in enumerate(BOXES)],
            "categories": [{"id": at, "name": name} for at, name in enumerate(names)],
            "annotations": [
                {"id": at, "image_id": at, "category_id": at, "bbox": list(one[2:])}
                for at, one in enumerate(BOXES)
            ],
        }
    ).encode()


def megadetector() -> bytes:
    images = [
        {
            "file": name,
            "detections": [{"category": str(at), "conf": 0.5, "bbox": [u / 200, v / 100, w / 200, h / 100]}],
        }
        for at, (name, _, u, v, w, h) in enumerate(BOXES)
    ]
    kinds = {str(at): one[1] for at, one in enumerate(BOXES)}
    return json.dumps({"images": images, "detection_categories": kinds}).encode()


def cvat(shapes: str = "") -> bytes:
    images = "".join(
        f'<image id="{at}" name="{name}" width="200" height="100"><box label="{what.replace("<", "&lt;")}" '
        f'occluded="0" xtl="{u}" ytl="{v}" xbr="{u + w}" ybr="{v + h}" z_order="0"></box></image>'
        for at, (name, what, u, v, w, h) in enumerate(BOXES)
    )
    start = '<?xml version="1.0" encoding="utf-8"?><annotations><version>1.1</version><meta><task/></meta>'
    return f"{start}{images}{shapes}</annotations>".encode()


def table(header: str, rows: list[list[Any]], sign: str = ",") -> bytes:
    return "\n".join([header, *(sign.join(map(str, row)) for row in rows)]).encode()


@pytest.mark.parametrize(
    "data",
    [
        coco(),
        cvat(),
        table("image,name,x,y,w,h", [list(one) for one in BOXES]),
        table("Filename;Label;left_px;top_px;width_px;height_px", [list(one) for one in BOXES], ";"),
        table("file\ttarget\tx_min\ty_min\tx_max\ty_max", [
            [a, b, u, v, u + w, v + h] for a, b, u, v, w, h in BOXES
        ], "\t"),
    ],
)  # fmt: skip
def test_boxes_out_of_every_format(data):
    assert clicks.recognise(data[:8192], "x")
    check_boxes(clicks.read(HERE, data))


def test_shares_of_an_image_want_its_size():
    assert clicks.recognise(megadetector()[:8192], "x")
    log = clicks.read(HERE, megadetector(), sizes=SIZES)
    check_boxes(log)
    assert column(log, "score") == [0.5, 0.5]
    without = clicks.read(HERE, megadetector())
    assert column(without, "why") == ["no place in the image"] * 2
    assert "2 of 2 boxes are shares of images whose size is not known" in without.notes


def test_yolo_folder(tmp_path):
    for at, (name, _, u, v, w, h) in enumerate(BOXES):
        line = f"{at} {(u + w / 2) / 200} {(v + h / 2) / 100} {w / 200} {h / 100}\n"
        (tmp_path / name).with_suffix(".txt").write_text(line, encoding="utf-8")
    (tmp_path / "classes.txt").write_text("".join(f"{one[1]}\n" for one in BOXES), encoding="utf-8")
    check_boxes(clicks.clicks_of_folder(tmp_path, SIZES), stems=True)
    assert not clicks.clicks_of_folder(tmp_path).parts["clicks"].used.any()
    with pytest.raises(WildlabError, match="no text file"):
        (tmp_path / "none").mkdir()
        clicks.clicks_of_folder(tmp_path / "none")


@pytest.mark.parametrize("layout", [("", ""), ("images", "labels"), ("images/train", "labels/train")])
def test_sizes_of_images_beside_labels(tmp_path, layout):
    images, labels = (tmp_path / one for one in layout)
    for folder in (images, labels):
        folder.mkdir(parents=True, exist_ok=True)
    for at, (name, _, u, v, w, h) in enumerate(BOXES):
        made.write(images, name, size=(200, 100))
        line = f"{at} {(u + w / 2) / 200} {(v + h / 2) / 100} {w / 200} {h / 100}\n"
        (labels / name).with_suffix(".txt").write_text(line, encoding="utf-8")
    (tmp_path / "classes.txt").write_text("".join(f"{one[1]}\n" for one in BOXES), encoding="utf-8")
    check_boxes(clicks.read_clicks_folder(labels), stems=True)
    # MegaDetector names images with their folders, and a file may name what lies elsewhere.
    check_boxes(clicks.read(images / "md.json", megadetector()))
    above = megadetector().replace(b"a.jpg", b"../../../a.jpg").replace(b"b.jpg", b"/etc/b.jpg")
    log = clicks.read(images / "md.json", above)
    assert column(log, "u_px") == pytest.approx([12.0, 50.0])
    deep = megadetector().replace(b'"a.jpg', b'"images/a.jpg').replace(b'"b.jpg', b'"images\\\\b.jpg')
    assert clicks.read(tmp_path / "md.json", deep).parts["clicks"].used.all() == (layout[0] != "images/train")


def test_points():
    log = clicks.read(
        HERE, b'image,name,u_px,v_px\na.jpg,007,1.5,-0.5\n"b,c.jpg",,3,4\nd.jpg,X,,\ne.jpg,Y,1,z\n'
    )
    assert column(log, "image") == ["a.jpg", "b,c.jpg", "e.jpg"]
    assert column(log, "name") == ["007", "", "Y"]
    assert column(log, "u_px")[:2] == [1.5, 3.0]
    assert np.isnan(column(log, "box_u_px")).all()
    assert column(log, "why") == ["", "", "no place in the image"]
    assert log.parts["clicks"].rows.tolist() == [2, 3, 5]
    comma = clicks.read(HERE, b"image;marker;u;v\na.jpg;A;1,5;2,25\n")
    assert (column(comma, "u_px"), column(comma, "v_px")) == ([1.5], [2.25])


def test_points_attributes_and_other_shapes_of_cvat():
    more = (
        '<image id="9" name="c.jpg"><points label="marker" points="1.5,2.5;3,4"><attribute name="name">A7'
        '</attribute></points><polygon label="x" points="1,2;3,4;5,6"/><tag label="sunny"/></image>'
    )
    log = clicks.read(HERE, cvat(more))
    assert column(log, "name")[2:] == ["A7", "A7"]
    assert list(zip(column(log, "u_px"), column(log, "v_px"), strict=True))[2:] == [(1.5, 2.5), (3.0, 4.0)]
    assert log.lost[0].startswith("1 ")


def test_cvat_that_breaks_off_is_kept_as_far_as_it_goes():
    whole = cvat()
    log = clicks.read(HERE, whole[: whole.find(b'name="b.jpg"')])
    assert column(log, "image") == ["a.jpg"]


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"image,name\na.jpg,A\n", "says where"),
        (b"name,u,v\nA,1,2\n", "names the image"),
        (b"image,u,v\na.jpg,,\n", "marks nothing"),
        (b"image,x,y,w,h\na.jpg,0.1,0.2,0.1,0.1\n", "shares"),
        (b"{}", "no format"),
        (b"[[[", "is none"),
        (b"<annotations><image name='a'></image></annotations>", "no box"),
        (b"<annotations>", "is not readable XML"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><annotations>&b;</annotations>', "document type"),
        (json.dumps({"images": [{"id": 1, "file_name": "a"}], "annotations": [], "categories": []}).encode(),
         "marks nothing"),
    ],
)  # fmt: skip
def test_what_is_refused(data, problem):
    with pytest.raises(WildlabError, match=problem):
        clicks.read(HERE, data)


@pytest.mark.parametrize(
    "head", [b"", b"\x00\xff", b"{}", b'{"type": "Point"}', b"<kml>", b"time,u,v\n", b"image,note\n"]
)
def test_what_is_not_recognised(head):
    assert not clicks.recognise(head, "x.csv")


@pytest.mark.parametrize("data", [coco(), cvat(), megadetector(), table("image,u,v", [["a", 1, 2]] * 9)])
def test_damaged_files_end_in_a_sentence(data):
    random = np.random.default_rng(14)
    cuts = [data[:place] for place in random.integers(0, len(data), 20)]
    for _ in range(20):
        spoilt = np.frombuffer(data, np.uint8).copy()
        spoilt[random.integers(0, len(data), 100)] = random.integers(0, 256, 100)
        cuts.append(spoilt.tobytes())
    for one in cuts:
        clicks.recognise(one, "x")
        try:
            part = clicks.read(HERE, one, sizes=SIZES).parts["clicks"]
        except WildlabError:
            continue
        assert np.isfinite(part.columns["u_px"][part.used]).all()


@given(st.text())
def test_what_guards_a_value_is_taken_off_again(text):
    assert from_csv_cell(csv_cell(text)) == text
    assert not csv_cell(text).startswith(("=", "+", "-", "@", "\t", "\r"))
