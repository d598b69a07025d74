"""Tables of labels: three ways to say where, classes, groups, and what is wrong with bad ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from wildlab.errors import WildlabError
from wildlab.flight.readers.labels import read_labels


def table(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "text",
    ["image,x,y,w,h\na.png,1,2,3,4\n", "file,x_min,y_min,x_max,y_max\na.png,1,2,4,6\n",
     "\ufefffilename,x0,y0,x1,y1\na.png,1,2,4,6\n"],
)  # fmt: skip
def test_boxes_in_any_of_the_ways(tmp_path, text):
    assert read_labels(table(tmp_path / "l.csv", text)).boxes["a.png"].tolist() == [[1, 2, 3, 4]]


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


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("x,y,w,h\n1,2,3,4\n", "names the image"),
        ("image,a\nb.png,3\n", "no columns"),
        ("image,x,y,w,h\n", "has no row"),
        ("image,x,y,w,h\na.png,1,2,3,4\na.png,1,2,-3,4\n", "line 3 has no box"),
        ("image,x,y,w,h\na.png,1,?,3,4\n", "line 2 has no box"),
        ("frame0,x,y,w,h\na,1,2,3,4\n", "line 2 has no number"),
        ("", "has no row"),
        ("image,x,y,w,h\na.png,1,2,3,4,5,6\n", "7 values"),
        ("image,x,y,w,h\na.png,.1,.2,.3,.4\n", "shares"),
        ("image,x_min,y_min,x_max,y_max\na.png,5,2,3,4\n", "x_min 5"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, word):
    with pytest.raises(WildlabError, match=word):
        read_labels(table(tmp_path / "l.csv", text))


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


def test_a_row_that_stands_twice_counts_once_and_is_told(tmp_path):
    labels = read_labels(
        table(tmp_path / "l.csv", "image,x,y,w,h\n" + 2 * "a.png,1,2,3,4\n" + "a.png,1,2,3,5\n")
    )
    assert len(labels.boxes["a.png"]) == 2
    assert labels.marked.left_out == {"a row that stands in the file twice": 1}
