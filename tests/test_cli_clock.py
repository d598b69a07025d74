"""`wildlab clock`: what is used where the motion of the images does not tell the offset."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tests.analysis.survey_twin import Survey, simulate
from tests.annotation import write_images
from tests.commands import succeed
from wildlab.analysis import camera as module
from wildlab.analysis.accuracy import apply_learnt, as_calibrated, corrected_flight, learn_flight
from wildlab.analysis.camera import CameraClock
from wildlab.analysis.georeference import observe
from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import LearntParameter
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import load_flight, save_flight


def clock(sentence: str, certain: bool) -> CameraClock:
    facts = (("detect-note", {"note": f"{sentence} say so"}),)
    return CameraClock({"certain": certain, "method": sentence}, facts)


@pytest.mark.parametrize(
    ("motion", "points", "said"),
    [
        (None, clock("points", True), "points say so."),
        (clock("motion", False), clock("points", True), "points"),
        (clock("motion", False), clock("points", False), "motion say so."),
        (clock("motion", True), clock("points", True), "motion say so."),
        (clock("motion", False), None, "motion say so."),
        (None, None, "no pairs"),
    ],
)
def test_known_points_tell_it_where_motion_does_not(motion, points, said, tmp_path, monkeypatch):
    save_flight(simulate(Survey(images=4)), tmp_path / "flight")
    write_images(tmp_path / "images", "a.png")

    def estimate(found: CameraClock | None, problem: str) -> Any:
        def told(*_: Any) -> CameraClock:
            if found is None:
                raise WildlabError(problem, "fly longer")
            return found

        return told

    monkeypatch.setattr(module, "clock_from_images", estimate(motion, "no pairs"))
    monkeypatch.setattr(module, "clock_from_points", estimate(points, "no points"))
    call = ["clock", str(tmp_path / "flight"), "--images", str(tmp_path / "images"), "--json"]
    ran = CliRunner().invoke(wildlab, call)
    if motion is None and points is None:
        assert isinstance(ran.exception, WildlabError) and ran.exception.problem == said
        return
    told = json.loads(ran.stdout)["sentence"]
    assert said in told
    assert ("points" in told) == (told != "motion say so.")


@pytest.fixture(scope="module")
def late():
    """A flight whose camera's clock is late, and what is learnt of it."""
    flight = simulate(Survey(images=12, clock_s=0.5))
    return flight, learn_flight(flight, np.random.default_rng(0))[0]


@pytest.mark.slow
def test_a_clock_that_is_set_takes_the_place_of_a_calibration_s(late, tmp_path):
    clock = LearntParameter(name="clock", value=0.3, low=0.2, high=0.4, unit="s")
    flight, kept = late
    kept = kept.model_copy(update={"parameter": (clock,), "covariance": ((0.0025,),)})
    folder = save_flight(flight, tmp_path / "flight", calibration=kept).folder
    assert as_calibrated(load_flight(folder)).manifest.clocks.camera_offset_s == pytest.approx(0.3)
    # An offset that happens to be that of the flight it was learnt on, too.
    for offset, found in ((0.5, []), (0.5, ["--offset", "0.5"]), (0.0, ["--offset", "0"])):
        succeed("clock", folder, "--set", *found)
        set_ = load_flight(folder)
        assert set_.manifest.clocks.camera_offset_s == pytest.approx(offset, abs=0.05)
        assert as_calibrated(set_).manifest.clocks == set_.manifest.clocks


@pytest.mark.parametrize(
    ("stated", "learnt_with", "adds"),
    [(0.0, 0.0, True), (-7200.0, 0.0, True), (0.2, 0.2, True), (0.4, 0.0, False), (3600.4, 0.0, False)],
)
def test_a_calibration_s_clock_is_no_second_one(late, stated, learnt_with, adds):
    flight, learnt = late
    (clock,) = learnt.parameter
    assert clock.name == "clock"
    there = learnt.learnt_on.model_copy(update={"camera_offset_s": learnt_with})
    learnt = learnt.model_copy(update={"learnt_on": there})
    judged = replace(
        flight, manifest=replace_in_manifest(flight.manifest, {"clocks": {"camera_offset_s": stated}})
    )
    offset = corrected_flight(judged, None, learnt).manifest.clocks.camera_offset_s
    assert offset == pytest.approx(stated + adds * clock.value)
    applied = apply_learnt(observe(judged), learnt)
    assert applied.observations.table["time_s"].iloc[0] == pytest.approx(
        observe(judged).table["time_s"].iloc[0] + adds * clock.value
    )
    assert ("applied-own-clock" in dict(applied.facts)) != adds
