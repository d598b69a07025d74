"""How well stated and true errors match: the headline of the reports on the Schmidt filter, and its curve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.evaluation.consistency import Average, average, share_inside
from wildlab.reporting.published import load_published
from wildlab.reporting.spread import bounds_of
from wildlab.studies.schmidt.trial import (
    BOUNDS,
    CALIBRATION_S,
    COVARIANCES,
    CURVE,
    DEGREES,
    ESTIMATED,
    FACTORS,
    SHEET,
    SOURCE,
    constant,
)

#: Where a pose covariance is from, and whose poses it is of.
ORIGINS = {
    "schmidt": ("tuned to H 7.5.3", SOURCE, SOURCE),
    "schmidt-data-sheet": ("as the data sheets give it", SHEET, SHEET),
    "schmidt-estimated": ("as a calibration flight gave it", ESTIMATED, SOURCE),
}
HONESTY_COLUMNS = {
    "told": "pose covariance",
    "stated": "stated: roll, pitch, yaw (°)",
    "true": "true, RMS (°)",
    "median": "NEES, median flight",
    "ratio": "error / stated",
    "drawn": "NEES, one moment of each flight",
    "band": "consistent: 95 %",
    "verdict": "verdict",
    "inside": "in the lenient band (%)",
}
HONESTY_DIGITS = {"median": 2, "ratio": 2, "drawn": 2, "inside": 0}
OPTIMISTIC, PESSIMISTIC, CONSISTENT = "optimistic", "pessimistic", "nothing against it"


class Honesty(NamedTuple):
    """How well a filter's stated and true errors match.

    ``median`` of the flights' average NEES; ``drawn``, the mean of one value of each flight with the interval
    of a consistent filter's; ``inside``, the share of flights whose average lies within the bounds of single
    values; ``flights``.
    """

    median: float
    drawn: Average
    inside: float
    flights: int

    @property
    def ratio(self) -> float:
        """How many times as large as stated errors are on the median flight."""
        return float(np.sqrt(self.median / 2))

    @property
    def overall(self) -> float:
        """The same by the mean of one moment of each flight, where flights with large errors weigh more."""
        return float(np.sqrt(self.drawn.mean / 2))

    @property
    def verdict(self) -> str:
        """`OPTIMISTIC`, `PESSIMISTIC`, `CONSISTENT` or "not known", by the test over all flights."""
        if np.isnan(self.drawn.mean):
            return "not known"
        if self.drawn.inside:
            return CONSISTENT
        return OPTIMISTIC if self.drawn.mean > self.drawn.high else PESSIMISTIC


def honesty(spread: pd.DataFrame, who: str) -> Honesty:
    """`Honesty` of a filter over flights, one row each."""
    values = spread[who, "nees"]
    drawn = average(spread[who, "nees_drawn"].to_numpy(float), 2)
    return Honesty(float(values.median()), drawn, share_inside(values, BOUNDS), len(values))


def honest_words(one: Honesty) -> str:
    """Which way a filter errs and by how much, as what follows "it is"."""
    if one.verdict == CONSISTENT:
        return f"not found wrong ({one.overall:.1f} times)"
    return f"{one.verdict} ({one.overall:.1f} times, over all flights)"


def summary_words(spread: pd.DataFrame) -> list[str]:
    """The summary's sentences."""
    found = {who: honesty(spread, who) for who in ("ekf", *COVARIANCES)}
    ratios = ", ".join(f"{found[who].ratio:.1f} times ({ORIGINS[who][0]})" for who in COVARIANCES)
    verdicts = "; ".join(f"{ORIGINS[who][0]}, {found[who].verdict}" for who in COVARIANCES)
    passed = ", ".join(f"{100 * found[who].inside:.0f} %" for who in COVARIANCES)
    mae = {who: spread[who, "mae"].mean() for who in ("ekf", "schmidt")}
    return [
        f"With three pose covariances the Schmidt filter's errors are {ratios} what it states, those of the "
        f"extended filter, which takes the poses for true, {found['ekf'].ratio:.1f} times.",
        f"That is of the median flight. A test with one moment of each of {len(spread)} flights says: "
        f"{verdicts}; extended filter, {found['ekf'].verdict}.",
        "By a lenient band, the average of one flight within the bounds that the thesis draws for single "
        "values, "
        f"{passed} of the flights pass in that order, and {100 * found['ekf'].inside:.0f} % with the "
        "extended filter. The first covariance was tuned to the standard deviations that H prints: its share "
        "says how the print fits this twin, not what the filter is worth.",
        f"Positions are {mae['schmidt']:.1f} m off on average, those of the extended filter "
        f"{mae['ekf']:.1f} m.",
    ]


