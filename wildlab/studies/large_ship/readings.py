"""What H 4.3 and 6.4.1 leave open, tried on the images of one flight."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.rendered import Marks, Shot
from wildlab.analysis.track import start
from wildlab.studies.large_ship.trial import (
    TUNING,
    WITH,
    WITHOUT,
    Photographs,
    Tracked,
    follow,
    numbers_of_track,
)
from wildlab.tracking.batch import BatchCamera, as_tracks, run_batch

#: A rectangle's length over the full axis of the ellipse with its moments.
BOX = float(np.sqrt(3) / 2)
#: What is shown of each reading.
NAMES = (
    "error_of_mean", "sd_both", "mae", "mae_after_start", "time_to_rest", "pixel_error",
    "ellipse_coverage_90",
)  # fmt: skip


class Reading(NamedTuple):
    """A way to read the images, and the track that it gives.

    Attributes
    ----------
    words
        What is read otherwise.
    subject
        Whether centres are moved.
    tracked
        What comes out.
    beside
        Words of the reading without the adjustment of the same images and noise.
    """

    words: str
    subject: str
    tracked: Tracked
    beside: str


def shots_as_boxes(shots: list[Shot]) -> list[Shot]:
    """The same detections, with the axes of rectangles in place of those of ellipses."""
    return [
        shot._replace(detections=replace(shot.detections, axes=BOX * shot.detections.axes)) for shot in shots
    ]


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
        view=BatchCamera(seen.poses, seen.plane_down),
        pose=None,
    )
    return plain._replace(track=as_tracks(batch)[0])


def readings_of(taken: Photographs) -> list[Reading]:
    """Every reading of one flight's images, the study's own two first."""
    moved, still = taken.marks(), taken.marks(np.nan)
    boxes = taken._replace(shots=shots_as_boxes(taken.shots))
    half = taken._replace(shots=taken.shots[::2])
    wide = TUNING._replace(pixel=TUNING.measurement * taken.per_metre)

    def pair(words: str, adjusted: Tracked, plain: Tracked) -> list[Reading]:
        beside = f"{words}, not adjusted"
        return [
            Reading(f"{words}, adjusted", WITH, adjusted, beside),
            Reading(beside, WITHOUT, plain, beside),
        ]

    as_it_stands = pair("as it stands", follow(taken, moved), follow(taken, still))
    otherwise = {
        "a of (4.7) half of the axis": taken.marks(full_axis=False),
        "a of (4.7) the length of a box": boxes.marks(),
        **{f"axes {ratio:g} to 1 at least": taken.marks(axis_ratio=ratio) for ratio in (1.2, 2.5)},
        "ship told 10 % too short": taken.marks(0.9 * taken.length),
        "ship told 10 % too long": taken.marks(1.1 * taken.length),
    }
    return [
        *as_it_stands,
        *(
            Reading(words, WITH, follow(taken, marks), as_it_stands[1].words)
            for words, marks in otherwise.items()
        ),
        *pair("every second of these images", follow(half, half.marks()), follow(half, half.marks(np.nan))),
        *pair(f"filter's noise {wide.pixel:.0f} px", follow(taken, moved, wide), follow(taken, still, wide)),
        *pair(
            "each with its covariance", with_own_covariance(taken, moved), with_own_covariance(taken, still)
        ),
    ]


def readings_table(taken: Photographs, readings: list[Reading]) -> pd.DataFrame:
    """Numbers of each reading: ``reading``, ``subject``, ``beside`` and `NAMES`."""
    rows = []
    for one in readings:
        numbers = numbers_of_track(taken, one.tracked)
        rows.append(
            {"reading": one.words, "subject": one.subject, "beside": one.beside}
            | {name: numbers[name] for name in NAMES}
        )
    return pd.DataFrame(rows)
