"""Without truth: the scatter of sightings is found, and nothing is claimed that takes truth."""

from functools import cache

import numpy as np
import pandas as pd
import pytest

from tests.pipeline.conftest import changed
from tests.pipeline.survey_twin import Survey, simulate
from wildlab.errors import WildlabError
from wildlab.pipeline.camera_clock import by_points_in_words
from wildlab.pipeline.evaluate import score_points
from wildlab.pipeline.georeference import observe
from wildlab.pipeline.learn import learn_from
from wildlab.pipeline.repeats import compare_sightings, judge_repeats


def judged(flight):
    full = flight.tables.pop("truth")
    found = judge_repeats(flight, observe(flight), np.random.default_rng(0))
    flight.tables["truth"] = full
    return found


@pytest.mark.slow
def test_the_scatter_is_that_of_the_errors_that_images_do_not_share():
    flight = simulate(Survey())
    found = judged(flight)
    errors = score_points(flight, found.points)[["error_north_m", "error_east_m"]].to_numpy()
    assert found.spread.sd == pytest.approx(errors.std(), rel=0.2)
    assert 0.8 < found.spread.consistent < 1.2
    assert found.lost == 0
    assert found.things["sightings"].sum() == len(errors)
    # What all images share does not show.
    shifted = judged(simulate(Survey(north_m=30.0)))
    assert shifted.spread.sd == pytest.approx(found.spread.sd, rel=1e-3)


@cache
def unknown(clock_s):
    """A flight without truth, its observations, and what sightings say of it."""
    flight = simulate(Survey(images=24, clock_s=clock_s))
    del flight.tables["truth"]
    seen = observe(flight)
    return flight, seen, judge_repeats(flight, seen, np.random.default_rng(0))


@pytest.mark.slow
def test_a_clock_shows_without_a_known_place():
    """Leaving its image out, a sighting comes as near to the others as on a flight whose clock is right."""
    late, right = (unknown(wrong)[2].diagnosis for wrong in (0.3, 0.0))
    assert late.counts and late.winner.causes == ("clock",) and not late.places_known
    low, high = late.calibration.interval("clock")
    assert low <= 0.3 <= high and high - low < 0.1
    logged = right.models[0].gain.without
    assert late.winner.gain.without > 1.5 * logged and late.winner.gain.with_ < 1.1 * logged
    assert not right.counts
    # What moves all sightings alike does not show, and is not tried.
    assert not any("position" in one.causes for one in late.models)


@pytest.mark.slow
def test_calibration_and_clock_have_what_sightings_say(monkeypatch):
    flight, seen, found = unknown(0.3)
    learnt = learn_from(flight, seen, found.diagnosis, np.random.default_rng(0))
    assert [one.name for one in learnt.parameter] == ["clock"]
    assert learnt.parameter[0].low <= 0.3 <= learnt.parameter[0].high
    monkeypatch.setattr("wildlab.pipeline.camera_clock.judge_repeats", lambda *_: found)
    clock = by_points_in_words(flight)
    assert clock.numbers["certain"] and clock.numbers["offset_s"] == pytest.approx(0.3, abs=0.03)
    assert clock.curve["offset_s"][clock.curve["cost"].argmin()] == pytest.approx(0.3, abs=0.15)
    monkeypatch.setattr("wildlab.pipeline.camera_clock.judge_repeats", lambda *_: unknown(0.0)[2])
    assert not by_points_in_words(unknown(0.0)[0]).numbers["certain"]


def test_a_sighting_is_held_against_those_of_other_images():
    points = pd.DataFrame(
        {
            "target_id": ["a", "a", "a", "b", ""],
            "frame_id": ["1", "1", "2", "1", "2"],
            "north_m": [0.0, 2.0, 5.0, 1.0, 1.0],
            "east_m": 0.0,
        }
    )
    found = compare_sightings(points)
    np.testing.assert_allclose(found["error_north_m"], [-5.0, -3.0, 4.0, np.nan])


def test_without_names_there_is_nothing_to_compare():
    with pytest.raises(WildlabError, match="no detection names"):
        judged(simulate(Survey(images=8, rule="nearest")))


def test_where_no_ray_meets_the_ground_all_is_lost():
    """All rays above the horizon: things are in many images, and have a position from none."""
    found = judged(changed(simulate(Survey(images=8)), {"mount": {"tilt_deg": 120.0}}))
    assert found.lost == len(found.points) and found.spread is None
