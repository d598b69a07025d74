"""The detectors that `wildlab detect` offers with their thresholds, and one of them over a folder or a clip.

What is detected is kept part by part, so that a run that was broken off can go on.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields, replace
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from pydantic import TypeAdapter, ValidationError

from wildlab.detection.colour import Colour, find_coloured
from wildlab.detection.contrast import Contrast, Shape, find_by_contrast, find_by_shape
from wildlab.detection.detections import Detections, detections_of_boxes, no_detections
from wildlab.detection.floating import FloatingThresholds, detect_floating
from wildlab.detection.warm import Warm, block_from_distance, find_warm, gate_from_distance, to_grey
from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_csv, write_json
from wildlab.flight.files import read_regular
from wildlab.flight.readers.frames import Frame, Frames
from wildlab.flight.readers.labels import Labels

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
        One of `wildlab.analysis.detectors.METHODS`.
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


@dataclass(frozen=True)
class GivenBoxes:
    """In place of thresholds: the file whose boxes are taken, and what is in it."""

    file: str
    sha256: str


def given_boxes(frame: Frame, boxes: Labels) -> Detections:
    """What another detector found in one frame."""
    name = boxes.name_of(frame.name)
    if not frame.usable or name is None:
        return no_detections()
    found, _ = boxes.boxes_of(frame.name, name, *frame.image.shape[1::-1])
    return detections_of_boxes(found, boxes.scores[name])


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
    boxes: Labels | None = None,
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
    boxes
        What another detector found, in place of a method; ``thresholds`` say whose these are.

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
        found = detect_frame(frame, method, thresholds) if boxes is None else given_boxes(frame, boxes)
        source = f"wildlab {method}" if boxes is None else boxes.path.name
        batch.append((detections_table(frame, found, source), frame_row(frame, found)))
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


#: Bytes of a file of thresholds at most.
MOST_BYTES = 1_000_000


def write_thresholds(path: Path, method: str, thresholds: Any) -> None:
    """Write thresholds as JSON; infinity is null.

    Parameters
    ----------
    path
        Of the file.
    method, thresholds
        Which detector's.
    """
    values = json.loads(TypeAdapter(type(thresholds)).dump_json(thresholds))
    write_json(path, {"method": method, "thresholds": values})


def read_thresholds(path: Path, method: str) -> Any:
    """Thresholds that `write_thresholds` wrote.

    Parameters
    ----------
    path
        Of the file.
    method
        Whose they have to be.

    Returns
    -------
    object
        Of ``METHODS[method].thresholds``.

    Raises
    ------
    WildlabError
        Where it is no such file, or another method's, or a value is not of its kind.
    """
    try:
        given = json.loads(read_regular(path, MOST_BYTES))
        named, values = given["method"], dict(given["thresholds"])
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    except (ValueError, TypeError, KeyError):
        raise WildlabError(
            "holds no thresholds", "name the thresholds.json of an earlier run", file=path
        ) from None
    if named != method:
        raise WildlabError(
            f"holds thresholds of {named!r}", f"say --method {named}, or leave it out", file=path
        )
    kind = METHODS[method].thresholds
    try:
        text = json.dumps(_given(kind(), values))
        return TypeAdapter(kind).validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(one) for one in first["loc"])
        raise WildlabError(f"the threshold {name!r}: {first['msg']}", "mend it", file=path) from None


def _given(defaults: Any, values: dict[str, Any]) -> dict[str, Any]:
    """What stands in a file, without what is null there: infinity, or no limit, which are the defaults."""
    known = {one.name for one in fields(defaults)}
    if unknown := sorted(values.keys() - known):
        raise WildlabError(f"there is no threshold {unknown[0]!r}", f"there are {', '.join(sorted(known))}")
    return {
        name: _given(getattr(defaults, name), value) if isinstance(value, dict) else value
        for name, value in values.items()
        if value is not None
    }


#: Of the square of an animal's length, what is seen of it at least and at most, and how many lengths the
#: window of a background is wide. Chosen, not fitted: a thin leg to a stout body seen from above.
SMALLEST_PART, LARGEST_PART, WINDOW_LENGTHS = 0.03, 1.0, 4.0


class Method(NamedTuple):
    """A detector with its thresholds.

    Attributes
    ----------
    thresholds
        Frozen dataclass; made without arguments it holds the defaults.
    find
        Called with image, valid and thresholds.
    colours
        Whether it takes (H, W, 3) colours; others get the image in grey.
    black_hot
        Called with thresholds where warm is dark, gives those to take then; None where warmth is
        nothing to it.
    for_distance
        Called with thresholds, distance in m, focal length in px and length in m of what is looked for, gives
        thresholds of these lengths; None where no length of it follows from the ground.
    """

    thresholds: type[Any]
    find: Callable[[Any, Any, Any], Detections]
    colours: bool = False
    black_hot: Callable[[Any], Any] | None = None
    for_distance: Callable[[Any, float, float, float], Any] | None = None


def for_distance(method: str, thresholds: Any, distance_m: float, focal_px: float, animal_m: float) -> Any:
    """Thresholds whose lengths and areas are those of an animal at that distance (F 3.2, 8.1.1, 8.4).

    Parameters
    ----------
    method
        One of `METHODS`.
    thresholds
        Of that method.
    distance_m
        From the camera to the ground along the middle of the image, m.
    focal_px
        Focal length, px.
    animal_m
        Length of what is looked for, m.

    Returns
    -------
    object
        Of the same kind.

    Raises
    ------
    WildlabError
        Where no length of the method follows from a distance, or a length is not above zero.

    Examples
    --------
    >>> near, far = (for_distance("contrast", Contrast(), distance, 1000.0, 1.5) for distance in (50, 100))
    >>> near.window_px, far.window_px, near.largest_px, far.largest_px
    (121, 61, 900.0, 225.0)
    """
    scaled = METHODS[method].for_distance
    if scaled is None:
        some = ", ".join(name for name, one in METHODS.items() if one.for_distance is not None)
        raise WildlabError(
            f"no length of the method {method!r} follows from the distance to the ground",
            f"leave --distance out, or take one of {some}",
        )
    return scaled(thresholds, distance_m, focal_px, animal_m)


def _gate(distance_m: float, focal_px: float, animal_m: float) -> tuple[float, float]:
    seen = animal_m**2
    return gate_from_distance(distance_m, focal_px, SMALLEST_PART * seen, LARGEST_PART * seen)


def _warm(thresholds: Warm, distance_m: float, focal_px: float, animal_m: float) -> Warm:
    smallest, largest = _gate(distance_m, focal_px, animal_m)
    block = block_from_distance(distance_m, focal_px, animal_m)
    return replace(thresholds, smallest_px=smallest, largest_px=largest, block_px=block)


def _contrast(thresholds: Contrast, distance_m: float, focal_px: float, animal_m: float) -> Contrast:
    smallest, largest = _gate(distance_m, focal_px, animal_m)
    window = block_from_distance(distance_m, focal_px, animal_m, WINDOW_LENGTHS)
    return replace(thresholds, smallest_px=smallest, largest_px=largest, window_px=window)


def _floating(
    thresholds: FloatingThresholds, distance_m: float, focal_px: float, animal_m: float
) -> FloatingThresholds:
    smallest, largest = _gate(distance_m, focal_px, animal_m)
    return replace(thresholds, smallest_area=smallest, largest_area=largest, area_of="filled")


def _dark_is_warm(thresholds: Any) -> Any:
    return replace(thresholds, warm_is_bright=False)


def _shape_dark_is_warm(thresholds: Shape) -> Shape:
    return replace(thresholds, regions=_dark_is_warm(thresholds.regions))


def _floating_dark_is_warm(thresholds: FloatingThresholds) -> FloatingThresholds:
    return replace(thresholds, warm=False)


#: What `wildlab detect --method` offers; `wildlab.commands.detect` has the same names, for a quick start.
METHODS: dict[str, Method] = {
    "contrast": Method(Contrast, find_by_contrast, black_hot=_dark_is_warm, for_distance=_contrast),
    "warm": Method(Warm, find_warm, black_hot=_dark_is_warm, for_distance=_warm),
    # Its regions are learnt with its weights: other lengths would be another classifier.
    "shape": Method(Shape, find_by_shape, black_hot=_shape_dark_is_warm),
    "floating": Method(
        FloatingThresholds, detect_floating, black_hot=_floating_dark_is_warm, for_distance=_floating
    ),
    # Its limits are px of a reduced image, which a focal length in px says nothing of.
    "colour": Method(Colour, find_coloured, colours=True),
}
