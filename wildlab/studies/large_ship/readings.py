"""What H 4.3 and 6.4.1 leave open, tried on the images of one flight."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.detection.floating import find_objects
from wildlab.detection.thresholds import FloatingThresholds
from wildlab.pipeline.rendered import Marks, Shot, judge
from wildlab.pipeline.track import start
from wildlab.studies.large_ship.trial import (
    TUNING,
    WITH,
    WITHOUT,
    Photographs,
    Tracked,
    follow,
    numbers_of_track,
)
from wildlab.tracking.batch import View, as_tracks, run_batch

#: A rectangle's length over the full axis of the ellipse with its moments.
BOX = float(np.sqrt(3) / 2)
#: What is shown of each reading.
NAMES = (
    "error_of_mean", "sd_both", "mae", "mae_after_start", "time_to_rest", "pixel_error",
    "ellipse_coverage_90",
)  # fmt: skip


class Reading(NamedTuple):
    """A reading: its words, whether centres are moved, and the track that it gives."""

    words: str
    subject: str
    tracked: Tracked


def shots_as_boxes(shots: list[Shot]) -> list[Shot]:
    """The same detections, with the axes of rectangles in place of those of ellipses."""
    return [
        shot._replace(detections=replace(shot.detections, axes=BOX * shot.detections.axes)) for shot in shots
    ]


def shots_again(taken: Photographs, thresholds: FloatingThresholds) -> list[Shot]:
    """The same images, searched with other thresholds."""
    found = []
    for shot in taken.shots:
        view, counts = taken.camera.image(shot.exposure)
        objects = find_objects(counts, thresholds=thresholds)
        found.append(Shot(shot.exposure, view.seen, objects.detections, judge(view, objects)))
    return found


def with_own_covariance(taken: Photographs, marks: Marks) -> Tracked:
    """As `follow`, each detection with its own covariance on top of the tuning's noise."""
    plain = follow(taken, marks)
    seen = plain.seen
    own = np.nan_to_num(plain.marks.covariance) + TUNING.pixel**2 * np.eye(2)
    batch = run_batch(
        seen.times,
        seen.uv[None],
        own,
        TUNING.motion,
        start(seen, TUNING),
        view=View(seen.poses, seen.plane_down),
        pose=None,
    )
    return plain._replace(track=as_tracks(batch)[0])


def readings_of(taken: Photographs) -> list[Reading]:
    """Every reading of one flight's images, the study's own two first."""
    moved, still = taken.marks(), taken.marks(np.nan)
    boxes = taken._replace(shots=shots_as_boxes(taken.shots))
    wide = TUNING._replace(pixel=TUNING.measurement * taken.per_metre)
    found = [
        Reading("as it stands, adjusted", WITH, follow(taken, moved)),
        Reading("as it stands, not adjusted", WITHOUT, follow(taken, still)),
        Reading("a of (4.7) half of the axis", WITH, follow(taken, taken.marks(full_axis=False))),
        Reading("a of (4.7) the length of a box", WITH, follow(taken, boxes.marks())),
    ]
    found += [
        Reading(f"axes {ratio:g} to 1 at least", WITH, follow(taken, taken.marks(axis_ratio=ratio)))
        for ratio in (1.2, 2.5)
    ]
    found += [
        Reading(f"ship told {word} % {way}", WITH, follow(taken, taken.marks(factor * taken.length)))
        for word, way, factor in ((10, "too short", 0.9), (10, "too long", 1.1))
    ]
    half = taken._replace(shots=taken.shots[::2])
    found += [
        Reading("every second of these images, adjusted", WITH, follow(half, half.marks())),
        Reading("every second of these images, not adjusted", WITHOUT, follow(half, half.marks(np.nan))),
    ]
    found += [
        Reading(f"filter's noise {wide.pixel:.0f} px, adjusted", WITH, follow(taken, moved, wide)),
        Reading(f"filter's noise {wide.pixel:.0f} px, not adjusted", WITHOUT, follow(taken, still, wide)),
        Reading("each with its covariance, adjusted", WITH, with_own_covariance(taken, moved)),
        Reading("each with its covariance, not adjusted", WITHOUT, with_own_covariance(taken, still)),
    ]
    return found


def readings_table(taken: Photographs, readings: list[Reading]) -> pd.DataFrame:
    """Numbers of each reading: ``reading``, ``subject`` and `NAMES`."""
    rows = []
    for one in readings:
        numbers = numbers_of_track(taken, one.tracked)
        rows.append({"reading": one.words, "subject": one.subject} | {name: numbers[name] for name in NAMES})
    return pd.DataFrame(rows)
