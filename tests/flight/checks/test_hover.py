"""An aircraft that hardly turns: rates that are far too small leave no more than its few turns."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.flight.conftest import MANIFEST
from wildlab.flight.checks.check import find
from wildlab.flight.manifest import make_manifest
from wildlab.flight.store import Flight

RATE, FORCE = ("w_x_rad_s", "w_y_rad_s", "w_z_rad_s"), ("f_x_m_s2", "f_y_m_s2", "f_z_m_s2")


def hover(by: float) -> Flight:
    """Four minutes about one place; rates times a factor."""
    rng, t = np.random.default_rng(1), np.arange(0.0, 240.0, 0.02)

    def attitude(t):
        turns = [0.4 * np.sin(t / 4), 0.02 * np.sin(t / 1.4), 0.02 * np.cos(t / 1.8)]
        return Rotation.from_euler("ZYX", np.stack(turns, axis=-1))

    h = 0.005
    rate = (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2 * h) + rng.normal(0, 0.01, (len(t), 3))
    force = attitude(t).inv().apply([0.0, 0.0, -9.81]) + rng.normal(0, 0.1, (len(t), 3))
    imu = pd.DataFrame(np.column_stack([t, force, by * rate]), columns=["time_s", *FORCE, *RATE])
    s = t[:-5:5]
    q = attitude(s).as_quat(scalar_first=True)
    place = np.column_stack([rng.normal(0, 0.05, (len(s), 2)), np.full(len(s), -50.0)])
    names = ["time_s", "north_m", "east_m", "down_m", "q_w", "q_x", "q_y", "q_z"]
    nav = pd.DataFrame(np.column_stack([s, place, q]), columns=names)
    manifest = {name: part for name, part in MANIFEST.items() if name != "camera"}
    return Flight(make_manifest(manifest), {"autopilot": nav}, {"imu": imu})


@pytest.mark.parametrize(("by", "cause"), [(1.0, ""), (np.pi / 180, "rad/s"), (180 / np.pi, "deg/s")])
def test_a_wrong_unit_of_rates_is_a_problem(by, cause):
    found = [one for one in find(hover(by)) if one.level == "problem"]
    assert bool(found) == bool(cause)
    assert not cause or found[0].code in ("felt-explained", "rate-fast", "rate-against-course")
