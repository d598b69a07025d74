"""A simulated flight's navigation against its truth: H 5.5 and 7.3, on the flights of 7.5.3 and 7.5.4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wildlab.analysis.navigate import (
    AXES,
    PLACES,
    SETTLING_S,
    NavigationErrors,
    Studied,
    against_autopilot,
    calibrated,
    numbers_of,
    study_navigation,
    summarise,
    summarise_innovations,
)
from wildlab.analysis.navigation_inputs import Placement, Receiver, heading_from, place_receiver
from wildlab.analysis.verdict import VERDICT_LEVEL, Evidence, Verdict, verdict_of
from wildlab.evaluation.intervals import block_mean, time_blocks
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.messages.catalogue import Message, load_texts
from wildlab.messages.quantities import significant
from wildlab.navigation.receiver import SIZE
from wildlab.reporting.charts.georeferencing import aircraft_map
from wildlab.reporting.charts.navigation import (
    bias_chart,
    error_bands,
    mark_period,
    poses_between,
    speed_chart,
    squares_chart,
    strips,
    velocities_of,
)
from wildlab.reporting.report import Report, Wording
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.page import Shown, tile_of


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
    fig = aircraft_map(path, places, below, "", "target")
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
    speeds = {name: velocities_of(table[table["time_s"].between(*window)]) for name, table in moving.items()}
    shown = {
        "attitude": (0, strips(attitude, "")),
        "velocity": (1, strips(velocity, "")),
        "speed": (4, speed_chart(speeds, "")),
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
    fig = error_bands(studied.times[late], turns, bounds, _TURNS, "", largest=largest)
    found = [_marked(studied, fig, "attitude-errors")]
    if np.isfinite(of["mekf"].error[late, 3:6]).any():
        errors = {who: one.error[late, 3:6] for who, one in of.items()}
        fig = error_bands(studied.times[late], errors, {"mekf": of["mekf"].sd[late, 3:6]}, _SPEEDS, "")
        found.append(_marked(studied, fig, "velocity-errors"))
    return found


def autopilot_figures(studied: Studied, tuned: str, begin: float, figures: int) -> list[Shown]:
    """The filter with deviations like the published ones, against the autopilot as in H."""
    difference = against_autopilot(studied, tuned)
    late = studied.times >= begin

    def bands(part: slice, scale: float, labels: Sequence[str]) -> Figure:
        errors, sd = scale * difference.error[late, part], scale * difference.sd[late, part]
        return error_bands(studied.times[late], {"mekf": errors}, {"mekf": sd}, labels, "")

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
    return Shown(bias_chart(biases["time_s"], biases[columns], spread, ""), "biases")


def nis_figure(studied: Studied, window: Period) -> Shown:
    """NIS of the filter's innovations, by source."""
    raw = studied.found["mekf"].innovations
    raw = raw[raw["time_s"].between(*window)]
    nis = {str(name): (part["time_s"], part["nis"]) for name, part in raw.groupby("source", sort=False)}
    return Shown(squares_chart(nis, 3, "NIS", ""), "nis")


def nees_figure(studied: Studied, begin: float) -> Shown:
    """NEES of the filter over time, where there is a truth."""
    late, scored = studied.times >= begin, studied.scored["mekf"]
    nees = {name: (studied.times[late], values[late]) for name, values in scored.nees.items()}
    return Shown(squares_chart(nees, 3, "NEES", ""), "nees")


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
            for who in ("mekf-receiver", "mekf", "observer", "autopilot")
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


#: So many standard deviations from what is configured are an error: four numbers are looked at.
FAR = 3.0
_PARTS = (
    ("white noise, level", 0),
    ("white noise, height", 1),
    ("slow error, level", 0),
    ("slow error, height", 1),
    ("how long that keeps", None),
    ("over what its change is smooth", None),
)


