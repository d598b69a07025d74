"""Parts of a report on navigation: what flights with and without truth have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.analysis.navigate import likelihoods_of_latency
from wildlab.analysis.navigation_errors import (
    AXES,
    PLACES,
    Studied,
    against_autopilot,
    calibrated,
    normalised_innovations,
    shares_within,
    summarise,
    summarise_innovations,
)
from wildlab.analysis.navigation_inputs import heading_from
from wildlab.evaluation.whiteness import innovation_whiteness
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.navigation import (
    NAMES,
    bias_chart,
    correlation_strips,
    deviation_chart,
    error_bands,
    mark_period,
    squares_chart,
)
from wildlab.reporting.report import Report
from wildlab.reporting.text import percent
from wildlab.studies.navigation.flown import counterpart_words, period_words, tracking_period

WORDS = {
    "mekf": "MEKF, noise as stated",
    "mekf-receiver": "MEKF, receiver's noise as found",
    "observer": "Nonlinear observer",
    "autopilot": "Autopilot",
    "mekf-published-like": "MEKF, tuned like H 7.5.3",
    "mekf-published-like-turning": "MEKF, tuned like H 7.5.4, flight 1",
    "mekf-published-like-long": "MEKF, tuned like H 7.5.4, flight 2",
}
CONVENTION = (
    "Position and velocity in n (m, m/s), attitude as four times the modified Rodrigues parameters of dq in "
    "q_true = q_hat dq, in b (rad); truth minus estimate."
)
#: Delays of a receiver that are tried, s.
LATENCIES = np.arange(0.0, 0.41, 0.02)
_TURNS = [f"{axis} (°)" for axis in AXES]
_SPEEDS = [f"{place} (m/s)" for place in PLACES]


def has_truth(studied: Studied) -> bool:
    """Whether it was scored by the truth, rather than by another estimate."""
    return studied.reference == "truth-payload"


def limits_of_observer(flight: Flight) -> list[str]:
    """What the observer's figures hang on, in sentences, for a flight with one antenna."""
    if heading_from(flight) == "antennas":
        return []
    course = "takes the course for the heading, and is off by the crab angle in wind"
    field = (
        "takes the magnetic field for its second vector, and is off by what calibrating that in flight leaves"
    )
    by_course = heading_from(flight) == "course"
    found = [f"With one antenna the observer {course if by_course else field}."]
    if not calibrated(flight):
        found.append(
            "The observer is for calibrated accelerometers, and by what is stated these are not: the "
            "bias that the filter found was taken off before. So the two do not check each other in that."
        )
    return found


def words_on_latency(flight: Flight) -> str:
    """How late the receiver is taken to be, and what the flight's own measurements say of it."""
    likely = likelihoods_of_latency(flight, LATENCIES)
    stated, likeliest = flight.manifest.gnss.latency_s, float(LATENCIES[int(np.argmax(likely))])
    return (
        f"The receiver is taken to stamp its fixes {stated:.2f} s late. To the filter, the fixes of this "
        f"flight are likeliest with {likeliest:.2f} s, of all delays up to {LATENCIES[-1]:.1f} s in steps of "
        f"{LATENCIES[1] - LATENCIES[0]:.2f} s; no attitude found on board has a part in that."
    )


def differences_table(studied: Studied, parts: Sequence[tuple[str, float, float]]) -> pd.DataFrame:
    """RMS errors and stated deviations of filter, observer and autopilot, a row for each and each part."""
    return pd.DataFrame(
        [
            {"who": WORDS[who], "part": part, **summarise(studied.scored[who], begin, end)}
            for part, begin, end in parts
            for who in ("mekf-receiver", "mekf", "observer", "autopilot")
            if who in studied.scored
        ]
    )


def _inside(errors: Array, stated: Array) -> str:
    """The share of errors that are within two stated standard deviations; (K, 3) both."""
    known = np.isfinite(errors) & np.isfinite(stated)
    return percent(float((np.abs(errors) <= 2 * stated)[known].mean()), 0)


