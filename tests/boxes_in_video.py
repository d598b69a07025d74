"""Simulated boxes of a herd in a video, and scores of tracks by identity: IDF1 (Ristani et al. 2016) and HOTA
(Luiten et al. 2021)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment

from wildlab.detection.detections import detections_of_boxes

SIZE, RATE = np.array([320.0, 256.0]), 8.0


class Clip(NamedTuple):
    """True boxes (``frame_id``, ``id``, box), what was detected, frames, and the camera's motion."""

    true: pd.DataFrame
    detections: pd.DataFrame
    frames: pd.DataFrame
    to_first: np.ndarray


BOX = ["left_px", "top_px", "width_px", "height_px"]


def herd(seed: int, animals: int = 12, frames: int = 100, dropout: float = 0.2, false: float = 1.0) -> Clip:
    """Animals that walk, every third towards another, under a camera that shakes and drifts."""
    rng = np.random.default_rng([seed, 3])
    # Where they are in the middle of the clip, and how they go.
    at = rng.uniform(40, SIZE - 40, (animals, 2))
    at[1::3] = at[: len(at[1::3]) * 3 : 3] + rng.normal(0, 5, at[1::3].shape)
    angle = rng.uniform(-np.pi, np.pi, animals) + rng.normal(0, 0.08, (frames, animals)).cumsum(0)
    speed = rng.uniform(0, 10, animals) / RATE
    ways = (speed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).cumsum(0)
    ways += at - ways[frames // 2]
    sides = rng.uniform(8, 16, (animals, 2))
    shift = rng.normal(0, 4, (frames, 2)) + np.linspace(0, rng.uniform(-30, 30, 2), frames)
    shift -= shift[0]
    true, found = [], []
    for k in range(frames):
        corner = ways[k] - shift[k] - sides / 2
        seen = ((corner > 0) & (corner + sides < SIZE)).all(axis=1)
        true += [(k, i, *corner[i], *sides[i]) for i in np.flatnonzero(seen)]
        for i in np.flatnonzero(seen & (rng.random(animals) > dropout)):
            found.append(
                (k, *(corner[i] + rng.normal(0, 0.07, 2) * sides[i]), *sides[i], rng.normal(0.75, 0.1))
            )
        for _ in range(rng.poisson(false)):
            found.append((k, *rng.uniform(0, SIZE - 12), 12.0, 12.0, rng.normal(0.45, 0.1)))
    table = pd.DataFrame(found, columns=["frame_id", *BOX, "score"])
    boxes = detections_of_boxes(table[BOX].to_numpy(), table["score"].to_numpy())
    table[["u_px", "v_px"]] = boxes.uv
    table["cov_uu_px2"] = table["cov_vv_px2"] = boxes.covariance[:, 0, 0]
    table = table.assign(cov_uv_px2=0.0, detection_id=[f"d{row}" for row in range(len(table))])
    of_frames = pd.DataFrame({"frame_id": range(frames), "time_s": np.arange(frames) / RATE, "problem": ""})
    of_frames[["width_px", "height_px"]] = SIZE
    to_first = np.tile(np.eye(3), (frames, 1, 1))
    to_first[:, :2, 2] = shift
    return Clip(pd.DataFrame(true, columns=["frame_id", "id", *BOX]), table, of_frames, to_first)


def overlaps(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, M) intersection over union of boxes."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum((a[:, :2] + a[:, 2:])[:, None], (b[:, :2] + b[:, 2:])[None])
    inside = np.maximum(high - low, 0).prod(axis=2)
    return inside / (a[:, 2:].prod(axis=1)[:, None] + b[:, 2:].prod(axis=1) - inside)


def scores(true: pd.DataFrame, tracks: pd.DataFrame) -> tuple[float, float]:
    """IDF1 and HOTA of ``tracks`` (``frame_id``, ``track``, box), as TrackEval 1.3 gives them."""
    t, p = (pd.factorize(one)[0] for one in (true["id"], tracks["track"]))
    of_true, of_track = np.bincount(t), np.bincount(p)
    near, weight = np.zeros((len(of_true), len(of_track))), np.zeros((len(of_true), len(of_track)))
    places = tracks.groupby("frame_id").indices
    frames = []
    for frame, rows in true.groupby("frame_id").indices.items():
        mine = places.get(frame, np.zeros(0, int))
        iou = overlaps(true[BOX].to_numpy()[rows], tracks[BOX].to_numpy()[mine])
        pair = np.ix_(t[rows], p[mine])
        near[pair] += iou >= 0.5
        weight[pair] += iou / np.maximum(iou.sum(0) + iou.sum(1)[:, None] - iou, 1e-12)
        frames.append((pair, iou))
    idf1 = 2 * near[linear_sum_assignment(-near)].sum() / (len(t) + len(p))
    align, found = weight / (of_true[:, None] + of_track - weight), []
    chosen = [(pair, iou, linear_sum_assignment(-(align[pair] * iou))) for pair, iou in frames]
    for alpha in np.arange(0.05, 0.99, 0.05):
        pairs = np.zeros_like(near)
        for (rows, columns), iou, (a, b) in chosen:
            good = iou[a, b] >= alpha - 1e-12
            pairs[rows[a[good], 0], columns[0, b[good]]] += 1
        hits = pairs.sum()
        associated = (pairs**2 / (of_true[:, None] + of_track - pairs)).sum() / max(hits, 1)
        found.append(np.sqrt(associated * hits / (len(t) + len(p) - hits)))
    return float(idf1), float(np.mean(found))
