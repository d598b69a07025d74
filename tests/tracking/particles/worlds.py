"""Small worlds for trackers: a fence, animals that walk, an aircraft with a view, a block that hides."""

import numpy as np

from wildlab.tracking.particles import ImageLook, Rules, move, stay_inside, walk_of

SIZE = np.array([120.0, 90.0])
WALK = walk_of(0.5, 1.0)
NOISE = 2.0  # m
VIEW = np.array([25.0, 15.0])  # half of what an image shows, m


def inside(places):
    return ((places > 0) & (places < SIZE)).all(axis=-1)


def moves(cloud, seen, dt, rng):
    return stay_inside(cloud, move(cloud, WALK, dt, rng), inside)


RULES = Rules(moves, particles=400, scheme="systematic")


def footprint(k):
    """Lanes to and fro: 50 m by 30 m, which move on by half their length."""
    lane, along = divmod(k, 5)
    lane %= 3
    return np.array([12.0 + 24.0 * (along if lane % 2 == 0 else 4 - along), 15.0 + 30.0 * lane])


def sight_from(middle, probability):
    def sight(places):
        seen = (np.abs(places - middle) <= VIEW).all(axis=-1)
        hidden = (np.abs(places - [60.0, 45.0]) <= [8.0, 8.0]).all(axis=-1)
        return np.where(seen & ~hidden, probability, 0.0)

    return sight


def world(rng, animals, images=30, dt=4.0, probability=0.8, clutter=2e-5):
    """What each image shows."""
    at = rng.uniform(0, SIZE, (animals, 2))
    looks = []
    for k in range(images):
        if k:
            step = at + rng.standard_normal((animals, 2)) * np.sqrt(WALK(dt)[1][0, 0])
            at = np.where(inside(step)[:, None], step, at)
        middle = footprint(k)
        sight = sight_from(middle, probability)
        seen = at[rng.random(animals) < sight(at)]
        z = seen + NOISE * rng.standard_normal(seen.shape)
        low, high = np.maximum(middle - VIEW, 0), np.minimum(middle + VIEW, SIZE)
        false = rng.uniform(low, high, (rng.poisson(clutter * np.prod(high - low)), 2))
        both = rng.permutation(np.concatenate([z, false]))
        looks.append(
            ImageLook(k * dt, both, np.tile(NOISE**2 * np.eye(2), (len(both), 1, 1)), sight, clutter)
        )
    return looks
