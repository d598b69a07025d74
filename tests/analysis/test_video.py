"""Which boxes of a video are the same animal: camera motion, identities, counts; and through the command."""

import json
from itertools import pairwise

import cv2
import numpy as np
import pandas as pd
import pytest

from tests.analysis.test_detect import folder, picture
from tests.boxes_in_video import BOX, herd, scores
from tests.commands import refuse, succeed
from wildlab.analysis.tracks.video import camera_motion, track_video, warped
from wildlab.flight.readers.frames import Frame


def test_scores_have_the_values_of_their_definition():
    """Two animals whose tracks are exchanged half-way: half of the boxes are of either pair."""
    true = pd.DataFrame([(k, i, 100.0 * i, 0.0, 10.0, 10.0) for k in range(10) for i in (0, 1)],
                        columns=["frame_id", "id", *BOX])  # fmt: skip
    swapped = true.assign(track=np.where(true["frame_id"] < 5, true["id"], 1 - true["id"]))
    assert scores(true, true.assign(track=true["id"])) == pytest.approx((1, 1))
    assert scores(true, swapped) == pytest.approx((0.5, np.sqrt(1 / 3)))
    aside = true.assign(track=true["id"], left_px=true["left_px"] + 5)
    assert scores(true, aside) == pytest.approx((0, 6 / 19))


def test_animals_keep_their_numbers_and_are_counted():
    for seed in (1, 2, 3):
        clip = herd(seed)
        table, count = track_video(clip.detections, clip.frames, clip.to_first, 1.5 / 12)
        assert scores(clip.true, table)[0] > 0.95
        assert count.low <= clip.true["id"].nunique() <= count.high
        own = table[table["detection_id"] != ""]
        assert own["detection_id"].is_unique
        there = clip.detections.set_index("detection_id").loc[own["detection_id"]]
        assert (
            np.array_equal(own[BOX], there[BOX]) and (own["frame_id"].to_numpy() == there["frame_id"]).all()
        )


def test_animals_that_return_are_counted_once():
    """Hidden for three seconds they keep their numbers; for twelve, the interval allows for it."""
    clip = herd(21, animals=6, frames=200, false=0.0, dropout=0.0)
    for last, most in ((44, 6), (120, 12)):
        seen = clip.detections[~clip.detections["frame_id"].between(20, last)]
        table, count = track_video(seen, clip.frames, clip.to_first, 1.5 / 12)
        assert table["track"].nunique() <= most and count.low <= 6 <= count.high
        assert last == 120 or count.high == 6


def test_nothing_detected_is_no_animal():
    clip = herd(5, animals=2, frames=10)
    table, count = track_video(clip.detections[:0], clip.frames, clip.to_first, 1.0)
    assert len(table) == 0 and (count.mean, count.high) == (0, 0)


def views(count, jump=0.0):
    """Frames of textured ground under a camera that moves, and what takes their pixels to the first's."""
    ground = cv2.GaussianBlur(np.random.default_rng(1).normal(0, 1, (700, 700)), (0, 0), 2)
    ground = np.uint8(np.clip(128 + 300 * ground, 0, 255))
    to_ground = []
    for k in range(count):
        c, s = np.cos(0.004 * k), np.sin(0.004 * k)
        at = 150 + 3 * k + (jump if k > count // 2 else 0)
        to_ground.append(np.array([[c, -s, at], [s, c, 200 + k], [2e-6 * k, 0, 1.0]]))
    images = [cv2.warpPerspective(ground, np.linalg.inv(H), (160, 128)) for H in to_ground]
    frames = [
        Frame(str(k), None, one, "grey levels", "white-hot", np.ones(one.shape, bool))
        for k, one in enumerate(images)
    ]
    return frames, [np.linalg.inv(to_ground[0]) @ H for H in to_ground]


def test_the_camera_s_own_motion_is_known_to_a_part_of_a_pixel():
    frames, truth = views(30)
    found, lost = camera_motion(frames, {"3": np.array([[10.0, 10.0, 20.0, 20.0]])})
    corners = np.array([[10.0, 10.0], [150.0, 10.0], [10.0, 118.0], [150.0, 118.0]])
    off = [
        np.linalg.norm(warped(a, corners) - warped(b, corners), axis=1).max()
        for a, b in zip(found, truth, strict=True)
    ]
    assert lost == 0 and max(off) < 1.5
    apart = [warped(np.linalg.inv(a) @ b, corners) - warped(np.linalg.inv(c) @ d, corners)
             for (a, b), (c, d) in zip(pairwise(found), pairwise(truth), strict=True)]  # fmt: skip
    assert np.abs(apart).max() < 0.5
    # A jump that nothing follows is told of.
    assert camera_motion(views(10, jump=140)[0], {})[1] == 1


def test_boxes_of_another_detector_become_tracks(tmp_path):
    path = tmp_path / "in"
    path.mkdir()
    rows = []
    for k in range(6):
        cv2.imwrite(str(path / f"{k}.png"), picture([(20 + k, 30), (100, 70)], k))
        rows += [(f"{k}.png", u - 2.5, v - 2.5, 5, 5) for u, v in ((20 + k, 30), (100, 70))]
    pd.DataFrame(rows, columns=["image", "x", "y", "w", "h"]).to_csv(tmp_path / "boxes.csv", index=False)
    given = ("detect", path, "--out", tmp_path / "out", "--boxes", tmp_path / "boxes.csv", "--tracks")
    result = json.loads(succeed(*given, "--json"))
    assert result["detections"] == 12 and result["tracks"]["tracks"] == 2
    assert (result["tracks"]["low"], result["tracks"]["high"]) == (2, 2) and result["tracks"]["untimed"]
    table = pd.read_csv(tmp_path / "out" / "tracks.csv")
    assert table.groupby("track").size().tolist() == [6, 6]
    assert "(2 to 2" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    # Asked for no more, they are not left from before.
    succeed(*given[:-1])
    assert not (tmp_path / "out" / "tracks.csv").exists()


def test_boxes_that_fit_nothing_are_refused(tmp_path):
    path = folder(tmp_path / "in")
    into, boxes = ("--out", tmp_path / "out"), tmp_path / "boxes.csv"
    boxes.write_text("image,x,y,w,h\nother.png,1,2,3,4\n")
    assert "none of those here" in refuse("detect", path, *into, "--boxes", boxes)
    assert "--fit" in refuse("detect", path, *into, "--boxes", boxes, "--fit", path / "labels.csv")
