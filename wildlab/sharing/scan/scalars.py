"""Single numbers that locate: heights, the geoid's undulation, gravity, the field's declination."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from wildlab.sharing.scan.hits import Hit
from wildlab.sharing.scan.numbers import Numbers

#: A number stands for itself where so many digits agree with the true one.
DIGITS = 5
#: Beside a word that says what it is, so many do.
BESIDE = 3
#: How far from such a word, in characters.
NEAR = 40
_SAYING = re.compile(
    r"undulation|geoid|origin|ellipsoid|altitude|elevation|above\s+sea|sea\s+level|amsl|declination"
    r"|inclination|gravity|h[oö]he|høyde|hoyde|terrain|_msl|height_m",
    re.IGNORECASE,
)


def scalars_in(text: str, numbers: Numbers, true: Sequence[float]) -> list[Hit]:
    """Where one of the true numbers is written: to five digits, or to three beside a word that names it.

    Parameters
    ----------
    text, numbers
        A text and the numbers in it.
    true
        What must not be written.
    """
    hits = []
    for value in sorted({abs(float(one)) for one in true if np.isfinite(one) and one}):
        size = 10.0 ** np.floor(np.log10(value))
        off = np.abs(numbers.value - value)
        # Rounded to its last digit, or cut off after it.
        fits = off <= np.maximum(numbers.half * 1.000001, size * 1e-9)
        fits |= (numbers.value < value) & (off < 2 * numbers.half)
        fits |= (off <= size * 10.0 ** (1 - DIGITS) / 2) & (numbers.digits > DIGITS)
        fits &= numbers.value > 0  # a zero has no digit that agrees, however many it is written with
        for k in np.flatnonzero(fits & (numbers.digits >= BESIDE)):
            start, end = int(numbers.start[k]), int(numbers.end[k])
            if numbers.digits[k] >= DIGITS:
                hits.append(Hit(start, end, "number", "a number that locates"))
            elif _SAYING.search(text[max(start - NEAR, 0) : end + NEAR]):
                hits.append(Hit(start, end, "number", "a number that locates, named beside it"))
    return hits
