"""A simulated flight's navigation against its truth: H 5.5 and 7.3, on the flights of 7.5.3 and 7.5.4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.analysis.navigate import (
    AXES,
    BIASES,
    PLACES,
    PUBLISHED_LIKE,
    REFERENCES,
    SETTLING_S,
    MekfTuning,
    Navigated,
    NavigationErrors,
    calibrated,
    comparison_times,
    errors_against,
    heading_from,
    known_mean,
    navigate_mekf,
    navigate_observer,
    reference_of,
    summarise,
)
from wildlab.analysis.verdict import Evidence, Verdict, verdict_of
from wildlab.evaluation.consistency import (
    autocorrelation,
    chi_square_interval,
    share_inside,
    white_bound,
)
from wildlab.flight.clocks import frame_times
from wildlab.flight.schema import VELOCITY
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.messages.catalogue import Message, load_texts
from wildlab.messages.quantities import significant
from wildlab.reporting.charts.drawing import Curve, squares_chart
from wildlab.reporting.charts.flights import (
    bias_chart,
    error_bands,
    mark_period,
    poses_between,
    strips,
)
from wildlab.reporting.charts.tracks import aircraft_map
from wildlab.reporting.figures import BLUE
from wildlab.reporting.report import Report, Wording
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.page import Shown, tile_of

#: The same for H 7.5.4, flight 1: "the IMU was weighted more in the navigation filter", for its turns, and
#: positions count for little. Printed are 43, 43 and 68 cm and 1.22, 1.24 and 2.63 deg; here come out 43, 43
#: and 69 cm and 1.20, 1.20 and 2.73 deg.
PUBLISHED_LIKE_TURNING = MekfTuning(0.38, 0.46, 1.5, 2.9)
#: The same for flight 2: 87, 87 and 142 cm and 1.73, 1.78 and 2.48 deg printed, 89, 89 and 142 cm and 1.73,
#: 1.69 and 2.57 deg here. The text does not say that it was tuned otherwise than flight 1; with flight 1's
#: tuning its deviations come out like those of flight 1.
PUBLISHED_LIKE_LONG = MekfTuning(0.25, 0.75, 3.6, 8.5)
#: The filter with the tunings that are compared with print, by the subject of their numbers.
TUNINGS = {
    "mekf-published-like": PUBLISHED_LIKE,
    "mekf-published-like-turning": PUBLISHED_LIKE_TURNING,
    "mekf-published-like-long": PUBLISHED_LIKE_LONG,
}


class Studied(NamedTuple):
    """A flight, navigated and scored at certain times (K,) against one of its nav sources."""

    flight: Flight
    reference: str
    times: Array
    found: dict[str, Navigated]
    scored: dict[str, NavigationErrors]


def summarise_innovations(found: Navigated, begin: float = -np.inf, end: float = np.inf) -> pd.DataFrame:
    """NIS and whiteness of each source's innovations between two times (s), one row for each source.

    Columns: ``source``, ``n``, ``nis`` (mean, ideally 3), ``inside`` (share within the 95 %
    interval of one), ``left_out`` (share), ``lag1`` (largest autocorrelation of an element of the innovation,
    in units of what the filter expects of it, at lag 1) and ``bound`` (what white noise stays below).
    """
    rows = []
    stamps = found.innovations["time_s"]
    inside = found.innovations[(stamps >= begin) & (stamps < end)]
    for source, part in inside.groupby("source", sort=False):
        whitened = normalised_innovations(part)
        rows.append(
            {
                "source": source,
                "n": len(part),
                "nis": float(part["nis"].mean()),
                "inside": share_inside(part["nis"], chi_square_interval(3)),
                "left_out": float((part["verdict"] == 0).mean()),
                "lag1": max((float(autocorrelation(column, 1)[1]) for column in whitened.T), key=abs),
                "bound": white_bound(len(part)),
            }
        )
    return pd.DataFrame(rows)


def normalised_innovations(innovations: pd.DataFrame) -> Array:
    """Elements (N, 3) of one source's innovations in units of the deviations that the filter expects."""
    names = ["first", "second", "third"]
    expected = innovations[[f"sd_{name}" for name in names]].to_numpy(float)
    return innovations[names].to_numpy(float) / expected


