"""Frames in, detections out: a detector over a folder or a clip, kept part by part so that it can go on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wildlab.analysis.detecting.methods import METHODS
from wildlab.detection.detections import Detections, no_detections
from wildlab.detection.warm import to_grey
from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_csv, write_json
from wildlab.flight.readers.frames import Frame, Frames

#: Frames between two savings: what is lost at most where a run is broken off.
PART = 25
TABLE_COLUMNS = (
    "detection_id", "frame_id", "source", "kind", "u_px", "v_px", "area_px", "major_px", "minor_px",
    "angle_rad", "touches_border", "cov_uu_px2", "cov_uv_px2", "cov_vv_px2", "intensity", "score",
    "left_px", "top_px", "width_px", "height_px", *(f"hu_{n}" for n in range(1, 8)),
)  # fmt: skip
FRAME_COLUMNS = (
    "frame_id",
    "time_s",
    "width_px",
    "height_px",
    "unit",
    "valid_share",
    "detections",
    "problem",
)


def detect_frame(frame: Frame, method: str, thresholds: Any) -> Detections:
    """Detections of one frame.

    Parameters
    ----------
    frame
        One with a problem has none.
    method
        One of `wildlab.analysis.detecting.methods.METHODS`.
    thresholds
        Of that method.

    Returns
    -------
    Detections

    Raises
    ------
    WildlabError
        Where the method is not known.
    """
    if method not in METHODS:
        raise WildlabError(f"there is no method {method!r}", f"take one of {', '.join(METHODS)}")
    if not frame.usable:
        return no_detections()
    how = METHODS[method]
    if how.black_hot is not None and frame.polarity == "black-hot":
        thresholds = how.black_hot(thresholds)
    as_it_is = how.colours or frame.image.ndim == 2
    return how.find(frame.image if as_it_is else to_grey(frame.image), frame.valid, thresholds)


def detections_table(frame: Frame, found: Detections, source: str) -> pd.DataFrame:
    """Detections of one frame with the columns of a flight's table of detections, and some more.

    Parameters
    ----------
    frame
        Whose they are.
    found
        N rows.
    source
        Who says so.

    Returns
    -------
    DataFrame
        N rows, `TABLE_COLUMNS`.
    """
    height, width = frame.image.shape[:2]
    left, top = found.box[:, 0], found.box[:, 1]
    right, below = left + found.box[:, 2], top + found.box[:, 3]
    border = (left < 1) | (top < 1) | (right > width - 2) | (below > height - 2)
    columns = [
        [f"{frame.name}/{row}" for row in range(len(found))],
        [frame.name] * len(found),
        [source] * len(found),
        ["pixel"] * len(found),
        *found.uv.T,
        found.area,
        *found.axes.T,
        found.orientation,
        border.astype(float),
        *(found.covariance[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1))),
        found.intensity,
        found.score,
        *found.box.T,
        *found.hu.T,
    ]
    return pd.DataFrame(dict(zip(TABLE_COLUMNS, columns, strict=True)), columns=list(TABLE_COLUMNS))


def frame_row(frame: Frame, found: Detections) -> dict[str, Any]:
    """What is kept of a frame itself.

    Parameters
    ----------
    frame, found
        The frame and its detections.

    Returns
    -------
    dict
        By `FRAME_COLUMNS`.
    """
    height, width = frame.image.shape[:2]
    share = float(frame.valid.mean()) if frame.usable else 0.0
    time = np.nan if frame.time is None else frame.time
    values = (frame.name, time, width, height, frame.unit, share, len(found), frame.problem)
    return dict(zip(FRAME_COLUMNS, values, strict=True))


@dataclass(frozen=True, eq=False)
class Detected:
    """What `run_detection` found.

    Attributes
    ----------
    detections
        `TABLE_COLUMNS`.
    frames
        One row for each frame, `FRAME_COLUMNS`.
    kept
        How many frames were there from a run that was broken off.
    """

    detections: pd.DataFrame
    frames: pd.DataFrame
    kept: int


def run_detection(
    frames: Frames,
    into: Path,
    method: str,
    thresholds: Any,
    tell: Callable[[int], None] | None = None,
) -> Detected:
    """Detections of all frames; what was finished before is not computed again.

    Parameters
    ----------
    frames
        From `wildlab.flight.readers.frames.open_frames`.
    into
        Folder for ``detections.parquet``, ``detections.csv``, ``frames.csv``, and ``parts``, which a run that
        goes on reads.
    method, thresholds
        As for `detect_frame`.
    tell
        Called with the number of frames that are done.

    Returns
    -------
    Detected

    Raises
    ------
    WildlabError
        As `detect_frame`, and where a video cannot be decoded.
    """
    parts = into / "parts"
    parts.mkdir(parents=True, exist_ok=True)
    digest = settings_digest(frames, method, thresholds)
    done = _usable_parts(parts, digest)
    kept = sum(len(rows) for _, rows in done)
    tables, rows = [one for one, _ in done], [one for _, one in done]
    if tell:
        tell(kept)
    batch: list[tuple[pd.DataFrame, dict[str, Any]]] = []
    for frame in _from(frames, kept):
        found = detect_frame(frame, method, thresholds)
        batch.append((detections_table(frame, found, f"wildlab {method}"), frame_row(frame, found)))
        if len(batch) == PART:
            _save_part(parts, digest, len(tables), batch, tables, rows)
            batch = []
        if tell:
            tell(kept + sum(len(one) for one in rows[len(done) :]) + len(batch))
    if batch:
        _save_part(parts, digest, len(tables), batch, tables, rows)
    detections = _joined(tables, TABLE_COLUMNS)
    of_frames = _joined(rows, FRAME_COLUMNS)
    write_atomic(into / "detections.parquet", _parquet(detections))
    write_csv(into / "detections.csv", detections)
    write_csv(into / "frames.csv", of_frames)
    return Detected(detections, of_frames, kept)


def settings_digest(frames: Frames, method: str, thresholds: Any) -> str:
    """What a kept part is told by: same files, same method, same thresholds.

    Parameters
    ----------
    frames, method, thresholds
        As for `run_detection`.

    Returns
    -------
    str
        64 hexadecimal digits, from names, sizes and times of change.
    """
    paths = frames.files or (frames.path,)
    looks = [(one.name, one.stat().st_size, one.stat().st_mtime_ns) for one in paths if one.exists()]
    said = [str(frames.path.resolve()), looks, frames.polarity, frames.even, method, asdict(thresholds), PART]
    return sha256(json.dumps(said, default=str).encode()).hexdigest()


def _from(frames: Frames, first: int) -> Iterator[Frame]:
    # All are done: a video would be decoded to its end only to find nothing.
    if frames.count is not None and first >= frames.count and frames.files:
        return iter(())
    return frames.starting_at(first)


def _usable_parts(parts: Path, digest: str) -> list[tuple[pd.DataFrame, pd.DataFrame]]:
    """Parts 0, 1, ... of a run with the same settings, as far as they have no gap; others are removed."""
    found: list[tuple[pd.DataFrame, pd.DataFrame]] = []
    for path in sorted(parts.glob("*.json")):
        table = path.with_suffix(".parquet")
        note = _note(path)
        good = note.get("digest") == digest and path.stem == f"{len(found):06d}" and table.is_file()
        if good and note.get("sha256") == sha256(table.read_bytes()).hexdigest():
            rows = pd.DataFrame(note["frames"], columns=list(FRAME_COLUMNS)).astype({"time_s": float})
            found.append((pd.read_parquet(table), rows))
            # A short part is the last of a run that was finished: more frames may have come since.
            if len(rows) == PART:
                continue
            found.pop()
        path.unlink(missing_ok=True)
        table.unlink(missing_ok=True)
    return found


def _note(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _save_part(
    parts: Path,
    digest: str,
    number: int,
    batch: list[tuple[pd.DataFrame, dict[str, Any]]],
    tables: list[pd.DataFrame],
    rows: list[pd.DataFrame],
) -> None:
    table = _joined([one for one, _ in batch], TABLE_COLUMNS)
    data = _parquet(table)
    write_atomic(parts / f"{number:06d}.parquet", data)
    frames = pd.DataFrame([one for _, one in batch], columns=list(FRAME_COLUMNS))
    plain = [{key: None if value != value else value for key, value in row.items()} for _, row in batch]
    note = {"digest": digest, "sha256": sha256(data).hexdigest(), "frames": plain}
    write_json(parts / f"{number:06d}.json", note)
    tables.append(table)
    rows.append(frames)


def _parquet(table: pd.DataFrame) -> bytes:
    stream = BytesIO()
    table.to_parquet(stream, index=False)
    return stream.getvalue()


def _joined(tables: list[pd.DataFrame], columns: tuple[str, ...]) -> pd.DataFrame:
    some = [one for one in tables if len(one)]
    return pd.concat(some, ignore_index=True) if some else pd.DataFrame(columns=list(columns))