def show_errors(report: Report, studied: Studied, window: tuple[float, float], figures: int | None) -> None:
    """Attitude and velocity against the reference, with the bounds that the filter states of itself.

    ``figures`` is the first figure of H's chapter 7 that the flight answers to; None for a public flight.
    """
    late = (studied.times >= window[0]) & (studied.times < window[1])
    of = {"mekf": studied.scored["mekf"], "observer": studied.scored["observer"]}
    whom = "the truth" if has_truth(studied) else "the one found on board"
    period = tracking_period(studied.flight)

    def instead(offset: int) -> str:
        if figures is None:
            return ""
        return f"{counterpart_words(figures + offset)[:-1]}, with {whom} in place of the autopilot."

    turns = {who: np.degrees(e.error[late, 6:]) for who, e in of.items()}
    stated = np.degrees(of["mekf"].sd[late, 6:])
    figure = error_bands(
        studied.times[late],
        turns,
        {"mekf": stated},
        _TURNS,
        f"{_inside(turns['mekf'], stated)} of the angles are within two SD of {whom}",
        largest=3 * float(np.nanquantile(np.abs(turns["observer"]), 0.95)),
    )
    mark_period(figure, period)
    report.figure(
        figure,
        name="attitude-errors",
        alt="Differences of roll, pitch and yaw over time by filter and observer, with two deviations. "
        f"{rms_words(turns, AXES, '°')}.{period_words(period)}",
        caption="Rotation from the estimate to the reference about the axes of the body; shaded: two "
        f"deviations.{period_words(period)}{instead(2)}",
        main=True,
    )
    if np.isfinite(of["mekf"].error[late, 3:6]).any():
        errors = {who: e.error[late, 3:6] for who, e in of.items()}
        bound = of["mekf"].sd[late, 3:6]
        title = f"{_inside(errors['mekf'], bound)} of the velocities are within two SD of {whom}"
        figure = error_bands(studied.times[late], errors, {"mekf": bound}, _SPEEDS, title)
        mark_period(figure, period)
        report.figure(
            figure,
            name="velocity-errors",
            alt="Differences of velocity over time by filter and observer, and two standard deviations. "
            f"{rms_words(errors, PLACES, ' m/s')}.{period_words(period)}",
            caption=f"Shaded: two deviations.{period_words(period)}{instead(3)}",
        )


def rms_words(errors: Mapping[str, ArrayLike], axes: Sequence[str], unit: str) -> str:
    """Root mean squares of errors (K, 3) by source, for alternative texts.

    Examples
    --------
    >>> rms_words({"observer": [[3.0, 0.0, 1.0], [3.0, 0.0, -1.0]]}, ("x", "y", "z"), " m")
    'Root mean squares: observer x 3.00 m, y 0.00 m, z 1.00 m'
    """
    said = []
    for name, values in errors.items():
        sizes = np.sqrt(np.nanmean(np.square(np.asarray(values, float)), axis=0))
        each = ", ".join(f"{axis} {size:.2f}{unit}" for axis, size in zip(axes, sizes, strict=True))
        said.append(f"{NAMES.get(name, name)} {each}")
    return f"Root mean squares: {'; '.join(said)}"


def show_against_autopilot(report: Report, studied: Studied, tuned: str, begin: float, figures: int) -> None:
    """The filter with deviations like the printed ones, against the autopilot as in H."""
    difference = against_autopilot(studied, tuned)
    late, period = studied.times >= begin, tracking_period(studied.flight)
    share = {name: 100 * value for name, value in shares_within(difference, begin).items()}
    for part, scale, labels, offset, title in (
        (slice(6, 9), np.degrees(1.0), _TURNS, 2, f"Roll: {share['inside_roll']:.0f} % within two SD"),
        (slice(3, 6), 1.0, _SPEEDS, 3, f"Velocity: {share['inside_velocity']:.0f} % within two SD"),
    ):
        off = scale * difference.error[late, part]
        stated = scale * difference.sd[late, part]
        figure = error_bands(studied.times[late], {"mekf": off}, {"mekf": stated}, labels, title)
        mark_period(figure, period)
        axes, unit = (AXES, "°") if offset == 2 else (PLACES, " m/s")
        report.figure(
            figure,
            name=f"fig-7-{figures + offset}",
            alt="Differences between filter and autopilot over time, with two deviations of the filter. "
            f"{title}. {rms_words({'mekf': off}, axes, unit)}.{period_words(period)}",
            caption=f"{WORDS[tuned]}, with the autopilot as reference.{period_words(period)}"
            f"{counterpart_words(figures + offset)}",
        )


