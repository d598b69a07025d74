"""What a flight's sensors really are: drawn within stated tolerances about what is said of them.

Data sheets, calibrations and levels are not exact, and nobody who flies knows by how much. So each flight
(seed) has its own noise, biases, camera and mount; its manifest and its tables state the sheet, which is all
that a filter or a georeferencing may know. What was drawn is written nowhere. Who judges an estimate may ask
`as_flown` for it again.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from wildlab.flight.files import Strict
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameter_groups import Gnss, Imu, Parameter, Tolerance, TwinCamera, TwinMount
from wildlab.simulation.parameters import TwinParameters

Part = TypeVar("Part", bound=Strict)

#: What is noisier or calmer than its sheet says, by group.
_NOISE = {
    "imu": ("gyro_random_walk", "accelerometer_random_walk"),
    "gnss": (
        "horizontal_noise",
        "vertical_noise",
        "horizontal_correlated_sd",
        "vertical_correlated_sd",
        "velocity_noise",
    ),
    "camera": ("marking_sd",),
}
#: What has larger or smaller biases, likewise.
_BIASES = {
    "imu": (
        "gyro_bias_stability",
        "gyro_turn_on_bias",
        "accelerometer_bias_stability",
        "accelerometer_turn_on_bias",
    ),
}


def as_flown(twin: TwinParameters, seed: int) -> TwinParameters:
    """The parameters that the sensors of one flight really have.

    Noise densities and the standard deviations of biases are the sheet's times a factor drawn evenly within
    one minus and one plus the tolerance, each its own; focal lengths, principal point and the angles of the
    mount are the stated ones plus a normal error.

    Parameters
    ----------
    twin
        What is stated, with its ``tolerance``.
    seed
        Of the flight, a whole number from 0.

    Returns
    -------
    TwinParameters
        The twin itself where it has no tolerances.

    Raises
    ------
    ValueError
        Where the seed is negative.

    Examples
    --------
    >>> from wildlab.simulation import load_twin
    >>> stated = load_twin("static-antenna")
    >>> as_flown(stated, 1).camera.fx.number == stated.camera.fx.number
    False
    """
    tolerance = twin.tolerance
    if tolerance is None:
        return twin
    found: dict[str, Any] = {
        "camera": _camera(twin.camera, tolerance, seed),
        "mount": _mount(twin.mount, tolerance, seed),
    }
    if twin.imu is not None:
        found["imu"] = _imu(twin.imu, tolerance, seed)
    if twin.gnss is not None:
        found["gnss"] = _gnss(twin.gnss, tolerance, seed)
    return twin.model_copy(update=found)


def _imu(imu: Imu, tolerance: Tolerance, seed: int) -> Imu:
    rng = stream(seed, "imu as flown")
    scaled = _scaled(imu, _NOISE["imu"], tolerance.noise.si, rng)
    return _scaled(scaled, _BIASES["imu"], tolerance.bias.si, rng)


def _gnss(gnss: Gnss, tolerance: Tolerance, seed: int) -> Gnss:
    return _scaled(gnss, _NOISE["gnss"], tolerance.noise.si, stream(seed, "gnss as flown"))


def _camera(camera: TwinCamera, tolerance: Tolerance, seed: int) -> TwinCamera:
    rng = stream(seed, "camera as flown")
    scaled = _scaled(camera, _NOISE["camera"], tolerance.noise.si, rng)
    longer = 1 + tolerance.focal_length.si * rng.standard_normal(2)
    moved = tolerance.principal_point.si * rng.standard_normal(2)
    return _with(
        scaled,
        fx=camera.fx.number * longer[0],
        fy=camera.fy.number * longer[1],
        cx=camera.cx.number + moved[0],
        cy=camera.cy.number + moved[1],
    )


def _mount(mount: TwinMount, tolerance: Tolerance, seed: int) -> TwinMount:
    turned = tolerance.mount.number * stream(seed, "mount as flown").standard_normal(3)
    return _with(
        mount,
        misalignment_roll=mount.misalignment_roll.number + turned[0],
        misalignment_tilt=mount.misalignment_tilt.number + turned[1],
        misalignment_pan=mount.misalignment_pan.number + turned[2],
    )


def _scaled(part: Part, names: tuple[str, ...], within: float, rng: np.random.Generator) -> Part:
    factors = rng.uniform(1 - within, 1 + within, len(names))
    return _with(
        part,
        **{name: getattr(part, name).number * factor for name, factor in zip(names, factors, strict=True)},
    )


def _with(part: Part, **values: float) -> Part:
    changed: dict[str, Parameter] = {
        name: getattr(part, name).model_copy(update={"value": float(value)}) for name, value in values.items()
    }
    return part.model_copy(update=changed)