def parameters_table(receiver: Receiver) -> pd.DataFrame:
    """Every number of the noise that was chosen, and what is configured.

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


def attitude_change(before: NavigationErrors, after: NavigationErrors, begin: float, end: float) -> str:
    """How the attitude's difference from the reference changed between two times, s: ``nearer``, ``farther``,
    ``same``, or ``unknown`` where the time is too short."""
    inside = (before.times >= begin) & (before.times < end)
    squares = [np.degrees(one.error[inside, 6:]) ** 2 @ np.ones(3) for one in (before, after)]
    known = np.isfinite(squares[0]) & np.isfinite(squares[1])
    change = (squares[1] - squares[0])[known]
    span = block_mean(change, time_blocks(before.times[inside][known], seconds=True))
    if not np.isfinite(span.low):
        return "unknown"
    return "farther" if span.low > 0 else "nearer" if span.high < 0 else "same"


def placement_message(found: Placement, configured: ArrayLike) -> Message:
    """How late the receiver is and where its antenna sits, and what of that is not as configured.

    Parameters
    ----------
    found
        As `wildlab.analysis.navigation_inputs.place_receiver` gives it.
    configured
        (4,) latency, s, and lever arm, m.
    """
    given = np.asarray(configured, float)
    likely = np.array([found.latency, *found.lever])
    known = np.isfinite(found.sd)
    if not known.any():
        return Message("placement-unknown")
    wrong = known & (np.abs(likely - given) > FAR * found.sd)
    values = {"latency": f"{likely[0]:.3f}", "configured": f"{given[0]:.3f}"}
    if not wrong.any():
        return Message("placement-confirmed", values)
    write = [f"latency_s = {likely[0]:.3f}"] if wrong[0] else []
    if wrong[1:].any():
        write.append(f"lever_arm_m = [{', '.join(f'{value:.2f}' for value in likely[1:])}]")
    return Message("placement-wrong", {**values, "settings": " and ".join(write)})


Part = tuple[str, float, float]


def attitude_messages(studied: Studied, part: Part) -> list[Message]:
    """How far the filter's attitude is from the one found on board, with the configured noise and with that
    estimated on the flight."""
    name, *between = part
    off, predicted = attitude_of(summarise(studied.scored["mekf"], *between))
    values = {"part": name, "off": significant(off), "predicted": significant(predicted)}
    values["ratio"] = significant(off / predicted)
    said = [Message("overconfident" if off > OVERCONFIDENT * predicted else "plausible", values)]
    if "mekf-receiver" in studied.scored:
        off, predicted = attitude_of(summarise(studied.scored["mekf-receiver"], *between))
        said.append(Message("receiver", {"off": significant(off), "predicted": significant(predicted)}))
    return said


def receiver_messages(studied: Studied) -> list[Message]:
    """What was found of the receiver's noise, and of when and where its fixes are taken."""
    receiver = studied.receiver
    if receiver is None:
        return [Message("noise-unknown", {"refusal": studied.refusal})]
    values = {"fixes": str(receiver.fixes), "models": str(len(receiver.candidates))}
    gnss = studied.flight.manifest.gnss
    placed = place_receiver(studied.flight, receiver.chosen.noise)
    placement = placement_message(placed, [gnss.latency_s, *gnss.lever_arm_m])
    if receiver.noise is None:
        return [Message("noise-confirmed", values), placement]
    both = studied.scored["mekf"], studied.scored["mekf-receiver"]
    change = attitude_change(*both, receiver.begin, receiver.end)
    return [Message("noise-estimated", values), Message(f"attitude-{change}"), placement]


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
    mine = summarise(studied.scored["mekf"], *first[1:])
    verdict = verdict_of_attitude(mine)
    report.head(names["question"], wording.say(texts.subtitle))
    said = attitude_messages(studied, first)
    reason = Message("reason", said[0].values)
    report.summary(
        wording.messages(said),
        level=verdict.colour,
        verdict=(verdict.value, wording.messages([reason])[0]),
    )
    report.metric(VERDICT_LEVEL, "navigation", verdict.level, "1")
    report.tiles([tile_of(report, one, wording) for one in texts.tiles])
    main, *others = logged_figures(studied, window)
    wording.figure(main.text, main.fig, main.name, main=True)
    wording.table("differences", differences_table(studied, parts, names))
    report.section("The receiver's noise")
    report.points(wording.messages(receiver_messages(studied)))
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
    receiver = studied.receiver
    if receiver is not None and receiver.noise is not None:
        wording.table("parameters", parameters_table(receiver))
    report.method(texts.method)
