"""What `flight.toml` of a twin says, and what the flight's sensors really are: drawn about it within stated
tolerances.

Data sheets, calibrations and levels are not exact, and nobody who flies knows by how much. So each flight
(seed) has its own noise, biases, camera and mount; its manifest and its tables state the sheet, which is all
that a filter or a georeferencing may know. What was drawn is written nowhere. Who judges an estimate may ask
`as_flown` for it again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wildlab.flight.manifest import Manifest, make_manifest
from wildlab.geometry.camera_poses import Mount, helgesen_misalignment
from wildlab.simulation.error_models import stream
from wildlab.simulation.landscape import land_record
from wildlab.simulation.parameters import Group, Parameter, TwinParameters


def twin_manifest(twin: TwinParameters, seed: int) -> Manifest:
    """What `flight.toml` of the twin says: its sensors' sheets and what one would assume, not the truth.

    The truth of a flight is drawn about it (`wildlab.simulation.manifest`). Of a twin as flown,
    camera and mount are the real ones.
    """
    c, m, assumed = twin.camera, twin.mount, twin.assumed
    calibrated = m.calibrated is None or m.calibrated.text == "yes"
    misalignment = _misalignment(m) if calibrated else (0.0, 0.0, 0.0)
    return make_manifest(
        {
            "name": f"{twin.name}-{seed}",
            "kind": "twin",
            "description": twin.description,
            "locations": {"sensitivity": "open"},
            "origin": {
                "latitude_deg": twin.place.latitude.number,
                "longitude_deg": twin.place.longitude.number,
                "height_m": twin.place.height.number,
            },
            "platform": {"name": twin.flight.platform.text},
            "camera": {
                "name": c.name.text,
                "width_px": int(c.width.number),
                "height_px": int(c.height.number),
                "fx_px": c.fx.number,
                "fy_px": c.fy.number,
                "cx_px": c.cx.number,
                "cy_px": c.cy.number,
                "k1": 0.0 if c.k1 is None else c.k1.number,
            },
            "mount": {
                "looks": "down" if m.looks is None else m.looks.text,
                "pan_deg": m.pan.number,
                "tilt_deg": m.tilt.number,
                "misalignment_roll_deg": misalignment[0],
                "misalignment_tilt_deg": misalignment[1],
                "misalignment_pan_deg": misalignment[2],
            },
            "imu": {} if twin.imu is None else _imu(twin.imu),
            "gnss": {} if twin.gnss is None else _gnss(twin.gnss),
            "time": {"kind": "utc", "epoch": twin.place.epoch.text},
            "vertical": {
                "reference": "ellipsoid",
                "note": "the ground or the sea lies at the origin of n"
                if twin.land is None
                else "the lowest ground lies as high as the origin of n",
            },
            **({} if twin.land is None else {"terrain": land_record(twin)}),
            "uncertainty": {
                "pixel_px": assumed.pixel.number,
                "position_horizontal_m": assumed.horizontal.number,
                "position_vertical_m": assumed.vertical.number,
                "plane_height_m": assumed.plane_height.number,
                "tilt_deg": assumed.tilt.number,
                "heading_deg": assumed.heading.number,
                "note": "what the published facts suggest; the simulated errors are set apart from it",
            },
            "scoring": {"rule": "labelled"},
            "twin": {"name": twin.name, "seed": seed},
        }
    )


def true_mount(twin: TwinParameters) -> Mount:
    """How the camera really sits: with its misalignment, whether somebody calibrated it or not."""
    stated = twin_manifest(twin, 0).geometry_mount()
    roll, tilt, pan = (math.radians(angle) for angle in _misalignment(twin.mount))
    return replace(stated, misalignment=(roll, tilt, pan))


def _misalignment(mount: Group) -> tuple[float, float, float]:
    """Degrees, in the sense of the manifest."""
    return helgesen_misalignment(
        mount.misalignment_roll.number, mount.misalignment_tilt.number, mount.misalignment_pan.number
    )


def _imu(imu: Group) -> dict[str, Any]:
    """The unit's data sheet; a figure that is zero is not stated."""
    figures = {
        "velocity_random_walk_m_s_sqrt_h": imu.accelerometer_random_walk.number,
        "angle_random_walk_deg_sqrt_h": imu.gyro_random_walk.number,
        "accelerometer_bias_m_s2": imu.accelerometer_bias_stability.si,
        "accelerometer_bias_time_s": imu.accelerometer_bias_time.si,
        "gyro_bias_deg_h": imu.gyro_bias_stability.number,
        "gyro_bias_time_s": imu.gyro_bias_time.si,
        "accelerometer_turn_on_m_s2": imu.accelerometer_turn_on_bias.si,
        "gyro_turn_on_deg_h": imu.gyro_turn_on_bias.number,
        "misalignment_deg": imu.package_misalignment.number,
        "axis_misalignment_deg": imu.axis_misalignment.number,
    }
    return {"name": imu.name.text, **{name: value for name, value in figures.items() if value > 0}}


