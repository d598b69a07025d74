"""Sums of sines at many times, compiled: what a simulated flight spends most of its time on."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from wildlab.geometry.frames import Array

#: Sines are computed afresh after so many steps of equal length; in between each is turned on by a constant
#: angle, which costs two products instead of a sine, and leaves some 1e-14 of rounding.
_BLOCK = 64


def sum_of_sines(times: Array, amplitudes: Array, frequencies: Array, phases: Array) -> Array:
    """``sum_k amplitudes[k] sin(frequencies[k] t + phases[k])``. (N,) s and (K,) each, rad/s and rad -> (N,).

    Times in equal steps, as those of a sensor's samples, take a tenth of the time of others.
    """
    t = np.asarray(times, float)
    flat = np.ascontiguousarray(t.ravel())
    return np.asarray(_sum(flat, amplitudes, frequencies, phases)).reshape(t.shape)


def plain_sum_of_sines(times: Array, amplitudes: Array, frequencies: Array, phases: Array) -> Array:
    """As `sum_of_sines`, in one line of numpy."""
    return np.asarray(np.sin(np.multiply.outer(times, frequencies) + phases) @ amplitudes)


@nb.njit(cache=True, error_model="numpy")
def _sum(times: Array, amplitudes: Array, frequencies: Array, phases: Array) -> Array:
    out = np.zeros(len(times))
    count = len(times)
    first = 0
    while first < count:
        last = min(first + _BLOCK, count)
        step = times[first + 1] - times[first] if last - first > 1 else 0.0
        even = True
        for i in range(first + 1, last):
            # A rounding of the times is far below what any signal changes in it.
            if abs(times[i] - times[first] - (i - first) * step) > 1e-11 * (1.0 + abs(times[i])):
                even = False
                break
        for k in range(len(amplitudes)):
            w, a = frequencies[k], amplitudes[k]
            if not even:
                for i in range(first, last):
                    out[i] += a * math.sin(w * times[i] + phases[k])
                continue
            angle = w * times[first] + phases[k]
            s, c = math.sin(angle), math.cos(angle)
            turn_s, turn_c = math.sin(w * step), math.cos(w * step)
            for i in range(first, last):
                out[i] += a * s
                s, c = s * turn_c + c * turn_s, c * turn_c - s * turn_s
        first = last
    return out
