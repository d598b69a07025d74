"""Sensors of a level platform, and named errors with their standard deviations, for tests of filters."""

import numpy as np

from wildlab.tracking.kalman import TOGETHER, Considered
from wildlab.tracking.sensors import Prediction, Sensor, predict_position, predict_range_bearing, row_of


def ranges_bearings(platform, yaw):
    """Range and bearing from the bow, of a platform at (N, 2) or (2,) with the heading (N,) or a number."""

    def predict(row, position):
        return predict_range_bearing(position, row_of(platform, row, 1), row_of(yaw, row, 0))

    rows = len(platform) if np.ndim(platform) == 2 else None
    return Sensor(predict, (False, True), rows)


def bearings(platform, yaw):
    """The bearings alone."""
    both = ranges_bearings(platform, yaw)

    def predict(row, position):
        return Prediction(*(one[..., 1:] if i == 0 else one[..., 1:, :]
                            for i, one in enumerate(both.predict(row, position))))  # fmt: skip

    return both._replace(predict=predict, angles=(True,))


def measured_from(platform):
    """Positions that a platform at (N, 2) or (2,) measures: its own plus what it sees from there."""
    rows = len(platform) if np.ndim(platform) == 2 else None
    return Sensor(
        lambda row, position: predict_position(position, row_of(platform, row, 1)), (False, False), rows,
    )  # fmt: skip


def consider(sds, times=None):
    """Uncorrelated errors, which last for ever or for ``times`` by name."""
    each = {one: float(sd) for name, sd in sds.items() for one in TOGETHER.get(name, (name,))}
    lasting = tuple((times or {}).get(name, np.inf) for name in each)
    return Considered(tuple(each), np.diag(np.square(list(each.values()))), lasting)