def navigate_all(flight: Flight, times: ArrayLike) -> dict[str, Navigated]:
    """Every estimate that is compared, by its subject: the filter by what is stated, and the observer; with
    two antennas also the filter with the tunings of `TUNINGS`.

    The observer of H is for calibrated accelerometers. Where these are not (see `calibrated`), their
    calibration is the bias that the filter found, the median over the flight.
    """
    filtered, off = navigate_mekf(flight, times), np.zeros(3)
    if not calibrated(flight):
        off = filtered.biases[BIASES[:3]].median().to_numpy(float)
    found = {"mekf": filtered, "observer": navigate_observer(flight, times, accelerometer_bias=off)}
    if "second_north_m" in flight.table("gnss"):
        found |= {name: navigate_mekf(flight, times, tuning=tuning) for name, tuning in TUNINGS.items()}
    return found


def evaluate_all(
    flight: Flight, found: Mapping[str, Navigated], times: ArrayLike, reference: str
) -> dict[str, NavigationErrors]:
    """Errors of each estimate against the reference, and on a twin those of its autopilot.

    The autopilot is scored by the airframe it sits on, not by the payload with the IMU and the antennas.
    """
    table = flight.nav[reference]
    scored = {
        name: errors_against(table, one.nav, times, one.velocity_covariance) for name, one in found.items()
    }
    if "truth" in flight.nav and "autopilot" in flight.nav:
        scored["autopilot"] = errors_against(flight.nav["truth"], flight.nav["autopilot"], times)
    return scored


def study_navigation(flight: Flight) -> Studied:
    """A flight navigated in every way that is compared, and scored by the best reference it has.

    Raises
    ------
    WildlabError
        Where it has no reference, or lacks what navigation needs.
    """
    reference = reference_of(flight)
    times = comparison_times(flight, reference)
    found = navigate_all(flight, times)
    return Studied(flight, reference, times, found, evaluate_all(flight, found, times, reference))


def numbers_of(studied: Studied, begin: float, end: float = np.inf) -> dict[tuple[str, str], float]:
    """What is compared over flights, by (subject, name): `summarise`; of the filter ``nis_<source>``, and of
    logged flights ``lag1_<source>``; on twins of the tuned filters how often they have the autopilot within
    their bounds (`shares_within`).

    There is no NEES without a truth, and no error of position where the reference has no velocity: its
    positions are then those of the receiver, which the estimate is made from.
    """
    table = studied.flight.nav[studied.reference]
    hidden = [] if studied.reference == REFERENCES[0] else ["nees"]
    hidden += [] if set(VELOCITY) <= set(table) else [f"rms_{place}" for place in PLACES]
    numbers = {
        (subject, name): value
        for subject, errors in studied.scored.items()
        for name, value in summarise(errors, begin, end).items()
        if np.isfinite(value) and not name.startswith(tuple(hidden))
    }
    for row in summarise_innovations(studied.found["mekf"], begin, end).to_dict(orient="records"):
        source = row["source"].replace(" ", "_")
        numbers["mekf", f"nis_{source}"] = row["nis"]
        if studied.flight.manifest.kind == "logged":
            numbers["mekf", f"lag1_{source}"] = row["lag1"]
    if "autopilot" in studied.scored:
        for subject in [name for name in TUNINGS if name in studied.found]:
            shares = shares_within(against_autopilot(studied, subject), begin)
            numbers |= {(subject, name): value for name, value in shares.items()}
    return numbers


def shares_within(errors: NavigationErrors, begin: float = -np.inf) -> dict[str, float]:
    """Share of the errors within two of the stated standard deviations, of ``roll``, ``pitch``, ``yaw`` and
    ``velocity`` (all three axes), from a time on."""
    late = errors.times >= begin
    e, two = errors.error[late], 2 * errors.sd[late]
    known = np.isfinite(e) & np.isfinite(two)
    inside = np.where(known, np.abs(e) <= two, np.nan)
    shares = {f"inside_{name}": float(known_mean(inside[:, 6 + i])) for i, name in enumerate(AXES)}
    return shares | {"inside_velocity": float(known_mean(inside[:, 3:6].ravel()))}


def against_autopilot(studied: Studied, subject: str) -> NavigationErrors:
    """Differences of an estimate from the autopilot, as H 7.5 has them: neither of the two is the truth."""
    one = studied.found[subject]
    return errors_against(studied.flight.nav["autopilot"], one.nav, studied.times, one.velocity_covariance)


def unit_of(name: str) -> str:
    """The unit of one of those numbers."""
    if name.startswith(("nees", "nis", "lag1", "inside")):
        return "1"
    return "deg" if name.endswith(AXES) else "m/s" if name.endswith("velocity") else "m"


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """One simulated flight, navigated and compared with its truth from `SETTLING_S` on.

    Raises
    ------
    WildlabError
        If there is no such twin, or it has no inertial unit and receivers.
    """
    return numbers_of(study_navigation(simulate_twin(twin, seed)), SETTLING_S)


