"""What the ground of a flight is: its terrain where it has one, and what a level plane would have given."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import Observations
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.terrain import Terrain

Array = NDArray[np.float64]


class Shift(NamedTuple):
    """How far points on terrain lie from those on a level plane, metres, horizontally.

    Attributes
    ----------
    n
        How many points are on both.
    median, largest
        Of the distances; NaN where there is none.
    """

    n: int
    median: float
    largest: float




def level_of(observations: Observations) -> Array:
    """Down coordinate (N,) of the plane that would serve without terrain: as stated, else under the lens."""
    ground: Terrain | None = observations.terrain
    if ground is None or observations.level is None:
        return observations.plane_down
    p_nc = np.broadcast_to(observations.poses.p_nc, (len(observations.uv), 3))
    under = -ground.heights_at(p_nc[:, :2])
    return np.where(np.isfinite(observations.level), observations.level, under)


def on_level(observations: Observations) -> Observations:
    """The same observations as they would be without terrain."""
    return replace(observations, plane_down=level_of(observations), terrain=None, level=None)


def shift_from_level(observations: Observations, points: pd.DataFrame) -> Shift:
    """How far points lie from where a level plane would have put them.

    Parameters
    ----------
    observations
        Of a flight with terrain.
    points
        From `wildlab.analysis.georeference.georeference`, of these.

    Returns
    -------
    Shift
    """
    level = georeference_pixels(observations.poses, observations.uv, level_of(observations))[:, :2]
    off = np.linalg.norm(points[["north_m", "east_m"]].to_numpy(float) - level, axis=1)
    off = off[np.isfinite(off)]
    if not len(off):
        return Shift(0, float("nan"), float("nan"))
    return Shift(len(off), float(np.median(off)), float(off.max()))


def ground_sentences(observations: Observations, points: pd.DataFrame) -> list[str]:
    """What the points lie on, what became of the rays, and what a plane would have given; without full stops.

    Parameters
    ----------
    observations, points
        As for `shift_from_level`; without terrain there is less to say.

    Returns
    -------
    list of str
    """
    placed = int(points["north_m"].notna().sum())
    kinds = points["ellipse"].value_counts()
    if observations.terrain is None:
        return [
            f"{placed} of {len(points)} points lie on level ground, at the height of each target: "
            "there is no terrain"
        ]
    became = "; ".join(f"{n} {words}" for words, n in points["ray"].value_counts().items())
    said = [f"Of {len(points)} rays, over terrain: {became or 'none'}"]
    shift = shift_from_level(observations, points)
    if shift.n:
        whose = "as high as is stated of each target, else as the ground under the camera"
        said.append(
            f"Level ground ({whose}) would have put {shift.n} of them {shift.median:.2f} m elsewhere in the "
            f"median, {shift.largest:.2f} m at most"
        )
    sampled, split = int(kinds.get("sampled", 0)), int(kinds.get("split", 0))
    if sampled + split:
        said.append(
            f"{sampled + split} of {placed} ellipses were sampled: the ground is bent there, or the ray flat"
            + (f"; {split} of these over a ridge, with a near and a far group" if split else "")
        )
    if unbounded := int(kinds.get("unbounded", 0)):
        said.append(
            f"{unbounded} of {placed} points have no ellipse: more than 5 % of their samples meet no ground"
        )
    return said
