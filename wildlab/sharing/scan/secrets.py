"""What must not be sent."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MayStay = Literal["nothing", "year", "month", "day", "all"]


@dataclass(frozen=True)
class Secrets:
    """What must not be in what is sent. Printed, it shows none of it.

    Attributes
    ----------
    places
        (N, 3) latitude and longitude (deg, WGS84), height above the ellipsoid (m; NaN where not known).
    near_m
        How near to one of them a written place is a leak.
    cell_deg
        Places on this grid may be written (0.1: 60.1 N 10.3 E); 0 means that none may.
    words
        Names, labels, file names, folders, users, hosts.
    moments
        UTC, with a zone: when it was. The days they fall on are looked for, and their seconds.
    may_stay
        How much of a date may be written.
    numbers
        Other numbers that locate: heights, the geoid's undulation, gravity, declination. Their sign does not
        count.
    """

    places: Array = field(default_factory=lambda: np.empty((0, 3)), repr=False)
    near_m: float = 1000.0
    cell_deg: float = 0.0
    words: tuple[str, ...] = field(default=(), repr=False)
    moments: tuple[datetime, ...] = field(default=(), repr=False)
    may_stay: MayStay = "month"
    numbers: tuple[float, ...] = field(default=(), repr=False)

    def with_words(self, *words: str) -> Secrets:
        """The same and some more words."""
        return replace(self, words=(*self.words, *words))
