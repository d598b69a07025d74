"""What a report says of a receiver's noise: what was found, what it changed, and what it leaves.

Every sentence is chosen by the numbers that it states.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.analysis.navigation_errors import (
    AXES,
    NavigationErrors,
    Studied,
    summarise,
    summarise_innovations,
)
from wildlab.analysis.receiver import Placement, Receiver, place_receiver
from wildlab.evaluation.blocks import PROBABILITY, block_mean, time_blocks
from wildlab.navigation.receiver import SIZE, Candidate, SourceNoise
from wildlab.reporting.report import Report

#: Mean NIS over its ideal within this is of the right level; correlations at lag 1 below that are no colour.
LEVEL, COLOUR = (0.7, 1.4), 0.3
#: So many standard deviations from what is stated are said to be off: four numbers are looked at.
FAR = 3.0
_ORDERS = ("white", "and an error of first order", "and an error of second order")
_PARTS = (
    ("white noise, level", 0),
    ("white noise, height", 1),
    ("slow error, level", 0),
    ("slow error, height", 1),
    ("how long that keeps", None),
    ("over what its change is smooth", None),
)


def parameters_table(receiver: Receiver) -> pd.DataFrame:
    """Every number of the noise that was chosen, beside what is stated.

    Returns
    -------
    DataFrame
        ``source``, ``what``, ``unit``, ``stated``, ``found``, ``low`` and ``high`` (two standard deviations
        by the information in the innovations; NaN at the limit of what was tried).
    """
    rows = []
    scale, chosen = receiver.scale, receiver.chosen
    for index, (name, noise, stated, unit) in enumerate(
        (("position", chosen.noise.position, scale.position, "m"),
         ("velocity", chosen.noise.velocity, scale.velocity, "m/s"))
    ):  # fmt: skip
        if stated is None:
            continue
        for place, (what, axis) in enumerate(_PARTS):
            if place > 1 and (noise.order == 0 or (place == 5 and noise.order == 1)):
                continue
            value = noise[place] * (stated[axis] if place < 2 and axis is not None else 1.0)
            spread = float(np.exp(2 * chosen.sd[SIZE * index + place]))
            rows.append(
                {
                    "source": name,
                    "what": what,
                    "unit": "s" if axis is None else unit,
                    "stated": stated[axis] if place < 2 and axis is not None else np.nan,
                    "found": value,
                    "low": value / spread,
                    "high": value * spread,
                }
            )
    return pd.DataFrame(rows)


def models_table(receiver: Receiver) -> pd.DataFrame:
    """Models that were tried: ``model``, ``parameters``, ``gain`` of the log likelihood over what is stated,
    ``score`` (that less what chance gains) and ``chosen``."""
    first = receiver.candidates[0]
    return pd.DataFrame(
        [
            {
                "model": _model(one, receiver),
                "parameters": one.parameters,
                "gain": one.log_likelihood - first.log_likelihood,
                "score": one.score - first.score,
                "chosen": "chosen" if one is receiver.chosen else "",
            }
            for one in receiver.candidates
        ]
    )


def _model(one: Candidate, receiver: Receiver) -> str:
    if one.parameters == 0:
        return "as stated"
    moving = "" if receiver.scale.velocity is None else f"; velocities {_ORDERS[one.noise.velocity.order]}"
    return f"positions {_ORDERS[one.noise.position.order]}{moving}"


def words_on_estimate(receiver: Receiver) -> str:
    """What was found from how much, and by what it was chosen."""
    since = f"the {receiver.fixes} fixes from {receiver.begin:.0f} to {receiver.end:.0f} s"
    left_out = f" {receiver.gross} fixes that no noise explains were left out." if receiver.gross else ""
    if receiver.noise is None:
        return (
            f"From {since}, what is stated of the receiver is as likely as any of the "
            f"{len(receiver.candidates) - 1} other models of its noise: nothing was changed.{left_out}"
        )
    scale = receiver.scale
    sources = [f"Positions have {_noise(receiver.noise.position, scale.position, 'm', scale.duration)}."]
    if scale.velocity is not None:
        sources.append(
            f"Velocities have {_noise(receiver.noise.velocity, scale.velocity, 'm/s', scale.duration)}."
        )
    return (
        f"The likeliest noise by {since}, of {len(receiver.candidates)} models; no pose found on board has a "
        f"part in it. {' '.join(sources)}{left_out}"
    )


def _noise(noise: SourceNoise, stated: np.ndarray, unit: str, longest: float) -> str:
    white = _two(noise.white_level * stated[0]), _two(noise.white_vertical * stated[1])
    words = f"white noise of {white[0]} {unit} level and {white[1]} {unit} in height"
    if noise.order == 0:
        return f"{words}, and no error that lasts"
    words += (
        f", and beside it an error of {_two(noise.sd_level)} and {_two(noise.sd_vertical)} {unit} that keeps "
    )
    # No flight tells how long an error keeps that outlasts it.
    words += "for all of that time" if noise.time > 0.99 * longest else f"for {_two(noise.time)} s"
    return words + (f" and whose change is smooth over {_two(noise.rate_time)} s" if noise.order == 2 else "")


def _two(value: float) -> str:
    """With two digits that count."""
    return f"{float(f'{value:.2g}'):g}"


def left_over(ratio: float, lag1: float) -> tuple[str, ...]:
    """What innovations still have that they should not: ``"level"``, ``"colour"``, both or nothing.

    Parameters
    ----------
    ratio
        Mean NIS over its ideal.
    lag1
        Largest correlation at lag 1.
    """
    level = () if LEVEL[0] <= ratio <= LEVEL[1] else ("level",)
    return level if abs(lag1) < COLOUR else (*level, "colour")


def words_on_innovations(before: pd.DataFrame, after: pd.DataFrame | None) -> list[str]:
    """A sentence for each source: NIS and correlation with what is stated and with what was found, and which
    of the two is left.

    Parameters
    ----------
    before, after
        As `summarise_innovations` gives them; ``after`` is None where nothing was changed.
    """
    now = {} if after is None else {row["source"]: row for row in after.to_dict(orient="records")}
    sentences = []
    for was in before.to_dict(orient="records"):
        name = was["source"]
        then = was["nis"] / was["dof"], was["lag1"]
        words = f"GNSS {name}: with what is stated the mean NIS is {then[0]:.2f} of its ideal and the "
        words += f"correlation at lag 1 {then[1]:.2f}"
        last = then
        if name in now:
            last = now[name]["nis"] / now[name]["dof"], now[name]["lag1"]
            words += f"; with what was found, {last[0]:.2f} and {last[1]:.2f}"
        sentences.append(
            f"{words}. {_LEFT[left_over(*last)].format(low=LEVEL[0], high=LEVEL[1], lag=COLOUR)}"
        )
    return sentences


_LEFT = {
    (): "Both are as they should be: {low} to {high}, and below {lag}.",
    ("level",): "What is left is the level, which should be {low} to {high}; the colour is below {lag}.",
    (
        "colour",
    ): "What is left is the colour, which should be below {lag}; the level is within {low} to {high}.",
    ("level", "colour"): "Both are left: the level should be {low} to {high}, the colour below {lag}.",
}


def words_on_attitude(before: NavigationErrors, after: NavigationErrors, begin: float, end: float) -> str:
    """Whether the attitude came nearer to the reference by the noise that was found, between two times, s."""
    inside = (before.times >= begin) & (before.times < end)
    squares = [np.degrees(one.error[inside, 6:]) ** 2 @ np.ones(3) for one in (before, after)]
    known = np.isfinite(squares[0]) & np.isfinite(squares[1])
    was, now = (float(np.sqrt(one[known].mean())) if known.any() else np.nan for one in squares)
    change = squares[1] - squares[0]
    span = block_mean(change[known], time_blocks(before.times[inside][known], seconds=True))
    if span.low > 0:
        verdict = "farther from it"
    elif span.high < 0:
        verdict = "nearer to it"
    else:
        verdict = "neither nearer nor farther"
    said = "too short a time to say which is nearer."
    if np.isfinite(span.low):
        said = (
            f"{verdict}, by the {100 * PROBABILITY:.0f} % interval of the difference of mean squares over "
            f"blocks of the flight, {span.low:+.2f} to {span.high:+.2f} degrees squared."
        )
    return (
        f"The attitude is {now:.2f} degrees from the reference with that noise, all three axes together, and "
        f"{was:.2f} with what is stated: {said}"
    )


def words_on_placement(found: Placement, stated: ArrayLike) -> str:
    """How late the receiver is and where its antenna sits, and what of that is not as stated.

    Parameters
    ----------
    found
        As `place_receiver` gives it.
    stated
        (4,) latency, s, and lever arm, m.
    """
    given = np.asarray(stated, float)
    likely = np.array([found.latency, *found.lever])
    looked = np.isfinite(found.sd)
    if not looked.any():
        return "How late the receiver is cannot be told from this flight."
    off = looked & (np.abs(likely - given) > FAR * found.sd)
    words = (
        f"With that noise the fixes are likeliest {likely[0]:.3f} s late (SD {found.sd[0]:.3f}; stated "
        f"{given[0]:.3f})"
    )
    if looked[1:].all():
        arms = [", ".join(f"{value:.2f}" for value in values[1:]) for values in (likely, found.sd, given)]
        words += f" and the antenna at {arms[0]} m (SD {arms[1]}; stated {arms[2]})"
    if not off.any():
        return f"{words}: as stated, within {FAR:.0f} SD."
    write = [f"latency_s = {likely[0]:.3f}"] if off[0] else []
    if off[1:].any():
        write.append(f"lever_arm_m = [{', '.join(f'{value:.2f}' for value in likely[1:])}]")
    return (
        f"{words}: more than {FAR:.0f} SD from what is stated. Unless you know better, write "
        f"{' and '.join(write)} in [gnss]. No pose found on board has a part in it."
    )


def parts_table(studied: Studied, parts: Sequence[tuple[str, float, float]]) -> pd.DataFrame:
    """Innovations and attitude in parts of a flight (words, from, to, s), with what is stated and as found.

    Returns
    -------
    DataFrame
        A row for each part and source: ``part``, ``source``; NIS over its ideal and correlation at lag 1
        (``ratio_before``, ``lag1_before``, ``ratio``, ``lag1``); RMS of the attitude's difference from the
        reference (``off_before``, ``off``, degrees); and what is ``left``, in words. Where nothing was
        changed, before is now.
    """
    rows = []
    last = "mekf-receiver" if "mekf-receiver" in studied.found else "mekf"
    for words, begin, end in parts:
        now = summarise_innovations(studied.found[last], begin, end)
        was = summarise_innovations(studied.found["mekf"], begin, end)
        off = {}
        for who in ("mekf", last):
            numbers = summarise(studied.scored[who], begin, end)
            off[who] = float(np.linalg.norm([numbers[f"rms_{axis}"] for axis in AXES]))
        for (_, before), (_, after) in zip(was.iterrows(), now.iterrows(), strict=True):
            ratio, lag1 = after["nis"] / after["dof"], after["lag1"]
            rows.append(
                {
                    "part": words,
                    "source": after["source"],
                    "ratio_before": before["nis"] / before["dof"],
                    "lag1_before": before["lag1"],
                    "ratio": ratio,
                    "lag1": lag1,
                    "off_before": off["mekf"],
                    "off": off[last],
                    "left": " and ".join(left_over(ratio, lag1)),
                }
            )
    return pd.DataFrame(rows)


def words_on_parts(table: pd.DataFrame) -> str:
    """Whether one noise does for all parts of the flight; ``table`` as `parts_table` gives it."""
    amiss = table[table["left"] != ""]
    if not len(amiss):
        return "In no part of the flight that is listed below is either left."
    ratios = table["ratio"]
    of = "; ".join(f"{row['part']}, {row['source']}: {row['left']}" for _, row in amiss.iterrows())
    return (
        f"Part by part, the mean NIS is {ratios.min():.2f} to {ratios.max():.2f} of its ideal. What is left: "
        f"{of}. One noise for the whole flight does not do for these parts."
    )


def thirds(begin: float, end: float) -> list[tuple[str, float, float]]:
    """The thirds of a time, s, for a flight of which nobody named parts."""
    edges = np.linspace(begin, end, 4)
    names = ("first third", "second third", "last third")
    return [(name, float(edges[i]), float(edges[i + 1])) for i, name in enumerate(names)]


def show_receiver(report: Report, studied: Studied, parts: Sequence[tuple[str, float, float]]) -> None:
    """The section on the receiver's noise of a logged flight, and on the parts of it that are named, s."""
    receiver = studied.receiver
    if receiver is None:
        report.section("How does the receiver err?", f"Not found out: {studied.refusal}.")
        _, begin, end = parts[0]
        report.points(words_on_innovations(summarise_innovations(studied.found["mekf"], begin, end), None))
        return
    begin, end = receiver.begin, receiver.end
    report.section("How does the receiver err?", words_on_estimate(receiver))
    before = summarise_innovations(studied.found["mekf"], begin, end)
    changed = receiver.noise is not None
    after = summarise_innovations(studied.found["mekf-receiver"], begin, end) if changed else None
    by_part = parts_table(studied, parts if len(parts) > 1 else thirds(begin, end))
    points = [*words_on_innovations(before, after), words_on_parts(by_part)]
    if changed:
        both = studied.scored["mekf"], studied.scored["mekf-receiver"]
        points.append(words_on_attitude(*both, begin, end))
        gnss = studied.flight.manifest.gnss
        placed = place_receiver(studied.flight, receiver.chosen.noise)
        points.append(words_on_placement(placed, [gnss.latency_s, *gnss.lever_arm_m]))
        points.append("The noise was found from the innovations that are judged here, of one flight.")
    report.points(points)
    report.table(
        by_part,
        columns={
            "part": "part",
            "source": "GNSS",
            "ratio_before": "NIS over ideal, as stated",
            "ratio": "as found",
            "lag1_before": "lag 1, as stated",
            "lag1": "lag 1, as found",
            "left": "left",
            "off_before": "attitude, as stated (°)",
            "off": "attitude, as found (°)",
        },
        digits=2,
        caption="Innovations by part of the flight, and the RMS rotation between estimate and reference.",
    )
    report.table(
        models_table(receiver),
        columns={
            "model": "noise of the receiver",
            "parameters": "numbers found",
            "gain": "log likelihood above the stated",
            "score": "less what chance gains",
            "chosen": "",
        },
        digits={"gain": 1, "score": 1},
        caption="Models that were tried, each with its likeliest numbers. Chance gains half the logarithm of "
        "the number of measurements for each number found (Schwarz).",
    )
    if changed:
        report.table(
            parameters_table(receiver),
            columns={
                "source": "GNSS",
                "what": "what",
                "unit": "unit",
                "stated": "stated SD",
                "found": "found",
                "low": "from",
                "high": "to",
            },
            digits={"stated": 2, "found": 3, "low": 3, "high": 3},
            caption="From and to: two standard deviations, by the information that the innovations have. "
            "Where there is none, the number is at the limit of what was tried: the flight does not tell.",
        )
