"""Boxes of COCO, YOLO and MegaDetector: the same boxes out of each, and a sentence for whatever is wrong."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.readers import label_yolo
from wildlab.flight.readers.labels import Labels, read_labels

#: Two animals and a car in an image of 200 x 100 pixels, and an image in which nothing is.
COCO: dict[str, Any] = {
    "images": [
        {"id": 7, "file_name": "day/a.png", "width": 200, "height": 100, "site": "north"},
        {"id": 9, "file_name": "b.png", "site": "south"},
    ],
    "categories": [{"id": 1, "name": "deer"}, {"id": 3, "name": "car"}, {"id": 4, "name": "boar"}],
    "annotations": [
        {"id": 1, "image_id": 7, "category_id": 1, "bbox": [20, 10, 40, 30]},
        {"id": 2, "image_id": 7, "category_id": 3, "bbox": [100, 50, 20.5, 10]},
        {"id": 3, "image_id": 7, "category_id": 1, "bbox": [0, 0, 200, 5], "iscrowd": 1},
    ],
}
RESULTS: list[dict[str, Any]] = [
    {"image_id": 7, "category_id": 1, "bbox": [20, 10, 40, 30], "score": 0.9},
    {"image_id": 9, "category_id": 3, "bbox": [1, 2, 3, 4], "score": 0.25},
]
BATCH: dict[str, Any] = {
    "info": {"detector": "md_v5a"},
    "detection_categories": {"1": "animal", "2": "person"},
    "images": [
        {"file": "day/a.png", "detections": [{"category": "1", "conf": 0.8, "bbox": [0.1, 0.1, 0.2, 0.3]}]},
        {"file": "b.png", "detections": []},
        {"file": "c.png", "failure": "Failure image access", "detections": None},
    ],
}


def write(path: Path, content: Any) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
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
    strange = [*RESULTS, {**RESULTS[0], "image_id": 1234}]
    found = read_labels(write(tmp_path / "r.json", strange), truth=truth, classes=("deer",))
    assert in_px(found, "a.png") == [[20, 10, 40, 30]] and found.scores["day/a.png"].tolist() == [0.9]
    assert found.marked.left_out == {"result of an image that the labels do not have": 1}
    alone = read_labels(write(tmp_path / "r.json", RESULTS))
    assert in_px(alone, "000007.png") == [[20, 10, 40, 30]] and alone.name_of("000008.png") is None
    assert in_px(alone, "clip#000009") == [[1, 2, 3, 4]]
    named = [{**RESULTS[0], "image_id": "IMG_7"}]
    assert in_px(read_labels(write(tmp_path / "r.json", named)), "IMG_7.JPG") == [[20, 10, 40, 30]]
    assert read_labels(write(tmp_path / "r.json", [])).boxes == {}


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
    assert found.marked.kinds == ["0", "2"]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("classes.txt", "deer\ncar\nboar\n"),
        ("data.yaml", "path: x\nnames: ['deer', \"car\", boar]\nnc: 3\n"),
        ("data.yaml", "nc: 3\nnames:\n- deer\n- car\n- 'boar'\n"),
        ("data.yaml", "names:\n  0: deer  # red\n  1: car\n  2: boar\ntrain: images\n"),
        ("data.yaml", "names: {0: deer, 1: car, 2: boar}\n"),
        ("data.yaml", "names: [\n  deer, car,\n  boar,\n]\nnc: 3\n"),
    ],
)
@pytest.mark.parametrize("above", [0, 2])
def test_names_of_yolo_lie_beside_the_text_files_or_above(tmp_path, name, text, above):
    path = tmp_path / "set" / "labels" / "train"
    path.mkdir(parents=True)
    yolo(path, a="0 0.2 0.25 0.2 0.3\n2 0.5 0.5 0.1 0.1\n")
    write([path, *path.parents][above] / name, text)
    found = read_labels(path, classes=("boar",))
    assert found.marked.kinds == ["deer", "boar"] and found.marked.known_kinds == ("deer", "car", "boar")
    assert len(found.boxes["a"]) == 1 and len(found.ignore["a"]) == 1


def test_one_truth_in_three_formats_is_one_truth(tmp_path):
    """Written out of the same numbers, the boxes of the three formats are the same to rounding."""
    rng = np.random.default_rng(3)
    low, size = rng.uniform(0, 60, (20, 2)), rng.uniform(1, 40, (20, 2))
    boxes = np.concatenate([low, size], axis=1)
    share = boxes / [200, 100, 200, 100]
    coco = {**COCO, "annotations": [{"image_id": 9, "category_id": 1, "bbox": list(one)} for one in boxes]}
    md = copy.deepcopy(BATCH)
    md["images"][1]["detections"] = [{"category": "1", "conf": 1, "bbox": list(one)} for one in share]
    lines = "".join(f"0 {a + w / 2} {b + h / 2} {w} {h}\n" for a, b, w, h in share)
    read = [read_labels(write(tmp_path / "c", coco)), read_labels(write(tmp_path / "m", md))]
    for labels in (*read, read_labels(yolo(tmp_path / "y", b=lines))):
        assert np.allclose(in_px(labels, "b.png"), boxes, atol=1e-9)


def test_images_of_another_size_are_told(tmp_path):
    labels = read_labels(write(tmp_path / "t.json", COCO))
    with pytest.raises(WildlabError, match=r"200 x 100 pixels, and a\.png has 400"):
        labels.boxes_of("a.png", "day/a.png", 400, 200)
    assert len(labels.boxes_of("a.png", "day/a.png", 0, 0)[0]) == 2


def test_an_image_with_a_class_and_no_box_is_not_judged(tmp_path):
    coco = copy.deepcopy(COCO)
    del coco["annotations"][0]["bbox"]
    labels = read_labels(write(tmp_path / "t.json", coco))
    assert list(labels.boxes) == ["b.png"] and sum(labels.marked.left_out.values()) == 1
    coco["categories"][0]["name"] = "empty"
    assert list(read_labels(write(tmp_path / "t.json", coco)).boxes) == ["day/a.png", "b.png"]


def changed(source: Any, change: Callable[[Any], Any]) -> Any:
    found = copy.deepcopy(source)
    return change(found) or found


@pytest.mark.parametrize(
    ("source", "change", "word"),
    [
(COCO, lambda c: c["annotations"][1].update(bbox=[1, 2, -3, 4]), r"\[1\].bbox"),
(COCO, lambda c: c["annotations"][1].update(bbox=[1, 2, 3, "4"]), "four numbers"),
(COCO, lambda c: c["annotations"][1].update(image_id=8), "image_id: is 8"),
(COCO, lambda c: c["annotations"][1].update(category_id=2), "categories has 1, 3"),
(COCO, lambda c: c["images"].append(c["images"][0]), "7 stands"),
(COCO, lambda c: c.pop("categories") and None, "categories: is missing"),
(COCO, lambda c: c.update(images=[], annotations=[]), "names no image"),
(RESULTS, lambda c: c[1].pop("score") and None, "has a score"),
(RESULTS, lambda c: c[1].update(score=float("inf")), "is inf"),
(BATCH, lambda c: c["images"][0]["detections"][0].update(bbox=[9, 9, 2, 3]), "shares of the image"),
(BATCH, lambda c: c["images"][0]["detections"][0].update(category="9"), "_categories has 1, 2"),
(BATCH, lambda c: c.pop("detection_categories") and None, "categories are called"),
(COCO, lambda c: {"a": 1, "b\x1b": 2}, r"'b\\x1b'"),
(COCO, lambda c: '{"images": [', "like JSON"),
],
)  # fmt: skip
def test_what_is_wrong_in_json_is_named(tmp_path, source, change, word):
    path = write(tmp_path / "l.json", changed(source, change))
    with pytest.raises(WildlabError, match=word) as error:
        read_labels(path)
    assert str(path) in str(error.value) and error.value.fix


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("0 0.5 0.5 0.1", "line 1"),
        ("0 0.5 0.5 0.1 -0.1", "no size below zero"),
        ("0 50 50 10 10", "shares"),
        ("deer 0.5 0.5 0.1 0.1", "the first a whole one"),
        ("5 0.5 0.5 0.1 0.1", "class 5"),
    ],
)
def test_what_is_wrong_in_a_line_of_yolo_is_named(tmp_path, line, word):
    path = yolo(tmp_path / "labels", a=f"{line}\n", classes="deer\ncar\n")
    with pytest.raises(WildlabError, match=word) as error:
        read_labels(path)
    assert str(path / "a.txt") in str(error.value)


def test_folders_that_are_none_of_yolo_are_refused(tmp_path, monkeypatch):
    with pytest.raises(WildlabError, match="no text file"):
        read_labels(yolo(tmp_path / "labels", classes="deer"))
    yolo(tmp_path / "labels", a="", b="")
    (tmp_path / "labels" / "classes.txt").unlink()
    write(tmp_path / "data.yaml", "names: 3\n")
    with pytest.raises(WildlabError, match=r"data\.yaml"):
        read_labels(tmp_path / "labels")
    write(tmp_path / "data.yaml", "nc: 3\n")
    assert len(read_labels(tmp_path / "labels").boxes) == 2
    monkeypatch.setattr(label_yolo, "MOST_FILES", 1)
    with pytest.raises(WildlabError, match="more than 1"):
        read_labels(tmp_path / "labels")


def test_groups_classes_and_crowded_images(tmp_path):
    coco = write(tmp_path / "t.json", COCO)
    with pytest.raises(WildlabError, match="no such field"):
        read_labels(coco, group="clip")
    with pytest.raises(WildlabError, match="nothing of groups"):
        read_labels(write(tmp_path / "r.json", RESULTS), group="clip")
    with pytest.raises(WildlabError, match="class 'wolf'"):
        read_labels(coco, classes=("wolf",))
    with pytest.raises(WildlabError, match="none of 1"):
        read_labels(write(tmp_path / "r.json", [{**RESULTS[0], "image_id": 1}]), truth=read_labels(coco))
    with pytest.raises(WildlabError, match="is 8"):
        read_labels(write(tmp_path / "r.json", [{**RESULTS[0], "category_id": 8}]), truth=read_labels(coco))
    with pytest.raises(WildlabError, match="3,001 boxes"):
        read_labels(yolo(tmp_path / "labels", a="0 0.5 0.5 0.1 0.1\n" * 3001))
