"""Two runs of a detector over two cameras that look at the same place, frame by frame as one table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.detection.fusion import GATE, fuse_points, through_homography
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

FUSED_COLUMNS = (
    "frame_id", "u_px", "v_px", "cov_uu_px2", "cov_uv_px2", "cov_vv_px2", "seen_by", "first_id", "second_id",
    "distance2",
)  # fmt: skip


def fuse_runs(
    first: pd.DataFrame,
    second: pd.DataFrame,
    H: ArrayLike,
    *,
    registration_px: float = 0.0,
    frames: Mapping[str, str] | None = None,
    gate: float = GATE,
) -> pd.DataFrame:
    """What a thermal and a colour camera, or any two, found in images of the same moments.

    Parameters
    ----------
    first, second
        Tables of `wildlab detect` (``detections.parquet``), with `wildlab.pipeline.detect.TABLE_COLUMNS`.
    H
        (3, 3) from pixels of the second camera to pixels of the first.
    registration_px
        Standard deviation of that, px of the first image for each axis.
    frames
        By the name of a frame of the first camera that of the second; None takes frames of the same name,
        whatever its ending.
    gate
        With which probability two detections of one thing are joined.

    Returns
    -------
    DataFrame
        `FUSED_COLUMNS`, in pixels of the first camera: ``seen_by`` is ``both``, ``first`` or ``second``, and
        the ids are those of the two tables, empty where that camera did not see it. Of frames that only one
        camera has, everything is seen by that one. Detections of the second camera that have no place in the
        image of the first are left out.

    Raises
    ------
    WildlabError
        Where a table lacks a column, no frame is in both, or as
        `wildlab.detection.fusion.fuse_points` and `wildlab.detection.fusion.through_homography`.
    """
    for table, which in ((first, "first"), (second, "second")):
        missing = [name for name in ("detection_id", *FUSED_COLUMNS[:6]) if name not in table]
        if missing:
            raise WildlabError(
                f"the {which} table has no column {missing[0]!r}", "give a table of wildlab detect"
            )
    own = {str(name): rows for name, rows in first.groupby("frame_id", sort=False)}
    others = {str(name): rows for name, rows in second.groupby("frame_id", sort=False)}
    by_stem = {Path(name).stem: name for name in others}
    called = {name: by_stem.get(Path(name).stem, "") for name in own} if frames is None else dict(frames)
    if own and others and not any(called.get(name, "") in others for name in own):
        raise WildlabError(
            f"none of {len(own)} frames of the first camera is one of the {len(others)} of the second",
            "say with frames which belong together",
        )
    paired = {name: called.get(name, "") for name in own}
    alone = [name for name in others if name not in paired.values()]
    # A frame in which the first camera found nothing has no rows, and yet its own name.
    named = {there: here for here, there in called.items()}
    parts = []
    for frame, other in (*paired.items(), *((named.get(name, name), name) for name in alone)):
        a, b = own.get(frame, first.iloc[:0]), others.get(other, second.iloc[:0])
        uv, covariance = through_homography(*_points(b), H, registration_px)
        there = np.flatnonzero(np.isfinite(uv).all(axis=1))
        found = fuse_points(*_points(a), uv[there], covariance[there], gate=gate)
        seen = np.where(found.by_both, "both", np.where(found.first >= 0, "first", "second"))
        ids = (_ids(a, found.first), _ids(b.iloc[there], found.second))
        columns = [
            [frame] * len(seen),
            *found.points.T,
            *(found.covariance[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1))),
            seen,
            *ids,
            found.distance2,
        ]
        parts.append(pd.DataFrame(dict(zip(FUSED_COLUMNS, columns, strict=True))))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(FUSED_COLUMNS))


def _points(table: pd.DataFrame) -> tuple[Array, Array]:
    uv = table[["u_px", "v_px"]].to_numpy(float)
    entries = table[["cov_uu_px2", "cov_uv_px2", "cov_uv_px2", "cov_vv_px2"]].to_numpy(float)
    return uv, entries.reshape(-1, 2, 2)


def _ids(table: pd.DataFrame, rows: np.ndarray) -> list[str]:
    names = [str(one) for one in table["detection_id"]]
    return [names[row] if row >= 0 else "" for row in rows]
