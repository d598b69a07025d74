"""Detectors on real thermal images with labels: thresholds are chosen on other frames than those judged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wildlab.analysis.detection_command import samples_of
from wildlab.analysis.detection_fit import Fitted, Sample, candidates, fit_part, fit_shapes, fit_thresholds
from wildlab.analysis.detectors import detect_frame
from wildlab.detection.detections import Detections
from wildlab.evaluation.matching import Rates, match, rates
from wildlab.flight.readers.frames import open_frames
from wildlab.flight.readers.labels import read_labels

pytestmark = pytest.mark.slow

#: Sets of thresholds that are tried, of the 160 that a user's fit tries.
FEW = 30


def judged(samples: list[Sample], method: str, thresholds: object) -> Rates:
    """What thresholds that were chosen elsewhere are worth on these frames."""
    counts = []
    for one in samples:
        found = detect_frame(one.frame, method, thresholds)
        counts.append(match(boxes(found), one.boxes, one.ignore).counts)
    return rates(np.array(counts), [one.group for one in samples])


def boxes(found: Detections) -> np.ndarray:
    return np.concatenate([found.uv - found.box[:, 2:] / 2, found.box[:, 2:]], axis=1)


@pytest.fixture(scope="module")
def at_night(shared_data: Callable[..., Path]) -> tuple[list[Sample], Fitted]:
    """People at night from 60 m, and F's chain fitted to them."""
    folder = shared_data("imagery", "hit_uav")
    labels = read_labels(folder / "labels.csv", classes=("Person",))
    every = samples_of(open_frames(folder / "images"), labels)
    some = [one for one in every if one.frame.name.startswith("1_60_")]
    return some, fit_thresholds("warm", some, tried=candidates("warm", FEW))


def test_people_at_night_by_thresholds_of_other_frames(at_night):
    samples, fitted = at_night
    assert len(samples) == 12 and sum(len(one.boxes) for one in samples) == 137
    assert fitted.held_out.f1.estimate >= 0.74
    assert fitted.held_out.f1.estimate <= fitted.inside.f1.estimate


def test_people_under_trees_by_the_shapes_of_the_other_line(shared_data):
    def line(which: str) -> list[Sample]:
        folder = shared_data("imagery", "aos_f6")
        labels = read_labels(folder / "labels" / f"propagated_{which}.csv")
        return samples_of(open_frames(folder / "images" / which), labels)

    fitted = fit_shapes(line("1"))
    assert judged(line("3"), "shape", fitted.thresholds).f1.estimate >= 0.70


def test_targets_in_the_sky_by_thresholds_of_other_clips(shared_data):
    folder = shared_data("imagery", "ir_tracks")
    clips = sorted(folder.glob("*.mp4"))
    samples = [one for clip in clips for one in clip_samples(clip, 12)]
    # A part of the sets that a user's fit tries, of which all together choose the same ones.
    fitted = fit_thresholds("contrast", samples, tried=candidates("contrast")[::3])
    for clip in clips:
        found = judged(list(clip_samples(clip, 5)), "contrast", fitted.chosen[clip.stem])
        assert found.f1.estimate == 1.0, clip.stem


def clip_samples(clip: Path, step: int) -> list[Sample]:
    """Every so manieth frame of a clip, all of them one group."""
    labels = read_labels(clip.with_suffix(".csv"))
    found = []
    for number, frame in enumerate(open_frames(clip)):
        name = labels.name_of(frame.name)
        if name is not None and number % step == 0:
            found.append(Sample(frame, labels.boxes[name], labels.ignore[name], clip.stem))
    return found


def test_ellipses_hold_labels_that_their_width_was_not_chosen_from(at_night):
    samples, fitted = at_night
    fit = fit_part("warm", samples, fitted.thresholds)
    assert fit is not None and fit.labels > 80 and fit.held_out is not None
    assert 0.85 <= fit.held_out.estimate <= 0.95, fit
