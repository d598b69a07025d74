"""Every sentence on the cause follows from its numbers: where it would be false it does not stand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from wildlab.evaluation.axes import AlongAxis
from wildlab.evaluation.blocks import Halves, Neighbours
from wildlab.evaluation.causes import Gain
from wildlab.evaluation.ellipses import EllipseVerdict
from wildlab.evaluation.errors import Scatter, summarise
from wildlab.evaluation.outliers import Outlier
from wildlab.evaluation.runs import Interval
from wildlab.evaluation.sightings import Averaged
from wildlab.geometry.calibration import Calibration
from wildlab.pipeline.diagnosis import Diagnosis
from wildlab.pipeline.overviews.verdict import WORTH, Evidence, verdict_of
from wildlab.pipeline.overviews.worth_fixing import gains_of, possible_gain
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


def verdict(word, factor=1.0, low=0.9, high=1.1, coverage=0.9):
    return EllipseVerdict(word, Interval(coverage, 0.0, 1.0), Interval(factor, low, high), 0.9, 50)


MOST = model(["boresight"], with_=2.0)
PART = model(["boresight"], with_=7.0)
LITTLE = model(["boresight"], with_=9.4)
UNSURE = model(["boresight"], with_=7.0, half=4.0)
SLIGHT = model(["boresight"], with_=9.4, half=2.0)
NOTHING = model(())


@pytest.mark.parametrize(
    ("winner", "words"),
    [
        (MOST, "Most of it is a constant error of the boresight"),
        (PART, "Part of it is a constant error of the boresight"),
        (LITTLE, "is certain and small"),
        (UNSURE, "is possible, not certain"),
        (SLIGHT, "No constant error is certain to explain it. The nearest is one of the boresight"),
        (NOTHING, "No constant error is certain: taking one off"),
    ],
)
def test_the_cause_is_named_by_its_measured_gain_alone(winner, words):
    said = cause.cause_sentence(diagnosis(winner, model(["height"])))
    assert words in said
    others = {
        "Most of it",
        "Part of it",
        "certain and small",
        "possible, not certain",
        "No constant error is certain",
    }
    assert sum(one in said for one in others) == 1
    assert "No calibration" not in said
    if winner.causes:
        assert f"to {winner.gain.with_:.1f}" in said


def test_a_cause_that_another_explains_as_well_is_not_named_alone():
    """A tilt of a camera that looks down and a clock that is off move points alike."""
    rival, both = model(["clock"], with_=2.1), model(["clock", "height"], with_=2.0)
    found = diagnosis(MOST, rival, both, rivals=(rival, both))
    said = cause.cause_sentence(found)
    assert "of the boresight (how the camera sits on the airframe) or, explaining it as well, of the " in said
    assert "camera's clock is possible, not certain: with the first" in said and "height" not in said
    assert not found.counts and found.inseparable == ("boresight", "clock", "height")
    assert "which of these it is" in cause.advice(found, True) and "calibrate" not in cause.advice(
        found, True
    )
    assert "with it taken off" in cause.cause_sentence(diagnosis(MOST))


def test_what_was_tried_is_listed_where_nothing_was_found():
    said = cause.cause_sentence(diagnosis(NOTHING, model(["height"]), model(["clock"])))
    assert "camera's clock or height" in said and "lens" not in said


def test_nothing_is_not_said_to_gain_nothing_where_something_does():
    some = cause.cause_sentence(diagnosis(NOTHING, model(["height"], with_=9.0)))
    assert "the height taken off gains 0.50 to 1.50 m" in some and "gains nothing" not in some
    none = cause.cause_sentence(diagnosis(NOTHING, model(["height"], with_=9.0, half=2.0)))
    assert "gains nothing for certain" in none and "stands out" not in none


def test_a_number_without_a_unit_stands_alone():
    found = Calibration(("radial",), np.array([0.1]), np.array([[4e-6]]), {}, 40, 20, 10)
    assert "radial distortion k1 +0.100 (+0.095 to +0.105)." in cause.size_sentence(found, True)


def test_sizes_are_stated_only_where_the_interval_leaves_zero_out():
    found = Calibration(
        ("tilt", "clock"), np.array([np.radians(-5.0), 0.1]), np.diag([1e-6, 1.0]), {}, 40, 20, 10
    )
    said = cause.size_sentence(found, True)
    assert cause.size_sentence(found, False).startswith("Not to be added unless another flight")
    assert "camera's tilt -5.00 °" in said and "clock" not in said
    assert (
        cause.size_sentence(Calibration(("clock",), np.array([0.1]), np.eye(1), {}, 40, 20, 10), True) == ""
    )


FAR = Outlier("mark", "", "M7", 8, 25.0)
CLICK = Outlier("click", "P1", "M7", 1, 25.0)


@pytest.mark.parametrize(
    ("found", "here", "words"),
    [
        (diagnosis(MOST), True, "wildlab calibrate"),
        (diagnosis(MOST), False, "does not hold for this flight"),
        (diagnosis(LITTLE), True, "hardly matters"),
        (diagnosis(NOTHING), True, None),
        (diagnosis(UNSURE), True, None),
        (diagnosis(NOTHING, outliers=(FAR,)), True, "Look at mark M7 first: it is 25.0 m off"),
        (diagnosis(NOTHING, outliers=(FAR._replace(kind="photo", photo="P3"),)), True, "Look at photo P3"),
        (diagnosis(NOTHING, outliers=(CLICK,)), True, None),
    ],
)
def test_advice_follows_from_gain_and_outliers(found, here, words):
    said = cause.advice(found, here)
    assert (words in said) if words else said == ""
    every = ("wildlab calibrate", "does not hold", "hardly matters", "Look at")
    assert sum(one in said for one in every) == (words is not None)


def test_lost_points_have_their_denominator():
    assert cause.lost_sentence(0, 50) == ""
    few, many, every = (cause.lost_sentence(lost, 50) for lost in (5, 11, 50))
    assert "5 of 50 points (10 %)" in few and "in no figure below" in few and "too many" not in few
    assert "11 of 50" in many and "too many to trust" in many and "None" not in many
    assert every.startswith("None of the 50 points") and "too many" not in every


@pytest.mark.parametrize(
    ("lost", "ellipses", "found", "level"),
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
def test_the_colour_of_the_verdict(lost, ellipses, found, level):
    size = Interval(1.3, 1.1, 1.5) if ellipses == "too small" else Interval(1.0, 0.9, 1.1)
    assert verdict_words(MANY, lost, verdict(ellipses, *size), diagnosis(found))[0].colour == level
    assert verdict_words(summarise(np.empty((0, 2))), 5, verdict(ellipses), None)[0].colour == "bad"


def test_no_flight_is_good_whose_cause_nobody_could_look_for():
    """Twelve points of one image: neither cause nor ellipses are judged."""
    assert verdict_words(MANY, 0, verdict("too few"), None)[0].colour == "neutral"


def test_a_cause_that_is_not_certain_is_in_no_figure_of_what_is_far_out():
    """Its held-out errors are zero here, those of the poses as logged are five metres."""
    found = diagnosis(UNSURE, outliers=(FAR,))
    found.models[0].held = np.tile([3.0, 4.0], (4, 1))
    assert found.held_summary().mean == found.held_summary(np.arange(4) < 2).mean == 5.0
    assert diagnosis(PART).held_summary().mean == 0.0


def test_what_cannot_be_told_apart_is_said_of_the_winner():
    rival = model(["height"], with_=2.0)
    said = cause.alike_sentences(
        diagnosis(MOST, rival, alike=(("boresight", "lens"), ("position", "clock")), rivals=(rival,))
    )
    assert len(said) == 2
    assert "Explains it as well: the height" in said[0]
    assert "cannot tell the boresight" in said[1] and "lens" in said[1]
    assert cause.alike_sentences(diagnosis(MOST)) == []
    lost = model(["boresight"], with_=2.0, undetermined={"pan": ("tilt",), "roll": ()})
    said = cause.alike_sentences(diagnosis(lost))
    assert "cannot tell the camera's pan from the camera's tilt" in said[0]
    assert "camera's roll of 3 ° would not show" in said[1]
    # What a cause that did not win has lost says nothing.
    assert cause.alike_sentences(diagnosis(MOST, model(["height"], undetermined={"down": ()}))) == []


def test_a_gain_without_a_parameter_told_from_zero_is_not_certain():
    sure = diagnosis(MOST)
    assert sure.counts
    unsure = replace(sure, calibration=replace(sure.calibration, covariance=np.eye(1)))
    assert not unsure.counts and "is possible, not certain" in cause.cause_sentence(unsure)


def test_images_that_stay_wrong_alike_are_said_to():
    said = cause.neighbours_sentence(Neighbours(0.6, 40))
    assert "correlation 0.60 of 40 images" in said and "this flight alone" in said
    assert cause.neighbours_sentence(Neighbours(0.1, 40)) == ""
    assert cause.neighbours_sentence(Neighbours(float("nan"), 3)) == ""


def test_halves_are_mentioned_only_where_they_disagree():
    assert left.halves_sentence(Halves(2.0, 2.2, Interval(0.2, -0.5, 0.9))) == ""
    said = left.halves_sentence(Halves(2.0, 6.0, Interval(4.0, 3.0, 5.0)))
    assert "2.0 m in the first and 6.0 m in the second" in said


@pytest.mark.parametrize(
    ("averaged", "inside", "outside"),
    [
        (None, "", "Averaging"),
        (Averaged(4, 4.0, 2.0, Interval(0.5, 0.4, 0.6), 9), "which halves it", "no certain gain"),
        (Averaged(4, 4.0, 3.0, Interval(0.75, 0.6, 0.9), 9), "from 4.0 m to 3.0 m", "halves"),
        (Averaged(4, 4.0, 3.9, Interval(0.98, 0.8, 1.2), 9), "no certain gain", "halves"),
    ],
)
def test_averaging_is_said_where_it_was_tried(averaged, inside, outside):
    said = left.averaging_sentence(averaged)
    assert inside in said and outside not in said


@pytest.mark.parametrize(
    ("found", "inside"),
    [
        (verdict("honest"), "**Honest**"),
        (verdict("too small", 3.0, 2.5, 3.5, 0.2), "do not use these ellipses"),
        (verdict("too large", 0.5, 0.4, 0.6, 1.0), "**Too large**"),
        (verdict("undecided", 1.0, 0.5, 2.0), "**Not decided**"),
        (verdict("too few", 1.0, float("nan"), float("nan")), "**Too few images to tell**"),
    ],
)
def test_ellipses_get_one_verdict(found, inside):
    said = left.ellipse_sentence(found)
    assert inside in said
    every = (
        "**Honest**",
        "**Nearly honest**",
        "**Too small**",
        "**Too large**",
        "**Not decided**",
        "**Too few",
    )
    assert sum(one in said for one in every) == 1
    if found.word == "too small":
        assert "3.0 times as long (2.5 to 3.5)" in said


def test_what_the_nearest_mark_hides():
    said = " ".join(left.nearest_sentences(0.3, 10.0, 9.0))
    assert "30 %" in said and "10.0 m" in said and "may be larger" in said
    said = " ".join(left.nearest_sentences(0.0, 10.0, 1.0))
    assert "ambiguous" not in said and "may be larger" not in said


def test_a_cause_that_hangs_on_ambiguous_clicks_is_said_to():
    assert cause.ambiguity_sentence(diagnosis(MOST), None) == ""
    assert cause.ambiguity_sentence(diagnosis(MOST), diagnosis(PART)) == ""
    said = cause.ambiguity_sentence(diagnosis(MOST), diagnosis(NOTHING))
    assert "'nothing'" in said and "before you correct" in said


def test_outliers_are_counted_by_kind_with_the_figures_without_them():
    without = summarise(np.tile([0.6, 0.8], (41, 1)))
    said = left.outliers_sentence((FAR, CLICK), MANY, without)
    assert said.startswith("1 mark and 1 click are far out")
    assert "9 of 50 points" in said and "1.0 m in place of 5.0 m" in said
    assert left.outliers_sentence((FAR,), MANY, without).startswith("1 mark is far out")
    table = left.outliers_table((FAR, CLICK))
    assert table["photo"].tolist() == ["several", "P1"]


def test_a_gain_says_what_it_leaves_out_and_what_it_is_with_that():
    said = cause.cause_sentence(diagnosis(MOST, out=3))
    assert "(gain 7.5 to 8.5 m; without the 3 points that are far out, with them -12.00 to 28.00 m)" in said
    assert "far out" not in cause.cause_sentence(diagnosis(MOST))


def test_no_cause_is_certain_where_a_third_is_far_out():
    found = diagnosis(MOST, out=6)
    assert diagnosis(MOST, out=5).counts and not found.counts
    assert cause.cause_sentence(found).startswith("No cause is certain: 6 of 20 points are far out")


def test_what_is_left_is_sorted_and_in_one_unit():
    image, within = np.array([0.6, 0.8]), np.array([3.0, 4.0])
    scatter = Scatter(0.1, 0.3, 0.6, image, within, np.array([1.2, 1.6]), 5.6)
    parts = left.remaining_parts(scatter)
    assert ["Single" in parts[0], "all images" in parts[1], "pose" in parts[2]] == [True] * 3
    assert ["5.0 m" in parts[0], "2.0 m" in parts[1], "1.0 m" in parts[2]] == [True] * 3
    said = left.remaining_sentence(scatter, ("height",))
    assert "5.6 m (root mean square) with the height taken off" in said
    assert "taken off" not in left.remaining_sentence(scatter, ())
    assert "%" not in " ".join([said, *parts])
    assert not any(word in " ".join(parts) for word in ("halve", "calibration", "flown"))
    nan = np.full(2, np.nan)
    unknown = Scatter(np.nan, np.nan, np.nan, nan, nan, nan, np.nan)
    assert left.remaining_parts(unknown) == [] and left.remaining_sentence(unknown, ()) == ""


def test_an_axis_is_constant_by_its_interval():
    table = cause.axes_table(
        {
            "north": AlongAxis(Interval(3.0, 2.0, 4.0), 0.5, 9),
            "east": AlongAxis(Interval(1.0, -1.0, 3.0), 0.1, 9),
        }
    )
    assert table["verdict"].tolist() == ["constant", "not told from zero"]


def test_the_table_of_models_shows_nothing_and_the_winner():
    others = [model([f"clock{i}"], with_=3.0 + i) for i in range(12)]
    table = cause.models_table(diagnosis(MOST, *others))
    assert table["what"].iloc[0] == "**boresight**"
    assert "nothing" in table["what"].tolist()
    assert len(table) == cause.SHOWN + 1


def test_parameters_are_called_different_from_zero_by_their_interval():
    report = open_report(study="made-up", kind="twin")
    covariance = np.diag([1e-4, 1.0])
    found = Calibration(("tilt", "north"), np.array([np.radians(-5.0), 1.5]), covariance, {}, 40, 20, 10)
    table = cause.parameters_table(report, found)
    assert table["verdict"].tolist() == ["differs from zero", "not told from zero"]
    assert table["what"].tolist() == ["camera's tilt (deg)", "position, north (m)"]
    # Student's with nine degrees of freedom, not the 1.96 of many draws.
    assert report.recorded["north_offset", "calibration"]["low"] == pytest.approx(1.5 - 2.262, abs=1e-3)
    assert report.recorded["boresight_tilt", "calibration"]["value"] == pytest.approx(-5.0)


def test_a_flight_that_contradicts_itself_is_said_only_where_a_problem_says_so():
    assert cause.amiss_sentence([]) == "" == cause.amiss_sentence(["warning: nav: a. Do b."])
    assert "one thing does not fit" in cause.amiss_sentence(["problem: nav: a. Do b.", "warning: c: d. E."])
    assert "2 things do not fit" in cause.amiss_sentence(["problem: a: b. C."] * 2)


@pytest.mark.parametrize("gain", [0.2, 0.49, 0.51, 3.0])
@pytest.mark.parametrize("half", [0.01, 4.0])
def test_the_parts_of_a_flight_come_to_the_same_verdict(gain, half):
    """The overview knows the numbers alone, the report on the georeferencing all of it: one rule for both."""
    found = diagnosis(model(["boresight"], 5.0, 5.0 - gain, half))
    numbers = {("gain", "winner"): {"value": gain, "low": gain - half, "high": gain + half},
               ("horizontal_error_mean", "logged-pose"): {"value": MANY.mean}}  # fmt: skip
    if found.counts:
        numbers["horizontal_error_mean", "calibrated-pose"] = {"value": 5.0 - gain}
    ours, reason = verdict_words(MANY, 0, verdict("honest"), found)
    worth = sum(one.share >= WORTH for one in gains_of(SimpleNamespace(lost=()), numbers))
    whole = Evidence(gain=WORTH * worth, troubled=int(possible_gain(numbers) is not None), judged=1)
    assert verdict_of(whole) == ours
    assert ("may gain" in reason) == (possible_gain(numbers) is not None)
