"""The filter's covariance against the truth of real twins, over many seeds: straight, in turns, without GNSS.

The sensors err as the manifest says, with all that a data sheet has: turn-on biases, axes that are not
where they should be, fixes whose error wanders. Attitude error: ``q_true = q_hat * dq``, as four times the
modified Rodrigues parameters of ``dq`` in b; position: truth less estimate in n.
"""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.analysis.navigate import errors_against, navigate_mekf
from wildlab.flight.store import Flight
from wildlab.simulation.courses import twin_trajectory
from wildlab.simulation.error_models import stream
from wildlab.simulation.manifest import twin_manifest
from wildlab.simulation.onboard_sensors import (
    gnss_table,
    imu_table,
    nav_table,
    payload_boresight,
    sample_times,
)
from wildlab.simulation.parameters import TwinParameters, load_twin
from wildlab.simulation.trajectory import Motion, angular_rates, attitude_along, turned

DURATION, SEEDS = 200.0, 20
OUTAGE = (115.0, 175.0)
#: Of the mean over seeds and time, over its degrees of freedom: about three deviations of 0.13, which are
#: sqrt(2 / 120) of 20 flights with two independent errors of three elements each.
LIMITS = (0.7, 1.4)


def shortened(name: str) -> TwinParameters:
    twin = load_twin(name)
    duration = twin.flight.duration.model_copy(update={"value": DURATION})
    return twin.model_copy(update={"flight": twin.flight.model_copy(update={"duration": duration})})


def sensors(twin: TwinParameters, seed: int) -> tuple[Flight, np.ndarray]:
    """Inertial unit, receivers and truth alone, with the outage; and whether it turns at each time."""
    airframe = twin_trajectory(twin, stream(seed, "trajectory"))
    boresight = payload_boresight(twin, seed)

    def payload(times: np.ndarray) -> Motion:
        return turned(airframe(times), boresight)

    times = sample_times(5.0, DURATION)
    gnss = gnss_table(twin, payload, seed, twin.gnss)
    gnss = gnss[~gnss["time_s"].between(*OUTAGE)].reset_index(drop=True)
    tables = {"imu": imu_table(twin, payload, seed), "gnss": gnss}
    truth = nav_table(payload(times))
    turning = np.abs(angular_rates(attitude_along(payload), times)[:, 2]) > 0.05
    return Flight(twin_manifest(twin, seed), {"truth-payload": truth}, tables), turning


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fast-vessel", "drifting-vessel-eight"])
def test_errors_are_as_large_as_the_filter_says(name):
    twin, times = shortened(name), sample_times(5.0, DURATION)
    squares: dict[str, list[np.ndarray]] = {"position": [], "attitude": []}
    nis, turns = [], []
    for seed in range(SEEDS):
        flight, turning = sensors(twin, seed)
        found = navigate_mekf(flight, times)
        errors = errors_against(flight.nav["truth-payload"], found.nav, times)
        for block, values in squares.items():
            values.append(errors.nees[block] / 3)
        late = found.innovations["time_s"] > 60.0
        nis.append(found.innovations["nis"][late].mean() / 3)
        turns.append(turning)
    with_gnss = (times > 60) & ~((times > OUTAGE[0]) & (times < OUTAGE[1]))
    off = (times > OUTAGE[0]) & (times < OUTAGE[1])
    parts = {
        "straight": with_gnss & ~np.array(turns),
        "in turns": with_gnss & np.array(turns),
        "without GNSS": np.broadcast_to(off, (SEEDS, len(times))),
    }
    means = {
        (part, block): float(np.array(values)[rows].mean())
        for part, rows in parts.items()
        for block, values in squares.items()
    }
    assert min(rows.sum() for rows in parts.values()) > 20 * SEEDS
    assert all(LIMITS[0] < mean < LIMITS[1] for mean in means.values()), means
    assert 0.95 < np.mean(nis) < 1.05