def show_states(report: Report, studied: Studied, printed: Sequence[float] | None) -> None:
    """Deviations and biases that the filter states; ``printed`` are six published means, m and degrees."""
    sd = studied.scored["mekf"].sd
    both = np.hstack([sd[:, :3], np.degrees(sd[:, 6:])])
    report.figure(
        deviation_chart(studied.times, both, printed, ("m", "°"), "What the filter states of itself"),
        name="deviations",
        alt="Standard deviations of position and attitude that the filter states, over time on log axes.",
        caption="Standard deviations over time"
        + ("; broken: the means that H prints of its own." if printed is not None else "."),
    )
    biases = studied.found["mekf"].biases
    columns = [str(name) for name in biases if not str(name).startswith("sd_") and name != "time_s"]
    report.figure(
        bias_chart(
            biases["time_s"],
            biases[columns],
            biases[[f"sd_{c}" for c in columns]],
            "Biases that the filter finds",
        ),
        name="biases",
        alt="Biases of the three accelerometers and gyros over time, each with two deviations.",
        caption="Biases along the axes of the body, with two standard deviations.",
    )


def show_innovations(report: Report, studied: Studied, window: tuple[float, float]) -> None:
    """NIS and autocorrelation of the filter's innovations, in figures and in a table."""
    found = studied.found["mekf"]
    raw = found.innovations[found.innovations["time_s"].between(*window)]
    split = {str(name): part for name, part in raw.groupby("source", sort=False)}
    report.figure(
        squares_chart(
            {name: (part["time_s"], part["nis"]) for name, part in split.items()},
            3,
            "NIS",
            "Do measurements fit what the filter expects?",
        ),
        name="nis",
        alt="Normalised innovation squared over time for each source on a log axis, with its 95 % band.",
        caption="Normalised innovation squared of the filter; three degrees of freedom.",
    )
    white = {name: innovation_whiteness(normalised_innovations(part), 40) for name, part in split.items()}
    report.figure(
        correlation_strips(
            {name: w.autocorrelation for name, w in white.items()},
            {name: w.bound for name, w in white.items()},
            "Do innovations that follow each other agree?",
        ),
        name="autocorrelation",
        alt="Autocorrelation of the innovations of each source by lag, with the band of white noise.",
        caption="Autocorrelation of the innovations in units of what the filter expects; green: where white "
        "noise stays with 95 %.",
    )
    table = summarise_innovations(found._replace(innovations=raw))
    report.table(
        table.assign(inside=100 * table["inside"], left_out=100 * table["left_out"]),
        columns={
            "source": "GNSS",
            "n": "measurements",
            "nis": "mean NIS",
            "dof": "ideal",
            "inside": "within 95 % band (%)",
            "left_out": "left out (%)",
            "lag1": "correlation at lag 1",
            "bound": "white below",
        },
        digits={"nis": 2, "inside": 1, "left_out": 1, "lag1": 3, "bound": 3},
        caption=f"Innovations of the filter ({WORDS['mekf']}).",
    )
    if found.signs:
        report.subsection("What should make you doubt it")
        report.points(found.signs)


def show_nees(report: Report, studied: Studied, begin: float) -> None:
    """NEES of the filter over time, where there is a truth."""
    late = studied.times >= begin
    report.figure(
        squares_chart(
            {name: (studied.times[late], v[late]) for name, v in studied.scored["mekf"].nees.items()},
            3,
            "NEES",
            "Are the errors as large as the filter says?",
        ),
        name="nees",
        alt="NEES of position, velocity and attitude over time on log axes, with 95 % bands.",
        caption=f"NEES, three degrees of freedom each. {CONVENTION} An error that stays for the whole flight "
        "keeps it on one side.",
    )


def sheet_words(published: Mapping[tuple[str, str], float], spread: pd.DataFrame) -> str:
    """How the deviations of the filter that has the data sheets' noise compare with the printed ones.

    Parameters
    ----------
    published
        By (subject, name).
    spread
        What the trial gives, one row for each flight.
    """
    names = [f"mean_sd_{name}" for name in (*PLACES, *AXES)]
    ratios = [float(spread["mekf", name].median() / published["mekf", name]) for name in names]
    low, high = min(ratios), max(ratios)
    return (
        "With the noise that the data sheets state they come out "
        f"{low:.2f} to {high:.2f} times as large here."
    )
