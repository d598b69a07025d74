"""Boxes of COCO, YOLO, MegaDetector and tables: the same out of each, and a sentence for what is wrong."""

import json
from pathlib import Path

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.readers.labels import Labels, read_labels

#: Two animals and a car in an image of 200 x 100 pixels, and an image in which nothing is.
COCO = """{
  "images": [
    {"id": 7, "file_name": "day/a.png", "width": 200, "height": 100, "site": "north"},
    {"id": 9, "file_name": "b.png", "site": "south"}
  ],
  "categories": [{"id": 1, "name": "deer"}, {"id": 3, "name": "car"}, {"id": 4, "name": "boar"}],
  "annotations": [
    {"id": 1, "image_id": 7, "category_id": 1, "bbox": [20, 10, 40, 30]},
    {"id": 2, "image_id": 7, "category_id": 3, "bbox": [100, 50, 20.5, 10]},
    {"id": 3, "image_id": 7, "category_id": 1, "bbox": [0, 0, 200, 5], "iscrowd": 1}
  ]
}"""
RESULTS = """[
  {"image_id": 7, "category_id": 1, "bbox": [20, 10, 40, 30], "score": 0.9},
  {"image_id": 9, "category_id": 3, "bbox": [1, 2, 3, 4], "score": 0.25}
]"""
BATCH = """{
  "info": {"detector": "md_v5a"},
  "detection_categories": {"1": "animal", "2": "person"},
  "images": [
    {"file": "day/a.png", "detections": [{"category": "1", "conf": 0.8, "bbox": [0.1, 0.1, 0.2, 0.3]}]},
    {"file": "b.png", "detections": []},
    {"file": "c.png", "failure": "Failure image access", "detections": null}
  ]
}"""


def write(path: Path, content: str, old: str = "", new: str = "") -> Path:
    """A file of that content, with one part of it replaced."""
    assert content.count(old) == 1 or not old
    path.write_text(content.replace(old, new) if old else content, encoding="utf-8")
    return path


def yolo(path: Path, **files: str) -> Path:
    path.mkdir(exist_ok=True)
    for name, text in files.items():
        (path / f"{name}.txt").write_text(text, encoding="utf-8")
    return path


def in_px(labels: Labels, frame: str) -> list[list[float]]:
    name = labels.name_of(frame)
    assert name is not None
    return labels.boxes_of(frame, name, 200, 100)[0].tolist()


def test_coco_has_its_boxes_classes_crowds_and_empty_images(tmp_path):
    path = write(tmp_path / "anything.txt", COCO)
    every = read_labels(path)
    assert in_px(every, "a.png") == [[20, 10, 40, 30], [100, 50, 20.5, 10]]
    assert every.ignore["day/a.png"].tolist() == [[0, 0, 200, 5]]
    assert in_px(every, "b.png") == [] and every.name_of("c.png") is None
    assert np.isnan(every.scores["day/a.png"]).all()
    deer = read_labels(path, classes=("deer",), group="site")
    assert in_px(deer, "a.png") == [[20, 10, 40, 30]] and len(deer.ignore["day/a.png"]) == 2
    assert deer.group == {"day/a.png": "north", "b.png": "south"}
    # A class that the file knows and nobody is of can be asked for.
    assert in_px(read_labels(path, classes=("boar",)), "a.png") == []


def test_results_of_coco_are_named_by_the_truth_or_by_their_ids(tmp_path):
    truth = read_labels(write(tmp_path / "t.json", COCO))
    path = tmp_path / "r.json"
    strange = '[{"image_id": 1234, "category_id": 1, "bbox": [20, 10, 40, 30], "score": 0.9},'
    found = read_labels(write(path, RESULTS, "[\n", strange), truth=truth, classes=("deer",))
    assert in_px(found, "a.png") == [[20, 10, 40, 30]] and found.scores["day/a.png"].tolist() == [0.9]
    assert found.marked.left_out == {"result of an image that the labels do not have": 1}
    alone = read_labels(write(path, RESULTS))
    assert in_px(alone, "000007.png") == [[20, 10, 40, 30]] and alone.name_of("000008.png") is None
    assert in_px(alone, "clip#000009") == [[1, 2, 3, 4]]
    named = read_labels(write(path, RESULTS, '"image_id": 7', '"image_id": "IMG_7"'))
    assert in_px(named, "IMG_7.JPG") == [[20, 10, 40, 30]]
    assert read_labels(write(path, "[]")).boxes == {}


