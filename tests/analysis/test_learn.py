"""What is learnt on one flight is kept in a file, helps the next, and is refused where it does not belong."""

from functools import cache

import numpy as np
import pytest

from tests.analysis.conftest import changed, score
from tests.analysis.survey_twin import Survey, simulate
from tests.refused import refused
from wildlab.analysis.accuracy import apply_learnt, corrected_flight, learn_flight
from wildlab.analysis.georeference import georeference, observe
from wildlab.flight.calibration_files import (
    LearntParameter,
    calibration_toml,
    parse_learnt,
    read_learnt,
    write_calibration,
)
from wildlab.flight.checks.check import sense_sentences


def tuesday(**more):
    return simulate(Survey(tilt_deg=5.0, clock_s=0.3, **more))


def named(flight, name):
    return changed(flight, {"name": name})


@cache
def learnt():
    return learn_flight(named(tuesday(), "tuesday"), np.random.default_rng(0))[0]


def test_it_comes_back_from_its_file_as_it_was(tmp_path):
    write_calibration(learnt(), tmp_path / "calibration.toml")
    assert read_learnt(tmp_path / "calibration.toml") == learnt() == parse_learnt(calibration_toml(learnt()))
    values = {one.name: one for one in learnt().parameter}
    assert {"tilt", "clock"} <= set(values) <= {"roll", "tilt", "pan", "clock"}
    assert values["tilt"].low <= -5.0 <= values["tilt"].high and values["tilt"].unit == "deg"
    assert values["clock"].low <= 0.3 <= values["clock"].high
    assert (learnt().learnt_on.flight, learnt().learnt_on.images) == ("tuesday", 40)
    assert learnt().conditions.height_m[0] == pytest.approx(55.0, abs=3.0)
    # The place of a flight is in no calibration.
    assert "latitude" not in calibration_toml(learnt())


def only(name, value, half, unit):
    """The calibration with one parameter alone."""
    one = LearntParameter(name=name, value=value, low=value - half, high=value + half, unit=unit)
    return learnt().model_copy(update={"parameter": (one,), "covariance": ((half**2 / 4,),)})


@pytest.mark.slow
def test_a_corrected_flight_says_what_the_applied_calibration_says():
    flight = named(tuesday(seed=5), "wednesday")
    applied = apply_learnt(observe(flight), learnt())
    corrected = corrected_flight(flight, None, learnt())
    rng = np.random.default_rng(0)
    np.testing.assert_allclose(
        georeference(observe(corrected), rng)[["north_m", "east_m"]],
        georeference(applied.observations, rng)[["north_m", "east_m"]],
        atol=1e-6,
    )
    # So it does of the lens.
    of_lens = only("radial", 0.1, 0.01, "1")
    camera = apply_learnt(observe(flight), of_lens).observations.poses.camera
    assert camera == observe(corrected_flight(flight, None, of_lens)).poses.camera
    assert camera.distortion == (0.1, 0.0, 0.0, 0.0, 0.0)
    # What the calibration takes off is no contradiction any more.
    late = simulate(Survey(seed=5, clock_s=1.0))
    assert len(sense_sentences(late)) == 1
    assert sense_sentences(corrected_flight(late, None, only("clock", 1.0, 0.1, "s"))) == []
    nothing = learnt().model_copy(update={"parameter": (), "covariance": ()})
    same = corrected_flight(flight, None, nothing)
    assert same.nav["logged"].equals(flight.nav["logged"]) and same.manifest.mount == flight.manifest.mount
    # What it says of the noise of poses holds even so, as where it is applied.
    noise = nothing.noise.model_dump()
    assert {name: getattr(same.manifest.uncertainty, name) for name in noise} == noise


def test_only_another_height_than_that_of_the_calibration_is_said():
    """A fifth lower or higher is the same height, a half is not."""
    flight = named(tuesday(seed=5, images=10), "wednesday")
    logged = observe(flight)
    height = logged.plane_down - logged.poses.p_nc[:, 2]
    for factor, other_height in ((1.2, False), (1.5, True)):
        for low, high in ((factor * height.min(), 1e3), (1.0, height.max() / factor)):
            near = learnt().conditions.model_copy(update={"height_m": (low, high)})
            other = learnt().model_copy(update={"conditions": near})
            assert ("applied-height" in dict(apply_learnt(logged, other).facts)) == other_height


def test_the_next_flight_is_as_good_as_if_nothing_were_wrong():
    flight = named(tuesday(seed=5), "wednesday")
    logged = observe(flight)
    applied = apply_learnt(logged, learnt())
    after = score(flight, applied.observations, applied.deviations)
    well = simulate(Survey(seed=5))
    untouched = score(well)
    assert score(flight, logged)["error_m"].mean() > 10.0
    assert after["error_m"].mean() <= 1.1 * untouched["error_m"].mean()
    assert 0.83 < after["inside_90"].mean() < 0.97
    assert "applied-here" not in dict(applied.facts)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"camera": {"fx_px": 2500.0}}, "fx_px"),
        ({"camera": {"width_px": 640}}, "width_px"),
        ({"camera": {"k1": 0.1}}, "k1"),
        ({"mount": {"looks": "down"}}, "looks"),
        ({"mount": {"tilt_deg": -30.0}}, "tilt_deg"),
    ],
)
def test_another_camera_or_mount_is_refused(change, words):
    flight = changed(tuesday(images=8), change)
    with refused(words):
        apply_learnt(observe(flight), learnt())


def test_where_nothing_gains_for_certain_the_noise_alone_is_kept():
    found, diagnosis = learn_flight(simulate(Survey(seed=1)), np.random.default_rng(0))
    assert not diagnosis.counts
    assert found.parameter == () and found.gain is None
    assert 0.4 < found.noise.tilt_deg < 1.1
    assert parse_learnt(calibration_toml(found)) == found
    flight = named(tuesday(seed=5), "wednesday")
    applied = apply_learnt(observe(flight), found)
    assert np.allclose(applied.observations.poses.p_nb, observe(flight).poses.p_nb)


def test_a_tilt_that_is_not_certain_is_no_noise():
    """The same short flight with and without it: what never varies is no part of the noise."""
    noises = []
    for tilt in (0.0, 3.0):
        flight = simulate(Survey(seed=3, images=10, every_s=1.0, tilt_deg=tilt))
        kept, diagnosis = learn_flight(flight, np.random.default_rng(0))
        assert not diagnosis.counts and kept.parameter == ()
        noises.append(list(kept.noise.model_dump().values()))
    np.testing.assert_allclose(noises[1], noises[0], rtol=0.1)
