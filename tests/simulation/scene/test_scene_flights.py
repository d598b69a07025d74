"""Parts of a flight's images, and what is on a deck."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.bodies import fitted_out, vessel
from wildlab.simulation.scene.flights import Look, SceneFlight


@pytest.fixture(scope="module")
def flight():
    return SceneFlight(load_twin("gimballed-ship"), 1, Look(lengths=(70.0,), slender=5.0, fittings=10))


def test_a_window_shows_what_the_whole_image_shows_there(flight):
    part = flight.window(60, 40)
    whole = flight.view(60, waves_move=False)
    seen = flight.view(60, waves_move=False, window=part)
    assert seen.kelvin.shape == (part.height, part.width)
    assert seen.kelvin.size < 0.7 * whole.kelvin.size
    assert np.allclose(seen.kelvin, whole.kelvin[part.slices], atol=1e-3)
    assert np.array_equal(seen.labels, whole.labels[part.slices])
    # Nothing of the ship is outside of it, and there is sea around it.
    assert (seen.labels > 0).sum() == (whole.labels > 0).sum() > 1000
    assert not seen.labels[:5].any() and not seen.labels[-5:].any()


def test_an_image_without_the_ship_has_no_window(flight):
    away = int(np.flatnonzero(~flight.near().any(axis=1))[0])
    assert flight.window(away, 40) is None


def test_fittings_are_on_the_deck_and_as_warm_as_they_should_be():
    plain = vessel(70.0, 14.0)
    fitted = fitted_out(plain, 400, 5.0, np.random.default_rng(1))
    deck = fitted.layers[-2]
    own = deck.hot[len(plain.layers[-2].hot) :]
    assert len(own) == 400
    assert np.std([one.excess for one in own]) == pytest.approx(5.0, rel=0.15)
    assert max(abs(one.ahead) for one in own) < 40 and max(abs(one.right) for one in own) < 7
    assert fitted.layers[-1] == plain.layers[-1] and fitted.layers[:-2] == plain.layers[:-2]


def test_without_fittings_a_deck_is_as_it_was(flight):
    bare = SceneFlight(load_twin("gimballed-ship"), 1, Look(lengths=(70.0,), slender=5.0))
    assert len(bare.bodies(0)[0].layers[-2].hot) == 1
    assert len(flight.bodies(0)[0].layers[-2].hot) == 11
    assert flight.sea == bare.sea
