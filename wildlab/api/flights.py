"""Flights and their points for a notebook: simulated, looked over, and detections put on the ground."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from wildlab.analysis.accuracy import observe_calibrated
from wildlab.analysis.georeference import covariances_of, errors_of, score_points
from wildlab.analysis.georeference import georeference as to_ground
from wildlab.evaluation.errors import ErrorSummary, summarise
from wildlab.flight.checks.check import Finding, Use, check_flight, usable_for
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import chi2_quantile
from wildlab.simulation.twins import simulate_twin
from wildlab.summary_table import Brief, Summary


def simulate(twin: str | Path, seed: int = 1, without: Collection[str] = ()) -> Flight:
    """Simulate a twin. The same seed gives the same flight, to the last bit.

    Parameters
    ----------
    twin
        A twin that comes with wildlab (``"fast-vessel"``), or a file like those in ``data/twins``.
    seed
        A whole number from 0.
    without
        Tables to leave out, to save time: any of ``"imu"`` and ``"gnss"``.

    Returns
    -------
    Flight
        In memory; `save_flight` writes it.

    Raises
    ------
    WildlabError
        Where the twin or one of its parameters is unusable, or the seed is negative.

    Examples
    --------
    >>> import wildlab
    >>> flight = wildlab.simulate("large-ship", seed=1)
    >>> flight.name
    'large-ship-1'
    """
    return simulate_twin(twin, seed, without)


@dataclass(frozen=True, repr=False)
class Checked(Brief):
    """What is to be known about a flight before it is used.

    Attributes
    ----------
    findings
        Worst first, in whole sentences.
    uses
        What the flight can be used for, and why not.
    """

    findings: tuple[Finding, ...]
    uses: tuple[Use, ...]

    @property
    def problems(self) -> tuple[Finding, ...]:
        """The findings that keep something from being used."""
        return tuple(one for one in self.findings if one.level == "problem")

    def brief(self) -> Summary:
        """A row for each finding, and one for each use."""
        rows: list[tuple[str, str]] = [(one.level, one.sentence) for one in self.findings]
        rows += [(one.purpose, f"{'yes' if one.usable else 'no'}, {one.why}") for one in self.uses]
        n = len(self.problems)
        return Summary(f"{n or 'No'} problem{'' if n == 1 else 's'}", rows)


def check(flight: Flight) -> Checked:
    """Whether a flight is usable, for what, and whether its numbers make sense.

    Parameters
    ----------
    flight
        The flight; nothing in it is changed.

    Returns
    -------
    Checked

    Examples
    --------
    >>> import wildlab
    >>> checked = wildlab.check(wildlab.simulate("large-ship"))
    >>> checked.problems
    ()
    >>> [use.purpose for use in checked.uses if use.usable]
    ['georeferencing accuracy', 'tracking']
    """
    return Checked(tuple(check_flight(flight)), tuple(usable_for(flight)))


@dataclass(frozen=True, repr=False)
class Points(Brief):
    """Detections on the ground.

    Attributes
    ----------
    flight, source
        Where they come from: the flight, and the name of the poses.
    table
        One row for each detection: see `wildlab.analysis.georeference.georeference`.
    """

    flight: Flight
    source: str
    table: pd.DataFrame

    def brief(self) -> Summary:
        """How many there are, and how long their ellipses."""
        placed = int(self.table["north_m"].notna().sum())
        P = covariances_of(self.table)
        known = np.isfinite(P).all(axis=(1, 2))
        rows = [("poses", self.source), ("on the ground", f"{placed} of {len(self.table)} detections")]
        if known.any():
            half = np.sqrt(np.linalg.eigvalsh(P[known])[:, 1] * chi2_quantile(0.9, 2))
            rows.append(("longer half axis of the 90 % ellipse", f"{np.median(half):.2f} m (median)"))
        if "ray" in self.table:
            counts = self.table["ray"].value_counts()
            rows.append(("rays over terrain", "; ".join(f"{n} {what}" for what, n in counts.items())))
        return Summary(f"Points of {self.flight.name}", rows)


def georeference(flight: Flight, source: str | None = None, seed: int = 0) -> Points:
    """Put a flight's pixel detections on the ground, each with its covariance.

    A calibration that the flight keeps is applied.

    Poses and ground come from the flight, the ground being its terrain where it has one; standard deviations
    from the log where it has them, else from the manifest, else usual ones
    (`wildlab.analysis.georeference.USUAL`).

    Parameters
    ----------
    flight
        With frames, pixel detections and poses.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    seed
        Of the samples that decide the ellipses of flat rays.

    Returns
    -------
    Points
        Its ``table`` has north, east and down (m) from the flight's origin; NaN where the ray misses the
        ground.

    Raises
    ------
    WildlabError
        Where the flight has no frames, detections or poses, or two sources to choose from.

    Examples
    --------
    >>> import wildlab
    >>> points = wildlab.georeference(wildlab.simulate("large-ship"), source="autopilot")
    >>> list(points.table[["north_m", "east_m"]].isna().any())
    [False, False]
    """
    name, _ = flight.pose_source(source)
    observations, errors = observe_calibrated(flight, name)
    return Points(flight, name, to_ground(observations, np.random.default_rng(seed), errors))


@dataclass(frozen=True, repr=False)
class PointErrors(Brief):
    """Points beside the truth.

    Attributes
    ----------
    points
        What was scored.
    table
        Those of them that can be judged: see `wildlab.analysis.georeference.score_points`.
    summary
        Of the horizontal errors, m.
    inside_90
        Share of the points whose 90 % ellipse holds the truth; NaN where there are no ellipses.
    """

    points: Points
    table: pd.DataFrame
    summary: ErrorSummary
    inside_90: float

    def brief(self) -> Summary:
        """Size of the errors, and what the ellipses are worth."""
        s = self.summary
        rows = [
            ("poses", self.points.source),
            ("compared", f"{s.n} points"),
            ("mean, median, 90 %", f"{s.mean:.2f}, {s.median:.2f}, {s.p90:.2f} m"),
            ("mean error north, east", f"{s.bias_north:.2f}, {s.bias_east:.2f} m (point minus truth)"),
        ]
        if np.isfinite(self.inside_90):
            rows.append(("truth inside the 90 % ellipse", f"{100 * self.inside_90:.0f} %"))
        return Summary(f"Errors of the points of {self.points.flight.name}", rows)


def evaluate_points(points: Points) -> PointErrors:
    """Compare points with the truth, by the scoring rule of the flight.

    Parameters
    ----------
    points
        From `georeference`.

    Returns
    -------
    PointErrors

    Raises
    ------
    WildlabError
        Where the flight has no truth, or none of its points can be judged.

    Examples
    --------
    >>> import wildlab
    >>> points = wildlab.georeference(wildlab.simulate("large-ship"), source="truth")
    >>> errors = wildlab.evaluate_points(points)
    >>> errors.summary.n == len(points.table)
    True
    """
    scored = score_points(points.flight, points.table)
    return PointErrors(points, scored, summarise(errors_of(scored)), float(scored["inside_90"].mean()))