def _gnss(gnss: Group) -> dict[str, Any]:
    """The receiver with the first antenna; where the second one is stands in the table."""
    arm = (gnss.first_x.si, gnss.first_y.si, gnss.first_z.si)
    correlated = {
        "wander_horizontal_m": gnss.horizontal_correlated_sd.si,
        "wander_vertical_m": gnss.vertical_correlated_sd.si,
        "wander_time_s": gnss.correlation_time.si,
    }
    known = {name: value for name, value in correlated.items() if value > 0}
    return {"name": gnss.name.text, "lever_arm_m": arm, "latency_s": gnss.latency.si, **known}


#: What is noisier or calmer than its sheet says, and what has larger or smaller biases, by group; each within
#: which of the tolerances.
_SCALED: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "imu": {
        "noise": ("gyro_random_walk", "accelerometer_random_walk"),
        "bias": (
            "gyro_bias_stability",
            "gyro_turn_on_bias",
            "accelerometer_bias_stability",
            "accelerometer_turn_on_bias",
        ),
    },
    "gnss": {
        "noise": (
            "horizontal_noise",
            "vertical_noise",
            "horizontal_correlated_sd",
            "vertical_correlated_sd",
            "velocity_noise",
        )
    },
    "camera": {"noise": ("marking_sd",)},
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
    >>> from wildlab.simulation.parameters import load_twin
    >>> stated = load_twin("static-antenna")
    >>> as_flown(stated, 1).camera.fx.number == stated.camera.fx.number
    False
    """
    tolerance = twin.tolerance
    if tolerance is None:
        return twin
    found: dict[str, Any] = {}
    for group, names in _SCALED.items():
        part = getattr(twin, group)
        if part is None:
            continue
        rng = stream(seed, f"{group} as flown")
        for within, some in names.items():
            part = _scaled(part, some, getattr(tolerance, within).si, rng)
        if group == "camera":
            longer = 1 + tolerance.focal_length.si * rng.standard_normal(2)
            moved = tolerance.principal_point.si * rng.standard_normal(2)
            part = _with(
                part,
                fx=part.fx.number * longer[0],
                fy=part.fy.number * longer[1],
                cx=part.cx.number + moved[0],
                cy=part.cy.number + moved[1],
            )
        found[group] = part
    turned = tolerance.mount.number * stream(seed, "mount as flown").standard_normal(3)
    angles = [f"misalignment_{name}" for name in ("roll", "tilt", "pan")]
    stated = [getattr(twin.mount, name).number for name in angles]
    found["mount"] = _with(twin.mount, **dict(zip(angles, stated + turned, strict=True)))
    return twin.model_copy(update=found)


def _scaled(part: Group, names: tuple[str, ...], within: float, rng: np.random.Generator) -> Group:
    factors = rng.uniform(1 - within, 1 + within, len(names))
    return _with(
        part,
        **{name: getattr(part, name).number * factor for name, factor in zip(names, factors, strict=True)},
    )


def _with(part: Group, **values: float) -> Group:
    changed: dict[str, Parameter] = {
        name: getattr(part, name).model_copy(update={"value": float(value)}) for name, value in values.items()
    }
    return part.model_copy(update=changed)
