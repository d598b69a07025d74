"""Marks that are surveyed to centimetres and a walker with a telephone: each has its own errors."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.analysis.conftest import build, changed, score
from wildlab.analysis.accuracy import errors_by_target, is_known, judge_accuracy
from wildlab.analysis.georeference import ALIKE_M, blocks_of, observe
from wildlab.analysis.georeference import best_known as best
from wildlab.evaluation.intervals import block_mean
from wildlab.flight.store import Flight

N = 40


def walked(mark_sd: float = 0.02, walker_sd: float = 3.0, lasts: int = N) -> Flight:
    """One of the four marks in each image is of a walker, whose receiver errs alike for a while."""
    flight = build(pixel_px=2.0, attitude_deg=0.3)
    truth, detections = flight.table("truth"), flight.table("detections").copy()
    walker = np.arange(len(truth)) % 4 == 3
    off = np.random.default_rng(1).normal(0, 3.0, (N // lasts, 2)).repeat(lasts, axis=0)
    track = truth[walker].assign(target_id="walker", time_s=np.arange(N) * 1.0, sd_horizontal_m=walker_sd)
    track[["north_m", "east_m"]] += off
    detections.loc[walker, "target_id"] = "walker"
    marks = truth[~walker].assign(sd_horizontal_m=mark_sd)
    return changed(flight, detections=detections, truth=pd.concat([marks, track], ignore_index=True))


def test_the_headline_and_the_ellipses_are_of_the_best_known_truth(monkeypatch):
    monkeypatch.setattr("wildlab.analysis.accuracy.diagnose", lambda *_: None)
    rows, whole = score(walked()), judge_accuracy(observe(walked(), None), np.random.default_rng(0))
    assert whole.summary.n == whole.ellipses.n == 3 * N
    assert set(rows.loc[~rows["best_truth"], "truth_id"]) == {"walker"}
    assert len(best(rows)) == 3 * N


@pytest.mark.parametrize(
    ("mark_sd", "walker_sd", "left_out"),
    [(0.02, 0.02 + ALIKE_M, 0), (3.0, 0.02, 3 * N), (np.nan, 3.0, N), (0.02, np.nan, N)],
)
def test_truths_that_are_as_well_known_count_together(mark_sd, walker_sd, left_out):
    """What states nothing is known as a mark, and not known as a track."""
    assert (~score(walked(mark_sd, walker_sd))["best_truth"]).sum() == left_out


def test_a_truth_that_few_points_have_is_not_the_headline():
    flight = walked()
    kept = flight.table("detections")
    few = kept[(kept["target_id"] == "walker") | (kept.index < 10)]
    assert score(changed(flight, detections=few.reset_index(drop=True)))["best_truth"].all()


@pytest.mark.parametrize(("lasts", "known"), [(1, True), (N, False)])
def test_an_interval_needs_independent_errors(lasts, known):
    flight = walked(lasts=lasts)
    scored = score(flight)
    if not known:  # errors that drift through the flight are one error
        scored["error_m"] = np.where(scored["truth_id"] == "walker", scored["time_s"], scored["error_m"])
    found = errors_by_target(flight, scored).set_index("target")
    assert found.index[-1] == "walker" and found.loc["walker", "kind"] == "track"
    row = found.loc["walker"]
    assert row["n"] == N and row["sd"] == 3.0
    assert np.isfinite(row["low"]) == known
    if known:
        assert row["low"] < row["mean"] < row["high"]
    assert len(np.unique(blocks_of(flight, scored))) >= 5


@pytest.mark.filterwarnings("error")
def test_targets_stand_in_the_order_that_the_headline_takes():
    """A mark that states nothing is exact, a track that states nothing comes last."""
    for mark_sd, walker_sd in ((np.nan, 3.0), (0.02, np.nan), (0.02, 3.0)):
        flight = walked(mark_sd, walker_sd)
        assert errors_by_target(flight, score(flight))["target"].iloc[-1] == "walker"


@pytest.mark.parametrize("count", [6, 10, 20])
@pytest.mark.parametrize("alike", [0.0, 0.5, 0.8, 0.9, 0.95])
def test_an_interval_that_is_shown_is_seldom_wrong_however_alike_blocks_are(count, alike):
    """Of 600 flights: by the estimate alone up to 16 % would show a wrong one."""
    drawn = np.random.default_rng(2).normal(size=(600, count + 200)) * np.sqrt(1 - alike**2)
    errors, blocks = lfilter([1], [1, -alike], drawn, axis=1)[:, 200:], np.arange(count)
    shown = [block_mean(one, blocks, 0.95) for one in errors if is_known(one, blocks)]
    assert np.mean([not low <= 0 <= high for _, low, high in shown] or [0]) * len(shown) / 600 < 0.06
    if count == 20 and alike == 0:
        assert len(shown) > 0.75 * 600
