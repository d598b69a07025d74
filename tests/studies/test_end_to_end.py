"""Drawn and rendered detections of the same flight: what is alike, and what is compared."""

import numpy as np
import pandas as pd
import pytest

from tests.studies.claims import checks_of, turn
from wildlab.evaluation.shares import Check
from wildlab.reporting.published import load_claims
from wildlab.studies import coloured_noise as coloured
from wildlab.studies import end_to_end
from wildlab.studies.end_to_end import (
    COLOURED,
    DRAWN,
    KINDS,
    RENDERED,
    STUDY_OF,
    TWO_FILTERS,
    fly,
    numbers_of,
    of_kind,
    pixel_errors,
)

TWIN, SEED = "fast-vessel", 1


@pytest.fixture(scope="module")
def pair():
    return fly(TWIN, SEED, every=6)


@pytest.fixture(scope="module")
def numbers(pair):
    return numbers_of(pair, TWIN, SEED)


def spread_of(numbers, changes=None, flights=3):
    return pd.DataFrame([dict(numbers) | (changes or {})] * flights)


def test_only_the_pixels_differ_between_both(pair):
    drawn, rendered = (pair.flights[kind] for kind in KINDS)
    assert drawn.frames.equals(rendered.frames)
    assert drawn.truth.equals(rendered.truth)
    assert drawn.nav is rendered.nav
    assert set(rendered.detections["frame_id"]) <= set(drawn.detections["frame_id"])
    same = drawn.detections.set_index("frame_id").loc[rendered.detections["frame_id"]]
    assert np.array_equal(same["plane_down_m"], rendered.detections["plane_down_m"])
    assert (same["u_px"].to_numpy() != rendered.detections["u_px"].to_numpy()).all()
    apart = same[["u_px", "v_px"]].to_numpy() - rendered.detections[["u_px", "v_px"]].to_numpy()
    assert np.hypot(*apart.T).max() < 30


def test_errors_are_along_the_vessels_axes(pair):
    errors = pixel_errors(pair, TWIN, SEED)
    moved = pair._replace(drawn_uv=pair.marks.uv)
    again = pixel_errors(moved, TWIN, SEED)
    assert np.allclose(again.drawn, again.rendered)
    # The axes are perpendicular and of unit length, but for perspective.
    far = np.hypot(*(pair.drawn_uv - pair.marks.uv).T)
    assert np.allclose(np.hypot(*(errors.drawn - errors.rendered).T), far, rtol=0.15)


def test_the_detector_is_nearer_than_what_the_twin_draws(numbers):
    assert numbers[RENDERED, "pixel_rms"] < numbers[DRAWN, "pixel_rms"]
    assert numbers[RENDERED, "detection_rate"] > 0.9
    assert numbers[DRAWN, "detection_rate"] == 1
    assert 0.5 < numbers[RENDERED, "ellipse_coverage_90"] <= 1
    for kind in KINDS:
        bias = np.hypot(numbers[kind, "bias_ahead"], numbers[kind, "bias_right"])
        assert np.hypot(bias, numbers[kind, "pixel_sd"]) == pytest.approx(numbers[kind, "pixel_rms"])


def test_every_claim_of_the_cases_is_checked_with_both(numbers):
    spread = spread_of(numbers)
    for kind in KINDS:
        checks = end_to_end.checks_of(spread, kind)
        assert set(checks) == {TWO_FILTERS, COLOURED}
        for case, found in checks.items():
            assert {claim["id"] for claim in load_claims(STUDY_OF[case, TWIN])} <= set(found)
    slow = spread[[key for key in spread if key[0] in KINDS or key[0].endswith(("kf", "measurements"))]]
    assert set(end_to_end.checks_of(slow, DRAWN)) == {TWO_FILTERS}
    assert ("kf", "mae") in of_kind(spread, RENDERED)


def test_verdicts_stand_side_by_side():
    many = np.ones(40, bool)
    claims = {"one": [{"id": "a", "text": "A.", "source": "x"}, {"id": "b", "text": "B.", "source": "y"}]}
    checks = {
        DRAWN: {"one": {"a": Check(true=many), "b": Check(true=many)}},
        RENDERED: {"one": {"a": Check(true=many), "b": Check(true=~many)}},
    }
    table = end_to_end.verdicts_table(checks, claims)
    assert table["flights"].tolist() == [0, 40]
    assert table["verdict_drawn"].tolist() == ["holds", "holds"]
    assert table["verdict_rendered"].tolist() == ["holds", "does not hold"]
    assert end_to_end.count_turned(table) == 1
    assert table[RENDERED].tolist() == ["holds: 40 of 40", "does not hold: 0 of 40"]


def test_own_claims_follow_the_numbers(numbers):
    better = {(RENDERED, "pixel_rms"): 1.0, (DRAWN, "pixel_rms"): 5.0, (RENDERED, "detection_rate"): 1.0}
    worse = {(RENDERED, "pixel_rms"): 9.0, (DRAWN, "pixel_rms"): 3.0, (RENDERED, "detection_rate"): 0.5}
    alike = {("rendered-" + who, "mae"): 10.0 for who in ("kf", "ekf", *coloured.SUBJECTS)} | {
        ("drawn-" + who, "mae"): 10.1 for who in ("kf", "ekf", *coloured.SUBJECTS)
    }
    apart = alike | {("rendered-singer", "mae"): 20.0}
    biased = {(RENDERED, "bias_ahead"): -2.0, (RENDERED, "bias_right"): 0.0, (RENDERED, "pixel_sd"): 1.0}
    noisy = {(RENDERED, "bias_ahead"): 0.1, (RENDERED, "bias_right"): 0.0, (RENDERED, "pixel_sd"): 1.0}
    turned = (better | alike | biased, worse | apart | noisy)
    checks = [checks_of("end-to-end", spread_of(numbers, one)) for one in turned]
    assert turn("end-to-end-fast", *checks)
