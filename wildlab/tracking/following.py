"""Any of the filters by its name, all with the same arguments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.tracking.coloured import run_coloured
from wildlab.tracking.consider_parameters import Considers
from wildlab.tracking.imm import run_imm
from wildlab.tracking.motion import Motion
from wildlab.tracking.records import Start, Track
from wildlab.tracking.run import run_filter
from wildlab.tracking.sensors import Sensor
from wildlab.tracking.smoothing import run_smoothed
from wildlab.tracking.unscented import run_unscented

#: As `follow`, without the name.
Filter = Callable[..., Track]


def follow(
    name: str,
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    motion: Motion | Sequence[Motion],
    start: Start,
    *,
    pose: Considers | None = None,
    gate_probability: float = 1.0,
    output_times: ArrayLike | None = None,
    mean_stay: Sequence[float] | None = None,
    F_c: ArrayLike | None = None,
    longest_gap: float = 1.0,
) -> Track:
    """Follow a target with the filter of a name.

    Parameters
    ----------
    name
        One of `FILTERS`. ``ekf`` is the Kalman filter where the sensor measures positions, and takes poses as
        true: it does not look at ``pose``. ``schmidt`` is `run_filter` with ``pose``; ``smoothed`` is that
        one or ``ekf``, gone back over (`run_smoothed`). ``ukf``, ``imm`` and ``coloured`` widen their noise
        by ``pose``, if it is given.
    times, measurements, R, sensor, start, gate_probability, output_times
        As in `run_filter`. Only ``ekf``, ``schmidt`` and ``smoothed`` take several detections in a frame.
    motion
        A model; for ``imm`` two or more.
    pose
        Errors to consider. ``schmidt`` asks for them.
    mean_stay
        Seconds that each model lasts, for ``imm``.
    F_c, longest_gap
        Of `run_coloured`.

    Returns
    -------
    Track

    Raises
    ------
    WildlabError
        For another name, what the filter of that name lacks, and as the filter itself.

    Examples
    --------
    >>> import numpy as np
    >>> from wildlab.tracking import positions, rest
    >>> start = Start(time=0.0, x=np.zeros(2), P=100.0 * np.eye(2))
    >>> track = follow("ekf", [0.0, 1.0], [[1.0, 0.0], [3.0, 0.0]], np.eye(2), positions(), rest, start)
    >>> track.x[-1].round(1).tolist()
    [2.0, 0.0]
    """
    if name not in FILTERS:
        raise WildlabError(f"there is no filter {name!r}", f"use one of {', '.join(FILTERS)}", field="filter")
    several = [motion] if callable(motion) else list(motion)
    common: dict[str, Any] = {"gate_probability": gate_probability, "output_times": output_times}
    if name == "imm":
        if mean_stay is None:
            raise WildlabError(
                "imm does not know how long a motion lasts", "give mean_stay, in s", field="mean_stay"
            )
        return run_imm(times, measurements, R, sensor, several, mean_stay, start, pose=pose, **common).track
    if len(several) != 1:
        raise WildlabError(f"{len(several)} motion models for {name}", "give one, or use imm", field="motion")
    if name == "schmidt" and pose is None:
        raise WildlabError(
            "schmidt has no errors to consider", "say what may be wrong and by how much, or use ekf",
            field="pose",
        )  # fmt: skip
    if name == "coloured":
        return run_coloured(
            times, measurements, R, several[0], start, sensor=sensor, pose=pose, F_c=F_c,
            longest_gap=longest_gap, **common,
        )  # fmt: skip
    considered = None if name == "ekf" else pose
    return FILTERS[name](times, measurements, R, sensor, several[0], start, pose=considered, **common)


#: The function behind each name; those of ``imm`` and ``coloured`` have arguments of their own.
FILTERS: dict[str, Filter] = {
    "ekf": run_filter,
    "schmidt": run_filter,
    "ukf": run_unscented,
    "imm": run_imm,  # type: ignore[dict-item]  # gives a `ModeTrack`
    "coloured": run_coloured,
    "smoothed": run_smoothed,
}
