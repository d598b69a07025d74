"""The compiled sum of sines against numpy's."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wildlab.simulation.sines import plain_sum_of_sines, sum_of_sines


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=16), rng.uniform(0.01, 4.0, 16), rng.uniform(0, 2 * np.pi, 16)


@given(
    seed=st.integers(0, 2**32 - 1),
    start=st.floats(0, 5000),
    step=st.floats(1e-4, 1.0),
    count=st.integers(0, 400),
)
def test_in_equal_steps_it_is_the_plain_sum(seed: int, start: float, step: float, count: int) -> None:
    signal, times = drawn(seed), start + step * np.arange(count)
    np.testing.assert_allclose(
        sum_of_sines(times, *signal), plain_sum_of_sines(times, *signal), rtol=0, atol=1e-9
    )


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 200))
def test_at_any_times_it_is_the_plain_sum(seed: int, count: int) -> None:
    signal = drawn(seed)
    times = np.random.default_rng(seed).uniform(-100, 3000, count)
    np.testing.assert_allclose(
        sum_of_sines(times, *signal), plain_sum_of_sines(times, *signal), rtol=0, atol=1e-11
    )


def test_it_keeps_the_shape_of_the_times() -> None:
    signal = drawn(1)
    assert sum_of_sines(np.zeros((3, 2)), *signal).shape == (3, 2)
    assert sum_of_sines(np.float64(2.0), *signal).shape == ()