def tile_words(spread: pd.DataFrame, published: Mapping[tuple[str, str], float]) -> list[tuple[str, str]]:
    """The few numbers to remember."""
    found = {who: honesty(spread, who) for who in ("ekf", *COVARIANCES)}
    tiles = [
        (
            f"{found[who].ratio:.1f} times",
            f"what it states: the Schmidt filter's error, covariance {ORIGINS[who][0]} (median flight; over "
            f"all flights {found[who].overall:.1f} times: {found[who].verdict})",
        )
        for who in COVARIANCES
    ]
    tiles.append((f"{found['ekf'].ratio:.1f} times", f"the extended filter's ({found['ekf'].verdict})"))
    return [
        *tiles,
        (
            f"{found['schmidt'].median:.1f}",
            "mean NEES, Schmidt filter (median flight); published "
            f"{published['schmidt', 'nees']:g}; two would be exact",
        ),
    ]


def honesty_table(spread: pd.DataFrame) -> pd.DataFrame:
    """A row for the extended filter and for each pose covariance, columns of `HONESTY_COLUMNS`."""
    rows = []
    for who in ("ekf", *COVARIANCES):
        one = honesty(spread, who)
        told, stated, poses = ORIGINS.get(who, ("none: extended filter", "", SOURCE))
        rows.append(
            {
                "told": told,
                "stated": _three(spread, stated, "mean_sd") if stated else "",
                "true": _three(spread, poses, "rms"),
                "median": one.median,
                "ratio": one.ratio,
                "drawn": one.drawn.mean,
                "band": f"{one.drawn.low:.2f} to {one.drawn.high:.2f}",
                "verdict": one.verdict,
                "inside": 100 * one.inside,
            }
        )
    return pd.DataFrame(rows)


def _three(spread: pd.DataFrame, source: str, what: str) -> str:
    means = [float(spread[source, f"{what}_{axis}"].mean()) for axis in ("roll", "pitch", "yaw")]
    return ", ".join(f"{one:.2g}" if one < 0.1 else f"{one:.2f}" for one in means)


def printed_deviations(twin: str) -> dict[str, float]:
    """Mean standard deviations that H prints of its MEKF for the flight of a twin, by name; m and degrees."""
    rows = load_published(f"navigation-{twin}")
    rows = rows[~rows["again"].astype(bool) & rows["name"].str.startswith("mean_sd_")]
    return dict(zip(rows["name"], rows["value"], strict=True))


def tuned_words(spread: pd.DataFrame, printed: Mapping[str, float]) -> str:
    """How near the tuned filter's mean standard deviations are to those printed for this flight.

    Parameters
    ----------
    printed
        From `printed_deviations`.
    """
    ours = {name: float(spread[SOURCE, name].mean()) for name in printed}
    worst = max(printed, key=lambda name: abs(np.log(ours[name] / printed[name])))
    ratio = ours[worst] / printed[worst]
    near = "all within a tenth of the print" if 1 / 1.1 <= ratio <= 1.1 else "not all near the print"
    return (
        "The first covariance is from one tuning for all flights, found from what H prints for the fast "
        f"vessel. On these flights it states {_deviations(ours)}, where H prints {_deviations(printed)} for "
        f"this flight: {near}; farthest is {worst.removeprefix('mean_sd_')}, {ratio:.2f} times the print."
    )


def _deviations(values: Mapping[str, float]) -> str:
    where = ", ".join(f"{100 * values[f'mean_sd_{one}']:.0f}" for one in ("north", "east", "down"))
    angles = ", ".join(f"{values[f'mean_sd_{one}']:.2f}" for one in ("roll", "pitch", "yaw"))
    return f"{where} cm (north, east, down) and {angles}° (roll, pitch, yaw)"


