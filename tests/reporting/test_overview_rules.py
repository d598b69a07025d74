"""What the overview of a flight says turns with its numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wildlab.analysis.overview import (
    APART_M,
    APART_SD,
    APART_SHARE,
    JUMP,
    JUMP_M,
    LEANT_DEG,
    Alarm,
    Issue,
)
from wildlab.analysis.verdict import LISTED, WORTH, Gain, Verdict
from wildlab.evaluation.streams import FINE, FLOOR_HZ, HARMFUL
from wildlab.flight.clocks import MAX_GAP_S, USUAL_STEPS
from wildlab.messages.catalogue import load_texts
from wildlab.reporting import overview as page
from wildlab.reporting.overview import Judged

TEXTS = load_texts("overview").answers
#: What may be lost: the keys of `wildlab.analysis.overview.lost_data`.
LOST = (
    "images_without_pose",
    "images_without_gimbal",
    "detections_off_ground",
    "detections_without_truth",
    "time_without_poses",
    "time_without_satellites",
    "time_without_inertial",
    "inertial_samples",
)


@dataclass
class Flight:
    """What the rules ask of an overview."""

    alarms: tuple[Any, ...] = ()
    troubles: tuple[Issue, ...] = ()
    length_s: float = 600.0
    streams: dict[str, Any] = field(default_factory=lambda: {"nav": SimpleNamespace(n=9, begin=100.0)})
    path: Any = None
    above: Any = None
    flight: Any = field(default_factory=lambda: SimpleNamespace(terrain=None))


def gain(key: str = "cause", share: float = 0.4, causes: tuple[str, ...] = ("boresight",)) -> Gain:
    return Gain(key, causes, 2.0, 5.0, share)


def alarm(what: str, often: int = 3) -> Alarm:
    return Alarm(what, often, 130.0, 6.72, 0.2)


def judged(verdict: Verdict, **more: Any) -> Judged:
    return Judged(
        more.pop("overview", Flight()), more.pop("gains", ()), more.pop("problems", 0), verdict, **more
    )


LASTING = Flight(troubles=(Issue("no poses", np.array([[0.0, 60.0]])),))
UNMEASURED = "opening-unmeasured"
CASES = [
    (judged(Verdict.SOUND, error=3.0), ["opening"]),
    (judged(Verdict.SOUND), [UNMEASURED]),
    (judged(Verdict.SOUND, gains=[gain(share=0.05)], error=3.0), ["opening", "gain-cause"]),
    (judged(Verdict.UNJUDGED), [UNMEASURED]),
    (judged(Verdict.FIX, gains=[gain(share=0.05), gain("far_out")]), [UNMEASURED, "gain-outliers"]),
    (judged(Verdict.ALARM, overview=Flight((alarm("leans"), alarm("jumps")))), [UNMEASURED, "alarm-leans"]),
    (judged(Verdict.MEND, problems=2), [UNMEASURED, "problems"]),
    (judged(Verdict.LOOK, overview=LASTING), [UNMEASURED, "issue"]),
    (judged(Verdict.LOOK, possible=gain(share=0.2), doubts=("tracking",)), [UNMEASURED, "possible"]),
    (judged(Verdict.LOOK, doubts=("tracking",), error=3.0), ["opening", "doubts"]),
]


@pytest.mark.parametrize(("found", "keys"), CASES)
def test_the_most_pressing_is_said_first(found, keys):
    assert [one.key for one in page.answer(found)] == keys


OUT, CAUSE = gain("far_out", 0.5, ()), gain(share=0.3, causes=("clock",))


@pytest.mark.parametrize(
    ("found", "keys"),
    [
        (judged(Verdict.FIX, gains=[CAUSE, OUT]), ["gain-outliers-remedy", "gain-cause-remedy"]),
        # What is far out may be turns under a clock that is wrong.
        (judged(Verdict.MEND, gains=[OUT, CAUSE], problems=1), ["problems-remedy", "gain-cause-remedy"]),
        (judged(Verdict.LOOK, gains=[OUT], possible=gain(share=0.2)), ["possible-remedy"]),
    ],
)
def test_outliers_are_no_advice_where_what_they_are_of_is_open(found, keys):
    assert [one.key for one in page.advice(found)] == keys


@pytest.mark.parametrize("found", [found for found, keys in CASES if len(keys) > 1])
def test_whatever_is_pressing_has_advice(found):
    assert page.advice(found)
    # A short spell of few satellites on a sound flight is none.
    assert not page.advice(judged(Verdict.SOUND, overview=LASTING))


COUNTS = {"worth": 0, "troubled": 0}


@pytest.mark.parametrize(
    ("found", "counts", "key"),
    [
        (CASES[5][0], {}, "reason-alarms"),
        (CASES[6][0], {"worth": 1}, "reason-problems"),
        (judged(Verdict.FIX), {"worth": 1, "troubled": 1}, "reason-worth"),
        (judged(Verdict.LOOK, doubts=("tracking",)), {"troubled": 1}, "reason-doubts"),
        (judged(Verdict.LOOK), {"troubled": 1}, "reason-troubled"),
        (judged(Verdict.UNJUDGED, judged=1), {}, "reason-unjudged"),
        (judged(Verdict.SOUND, judged=2), {}, "reason-sound"),
    ],
)
def test_the_reason_is_the_most_pressing_count(found, counts, key):
    assert page.reason(found, COUNTS | counts).key == key


def test_every_sentence_has_its_words_and_every_word_its_sentence():
    said = [one for found, _ in CASES for one in page.answer(found)]
    said += [
        page.alarm_message(alarm(what, n), Flight()) for what in ("jumps", "apart", "shakes") for n in (1, 2)
    ]
    said += [page.issue_message(Issue("position jumps", np.array([[5.0, 5.0]])), LASTING)]
    gains = [gain(), gain("far_out", causes=()), *(gain(key, causes=()) for key in LOST)]
    said += [page.gain_message(one) for one in gains]
    said += [one for each in gains for one in page.advice(judged(Verdict.MEND, gains=[each]))]
    said += [one for found, _ in CASES for one in page.advice(found)]
    said += [
        one
        for what in ("jumps", "apart", "shakes")
        for one in page.advice(judged(Verdict.ALARM, overview=Flight((alarm(what),))))
    ]
    said += page.advice(judged(Verdict.LOOK, overview=Flight(troubles=LASTING.troubles, length_s=np.nan)))
    for one in said:
        assert set(re.findall(r"{(\w+)}", TEXTS[one.key])) <= set(one.values), one.key
    rest = set(TEXTS) - {one.key for one in said}
    assert all(key.startswith(("reason-", "limit-")) for key in rest), rest


def test_the_method_names_the_constants_that_are_used():
    said = [float(one) for one in re.findall(r"[\d.]*\d", load_texts("overview").method)]
    assert said == [
        *(MAX_GAP_S, USUAL_STEPS, JUMP, JUMP_M, LEANT_DEG, HARMFUL, APART_M, APART_SD, 100 * APART_SHARE),
        *(FLOOR_HZ, FINE, HARMFUL, 100 * LISTED, 100 * WORTH),
    ]