def test_megadetector_has_shares_of_the_image_and_says_where_it_failed(tmp_path):
    found = read_labels(write(tmp_path / "md.json", BATCH))
    assert np.allclose(in_px(found, "a.png"), [[20, 10, 40, 30]]) and in_px(found, "b.png") == []
    assert found.name_of("c.png") is None
    assert found.marked.left_out == {"image that the detector failed on": 1}
    assert found.marked.known_kinds == ("animal", "person")


def test_yolo_has_centres_in_shares_of_the_image(tmp_path):
    path = yolo(tmp_path / "labels", a="0 0.2 0.25 0.2 0.3\n\n2 0.5 0.5 0.1 0.1 0.75\n", b="")
    found = read_labels(path)
    assert np.allclose(in_px(found, "a.png"), [[20, 10, 40, 30], [90, 45, 20, 10]])
    assert in_px(found, "b.png") == [] and found.name_of("c.png") is None
    assert np.isnan(found.scores["a"][0]) and found.scores["a"][1] == 0.75
    assert found.marked.table["kind"].tolist() == ["0", "2"]


def test_one_truth_in_three_formats_is_one_truth(tmp_path):
    """Written out of the same numbers, the boxes of the three formats are the same to rounding."""
    rng = np.random.default_rng(3)
    boxes = np.concatenate([rng.uniform(0, 60, (20, 2)), rng.uniform(1, 40, (20, 2))], axis=1)
    share = (boxes / [200, 100, 200, 100]).tolist()
    coco = [{"image_id": 9, "category_id": 1, "bbox": one} for one in boxes.tolist()]
    md = [{"category": "1", "conf": 1, "bbox": one} for one in share]
    lines = "".join(f"0 {a + w / 2} {b + h / 2} {w} {h}\n" for a, b, w, h in share)
    for path in (
        write(tmp_path / "c", json.dumps({**json.loads(COCO), "annotations": coco})),
        write(tmp_path / "m", BATCH, '"b.png", "detections": []', f'"b.png", "detections": {json.dumps(md)}'),
        yolo(tmp_path / "y", b=lines),
    ):
        assert np.allclose(in_px(read_labels(path), "b.png"), boxes, atol=1e-9)


def test_an_image_with_a_class_and_no_box_is_not_judged(tmp_path):
    without = COCO.replace(', "bbox": [20, 10, 40, 30]', "")
    labels = read_labels(write(tmp_path / "t.json", without))
    assert list(labels.boxes) == ["b.png"] and sum(labels.marked.left_out.values()) == 1
    labels = read_labels(write(tmp_path / "t.json", without, "deer", "empty"))
    assert list(labels.boxes) == ["day/a.png", "b.png"]


@pytest.mark.parametrize(
    ("source", "old", "new", "word"),
    [
        (COCO, "[100, 50, 20.5, 10]", "[1, 2, -3, 4]", r"\[1\].bbox"),
        (COCO, "[100, 50, 20.5, 10]", '[1, 2, 3, "4"]', r"\[1\].bbox\[3\]"),
        (COCO, '"id": 2, "image_id": 7', '"id": 2, "image_id": 8', "image_id: is 8"),
        (COCO, '"image_id": 7, "category_id": 3', '"image_id": 7, "category_id": 2', "categories has 1, 3"),
        (COCO, '"id": 9', '"id": 7', "7 stands"),
        (COCO, '"categories"', '"kinds"', "categories: this key is missing"),
        ('{"images": [], "categories": [], "annotations": []}', "", "", "images: .*at least 1"),
        (RESULTS, ', "score": 0.25', "", "score: this key is missing"),
        (RESULTS, "0.25", "Infinity", "inf does not fit"),
        (BATCH, "[0.1, 0.1, 0.2, 0.3]", "[9, 9, 2, 3]", r"bbox\[0\]: 9 does not fit"),
        (BATCH, '"category": "1"', '"category": "9"', "_categories has 1, 2"),
        (BATCH, '"detection_categories"', '"kinds"', "no format|missing"),
        (r'{"a": 1, "b\u001b": 2}', "", "", r"'b\\x1b'"),
        ('{"images": [', "", "", "begins like"),
    ],
)
def test_what_is_wrong_in_json_is_named(tmp_path, source, old, new, word):
    path = write(tmp_path / "l.json", source, old, new)
    with pytest.raises(WildlabError, match=word) as error:
        read_labels(path)
    assert str(path) in str(error.value) and error.value.fix


