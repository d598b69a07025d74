"""The Kalman filter on the ground with noise that follows the view, and with fewer detections: after H 8.2.

H proposes measurement noise that grows with the height, with roll and pitch, and towards the borders of the
image. That detections are left out until their errors are new is not in H.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.track import CvTuning, Sighting, follow_positions
from wildlab.evaluation.whiteness import effective_sample_size
from wildlab.geometry.camera import normalise
from wildlab.tracking.filters import thin
from wildlab.tracking.records import Track

Array = NDArray[np.float64]

#: Standard deviation of a position as a share of the height, H 6.4.4: the only one that is printed.
FRACTION = 0.05
#: What the noise follows, each with what those before it follow.
NOISES = ("noise-by-altitude", "noise-by-tilt", "noise-by-place")
THINNED = "thinned"
#: All variations of the filter here.
VARIATIONS = (*NOISES, THINNED)


def noise_by_altitude(height: ArrayLike, fraction: float = 0.05) -> Array:
    """Georeferenced positions, H 6.2.4: standard deviation a fraction of the height above the plane.

    Parameters
    ----------
    height
        (N,) of the camera above the plane, m.
    fraction
        Without a unit, the same north and east; 0.05 is what H 6.4.4 flies with.

    Returns
    -------
    R, (N, 2, 2), m^2.
    """
    sd = fraction * np.asarray(height, float)
    return np.asarray(sd[:, None, None] ** 2 * np.eye(2))


def noise_by_direction(rays: ArrayLike, height: ArrayLike, fraction: float = 0.05) -> Array:
    """Georeferenced positions whose rays err by an angle: what H 8.2 proposes beyond the height alone.

    A ray ``a`` off the vertical meets the plane at ``h / cos a``, and slantwise: an angle moves the point by
    ``h / cos(a)^2`` times it along the ray's bearing, and by ``h / cos a`` across. A ray straight down has
    the noise of `noise_by_altitude`.

    Parameters
    ----------
    rays
        (N, 3) in n, of any length: of the camera's axis, which the airframe's tilt turns, or of the pixel.
    height
        (N,) of the camera above the plane, m.
    fraction
        The angle's standard deviation about each axis across the ray, rad.

    Returns
    -------
    R, (N, 2, 2), m^2; NaN at and above the horizon.

    Examples
    --------
    >>> straight_down = [[0.0, 0.0, 2.0]]
    >>> bool(np.allclose(noise_by_direction(straight_down, [200.0]), noise_by_altitude([200.0])))
    True
    """
    d, h = np.asarray(rays, float), np.asarray(height, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(d[:, 2:] > 0, d[:, :2] / d[:, 2:], np.nan)
    # 1 / cos(a)^2 is one more than the slope's square: across once, and along once more.
    steep = 1 + np.einsum("ni,ni->n", slope, slope)
    shape = steep[:, None, None] * (np.eye(2) + slope[:, :, None] * slope[:, None, :])
    return np.asarray((fraction * h)[:, None, None] ** 2 * shape)


def noises_of(seen: Sighting, fraction: float = FRACTION) -> dict[str, Array]:
    """Covariances (N, 2, 2) m^2 of a sighting's georeferenced detections, by `NOISES`.

    By the height of the camera above the target's plane; by the direction of the camera's axis as well, which
    roll and pitch turn away from the vertical; by the direction of the detection's own ray in its place.

    Parameters
    ----------
    seen
        From `wildlab.analysis.track.sighting`.
    fraction
        Of the height, per axis, for a ray straight down.

    Returns
    -------
    dict
        NaN where there is no pose; the last also where there is no detection.
    """
    height, R_nc = seen.plane_down - seen.poses.p_nc[:, 2], seen.poses.R_nc
    ahead = np.column_stack([normalise(seen.poses.camera, seen.uv), np.ones(len(seen.uv))])
    rays = np.einsum("nij,nj->ni", R_nc, ahead)
    found = (
        noise_by_altitude(height, fraction),
        noise_by_direction(R_nc[:, :, 2], height, fraction),
        noise_by_direction(rays, height, fraction),
    )
    return dict(zip(NOISES, found, strict=True))


def interval_of_news(seen: Sighting, track: Track) -> float:
    """From one detection to the next whose innovation is new, s; found without the truth.

    Innovations of neighbouring images are alike. They are worth fewer independent ones than there are
    (`effective_sample_size`); the interval is that of the detections times how many are worth one.

    Parameters
    ----------
    seen
        What was followed.
    track
        What a filter made of all of it.

    Returns
    -------
    float
        The larger one of the two elements; of one or two innovations the interval of the detections.
    """
    rows = np.isfinite(track.innovation).all(axis=1)
    innovation, times = track.innovation[rows], seen.times[seen.seen]
    usual = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if len(innovation) < 3:
        return usual
    worth = min(effective_sample_size(one, len(one) - 1) for one in innovation.T)
    return usual * len(innovation) / min(worth, len(innovation))


def thinned(seen: Sighting, interval: float) -> Sighting:
    """The same frames, but of the detections only such as are an interval (s) apart.

    Parameters
    ----------
    seen
        From `wildlab.analysis.track.sighting`.
    interval
        s.

    Returns
    -------
    Sighting
        With NaN in place of those left out.
    """
    kept = thin(seen.times, interval, seen.seen)[:, None]
    return seen._replace(uv=np.where(kept, seen.uv, np.nan), positions=np.where(kept, seen.positions, np.nan))


def follow_variations(seen: Sighting, tuning: CvTuning, track: Track) -> dict[str, tuple[Sighting, Track]]:
    """A sighting through each of `VARIATIONS`: what the filter was given of it, and its track.

    Parameters
    ----------
    seen
        From `wildlab.analysis.track.sighting`.
    tuning
        Of the filter that all this varies, `wildlab.analysis.track.follow_positions`.
    track
        What that filter made of the sighting.

    Returns
    -------
    dict
    """
    fewer = thinned(seen, interval_of_news(seen, track))
    noisy = {name: (seen, follow_positions(seen, tuning, R)) for name, R in noises_of(seen).items()}
    return noisy | {THINNED: (fewer, follow_positions(fewer, tuning))}
