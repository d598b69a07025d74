"""What is named as a cause follows from its measured gain, and the verdict from gain, losses and ellipses."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from wildlab.analysis.diagnose import Diagnosis
from wildlab.analysis.verdict import (
    WORTH,
    Evidence,
    gains_of,
    possible_gain,
    verdict_of,
)
from wildlab.evaluation.causes import Gain
from wildlab.evaluation.ellipses import EllipseVerdict
from wildlab.evaluation.errors import summarise
from wildlab.evaluation.intervals import Interval
from wildlab.evaluation.outliers import Outlier
from wildlab.geometry.corrections import Calibration
from wildlab.messages.catalogue import load_texts
from wildlab.reporting import georeferencing as page
from wildlab.reporting import georeferencing as tables
from wildlab.reporting.report import open_report

MEAN = 5.0


def accuracy(points=50, lost=0, word="honest", size=(), found=None):
    """Points that are all 5 m off, and what else a verdict follows from."""
    summary = summarise(np.tile([3.0, 4.0], (points, 1)))
    scored = pd.DataFrame({"best_truth": np.ones(points + lost, bool)})
    return SimpleNamespace(
        summary=summary, lost=lost, ellipses=ellipses(word, *size), diagnosis=found, scored=scored
    )


def model(causes, without=10.0, with_=10.0, half=0.5, undetermined=None):
    names = tuple(
        name for one in causes for name in {"boresight": ("tilt",), "height": ("down",)}.get(one, (one,))
    )
    gain = without - with_
    return SimpleNamespace(
        causes=tuple(causes), name=" and ".join(causes) or "nothing",
        fit=SimpleNamespace(names=names, undetermined=undetermined or {}),
        gain=Gain(without, with_, Interval(gain, gain - half, gain + half)),
        held=np.zeros((20, 2)), chance=0.0,
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
    scored = pd.DataFrame({"frame_id": np.arange(20), "best_truth": True})
    return Diagnosis(
        scored, np.zeros(20, int), models, ranked, told, alike, outliers, np.arange(20) >= out, (), None
    )


def ellipses(word, factor=1.0, low=0.9, high=1.1):
    return EllipseVerdict(word, Interval(0.9, 0.0, 1.0), Interval(factor, low, high), 50)


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
    ("winner", "key"),
    [
        (MOST, "cause-most"),
        (PART, "cause-part"),
        (LITTLE, "cause-small"),
        (UNSURE, "cause-possible"),
        (SLIGHT, "cause-none"),
        (NOTHING, "cause-none"),
    ],
)
def test_the_cause_is_named_by_its_measured_gain_alone(winner, key):
    assert page.cause_message(diagnosis(winner, model(["height"]))).key == key


def test_no_cause_is_named_where_nobody_could_look_or_too_many_are_outliers():
    assert page.cause_message(None).key == "cause-untried"
    many = page.cause_message(diagnosis(MOST, out=6))
    assert many.key == "cause-outliers" and many.values == {"out": 6, "points": 20}


def test_a_cause_that_another_explains_as_well_does_not_count():
    """A tilt of a camera that looks down and a clock that is off move points alike."""
    rival, both = model(["clock"], with_=2.1), model(["clock", "height"], with_=2.0)
    found = diagnosis(MOST, rival, both, rivals=(rival, both))
    assert not found.counts and found.inseparable == ("boresight", "clock", "height")
    assert page.cause_message(found).key == "cause-inseparable"
    assert page.cause_message(found).values["others"] == page.words_of_causes(["clock"])
    # Two of the same causes are one.
    other = model(["clock"], with_=2.2)
    assert page.cause_message(diagnosis(MOST, rival, other, rivals=(rival, other))).values["others"] == (
        page.words_of_causes(["clock"])
    )
    # The table has every model that the sentence names, however many are likelier.
    likelier = [model([f"c{k}"], with_=1.0 + 0.01 * k) for k in range(tables.SHOWN)]
    shown = tables.models_table(diagnosis(MOST, *likelier, rival, both, rivals=(rival, both)))
    assert shown["what"].tolist()[tables.SHOWN :] == ["**boresight**", "clock", "nothing"]


def test_what_every_rival_holds_is_certain_and_the_rest_is_open():
    winner = model(["boresight", "clock"], with_=2.0)
    holding = [model(["height", "clock"], with_=2.1), model(["clock", "lens"], with_=2.2)]
    found = diagnosis(winner, *holding, rivals=holding)
    assert not found.counts and found.certain == ("clock",)
    said = page.cause_message(found)
    assert said.key == "cause-common"
    assert [said.values[name] for name in ("common", "causes", "others")] == [
        page.words_of_causes(["clock"]),
        page.words_of_causes(["boresight"]),
        " or ".join(page.words_of_causes([one]) for one in ("height", "lens")),
    ]
    # One rival without it, or a gain that is not certain, leave it open, too.
    without = model(["height", "heading"], with_=2.1)
    for open_ in (
        diagnosis(winner, *holding, without, rivals=[*holding, without]),
        diagnosis(model(["boresight", "clock"], with_=8.0, half=4.0), *holding, rivals=holding),
        replace(found, misfit=True),
    ):
        assert open_.certain == () and page.cause_message(open_).key == "cause-inseparable"


def test_what_is_not_told_from_zero_is_not_blamed():
    found = diagnosis(model(["height", "boresight", "clock"], with_=1.3))
    names = ("down", "tilt", "clock")
    for values, blamed in (
        ((0.1, 1.0, -1.0), ("boresight", "clock")),
        ((1.0, 1.0, -1.0), ("height", "boresight", "clock")),
        ((0.1, 0.1, -0.1), ("height", "boresight", "clock")),
    ):
        assert page.significant_causes(replace(found, calibration=calibration(names, values))) == blamed


@pytest.mark.parametrize(
    ("lost", "word", "found", "level"),
    [
        (0, "honest", NOTHING, "good"),
        (0, "honest", LITTLE, "good"),
        (0, "honest", UNSURE, "warn"),
        (0, "honest", PART, "warn"),
        (0, "too small", NOTHING, "warn"),
        (13, "honest", NOTHING, "bad"),
        (10, "honest", NOTHING, "good"),
    ],
)
def test_the_colour_of_the_verdict(lost, word, found, level):
    size = (1.3, 1.1, 1.5) if word == "too small" else (1.0, 0.9, 1.1)
    given = accuracy(50, lost, word, size, diagnosis(found))
    assert page.verdict_of_accuracy(given)[0].colour == level
    assert page.verdict_of_accuracy(accuracy(0, 5, word))[0].colour == "bad"


def test_logs_that_contradict_each_other_are_a_problem_and_a_warning_is_none():
    given = accuracy(found=diagnosis(NOTHING))
    assert page.verdict_of_accuracy(given, 0)[0].colour == "good"
    assert page.verdict_of_accuracy(given, 1)[0].colour == "bad"


def test_leaving_out_what_is_far_out_gains_what_the_mean_loses():
    found = diagnosis(model(()), outliers=(FAR,), out=5)
    found.models[0].held = np.where(np.arange(20)[:, None] < 5, [3.0, 4.0], [0.6, 0.8])
    evidence = page.evidence_of(accuracy(found=found))
    assert evidence.gain == pytest.approx(1 - 1.0 / 2.0) and evidence.troubled == 1


def test_a_gain_without_a_parameter_told_from_zero_is_not_certain():
    sure = diagnosis(MOST)
    assert sure.counts
    assert not replace(sure, calibration=replace(sure.calibration, covariance=np.eye(1))).counts


def test_no_cause_is_certain_where_a_third_is_far_out():
    assert diagnosis(MOST, out=5).counts and not diagnosis(MOST, out=6).counts


def test_several_photos_are_called_so():
    assert tables.outliers_table((FAR,))["photo"].tolist() == ["several"]


def test_parameters_are_called_different_from_zero_by_their_interval():
    report = open_report(study="made-up", kind="twin")
    covariance = np.diag([1e-4, 1.0])
    found = Calibration(("tilt", "north"), np.array([np.radians(-5.0), 1.5]), covariance, {}, 40, 20, 10)
    table = tables.parameters_table(report, found)
    assert table["zero"].tolist() == [False, True]
    # Student's with nine degrees of freedom, not the 1.96 of many draws.
    assert report.recorded["north_offset", "calibration"]["low"] == pytest.approx(1.5 - 2.262, abs=1e-3)
    assert report.recorded["boresight_tilt", "calibration"]["value"] == pytest.approx(-5.0)


@pytest.mark.parametrize("gain", [0.49, 0.51])
@pytest.mark.parametrize("half", [0.01, 4.0])
def test_the_parts_of_a_flight_come_to_the_same_verdict(gain, half):
    """The overview knows the numbers alone, the report on the georeferencing all of it: one rule for both."""
    found = diagnosis(model(["boresight"], 5.0, 5.0 - gain, half))
    numbers = {("gain", "winner"): {"value": gain, "low": gain - half, "high": gain + half},
               ("horizontal_error_mean", "logged-pose"): {"value": MEAN}}  # fmt: skip
    if found.counts:
        numbers["horizontal_error_mean", "calibrated-pose"] = {"value": 5.0 - gain}
    ours, _ = page.verdict_of_accuracy(accuracy(found=found))
    worth = sum(one.share >= WORTH for one in gains_of(SimpleNamespace(lost=()), numbers))
    whole = Evidence(gain=WORTH * worth, troubled=int(possible_gain(numbers) is not None), judged=1)
    assert verdict_of(whole) == ours


def found_with(points=50, lost=0, winner=NOTHING, **more):
    return accuracy(points, lost, found=more.get("diagnosis", diagnosis(winner)))


def partly_known():
    found = accuracy(50, found=diagnosis(NOTHING))
    found.best = pd.DataFrame({"truth_id": ["m1"]})
    found.by_target = pd.DataFrame({"target": ["m1", "w"], "kind": ["mark", "track"], "sd": [0.02, 3.0]})
    found.scored.loc[3, "best_truth"] = False
    return found


def test_the_best_known_truth_is_named_where_points_have_another():
    said = page.answer(partly_known())[0]
    assert said.key == "typical-best" and said.values["sd"] == "0.020 m"


@pytest.mark.parametrize(
    ("given", "keys"),
    [
        ({}, ["typical", "cause-none"]),
        ({"points": 9}, ["few-points"]),
        ({"points": 10}, ["typical", "cause-none"]),
        ({"lost": 13}, ["many-lost"]),
        ({"lost": 12}, ["typical", "cause-none"]),
        ({"points": 0, "lost": 5}, ["no-position"]),
    ],
)
def test_how_far_off_is_said_only_of_enough_points(given, keys):
    assert [one.key for one in page.answer(found_with(**given))] == keys


ALL_WINNERS = (MOST, PART, LITTLE, UNSURE, NOTHING)
ANSWERS = ({}, {"points": 9}, {"lost": 13}, {"points": 0, "lost": 5})
RIVAL = model(["clock"], with_=2.1)
ADVICE = [
    ({}, {}, []),
    ({"winner": MOST}, {}, ["advice-calibrate"]),
    ({"winner": MOST}, {"calibrated_elsewhere": True}, ["advice-recalibrate"]),
    ({"winner": LITTLE}, {}, []),
    ({"diagnosis": diagnosis(MOST, RIVAL, rivals=(RIVAL,))}, {}, ["advice-vary"]),
    ({"diagnosis": diagnosis(MOST, outliers=(FAR,))}, {}, ["advice-calibrate", "advice-outlier"]),
    ({"diagnosis": diagnosis(UNSURE, outliers=(FAR,))}, {}, []),
    ({"diagnosis": diagnosis(NOTHING, outliers=(FAR,))}, {"problems": 1}, ["advice-contradictions"]),
    ({"diagnosis": None}, {}, ["advice-more-points"]),
    ({"lost": 13}, {"problems": 1}, ["advice-contradictions", "advice-lost"]),
]


@pytest.mark.parametrize(("given", "options", "keys"), ADVICE)
def test_what_to_do_follows_from_what_was_found(given, options, keys):
    said = page.advice(found_with(**given), **{"calibrated_elsewhere": False, **options})
    assert [one.key for one in said] == keys


REASONS = [
    ((accuracy(found=diagnosis(NOTHING)),), "reason-sound"),
    ((accuracy(found=diagnosis(MOST)),), "reason-gain"),
    ((accuracy(found=diagnosis(UNSURE)),), "reason-possible"),
    ((accuracy(found=replace(diagnosis(NOTHING), misfit=True)),), "reason-misfit"),
    ((accuracy(found=diagnosis(NOTHING, outliers=(FAR,))),), "reason-outliers"),
    ((accuracy(50, 0, "too small", (1.3, 1.1, 1.5), diagnosis(NOTHING)),), "reason-ellipses"),
    ((accuracy(50, 0, "too large", (0.2, 0.1, 0.4), diagnosis(NOTHING)),), "reason-ellipses-long"),
    ((accuracy(50, 13, found=diagnosis(NOTHING)),), "reason-lost"),
    ((accuracy(found=diagnosis(NOTHING)), 2), "reason-contradictions"),
    ((accuracy(3, found=diagnosis(NOTHING)),), "reason-few"),
    ((accuracy(word="too few"),), "reason-untried"),
]


@pytest.mark.parametrize(("given", "key"), REASONS)
def test_the_most_pressing_reason_is_given(given, key):
    assert page.verdict_of_accuracy(*given)[1].key == key


def test_every_sentence_has_its_words_and_every_word_its_sentence():
    """Keys that the rules give in the tests above are those of the catalogue, with all their values."""
    said = [page.cause_message(d) for d in (None, diagnosis(MOST, out=6), *map(diagnosis, ALL_WINNERS))]
    both = model(["boresight", "clock"], with_=2.0), model(["height", "clock"], with_=2.1)
    said += [page.cause_message(diagnosis(*of, rivals=of[1:])) for of in ((MOST, RIVAL), both)]
    said += [one for given in ANSWERS for one in page.answer(found_with(**given))]
    said += page.answer(partly_known())
    for given, options, _ in ADVICE:
        said += page.advice(found_with(**given), **{"calibrated_elsewhere": False, **options})
    said += [page.verdict_of_accuracy(*given)[1] for given, _ in REASONS]
    for word in ("honest", "too small", "too large", "undecided", "too few"):
        said.append(page._ellipse_message(ellipses(word)))
    texts = load_texts("georeferencing").answers
    for one in said:
        assert set(re.findall(r"{(\w+)}", texts[one.key])) <= set(one.values), one.key
    rest = {
        key for key in set(texts) - {one.key for one in said} if not key.startswith(("limit-", "applied"))
    }
    assert not rest
