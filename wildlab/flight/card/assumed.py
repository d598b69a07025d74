"""What is assumed where logs say nothing: in data, and written into the recipe with a note."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wildlab.flight.files import read_toml
from wildlab.flight.readers.log import Stream
from wildlab.paths import DATA

FILE = DATA / "recipes" / "assumed.toml"


def assumed(part: str) -> dict[str, Any]:
    """What is assumed of ``"uncertainty"`` or ``"imu"``, as it stands in a recipe."""
    return dict(read_toml(FILE, "what is assumed where logs say nothing")[part])


def uncertainty_of(streams: Mapping[tuple[str, str], Stream]) -> tuple[dict[str, Any], str]:
    """The part ``[uncertainty]``: positions by the receivers' own statements where there are any.

    Parameters
    ----------
    streams
        The parts with positions.

    Returns
    -------
    dict, and a sentence on it
    """
    found, stated = assumed("uncertainty"), []
    for key, column in (
        ("position_horizontal_m", "sd_horizontal_m"),
        ("position_vertical_m", "sd_vertical_m"),
    ):
        values = [one.columns[column][one.used] for one in streams.values() if column in one.columns]
        every = np.concatenate([np.empty(0), *values])
        every = every[np.isfinite(every) & (every > 0)]
        if len(every):
            found[key] = round(float(np.median(every)), 4)
            stated.append(key.removesuffix("_m").replace("_", " "))
    if stated:
        found["note"] = (
            f"{' and '.join(stated).capitalize()}: median of what the receiver stated. The rest: "
            + found["note"]
        )
    said = (
        f"Assumed, since no log states it: pixels to {found['pixel_px']:g} px, tilt to "
        f"{found['tilt_deg']:g} deg, heading to {found['heading_deg']:g} deg"
    )
    if "position horizontal" not in stated:
        level, height = found["position_horizontal_m"], found["position_vertical_m"]
        said += f", positions to {level:g} m ({height:g} m in height)"
    return found, said + ". [uncertainty] has them: ellipses and verdicts on consistency rest on that."