def table(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_points_empty_frames_classes_and_groups(tmp_path):
    text = "image,u_px,v_px,class,clip\na.png,1,2,deer,x\na.png,5,6,car,x\n"
    text += "b.png,,,deer,y\na.png,7,8,DontCare,x\n"
    path = table(tmp_path / "l.csv", text)
    every = read_labels(path)
    assert every.boxes["a.png"].tolist() == [[1, 2, 0, 0], [5, 6, 0, 0]] and every.boxes["b.png"].shape == (
        0,
        4,
    )
    assert every.ignore["a.png"].tolist() == [[7, 8, 0, 0]] and every.group["b.png"] == "b.png"
    deer = read_labels(path, classes=("deer",), group="clip")
    assert len(deer.boxes["a.png"]) == 1 and len(deer.ignore["a.png"]) == 2 and deer.group["b.png"] == "y"


def test_a_clip_is_ten_stretches_unless_a_column_says_otherwise(tmp_path):
    rows = "".join(f"{number},1,2,3,4,{number % 2}\n" for number in range(7, 47))
    path = table(tmp_path / "l.csv", f"frame0,x,y,w,h,clip\n{rows}")
    group = read_labels(path).group
    assert [group[str(one)] for one in (7, 10, 11, 46)] == [
        "stretch 0",
        "stretch 0",
        "stretch 1",
        "stretch 9",
    ]
    assert read_labels(path, group="clip").group["8"] == "0"


def test_numbers_of_a_clip_and_names_without_ending(tmp_path):
    clip = read_labels(table(tmp_path / "l.csv", "frame0,x,y,w,h\n12,1,2,3,4\n"))
    assert clip.name_of("a#000012") == "12" and clip.name_of("a#000013") is None
    stems = read_labels(table(tmp_path / "m.csv", "image,x,y,w,h\na,1,2,3,4\n"))
    assert stems.name_of("a.png") == "a" and stems.name_of("b.png") is None
    files = read_labels(
        table(tmp_path / "n.csv", "image,x,y,w,h\na.png,1,2,3,4\nb.png,1,2,3,4\nb.jpg,1,2,3,4\n")
    )
    assert files.name_of("a") == "a.png" and files.name_of("b") is None
    assert files.name_of("A.PNG") == files.name_of("A.JPG") == "a.png"


@pytest.mark.parametrize(
    "text",
    [
        "image;x;y;w;h\na.png;1,5;2;3;4\n",
        "image\tx\ty\tw\th\na.png\t1.5\t2\t3\t4\n",
        "# drawn by hand\n\nimage, x, y, w, h\na.png, 1.5, 2, 3, 4\n",
        "Image,X,Y,W,H\na.png,1.5,2,3,4\n",
        "\ufeffimage,xmin,ymin,xmax,ymax\r\na.png,1.5,2,4.5,6\r\n",
        "image,x,y,w,h\nC:\\day 1\\a.png,1.5,2,3,4\n",
    ],
)
def test_tables_as_other_programs_write_them(tmp_path, text):
    labels = read_labels(table(tmp_path / "l.csv", text))
    name = labels.name_of("a.png")
    assert name is not None
    assert labels.boxes[name].tolist() == [[1.5, 2, 3, 4]]
