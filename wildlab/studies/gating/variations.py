"""What moves the success rates of H 6.4.3: the parts that it does not give, changed one at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.studies.gating.monte_carlo import FORMS, Choices, Overflight, overflight, success_rates
from wildlab.studies.gating.readings import standard_error

#: How far to the side the targets are put, m: three quarters of the way to the edge of the image.
ASIDE_M = 30.0


def variations(flight: Flight, chosen: Choices) -> dict[str, tuple[Overflight, Choices]]:
    """The flight and the choices of each variation, by what is changed; the first changes nothing."""
    over = overflight(flight)
    flights = {
        "as chosen": over,
        "camera at rest, looking down": overflight(flight, gimbal="down"),
        "camera of half the focal length": overflight(flight, focal_scale=0.5),
        "camera of one and a half times it": overflight(flight, focal_scale=1.5),
        "50 m high": overflight(flight, height_scale=0.5),
        "200 m high": overflight(flight, height_scale=2.0),
        f"targets {ASIDE_M:.0f} m to the right": overflight(flight, right=ASIDE_M),
        f"targets {ASIDE_M:.0f} m to the left": overflight(flight, right=-ASIDE_M),
    }
    filters: dict[str, Callable[[Choices], Choices]] = {
        "no process noise": lambda c: replace(c, sd_acceleration=0.0),
        "process noise 0.2 m/s²": lambda c: replace(c, sd_acceleration=0.2),
        "process noise 1 m/s²": lambda c: replace(c, sd_acceleration=1.0),
        "a second between the 50 iterations": lambda c: replace(c, warm_up_step=1.0),
        "track not updated": lambda c: replace(c, updated_with="nothing"),
        "one-argument arctangent": lambda c: replace(c, azimuth="arctan"),
        "(6.10) to the letter": lambda c: replace(c, azimuth="printed"),
        "only images that show both": lambda c: replace(c, in_image_only=True),
    }
    return {name: (other, chosen) for name, other in flights.items()} | {
        name: (over, change(chosen)) for name, change in filters.items()
    }


def vary(flight: Flight, chosen: Choices, runs: int, seed: int) -> pd.DataFrame:
    """Mean success rates (per cent) of every variation, on the same draws.

    Returns
    -------
    DataFrame
        ``variation``; for each form its mean, and as ``<form>_change`` and ``<form>_se`` the mean difference
        from the first row, run by run, with its standard error; and as ``<form>_mean_se`` the mean's own.
    """
    rows: list[dict[str, object]] = []
    first: Array | None = None
    for name, (over, choices) in variations(flight, chosen).items():
        rates = success_rates(over, choices, runs, seed)[: len(FORMS)]
        first = rates if first is None else first
        row: dict[str, object] = {"variation": name}
        for form, own, base in zip(FORMS, rates, first, strict=True):
            change = (own - base)[np.isfinite(own)]
            row |= {
                form: np.nanmean(own),
                f"{form}_change": change.mean(),
                f"{form}_se": standard_error(change),
                f"{form}_mean_se": standard_error(own),
            }
        rows.append(row)
    return pd.DataFrame(rows)
