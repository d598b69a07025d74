"""How wide ellipses have to be: identities, draws with a known part, and labelled frames."""

import numpy as np
import pytest

from wildlab.analysis.detection_fit import (
    Sample,
    fit_part,
    part_of,
    parts_needed,
    with_part,
)
from wildlab.detection.contrast import Contrast, Shape
from wildlab.detection.floating import FloatingThresholds
from wildlab.flight.readers.frames import Frame
from wildlab.geometry.covariances import inside_ellipse


def drawn(rng, count, part):
    """Labels that lie off by what covariance and part say."""
    half = rng.normal(size=(count, 2, 2))
    bare = half @ half.transpose(0, 2, 1) * 0.1 + 0.02 * np.eye(2)
    major = rng.uniform(5, 40, count)
    whole = bare + (part * major)[:, None, None] ** 2 * np.eye(2)
    off = np.einsum("nij,nj->ni", np.linalg.cholesky(whole), rng.normal(size=(count, 2)))
    return off, bare, major


def test_with_the_part_that_is_needed_the_ellipse_just_reaches_its_label():
    off, bare, major = drawn(np.random.default_rng(1), 300, 0.1)
    needed = parts_needed(off, bare, major)
    inside = inside_ellipse(off, bare, 0.9)
    assert (needed[inside] == 0).all() and (needed[~inside] > 0).all() and 0 < inside.sum() < 300
    for row in np.flatnonzero(~inside):
        C = bare[row] + (needed[row] * major[row]) ** 2 * np.eye(2)
        assert off[row] @ np.linalg.solve(C, off[row]) == pytest.approx(-2 * np.log(0.1), rel=1e-9)


def test_the_next_label_is_held_as_often_as_is_said():
    rng, held, parts = np.random.default_rng(2), [], []
    for _ in range(300):
        part = part_of(parts_needed(*drawn(rng, 19, 0.08)))
        held.append((parts_needed(*drawn(rng, 20, 0.08)) <= part).mean())
        parts.append(part)
    # 19 ellipses: the 18th part of 20 places, which is nine in ten exactly.
    assert np.mean(held) == pytest.approx(0.9, abs=0.02)
    assert part_of(parts_needed(*drawn(rng, 20_000, 0.08))) == pytest.approx(0.08, rel=0.05)


def test_of_too_few_nothing_is_chosen():
    assert np.isnan(part_of(np.zeros(8))) and part_of(np.zeros(9)) == 0


def sample(number, image, boxes, group):
    """A labelled frame; its boxes are left, top, width, height in px."""
    frame = Frame(f"{number}.png", None, image, "grey", "white-hot", np.ones(image.shape, bool))
    return Sample(frame, np.array(boxes, float), np.zeros((0, 4)), group)


def samples_of(rng, frames, shift):
    """Warm blobs, and labels whose middle is off by a share of the length, as each group has it."""
    made = []
    for number in range(frames):
        image = rng.normal(100, 1, (120, 160)).astype(np.float32)
        boxes = []
        for at in (30, 110):
            u, v = at + rng.integers(-8, 8), 60 + rng.integers(-20, 20)
            image[v - 4 : v + 4, u - 8 : u + 8] += 40
            # A label lies off by a share of 20 px, its size, one way or the other.
            boxes.append([u - 10 + 20 * shift * rng.choice([-1, 1]), v - 6, 20, 12])
        made.append(sample(number, image, boxes, f"clip {number // 4}"))
    return made


def test_labels_that_lie_off_widen_the_ellipses_and_others_do_not():
    rng = np.random.default_rng(3)
    off, exact = (fit_part("contrast", samples_of(rng, 16, shift), Contrast()) for shift in (0.15, 0.0))
    assert off.labels == exact.labels == 32
    # 3 px by the root of chi-square's nine tenths, of a major axis of about 18 px.
    assert off.part == pytest.approx(3 / np.sqrt(-2 * np.log(0.1)) / 18, rel=0.2)
    assert off.held_out is not None and off.held_out.estimate > 0.8
    assert exact.part < 0.05


def test_thresholds_without_a_part_have_none():
    assert fit_part("floating", [], FloatingThresholds()) is None
    assert with_part(Shape(), 0.03).regions.part == 0.03 and with_part(Contrast(), 0.03).part == 0.03
