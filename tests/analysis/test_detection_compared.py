"""Another detector beside ours: same frames, same labels, same rule, and what is not judged is told."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from tests.analysis.test_detect import folder
from tests.commands import succeed
from tests.refused import refused
from wildlab.analysis.detection_scores import read_others
from wildlab.flight.readers.labels import read_labels

#: Of the frames of `folder`.
WIDTH, HEIGHT = 128, 96


def batch(path: Path, frames: int = 6) -> Path:
    """A batch of MegaDetector: of each frame the animal that does not move, and something that is none."""
    box, wrong = [97.5 / WIDTH, 67.5 / HEIGHT, 5 / WIDTH, 5 / HEIGHT], [0.9, 0.02, 0.05, 0.05]
    images = [
        {
            "file": f"cam/{number:03d}.png",
            "detections": [
                {"category": "1", "conf": 0.9, "bbox": box},
                {"category": "1", "conf": 0.2, "bbox": wrong},
                {"category": "3", "conf": 0.99, "bbox": wrong},
            ],
        }
        for number in range(frames)
    ]
    content = {"images": images, "detection_categories": {"1": "animal", "3": "vehicle"}}
    path.write_text(json.dumps(content))
    return path


def test_a_batch_is_judged_beside_ours(tmp_path):
    """Six of twelve animals found; with the low scores six things that are none, without them none."""
    path = folder(tmp_path / "in")
    md = batch(tmp_path / "md.json", 7)
    out = succeed(
        "detect",
        path,
        "--out",
        tmp_path / "out",
        "--labels",
        path / "labels.csv",
        "--also",
        f"md={md}",
        "--also-class",
        "animal",
        "--json",
    )
    result = json.loads(out)
    ours, other = result["compared"]
    assert (ours["f1"]["estimate"], ours["f1_beyond_ours"]["estimate"]) == (1, 0)
    assert ours["f1"] == result["judged"]["f1"]
    assert (other["found"], other["invented"], other["missed"], other["groups"]) == (6, 6, 6, 6)
    # Precision 1 up to a recall of a half: 51 of 101 recalls.
    assert other["average_precision"]["estimate"] == round(51 / 101, 4)
    assert other["f1_beyond_ours"] == {"estimate": -0.5, "low": -0.5, "high": -0.5}
    assert other["told"]  # of the image that is not among those judged
    table = pd.read_csv(tmp_path / "out" / "compared.csv")
    rows = table[table["detector"] == "md"]
    counts = rows[["score", "found", "invented", "missed"]].to_numpy().tolist()
    assert counts == [[0.9, 6, 0, 6], [0.2, 6, 6, 6]]


def frames(count: int = 3, unusable: int = 0) -> pd.DataFrame:
    rows = [(f"{n}.png", WIDTH, HEIGHT, "") for n in range(count)]
    rows += [(f"{n}.png", 0, 0, "Cut off.") for n in range(count, count + unusable)]
    return pd.DataFrame(rows, columns=["frame_id", "width_px", "height_px", "problem"])


def truth(path: Path, count: int) -> Path:
    path.write_text("image,x,y,w,h,class\n" + "".join(f"{n}.png,10,10,8,8,deer\n" for n in range(count)))
    return path


def test_classes_of_another_detector(tmp_path):
    labels = read_labels(truth(tmp_path / "l.csv", 3), classes=("deer",))
    md = str(batch(tmp_path / "md.json"))
    every = read_others([md], labels, ("deer",))[0]
    assert len(every.boxes.boxes["cam/000.png"]) == 3
    chosen = read_others([md], labels, ("deer",), ("animal", "deer"))[0]
    assert len(chosen.boxes.boxes["cam/000.png"]) == 2 and chosen.told == ()
    (tmp_path / "plain.csv").write_text("image,x,y,w,h\n0.png,1,2,3,4\n")
    assert read_others([str(tmp_path / "plain.csv")], labels, ("deer",))[0].told == ()
    with refused("wolf"):
        read_others([md], labels, (), ("wolf",))
    with refused("'md'"):
        read_others([md, f"md={md}"], labels)
