"""The stamps of images in UTC: by the zone they state, by the satellites' time beside them, or not at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.logs.log import Clock
from wildlab.flight.readers.photos import values
from wildlab.flight.readers.photos.said import images
from wildlab.flight.readers.photos.tags import Tags
from wildlab.flight.time.zones import wall_to_utc

Array = NDArray[np.float64]

#: A camera's clock that scatters more about GPS than this is not one clock, s.
ONE_CLOCK_S = 5.0
#: A clock that differs more from GPS than a stamp of whole seconds and a slow shutter explain, s.
OFF_S = 2.0
#: What is said of a clock without a zone, and what others are known from.
LOCAL, BY_GPS, BY_ZONE = "local time without a zone", "GPS time of the images", "zones that the images state"


def times_of(tags: list[Tags], zone: str | None) -> tuple[Array, Array, Clock | None, list[str]]:
    """Stamps of images.

    The camera's clock has the intervals, and satellites or a zone bring it to UTC: a stamp of GPS may be of
    the second before, or of the last fix.

    Parameters
    ----------
    tags
        Of N images.
    zone
        Of the camera's clock where they do not state it.

    Returns
    -------
    wall, time, clock, said
        (N,) s since 1970 by the camera's clock as if it were UTC, and in UTC, NaN where not known; how the
        one became the other, None where there are none; sentences.

    Raises
    ------
    WildlabError
        Where the zone is none.
    """
    wall, ahead = np.array([values.wall_of(one) for one in tags], float).reshape(-1, 2).T
    sky = np.array([values.satellite_time_of(one) for one in tags], float)
    if not np.isfinite(wall).any():
        if not np.isfinite(sky).any():
            return wall, sky, None, ["no image carries a time"]
        return sky, sky, Clock(BY_GPS), []
    said: list[str] = []
    apart = (sky - wall)[np.isfinite(wall) & np.isfinite(sky)]
    middle = float(np.median(apart)) if len(apart) else np.nan
    left = np.abs(apart - middle)
    spread, largest = (1.4826 * float(np.median(left)), float(left.max())) if len(apart) else (0.0, 0.0)
    one_clock = spread <= ONE_CLOCK_S
    stated = np.isfinite(ahead)
    if stated.any() and (stated.all() or not len(apart)):
        # Where one image does not state its zone, the others' is that of the same clock.
        zone_s = float(np.median(ahead[stated]))
        time = wall - np.where(stated, ahead, zone_s)
        clock = Clock(BY_ZONE, 1.0, -zone_s, pairs=int(stated.sum()))
        off = middle + zone_s
        if len(apart) and one_clock and abs(off) > OFF_S:
            side = "behind" if off > 0 else "ahead of"
            said.append(
                f"the camera's clock with the zone it states is {abs(off):.0f} s {side} the GPS time in the "
                "same images; the clock is used"
            )
    elif len(apart):
        time = np.where(np.isfinite(wall), wall + middle, sky) if one_clock else sky
        clock = Clock(BY_GPS, 1.0, middle, spread, largest, len(apart))
        if not one_clock:
            said.append("the camera's clock does not run along with GPS time in its images, which is used")
    elif zone is not None:
        time = wall_to_utc(wall, zone)
        clock = Clock(f"local time of the zone {zone}", 1.0, float(np.nanmedian(time - wall)))
    else:
        time = np.full(len(wall), np.nan)
        clock = Clock(LOCAL)
        said.append("the camera's clock is local time and no image says its zone: state it to know UTC")
    without = int((~np.isfinite(wall) & ~np.isfinite(sky)).sum())
    if without:
        said.append(f"{images(without)} without a time")
    known = wall[np.isfinite(wall)]
    if len(known) > 1 and (known == known.round()).all():
        said.append("the camera's stamps are whole seconds")
    return wall, time, clock, said
