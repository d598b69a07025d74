"""`wildlab clock`: what is used where the motion of the images does not tell the offset."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from tests.analysis.survey_twin import Survey, simulate
from tests.annotation import write_images
from tests.commands import succeed
from wildlab.analysis import camera as module
from wildlab.analysis.accuracy import as_calibrated, learn_flight
from wildlab.analysis.camera import CameraClock
from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import LearntParameter
from wildlab.flight.store import load_flight, save_flight


def clock(sentence: str, certain: bool) -> CameraClock:
    facts = (("detect-note", {"note": f"{sentence} say so"}),)
    return CameraClock({"certain": certain, "method": sentence}, pd.DataFrame(), facts)


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


@pytest.mark.slow
def test_what_a_kept_calibration_adds_is_not_set_again(tmp_path):
    late = LearntParameter(name="clock", value=0.3, low=0.2, high=0.4, unit="s")
    flight = simulate(Survey(images=12, clock_s=0.5))
    kept = learn_flight(flight, np.random.default_rng(0))[0]
    kept = kept.model_copy(update={"parameter": (late,), "covariance": ((0.0025,),)})
    folder = save_flight(flight, tmp_path / "flight", calibration=kept).folder
    for found in ([], ["--offset", "0.5"]):
        succeed("clock", folder, "--set", *found)
        set_ = load_flight(folder)
        assert set_.manifest.clocks.camera_offset_s == pytest.approx(0.2, abs=0.15)
        assert as_calibrated(set_).manifest.clocks.camera_offset_s == pytest.approx(0.5, abs=0.15)
