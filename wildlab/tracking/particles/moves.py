"""Where particles go between two images, F 4.2.5: by the motion model itself (prior sampling, (4.15)).

F's random walk (4.5) draws a velocity for each step and holds it over that step, and F does not say how long
a step is. The spread after a time depends on it: n steps of length T add n (sd T)^2, so ten times as many
steps in the same time spread the cloud a tenth as far in variance. `walk_of` turns a standard deviation of
velocities *and* the step they last into a walk that gives the same spread however often it is predicted.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.motion import Motion, random_walk
from wildlab.tracking.particles.clouds import Cloud, Inside, root_of


def walk_of(sd_velocity: float, step: float) -> Motion:
    """F (4.5) with the step that its noise depends on: as spread out after any number of steps.

    Parameters
    ----------
    sd_velocity
        Of the velocity drawn for each step, m/s, the same north and east.
    step
        How long an animal keeps to it, s; not the time between two images.

    Returns
    -------
    Motion
        `wildlab.tracking.motion.random_walk` with the density sd sqrt(step).

    Raises
    ------
    WildlabError
        For a spread below zero, or a step that is not above it.

    Examples
    --------
    >>> F, Q = walk_of(0.5, 1.0)(1800.0)  # half an hour at half a metre a second
    >>> print(round(float(np.sqrt(Q[0, 0])), 1))
    21.2
    """
    if not (sd_velocity >= 0 and 0 < step < np.inf):
        raise WildlabError(
            f"velocities of {sd_velocity} m/s that last {step} s",
            "give zero or more, and more than zero",
            field="step",
        )
    return partial(random_walk, density=sd_velocity * float(np.sqrt(step)))


def move(cloud: Cloud, motion: Motion, dt: float, rng: np.random.Generator) -> Cloud:
    """Time update by a motion model, F (4.16); weights stay as they are, F (4.18).

    Parameters
    ----------
    cloud
        With the states of the model.
    motion
        As the other filters take it: a step in seconds -> F, Q.
    dt
        s.
    rng
        Random numbers.

    Returns
    -------
    Cloud
    """
    F, Q = motion(dt)
    noise = rng.standard_normal(cloud.x.shape) @ root_of(Q).T
    return Cloud(cloud.x @ F.T + noise, cloud.w)


def drift(
    positions: ArrayLike,
    dt: float,
    rng: np.random.Generator,
    *,
    density: float,
    places: ArrayLike,
    spread: float,
    shares: ArrayLike | None = None,
) -> Array:
    """A random walk that is drawn to places, F 8.4: water holes, or points along a path.

    Left alone for long, it is where the places are: a mixture of normal distributions about them. The pull is
    the one that goes with the walk's own pace, density^2 / 2 times the slope of that mixture's logarithm; so
    nothing but where the places are and how far about them has to be chosen. Exact for one place and any
    step; with several, a step short beside spread^2 / density^2.

    Parameters
    ----------
    positions
        (..., 2) m.
    dt
        s.
    rng
        Random numbers.
    density
        Of the walk, m/sqrt(s), above zero.
    places
        (K, 2) m.
    spread
        Standard deviation about a place in the long run, m, the same north and east.
    shares
        (K,) of the time spent about each place; equal where not given.

    Returns
    -------
    (..., 2) m.

    Raises
    ------
    WildlabError
        Where there is no place, a share is below zero or all are zero, or density or spread is not above
        zero.
    """
    x, to = np.asarray(positions, float), np.asarray(places, float).reshape(-1, 2)
    share = np.ones(len(to)) if shares is None else np.asarray(shares, float)
    if not (density > 0 and spread > 0):
        raise WildlabError(
            f"a walk of {density} m/sqrt(s) with a spread of {spread} m about its places",
            "give both above zero",
            field="spread",
        )
    if not len(to) or len(share) != len(to) or not (share >= 0).all() or not share.sum() > 0:
        raise WildlabError(
            f"{len(share)} shares for {len(to)} places",
            "give at least one place, and to each a share that is not below zero",
            field="shares",
        )
    with np.errstate(divide="ignore"):
        exponent = np.log(share) - ((x[..., None, :] - to) ** 2).sum(axis=-1) / (2 * spread**2)
    likely = np.exp(exponent - exponent.max(axis=-1, keepdims=True))
    middle = (likely / likely.sum(axis=-1, keepdims=True)) @ to
    kept = np.exp(-(density**2) * dt / (2 * spread**2))
    noise = spread * np.sqrt(-np.expm1(-(density**2) * dt / spread**2)) * rng.standard_normal(x.shape)
    return np.asarray(middle + kept * (x - middle) + noise)


def move_by_sight(
    cloud: Cloud,
    seen: ArrayLike,
    dt: float,
    rng: np.random.Generator,
    *,
    motion: Motion,
    sd_velocity: float,
    density: float,
    places: ArrayLike,
    spread: float,
    shares: ArrayLike | None = None,
) -> Cloud:
    """Time update of F 8.4: constant velocity while in sight, a drift to places while not.

    Parameters
    ----------
    cloud
        States ``[pN, pE, vN, vE]``.
    seen
        (A,) bool: which animals are in sight.
    dt
        s.
    rng
        Random numbers.
    motion
        Of those in sight, such as `wildlab.tracking.motion.constant_velocity` with its noise fixed.
    sd_velocity
        Of those out of sight, m/s: what was known of a velocity is forgotten, and one is drawn anew.
    density, places, spread, shares
        Of those out of sight, as `drift` takes them.

    Returns
    -------
    Cloud

    Raises
    ------
    WildlabError
        As `drift`.
    """
    there = np.asarray(seen, bool)
    x = cloud.x.copy()
    if there.any():
        x[there] = move(Cloud(cloud.x[there], cloud.w[there]), motion, dt, rng).x
    if not there.all():
        away = ~there
        x[away, :, :2] = drift(
            cloud.x[away, :, :2], dt, rng, density=density, places=places, spread=spread, shares=shares
        )
        x[away, :, 2:4] = sd_velocity * rng.standard_normal(x[away, :, 2:4].shape)
    return Cloud(x, cloud.w)


def stay_inside(before: Cloud, after: Cloud, inside: Inside) -> Cloud:
    """The enclosure as prior while animals move: a particle whose step leads out stays where it was.

    In the long run a walk is then anywhere in the enclosure with equal chance. A velocity that led out is
    given up as well.

    Parameters
    ----------
    before, after
        Clouds at two times, the same particles.
    inside
        The enclosure: (..., 2) m -> (...) bool.

    Returns
    -------
    Cloud
        With the weights of ``after``.
    """
    kept = np.asarray(inside(after.x[..., :2]), bool)
    stayed = before.x.copy()
    stayed[..., 2:] = 0.0
    return Cloud(np.where(kept[..., None], after.x, stayed), after.w)
