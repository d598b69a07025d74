"""Ten thousand runs of 141 measurements (H 6.4.3) through one core: compiled filters, loops and peers.

The slow ones get a few runs and their time is multiplied; what they were given stands in their row. All get
the same measurements and keep the same results, estimate and covariance after every measurement, but for the
row that says otherwise: writing down 200 MB of covariances is half of the compiled filter's time. Runs whose
measurements have the same noise and gaps share their covariances, and wildlab computes these once; where one
measurement of each run is missing, another one in each, every run has its own.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from functools import partial
from importlib.util import find_spec

import numpy as np
from filterpy.kalman import KalmanFilter

from benchmarks.timing import best_of
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.tracking import sensors
from wildlab.tracking.batch import BatchCamera, run_batch
from wildlab.tracking.kalman import Considered, predict, update
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.run import Start, run_filter

RUNS, UPDATES = 10_000, 141
#: Runs given to a loop in Python, and to Stone Soup.
FEW, VERY_FEW = 20, 4
MOTION = partial(constant_velocity, sd_acceleration=0.2)
H, R = np.eye(2, 4), 9.0 * np.eye(2)
CAMERA = Camera(640, 512, 1100.0, 1120.0, 318.0, 250.0)
START = Start(0.0, np.zeros(4), np.diag([100.0, 100.0, 20.0, 20.0]))


def numpy_loop(times: Array, z: Array) -> tuple[Array, Array]:
    """H (3.5) for one run after the other, written down as it stands."""
    xs, Ps = np.empty((*z.shape[:2], 4)), np.empty((*z.shape[:2], 4, 4))
    models = [MOTION(dt) for dt in np.diff(times, prepend=0.0)]
    for run in range(len(z)):
        x, P = START.x, START.P
        for k, (F, Q) in enumerate(models):
            x, P, *_ = update(*predict(x, P, F, Q), z[run, k], H, R)
            xs[run, k], Ps[run, k] = x, P
    return xs, Ps


def filterpy_loop(times: Array, z: Array) -> tuple[Array, Array]:
    xs, Ps = np.empty((*z.shape[:2], 4)), np.empty((*z.shape[:2], 4, 4))
    models = [MOTION(dt) for dt in np.diff(times, prepend=0.0)]
    for run in range(len(z)):
        kf = KalmanFilter(dim_x=4, dim_z=2)
        kf.x, kf.P, kf.H, kf.R = START.x.copy(), START.P.copy(), H, R
        for k, (F, Q) in enumerate(models):
            kf.predict(F=F, Q=Q)
            kf.update(z[run, k])
            xs[run, k], Ps[run, k] = kf.x, kf.P
    return xs, Ps


def stone_soup_loop(times: Array, z: Array) -> list[object]:
    """Its own constant velocity model, with the noise of continuous acceleration: the same amount of work."""
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import KalmanUpdater

    predictor = KalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(0.05)] * 2))
    updater = KalmanUpdater(LinearGaussian(4, (0, 2), R))
    epoch = datetime(2020, 1, 1)
    kept: list[object] = []
    for run in range(len(z)):
        state = GaussianState(START.x, START.P, timestamp=epoch)
        for k, t in enumerate(times):
            seen = Detection(z[run, k][:, None], timestamp=epoch + timedelta(seconds=float(t)))
            prior = predictor.predict(state, timestamp=seen.timestamp)
            state = updater.update(SingleHypothesis(prior, seen))
            kept.append(state)
    return kept


def scene() -> tuple[Array, Array, Array, CameraPoses, Considered]:
    """Times, positions (runs, N, 2), pixels (runs, N, 2), poses, their covariance: a target circled."""
    rng = np.random.default_rng(0)
    times = 0.1 * np.arange(UPDATES)
    truth = np.column_stack([1.0 * times, -0.5 * times, np.zeros(UPDATES)])
    p_nb = np.column_stack([60 * np.sin(0.1 * times), 60 * np.cos(0.1 * times), np.full(UPDATES, -300.0)])
    R_nb = euler_to_matrix(0.02 * np.sin(times), 0.03 * np.cos(times), 0.1 * times)
    poses = CameraPoses(CAMERA, Mount(), p_nb, R_nb)
    exact = ground_to_pixel(CAMERA, truth, poses.p_nc, poses.R_nc)
    size = np.repeat([1.0, 0.02], 3) ** 2 * (1 + 0.1 * np.sin(times))[:, None]
    covariance = np.einsum("ni,ij->nij", size, np.eye(6))
    return (
        times,
        truth[:, :2] + rng.normal(0, 3, (RUNS, UPDATES, 2)),
        exact + rng.normal(0, 2, (RUNS, UPDATES, 2)),
        poses,
        Considered(sensors.POSE, covariance),
    )


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to the reference of its group, what is wanted)."""
    times, z, pixels, poses, pose = scene()
    scale, rows = RUNS / FEW, []

    theirs = scale * best_of(lambda: filterpy_loop(times, z[:FEW]), repeats=3)
    rows.append((f"KF, filterpy ({FEW} runs, scaled)", theirs, 1.0, ""))
    plain = scale * best_of(lambda: numpy_loop(times, z[:FEW]), repeats=3)
    rows.append((f"KF, plain numpy ({FEW} runs, scaled)", plain, plain / theirs, ""))
    if find_spec("stonesoup"):
        soup = RUNS / VERY_FEW * best_of(lambda: stone_soup_loop(times, z[:VERY_FEW]), repeats=2)
        rows.append((f"KF, Stone Soup ({VERY_FEW} runs, scaled)", soup, soup / theirs, ""))
    else:
        rows.append(("KF, Stone Soup: not installed (extra `oracles`)", float("nan"), float("nan"), ""))
    own = best_of(lambda: run_batch(times, z, R, MOTION, START), repeats=5)
    rows.append(("KF, wildlab, all runs", own, own / theirs, "at most 0.033"))
    gaps = z.copy()
    gaps[np.arange(RUNS), np.arange(RUNS) % UPDATES] = np.nan
    apart = best_of(lambda: run_batch(times, gaps, R, MOTION, START), repeats=5)
    rows.append(("KF, wildlab, a gap of its own in each run", apart, apart / theirs, ""))

    noise, view = 4.0 * np.eye(2), BatchCamera(poses, 0.0)
    sensor = sensors.pixels(poses, 0.0)
    for name, uncertainty in (("pixel EKF", None), ("pixel Schmidt", pose)):

        def loop(uncertainty: Considered | None = uncertainty) -> object:
            few = pixels[: FEW // 4]
            return [run_filter(times, one, noise, sensor, MOTION, START, pose=uncertainty) for one in few]

        def batch(uncertainty: Considered | None = uncertainty) -> object:
            return run_batch(times, pixels, noise, MOTION, START, view=view, pose=uncertainty)

        slow = 4 * scale * best_of(loop, repeats=2)
        rows.append((f"{name}, readable numpy ({FEW // 4} runs, scaled)", slow, 1.0, ""))
        fast = best_of(batch, repeats=5)
        rows.append((f"{name}, wildlab, all runs", fast, fast / slow, "at most 0.033"))
    return f"{RUNS} runs of {UPDATES} measurements, one core", rows
