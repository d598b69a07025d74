"""One topic of a ULog with the names of its fields in old and new firmware, its times, its places."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.time.fitting import ClockFit

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: A sample is at most so much older than its message, s; what is further is no time of a sample.
_OLDEST_S = 1.0
#: Of the sphere on which PX4 lays its local frame, m.
PX4_EARTH_M = 6371000.0


class Topic(NamedTuple):
    """Messages of one instance: fields (N,) by name."""

    name: str
    data: Mapping[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.data["timestamp"])

    def has(self, *names: str) -> bool:
        """Whether it has one of the fields."""
        return any(name in self.data for name in names)

    def get(self, *names: str) -> Array:
        """The first of these fields that it has, (N,) as float64; NaN where it has none."""
        for name in names:
            if name in self.data:
                with np.errstate(invalid="ignore"):
                    return self.data[name].astype(np.float64)
        return np.full(len(self), np.nan)

    def several(self, name: str, count: int) -> Array:
        """A field that is an array, (N, count); NaN where it has none."""
        return np.stack([self.get(f"{name}[{at}]") for at in range(count)], axis=1)

    def taken_s(self) -> Array:
        """When each was measured, (N,) s since start: by the sample's stamp where true, else its own."""
        stamp, sample = self.get("timestamp") / 1e6, self.get("timestamp_sample") / 1e6
        with np.errstate(invalid="ignore"):
            true = (sample > 0) & (sample <= stamp) & (stamp - sample <= _OLDEST_S)
        return np.where(true, sample, stamp)

    def times(self, fit: ClockFit | None) -> dict[str, Array]:
        """Columns ``time_s`` (UTC, NaN where that is not known) and ``time_log_s`` (since start)."""
        taken = self.taken_s()
        utc = np.full(len(taken), np.nan) if fit is None else fit.to_reference(taken)
        return {"time_s": utc, "time_log_s": taken}


def from_local(
    north_m: ArrayLike, east_m: ArrayLike, latitude_deg: ArrayLike, longitude_deg: ArrayLike
) -> tuple[Array, Array]:
    """Latitude and longitude of places in PX4's local frame.

    PX4 lays the frame out by an azimuthal equidistant projection of a sphere; back on the same sphere it
    gives what its filter held, where an ellipsoid would be off by up to 0.5 % of the distance.

    Parameters
    ----------
    north_m, east_m
        (N,) m.
    latitude_deg, longitude_deg
        (N,) of the frame's origin.

    Returns
    -------
    latitude, longitude
        (N,) deg.
    """
    x, y = np.asarray(north_m, float) / PX4_EARTH_M, np.asarray(east_m, float) / PX4_EARTH_M
    lat_0, lon_0 = np.radians(latitude_deg), np.radians(longitude_deg)
    c = np.hypot(x, y)
    share = np.sinc(c / np.pi)  # sin(c) / c
    lat = np.arcsin(np.clip(np.cos(c) * np.sin(lat_0) + x * share * np.cos(lat_0), -1.0, 1.0))
    lon = lon_0 + np.arctan2(y * share, np.cos(lat_0) * np.cos(c) - x * share * np.sin(lat_0))
    return np.degrees(lat), np.degrees(lon)
