"""What a camera makes of a scene, parts of its images, and what is on a deck."""

import numpy as np
import pytest

from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.flights import (
    IDEAL,
    CameraResponse,
    SceneFlight,
    VesselLook,
    expose,
    sensor_of,
    to_counts,
)
from wildlab.simulation.scene.render import fitted_out, vessel

SHAPE = (120, 160)


def even(level=290.15):
    return np.full(SHAPE, level, np.float32)


def seen(response, image, seed=1):
    """What an image is taken for by one sensor."""
    sensor = sensor_of(response, SHAPE, np.random.default_rng(1))
    return kelvin_of(expose(image, response, sensor, np.random.default_rng(seed)), response)


def kelvin_of(counts, response):
    return 273.15 + (counts.astype(float) - to_counts(273.15, response)) / response.counts_per_kelvin


def test_an_ideal_camera_only_counts():
    sensor = sensor_of(IDEAL, SHAPE, np.random.default_rng(1))
    image = even()
    image[40:60, 50:70] = 300.15
    counts = expose(image, IDEAL, sensor, np.random.default_rng(2))
    assert counts[50, 60] - counts[0, 0] == 250
    assert np.abs(kelvin_of(counts, IDEAL) - image).max() <= 0.02 + 1e-4
    assert counts.max() < 2**14


def test_noise_and_pattern_have_their_deviations_and_the_pattern_stays():
    response = CameraResponse(vignetting=0.0, dead_share=0.0)
    images = [seen(response, even(), seed) for seed in (2, 3)]
    difference = (images[0] - images[1]).std()
    # Rounding to counts of 0.04 K adds its own.
    assert np.isclose(difference, np.sqrt(2 * (0.05**2 + 0.04**2 / 12)), rtol=0.03)
    mean = (images[0] + images[1]) / 2
    expected = 0.05**2 / 2 + 0.04**2 / 24 + 0.02**2 + 0.015**2
    assert np.isclose(mean.var(), expected, rtol=0.12)


def test_corners_look_warmer_by_the_vignetting():
    response = CameraResponse(noise=0.0, pattern=0.0, stripes=0.0, dead_share=0.0, vignetting=2.0)
    kelvin = seen(response, even())
    assert np.isclose(kelvin[0, 0] - kelvin[60, 80], 2.0, atol=0.05)


def test_blur_keeps_the_energy_and_widens_a_point():
    response = CameraResponse(blur_sd=1.5, noise=0, pattern=0, stripes=0, vignetting=0, dead_share=0)
    image = even()
    image[60, 80] += 200.0
    excess = seen(response, image) - 290.15
    assert np.isclose(excess[40:80, 60:100].sum(), 200, rtol=0.05)
    v = np.arange(SHAPE[0]) - 60
    assert np.isclose(
        (excess[:, 60:100].sum(axis=1) * v**2).sum() / excess[:, 60:100].sum(), 1.5**2, rtol=0.1
    )


def test_dead_pixels_show_the_same_in_every_image():
    response = CameraResponse(dead_share=0.01)
    sensor = sensor_of(response, SHAPE, np.random.default_rng(1))
    assert 0.005 < sensor.dead.mean() < 0.02
    one, two = (expose(even(280.0 + k), response, sensor, np.random.default_rng(k)) for k in (1, 9))
    assert np.array_equal(one[sensor.dead], two[sensor.dead])
    assert set(np.unique(one[sensor.dead])) <= {0, 2**14 - 1}


@pytest.fixture(scope="module")
def flight():
    return SceneFlight(load_twin("gimballed-ship"), 1, VesselLook(lengths=(70.0,), slender=5.0, fittings=10))


def test_a_window_shows_what_the_whole_image_shows_there(flight):
    part = flight.window(60, 40)
    whole = flight.view(60)
    seen = flight.view(60, part)
    assert seen.kelvin.shape == (part.height, part.width)
    assert seen.kelvin.size < 0.7 * whole.kelvin.size
    assert np.allclose(seen.kelvin, whole.kelvin[part.slices], atol=1e-3)
    assert np.array_equal(seen.labels, whole.labels[part.slices])
    # Nothing of the ship is outside of it, and there is sea around it.
    assert (seen.labels > 0).sum() == (whole.labels > 0).sum() > 1000
    assert not seen.labels[:5].any() and not seen.labels[-5:].any()


def test_fittings_are_on_the_deck_and_as_warm_as_they_should_be():
    plain = vessel(70.0, 14.0)
    fitted = fitted_out(plain, 400, 5.0, np.random.default_rng(1))
    deck = fitted.layers[-2]
    own = deck.hot[len(plain.layers[-2].hot) :]
    assert len(own) == 400
    assert np.std([one.excess for one in own]) == pytest.approx(5.0, rel=0.15)
    assert max(abs(one.ahead) for one in own) < 40 and max(abs(one.right) for one in own) < 7
    assert fitted.layers[-1] == plain.layers[-1] and fitted.layers[:-2] == plain.layers[:-2]