Period = tuple[float, float]
#: The map of a flight by the first of its other figures; that of 7.13 on is another case's figure 7.2.
MAPS = {23: 22, 33: 32}
_TURNS = [f"{axis} (°)" for axis in AXES]
_SPEEDS = [f"{place} (m/s)" for place in PLACES]


def observation_times(flight: Flight) -> Array:
    """Times of the images with a detection of a target that is named, (K,) s in order; none without any."""
    frames, detections = flight.frames, flight.detections
    if frames is None or detections is None:
        return np.empty(0)
    if "target_id" in detections:
        detections = detections[detections["target_id"].fillna("") != ""]
    times = frame_times(flight)[frames["frame_id"].isin(detections["frame_id"]).to_numpy()]
    return np.sort(times[np.isfinite(times)])


def tracking_period(flight: Flight) -> Period | None:
    """First and last observation of a target, s; None where there are none."""
    times = observation_times(flight)
    return (float(times[0]), float(times[-1])) if len(times) else None


def path_figures(studied: Studied, window: Period, figures: int) -> list[Shown]:
    """Paths of aircraft and target on a map, with from where the target was seen: H 7.2, 7.22, 7.32.

    Parameters
    ----------
    studied
        Of a flight with a target's true path; without one there is no figure.
    window
        Of the path, s.
    figures
        The first figure of H's chapter 7 that the flight's attitude and velocity answer to.
    """
    flight, number = studied.flight, MAPS.get(figures)
    seen = observation_times(flight)
    if flight.truth is None or not len(flight.truth) or not len(seen):
        return []
    nav = studied.found["mekf"].nav
    nav = nav[nav["time_s"].between(*window)]
    path = nav[["north_m", "east_m"]].to_numpy(float)
    places = np.stack([np.interp(seen, nav["time_s"], column) for column in path.T], axis=1)
    truth = flight.truth.sort_values("time_s")
    below = truth[["north_m", "east_m"]].to_numpy(float)
    inside = truth["time_s"].between(float(seen[0]), float(seen[-1])).to_numpy()
    below = below[inside] if inside.sum() > 1 else below
    fig = aircraft_map(path, places, below, "target")
    return [Shown(fig, "paths", "" if number is None else f"fig-7-{number}")]


def flight_figures(studied: Studied, window: Period, figures: int | None) -> list[Shown]:
    """Attitude, velocity and speed over time, each with the tracking period.

    Parameters
    ----------
    studied
        Of the flight.
    window
        From when to when, s.
    figures
        The first figure of H's chapter 7 that they answer to; None for a public flight, whose figures have
        names of their own.
    """
    nav = _sources(studied, twin=figures is not None)
    moving = {name: table for name, table in nav.items() if "v_north_m_s" in table}
    attitude, _ = poses_between(
        {name: t.reindex(columns=nav["mekf"].columns) for name, t in nav.items()}, *window
    )
    _, velocity = poses_between(moving, *window)
    speeds = {
        name: (
            velocity["north (m/s)"][name][0],
            np.sqrt(sum(np.square(one[name][1]) for one in velocity.values())),
        )
        for name in moving
    }
    shown = {
        "attitude": (0, strips(attitude)),
        "velocity": (1, strips(velocity)),
        "speed": (4, strips({"speed over ground (m/s)": speeds})),
    }
    return [
        _marked(studied, fig, text, "" if figures is None else f"fig-7-{figures + offset}")
        for text, (offset, fig) in shown.items()
    ]


def error_figures(studied: Studied, window: Period) -> list[Shown]:
    """Attitude and velocity against the reference, with the bounds that the filter predicts."""
    late = (studied.times >= window[0]) & (studied.times < window[1])
    of = {who: studied.scored[who] for who in ("mekf", "observer")}
    turns = {who: np.degrees(one.error[late, 6:]) for who, one in of.items()}
    largest = 3 * float(np.nanquantile(np.abs(turns["observer"]), 0.95))
    bounds = {"mekf": np.degrees(of["mekf"].sd[late, 6:])}
    fig = error_bands(studied.times[late], turns, bounds, _TURNS, largest=largest)
    found = [_marked(studied, fig, "attitude-errors")]
    if np.isfinite(of["mekf"].error[late, 3:6]).any():
        errors = {who: one.error[late, 3:6] for who, one in of.items()}
        fig = error_bands(studied.times[late], errors, {"mekf": of["mekf"].sd[late, 3:6]}, _SPEEDS)
        found.append(_marked(studied, fig, "velocity-errors"))
    return found


