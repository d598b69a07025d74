"""The page of a run of a detector has its numbers, and stays small and harmless."""

import re
from html import unescape

import cv2
import numpy as np
import pandas as pd
import pytest

from wildlab.messages.catalogue import load_texts
from wildlab.reporting.detections import LISTED, advice, answer, detections_page, rates_shown, reason

JPEG = bytes(cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes())


def rate(estimate, low=None, high=None):
    return {"estimate": estimate, "low": low, "high": high}


def rates(found, invented, missed, *, interval=True):
    bounds = (0.1, 0.9) if interval else (None, None)
    return {
        "found": found, "invented": invented, "missed": missed, "groups": 6,
        "recall": rate(found / (found + missed), *bounds), "f1": rate(0.5, *bounds),
        "precision": rate(found / (found + invented), *bounds),
    }  # fmt: skip


def run(detections=10, usable=5, **more):
    result = {
        "method": "warm",
        "frames": {"all": usable + len(more.get("problems", [])), "usable": usable, "kept": 0},
        "detections": detections,
        "problems": [],
        "pictures": {"overlays": 1},
        "facts": [],
    }
    return result | more


def shown(result, sheets=None, overlays=(), frames=None, thresholds=None, name="images", curves=None):
    counts = [result["detections"]] + [0] * (result["frames"]["usable"] - 1)
    rows = {"frame_id": [f"f{n}.png" for n in range(len(counts))], "detections": counts, "problem": None}
    if frames is None:
        frames = pd.DataFrame(rows)
    page = detections_page(name, result, frames, sheets or {}, overlays, thresholds or {"level": 3}, curves)
    return page, re.sub(r"\s+", " ", unescape(re.sub(r"<style.*?</style>|<[^>]+>", " ", page, flags=re.S)))


def test_other_detectors_stand_beside_ours_with_their_curves():
    ours = {"name": "wildlab warm", "told": [], **rates(6, 2, 3)}
    ours |= {"average_precision": rate(0.7, 0.6, 0.8), "f1_beyond_ours": rate(0, 0, 0)}
    evil = '<script>alert("1")</script>'
    other = {"name": evil, "told": [], **rates(3, 2, 6)}
    other |= {"average_precision": None, "f1_beyond_ours": rate(-0.25, -0.4, 0.1)}
    row = {"detector": "wildlab warm", "score": 1.0, "precision": 0.9, "recall": 0.5}
    result = run(judged=rates(6, 2, 3), compared=[ours, other])
    page, words = shown(result, curves=pd.DataFrame([row, row]))
    assert "-0.25 (-0.40 to +0.10)" in words and "0.70 (0.60 to 0.80)" in words and "<script" not in page
    assert page.count("data:image/png") == 2
    without, _ = shown(result, curves=pd.DataFrame([row]).iloc[:0])
    assert without.count("data:image/png") == 1


def test_what_was_chosen_here_does_not_come_first():
    fit = {"held_out": rates(5, 5, 4), "where_chosen": rates(8, 1, 1), "defaults": rates(2, 9, 7)}
    result = run(judged=rates(8, 1, 1), fit=fit, chosen_here=True, detections=9)
    assert list(rates_shown(result).values()) == [fit["held_out"], fit["where_chosen"], fit["defaults"]]
    assert "5 of 9" in shown(result)[1]
    elsewhere = run(judged=rates(7, 1, 2), fit=fit, chosen_here=False, detections=8)
    assert len(rates_shown(elsewhere)) == 4


def test_images_that_could_not_be_used_are_listed_and_never_silent():
    problems = [[f"bad{n}.png", "it is empty"] for n in range(LISTED + 2)]
    page, words = shown(run(problems=problems))
    assert page.count("it is empty") == LISTED and "2 more" in words
    nothing = run(usable=0, detections=0, problems=problems)
    assert [one.key for one in (*answer(nothing), *advice(nothing))] == ["no-image", "advice-images"]


def test_names_are_names_and_nothing_more():
    evil = "<script>alert(1)</script>"
    result = run(problems=[[evil, evil]], judged=rates(6, 2, 2), pictures={"missed": 3, "invented": 2})
    page, _ = shown(result, {"missed": JPEG}, [(f'"{evil}', JPEG)], thresholds={evil: evil}, name=evil)
    assert "<script" not in page and page.count("data:image/jpeg") == 2


ELLIPSES = {"estimate": 0.6, "low": 0.5, "high": 0.7}
RUNS = [
    (run(judged=rates(6, 2, 3)), ["labels", "reason-judged", "advice-fit"]),
    (run(), ["not-judged", "reason-not-judged", "advice-label"]),
    (run(problems=[["a", "b"]]), ["not-judged", "reason-lost", "advice-label"]),
    (run(judged=rates(6, 0, 0), fit={"held_out": rates(5, 1, 1), "where_chosen": rates(6, 1, 1),
                                     "defaults": rates(2, 9, 7)}), ["held-out", "reason-judged"]),
    (run(judged=rates(6, 0, 0) | {"ellipse_coverage_90": ELLIPSES}),
     ["labels", "ellipses-small", "reason-judged"]),
    (run(judged=rates(6, 0, 0) | {"ellipse_coverage_90": ELLIPSES | {"low": 0.95, "high": 0.99}}),
     ["labels", "ellipses-large", "reason-judged"]),
]  # fmt: skip


@pytest.mark.parametrize(("result", "keys"), RUNS)
def test_what_is_said_follows_from_the_run(result, keys):
    said = [*answer(result), reason(result)[2], *advice(result)]
    assert [one.key for one in said] == keys
    texts = load_texts("detections").answers
    for one in said:
        assert set(re.findall(r"{(\w+)}", texts[one.key])) <= set(one.values)