def estimate_words(spread: pd.DataFrame) -> str:
    """What the calibration flights gave, against what the poses on the flights were off by."""
    sd = spread[ESTIMATED, "mean_sd_roll"]
    true = np.sqrt((spread[SOURCE, "rms_roll"] ** 2 + spread[SOURCE, "rms_pitch"] ** 2) / 2)
    ratio = sd.mean() / true.mean()
    how = "as large as" if 0.9 <= ratio <= 1.1 else f"{ratio:.2f} times"
    return (
        f"The calibration flights, {CALIBRATION_S / 60:.0f} minutes of images at most, put roll and pitch, "
        f"with what mount and camera are off by in them, at {sd.min():.2f} to {sd.max():.2f}° "
        f"({sd.mean():.2f}° on average), {how} the true attitude errors of the flights that they are used on "
        f"({true.mean():.2f}°)."
    )


def curve_table(spread: pd.DataFrame) -> pd.DataFrame:
    """A row for each factor on the poses' standard deviations: ``factor``, ``sd`` (deg, mean of the three
    angles), what `Honesty` has of it, and ``low`` and ``high`` of the flights' NEES (`bounds_of`)."""
    one = float(np.mean([spread[SOURCE, f"mean_sd_{axis}"].mean() for axis in ("roll", "pitch", "yaw")]))
    found = [honesty(spread, who) for who in CURVE]
    bounds = [bounds_of(spread[who, "nees"]) for who in CURVE]
    return pd.DataFrame(
        {
            "factor": FACTORS,
            "sd": one * np.array(FACTORS),
            "median": [each.median for each in found],
            "low": [low for low, _ in bounds],
            "high": [high for _, high in bounds],
            "drawn": [each.drawn.mean for each in found],
            "verdict": [each.verdict for each in found],
            "inside": [each.inside for each in found],
        }
    )


def crossing(curve: pd.DataFrame) -> float:
    """The standard deviation (deg) at which the median NEES is two; NaN where the curve is on one side."""
    level = np.log(curve["median"].to_numpy(float) / 2)
    sd = np.log(curve["sd"].to_numpy(float))
    for i in range(len(level) - 1):
        if level[i] >= 0 > level[i + 1]:
            return float(np.exp(sd[i] + (sd[i + 1] - sd[i]) * level[i] / (level[i] - level[i + 1])))
    return float("nan")


def curve_words(spread: pd.DataFrame) -> tuple[str, list[str]]:
    """The title of the curve, and the sentences below it."""
    curve = curve_table(spread)
    at, first, last = crossing(curve), curve.iloc[0], curve.iloc[-1]
    if np.isnan(at):
        side = "above" if first["median"] > 2 else "below"
        title = f"NEES is {side} two from {first['sd']:.2f}° to {last['sd']:.1f}°"
    else:
        title = f"NEES is two where {at:.1f}° are stated"
    fine = curve[curve["verdict"] == CONSISTENT]
    passed = curve[curve["inside"] >= 0.9]
    points = [
        "The test over all flights is passed "
        + (f"at {_degrees(fine)}." if len(fine) else f"at none of the {len(curve)} points of the curve.")
        + " Nine flights of ten lie in the lenient band "
        + (f"at {_degrees(passed)}." if len(passed) else "at no point of it."),
    ]
    at_ends = [honesty(spread, constant(degrees)) for degrees in (DEGREES[0], DEGREES[-1])]
    shares = " and ".join(f"{100 * one.inside:.0f} %" for one in at_ends)
    before = 100 * honesty(spread, "ekf").inside
    points.append(
        f"H finds that {DEGREES[0]:g} to {DEGREES[-1]:g}° in roll, pitch and yaw have the desired effect. "
        f"With exactly these, {shares} of the flights lie in the lenient band, where the extended filter "
        f"does on {before:.0f} %; told {DEGREES[0]:g}° the filter is {honest_words(at_ends[0])}, told "
        f"{DEGREES[-1]:g}° {honest_words(at_ends[1])}."
    )
    return title, points


def _degrees(rows: pd.DataFrame) -> str:
    return f"{', '.join(f'{one:.2f}' for one in rows['sd'])}° ({len(rows)} of {len(FACTORS)} points)"