def autopilot_figures(studied: Studied, tuned: str, begin: float, figures: int) -> list[Shown]:
    """The filter with deviations like the published ones, against the autopilot as in H."""
    difference = against_autopilot(studied, tuned)
    late = studied.times >= begin

    def bands(part: slice, scale: float, labels: Sequence[str]) -> Figure:
        errors, sd = scale * difference.error[late, part], scale * difference.sd[late, part]
        return error_bands(studied.times[late], {"mekf": errors}, {"mekf": sd}, labels)

    attitude, velocity = bands(slice(6, 9), float(np.degrees(1.0)), _TURNS), bands(slice(3, 6), 1.0, _SPEEDS)
    return [
        _marked(studied, attitude, "attitude-against-autopilot", f"fig-7-{figures + 2}"),
        _marked(studied, velocity, "velocity-against-autopilot", f"fig-7-{figures + 3}"),
    ]


def bias_figure(studied: Studied) -> Shown:
    """Biases that the filter estimates, with their deviations."""
    biases = studied.found["mekf"].biases
    columns = [str(name) for name in biases if not str(name).startswith("sd_") and name != "time_s"]
    spread = biases[[f"sd_{name}" for name in columns]]
    return Shown(bias_chart(biases["time_s"], biases[columns], spread), "biases")


def nis_figure(studied: Studied, window: Period) -> Shown:
    """NIS of the filter's innovations, by source."""
    raw = studied.found["mekf"].innovations
    raw = raw[raw["time_s"].between(*window)]
    by_source = raw.groupby("source", sort=False)
    nis = {f"NIS\n{name}": _dots(part["time_s"], part["nis"]) for name, part in by_source}
    return Shown(squares_chart(nis, 3), "nis")


def nees_figure(studied: Studied, begin: float) -> Shown:
    """NEES of the filter over time, where there is a truth."""
    late, scored = studied.times >= begin, studied.scored["mekf"]
    times = studied.times[late]
    nees = {f"NEES\n{name}": _dots(times, values[late]) for name, values in scored.nees.items()}
    return Shown(squares_chart(nees, 3), "nees")


def _dots(times: ArrayLike, values: ArrayLike) -> list[Curve]:
    return [Curve(times, values, BLUE, look={"size": 2, "rasterized": True}, dots=True)]


def simulated_figures(studied: Studied, window: Period, tuned: str, figures: int) -> list[Shown]:
    """All figures of a simulated flight, errors of attitude first; parameters as of the functions above."""
    return [
        *error_figures(studied, window),
        *path_figures(studied, window, figures),
        *flight_figures(studied, window, figures),
        *autopilot_figures(studied, tuned, window[0], figures),
        bias_figure(studied),
        nis_figure(studied, window),
        nees_figure(studied, window[0]),
    ]


def logged_figures(studied: Studied, window: Period) -> list[Shown]:
    """All figures of a logged flight, differences of attitude first."""
    return [
        *error_figures(studied, window),
        *flight_figures(studied, window, None),
        bias_figure(studied),
        nis_figure(studied, window),
    ]


def differences_table(
    studied: Studied, parts: Sequence[tuple[str, float, float]], names: Mapping[str, str]
) -> pd.DataFrame:
    """RMS errors and predicted deviations of each estimate in each part of the flight (name, from, to; s)."""
    scored: Mapping[str, NavigationErrors] = studied.scored
    return pd.DataFrame(
        [
            {"who": names[who], "part": part, **summarise(scored[who], begin, end)}
            for part, begin, end in parts
            for who in ("mekf", "observer", "autopilot")
            if who in scored
        ]
    )


def innovations_table(studied: Studied, window: Period) -> pd.DataFrame:
    """NIS and whiteness of the filter's innovations, a row for each source; shares in per cent."""
    table = summarise_innovations(studied.found["mekf"], window[0], np.nextafter(window[1], np.inf))
    return table.assign(inside=100 * table["inside"], left_out=100 * table["left_out"])


def nees_table(runs: pd.DataFrame, subjects: Sequence[str], names: Mapping[str, str]) -> pd.DataFrame:
    """Mean NEES over the flights, a row for each filter."""
    blocks = ("position", "velocity", "attitude")
    return pd.DataFrame(
        [{"who": names[who], **{b: runs[who, f"nees_{b}"].mean() for b in blocks}} for who in subjects]
    )


