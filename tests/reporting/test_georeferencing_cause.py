"""What is named as a cause follows from its measured gain, and the verdict from gain, losses and ellipses."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from wildlab.analysis.diagnosis import Diagnosis
from wildlab.analysis.overviews.recommendations import CAUSES, causes_told, gains_of, possible_gain
from wildlab.analysis.overviews.verdict import WORTH, Evidence, verdict_of
from wildlab.evaluation.axes import AlongAxis
from wildlab.evaluation.causes import Gain
from wildlab.evaluation.ellipses import EllipseVerdict
from wildlab.evaluation.errors import Scatter, summarise
from wildlab.evaluation.outliers import Outlier
from wildlab.evaluation.runs import Interval
from wildlab.geometry.calibration import Calibration
from wildlab.reporting import georeferencing_cause as cause
from wildlab.reporting import georeferencing_left as left
from wildlab.reporting.georeferencing_sections import verdict_words
from wildlab.reporting.report import open_report

MANY = summarise(np.tile([3.0, 4.0], (50, 1)))


def model(causes, without=10.0, with_=10.0, half=0.5, undetermined=None):
    names = tuple(
        name for one in causes for name in {"boresight": ("tilt",), "height": ("down",)}.get(one, (one,))
    )
    gain = without - with_
    return SimpleNamespace(
        causes=tuple(causes), name=" and ".join(causes) or "nothing",
        fit=SimpleNamespace(names=names, undetermined=undetermined or {}),
        gain=Gain(without, with_, Interval(gain, gain - half, gain + half)),
        held=np.zeros((4, 2)), chance=0.0,
        gain_of_all=Gain(without, with_, Interval(gain, gain - 20.0, gain + 20.0)),
    )  # fmt: skip


def diagnosis(winner, *others, outliers=(), alike=(), rivals=(), out=0):
    """A diagnosis whose winner is given; its properties are those of the real one."""
    models = (model(()), winner, *others) if winner.causes else (winner, *others)
    place = models.index(winner)
    ranked = SimpleNamespace(
        winner=place, rivals=tuple(models.index(one) for one in rivals),
        scores=np.array([one.gain.with_ for one in models]),
    )  # fmt: skip
    names = winner.fit.names
    told = Calibration(names, np.ones(len(names)), 0.01 * np.eye(len(names)), {}, 4, 4, 10)
    scored = pd.DataFrame({"frame_id": np.arange(20)})
    return Diagnosis(scored, np.zeros(20, int), models, ranked, told, alike, outliers, np.arange(20) >= out)


def ellipses(word, factor=1.0, low=0.9, high=1.1):
    return EllipseVerdict(word, Interval(0.9, 0.0, 1.0), Interval(factor, low, high), 0.9, 50)


def calibration(names, values, sd=0.1):
    return Calibration(tuple(names), np.array(values), sd**2 * np.eye(len(names)), {}, 40, 20, 10)


MOST = model(["boresight"], with_=2.0)
PART = model(["boresight"], with_=7.0)
LITTLE = model(["boresight"], with_=9.4)
UNSURE = model(["boresight"], with_=7.0, half=4.0)
SLIGHT = model(["boresight"], with_=9.4, half=2.0)
NOTHING = model(())
FAR = Outlier("mark", "", "M7", 8, 25.0)


@pytest.mark.parametrize(
    ("winner", "word"),
    [
        (MOST, "Most"),
        (PART, "Part"),
        (LITTLE, "small"),
        (UNSURE, "possible"),
        (SLIGHT, "No"),
        (NOTHING, "No"),
    ],
)
def test_the_cause_is_named_by_its_measured_gain_alone(winner, word):
    said = cause.cause_sentence(diagnosis(winner, model(["height"])))
    assert [one for one in ("Most", "Part", "small", "possible", "No") if one in said] == [word]


def test_a_cause_that_another_explains_as_well_does_not_count():
    """A tilt of a camera that looks down and a clock that is off move points alike."""
    rival, both = model(["clock"], with_=2.1), model(["clock", "height"], with_=2.0)
    found = diagnosis(MOST, rival, both, rivals=(rival, both))
    assert not found.counts and found.inseparable == ("boresight", "clock", "height")
    assert cause.simplest_rivals(found) == [("clock",)]


def test_what_is_not_told_from_zero_is_not_blamed():
    found = diagnosis(model(["height", "boresight", "clock"], with_=1.3))
    names = ("down", "tilt", "clock")
    for values, blamed in (
        ((0.1, 1.0, -1.0), ("boresight", "clock")),
        ((1.0, 1.0, -1.0), ("height", "boresight", "clock")),
        ((0.1, 0.1, -0.1), ("height", "boresight", "clock")),
    ):
        assert cause.causes_told(replace(found, calibration=calibration(names, values))) == blamed


@pytest.mark.parametrize("high", [0.5, -0.1])
def test_numbers_alone_name_the_same(high):
    """The overview, the front page and the copies for others read the recorded numbers."""
    numbers = {("down_offset", "calibration"): {"value": -1.1, "low": -2.7, "high": high},
               ("clock_offset", "calibration"): {"value": 1.6, "low": 1.5, "high": 1.7}}  # fmt: skip
    assert causes_told(numbers) == ("height", "camera's clock")[high > 0 :]
    assert set(causes_told(numbers)) <= set(CAUSES)


@pytest.mark.parametrize(
    ("lost", "word", "found", "level"),
    [
        (0, "honest", NOTHING, "good"),
        (0, "honest", LITTLE, "good"),
        (0, "honest", UNSURE, "warn"),
        (0, "honest", SLIGHT, "warn"),
        (0, "honest", PART, "warn"),
        (0, "too small", NOTHING, "warn"),
        (13, "honest", NOTHING, "bad"),
        (10, "honest", NOTHING, "good"),
    ],
)
def test_the_colour_of_the_verdict(lost, word, found, level):
    size = (1.3, 1.1, 1.5) if word == "too small" else (1.0, 0.9, 1.1)
    assert verdict_words(MANY, lost, ellipses(word, *size), diagnosis(found))[0].colour == level
    assert verdict_words(summarise(np.empty((0, 2))), 5, ellipses(word), None)[0].colour == "bad"


def test_no_flight_is_good_whose_cause_nobody_could_look_for():
    """Twelve points of one image: neither cause nor ellipses are judged."""
    assert verdict_words(MANY, 0, ellipses("too few"), None)[0].colour == "neutral"


def test_logs_that_contradict_each_other_are_a_problem_and_a_warning_is_none():
    given = (MANY, 0, ellipses("honest"), diagnosis(NOTHING))
    assert verdict_words(*given, ["warning: a"])[0].colour == "good"
    assert verdict_words(*given, ["problem: a"])[0].colour == "bad"


def test_a_cause_that_is_not_certain_is_in_no_figure_of_what_is_far_out():
    """Its held-out errors are zero here, those of the poses as logged are five metres."""
    found = diagnosis(UNSURE, outliers=(FAR,))
    found.models[0].held = np.tile([3.0, 4.0], (4, 1))
    assert found.held_summary().mean == found.held_summary(np.arange(4) < 2).mean == 5.0
    assert diagnosis(PART).held_summary().mean == 0.0


def test_leaving_out_what_is_far_out_gains_what_the_mean_loses():
    found = diagnosis(model(()), outliers=(FAR,), out=5)
    found.models[0].held = np.where(np.arange(20)[:, None] < 5, [3.0, 4.0], [0.6, 0.8])
    evidence = cause.evidence_of(MANY, 0, ellipses("honest"), found)
    assert evidence.gain == pytest.approx(1 - 1.0 / 2.0) and evidence.troubled == 1


def test_a_gain_without_a_parameter_told_from_zero_is_not_certain():
    sure = diagnosis(MOST)
    assert sure.counts
    assert not replace(sure, calibration=replace(sure.calibration, covariance=np.eye(1))).counts


def test_no_cause_is_certain_where_a_third_is_far_out():
    assert diagnosis(MOST, out=5).counts and not diagnosis(MOST, out=6).counts


def test_outliers_are_counted_with_the_figures_without_them():
    without = summarise(np.tile([0.6, 0.8], (41, 1)))
    said = left.outliers_sentence((FAR, FAR), MANY, without)
    assert "9 of 50" in said and said.index("1.0 m") < said.index("5.0 m")
    assert left.outliers_table((FAR,))["photo"].tolist() == ["several"]


def test_what_is_left_is_sorted_and_in_one_unit():
    image, within = np.array([0.6, 0.8]), np.array([3.0, 4.0])
    parts = left.remaining_parts(Scatter(0.1, 0.3, 0.6, image, within, np.array([1.2, 1.6]), 5.6))
    assert [size in one for size, one in zip(("5.0 m", "2.0 m", "1.0 m"), parts, strict=True)] == [True] * 3
    nan = np.full(2, np.nan)
    assert left.remaining_parts(Scatter(np.nan, np.nan, np.nan, nan, nan, nan, np.nan)) == []


def test_an_axis_is_constant_by_its_interval():
    one, other = Interval(3.0, 2.0, 4.0), Interval(1.0, -1.0, 3.0)
    table = cause.axes_table({"north": AlongAxis(one, 0.5, 9), "east": AlongAxis(other, 0.1, 9)})
    assert [one == "lasting" for one in table["verdict"]] == [True, False]
    assert table["share"].tolist() == [50.0, 10.0]


def test_parameters_are_called_different_from_zero_by_their_interval():
    report = open_report(study="made-up", kind="twin")
    covariance = np.diag([1e-4, 1.0])
    found = Calibration(("tilt", "north"), np.array([np.radians(-5.0), 1.5]), covariance, {}, 40, 20, 10)
    table = cause.parameters_table(report, found)
    assert [one == "differs from zero" for one in table["verdict"]] == [True, False]
    # Student's with nine degrees of freedom, not the 1.96 of many draws.
    assert report.recorded["north_offset", "calibration"]["low"] == pytest.approx(1.5 - 2.262, abs=1e-3)
    assert report.recorded["boresight_tilt", "calibration"]["value"] == pytest.approx(-5.0)


@pytest.mark.parametrize("gain", [0.2, 0.49, 0.51, 3.0])
@pytest.mark.parametrize("half", [0.01, 4.0])
def test_the_parts_of_a_flight_come_to_the_same_verdict(gain, half):
    """The overview knows the numbers alone, the report on the georeferencing all of it: one rule for both."""
    found = diagnosis(model(["boresight"], 5.0, 5.0 - gain, half))
    numbers = {("gain", "winner"): {"value": gain, "low": gain - half, "high": gain + half},
               ("horizontal_error_mean", "logged-pose"): {"value": MANY.mean}}  # fmt: skip
    if found.counts:
        numbers["horizontal_error_mean", "calibrated-pose"] = {"value": 5.0 - gain}
    ours, _ = verdict_words(MANY, 0, ellipses("honest"), found)
    worth = sum(one.share >= WORTH for one in gains_of(SimpleNamespace(lost=()), numbers))
    whole = Evidence(gain=WORTH * worth, troubled=int(possible_gain(numbers) is not None), judged=1)
    assert verdict_of(whole) == ours