def _marked(studied: Studied, fig: Figure, text: str, name: str = "") -> Shown:
    mark_period(fig, tracking_period(studied.flight))
    return Shown(fig, text, name)


def _sources(studied: Studied, *, twin: bool) -> dict[str, pd.DataFrame]:
    """Filter and autopilot as in H; on a public flight filter, observer, and what was found on board."""
    mekf = studied.found["mekf"].nav
    if twin and "autopilot" in studied.flight.nav:
        return {"mekf": mekf, "autopilot": studied.flight.nav["autopilot"]}
    reference = studied.flight.nav[studied.reference]
    return {
        "mekf": mekf,
        "observer": studied.found["observer"].nav,
        "truth" if twin else "onboard": reference.iloc[:: max(1, len(reference) // 3000)],
    }


#: A difference of so many predicted ones is more than the filter can account for.
OVERCONFIDENT = 2.0
_ATTITUDE = tuple(f"{of}_{axis}" for of in ("rms", "mean_sd") for axis in AXES)


def attitude_of(found: Mapping[str, float]) -> tuple[float, float]:
    """RMS error or difference, and predicted deviation, of all three axes together, degrees.

    Parameters
    ----------
    found
        ``rms_...`` and ``mean_sd_...`` of each axis, degrees.
    """
    rms, sd = (float(np.linalg.norm([found[f"{of}_{axis}"] for axis in AXES])) for of in ("rms", "mean_sd"))
    return rms, sd


def verdict_of_attitude(found: Mapping[str, float]) -> Verdict:
    """What a flight's attitude comes to: up to `OVERCONFIDENT` times what is predicted, nothing is shown."""
    rms, sd = attitude_of(found)
    return verdict_of(Evidence(troubled=int(rms > OVERCONFIDENT * sd)))


def level_of(runs: pd.DataFrame) -> int:
    """The verdict on simulated flights as a number: many are compared with published ones, and not judged."""
    if len(runs) > 1:
        return Verdict.UNJUDGED.level
    return verdict_of_attitude({name: runs["mekf", name].iloc[0] for name in _ATTITUDE}).level


Part = tuple[str, float, float]


def attitude_messages(studied: Studied, part: Part) -> list[Message]:
    """How far the filter's attitude is from the one found on board."""
    name, *between = part
    off, predicted = attitude_of(summarise(studied.scored["mekf"], *between))
    values = {"part": name, "off": significant(off), "predicted": significant(predicted)}
    values["ratio"] = significant(off / predicted)
    return [Message("overconfident" if off > OVERCONFIDENT * predicted else "plausible", values)]


def observer_limits(flight: Flight) -> list[Message]:
    """What the observer's figures depend on, for a flight with one antenna."""
    source = heading_from(flight)
    if source == "antennas":
        return []
    found = [Message("observer-course" if source == "course" else "observer-field")]
    return found if calibrated(flight) else [*found, Message("observer-biases")]


def show_logged(report: Report, studied: Studied, parts: Sequence[Part]) -> None:
    """Fill the report of a logged flight, whose numbers are recorded already; ``parts`` of it, s."""
    first, last = parts[0], max(until for _, _, until in parts)
    window = (first[1], last)
    texts = load_texts("navigation-logged")
    wording = Wording(report, texts)
    names = texts.subjects
    verdict = verdict_of_attitude(summarise(studied.scored["mekf"], *first[1:]))
    report.head(names["question"], wording.say(texts.subtitle))
    said = attitude_messages(studied, first)
    wording.summary(said, verdict, Message("reason", said[0].values), "navigation")
    report.tiles([tile_of(report, one, wording) for one in texts.tiles])
    main, *others = logged_figures(studied, window)
    wording.figure(main.text, main.fig, main.name, main=True)
    wording.table("differences", differences_table(studied, parts, names))
    if studied.found["mekf"].signs:
        report.section("What should make you doubt the filter")
        report.points(studied.found["mekf"].signs)
    report.section("Figures")
    for i in range(0, len(others), 2):
        report.figures([wording.captioned(one.text, one.fig, one.name) for one in others[i : i + 2]])
    limits = [wording.say(one) for one in texts.limits]
    report.limits([*limits, *wording.messages(observer_limits(studied.flight))])
    report.section("Details")
    wording.table("innovations", innovations_table(studied, window))
    report.method(texts.method)
