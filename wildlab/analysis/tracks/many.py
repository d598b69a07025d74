"""All targets of a flight followed at once: what `wildlab track --many` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.tracks.inputs import TrackingInputs, order_notes
from wildlab.analysis.tracks.noise_model import STATED, ToldValue
from wildlab.analysis.tracks.places import (
    UNKNOWN_EFFECT,
    PlacedLooks,
    laid_out,
    lasting_of,
    places_of,
    said_of_pixels,
    thinned,
)
from wildlab.analysis.tracks.scans import truth_deviations, truths_at
from wildlab.analysis.tracks.target_model import of_many, unknown_lasting
from wildlab.errors import WildlabError
from wildlab.evaluation.identities import Identities, compare_identities
from wildlab.evaluation.identities import Moment as Compared
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.tracking.many import (
    ManySensorModel,
    ManyTargetModel,
    Scan,
    Shown,
    own_lasting,
    run_many,
    smooth_many,
)

#: From this distance a track is on no target, and a target without a track: the cut-off of GOSPA, m, where no
#: ``reach_m`` is stated.
CUTOFF_M = 20.0
BEARINGS_ALONE = "no sensor detects places: bearings alone begin no track."


class ManyTracks(NamedTuple):
    """All targets of a flight.

    Attributes
    ----------
    scans, named, shown
        Looks of all sensors in order of time, the targets that detections of each name, and what is believed
        after it.
    places
        By sensor.
    sensors, targets
        What the tracker was told.
    truth
        By target's name (N, 2), where it was at each look; NaN where that is not known. Empty without truth.
    said
        What the tracker was told, and who says so.
    notes
        What was done to the detections, in sentences.
    lasting_s
        Of each error that the detections of a look share, for how long it lasts.
    cutoff_m
        From this distance a track is on no target: what is believed of how near detections are.
    truth_sd
        By target's name, m: how well its true place is known, each axis, as stated, else as its positions
        tell (`wildlab.evaluation.position_noise`): errors that last for longer than from one to the next are
        not in it. Zero where they do not tell.
    truth_estimated
        Names of the targets for which it is estimated.
    others
        Whether targets are about of which no true place is known.
    unknown_lasting
        Sensors of which nobody says how long their errors last.
    """

    scans: list[Scan]
    named: list[frozenset[str]]
    shown: list[Shown]
    places: dict[str, PlacedLooks]
    sensors: list[ManySensorModel]
    targets: ManyTargetModel
    truth: dict[str, Array]
    said: list[ToldValue]
    notes: list[str]
    lasting_s: tuple[float, ...] = ()
    cutoff_m: float = CUTOFF_M
    truth_sd: Mapping[str, float] = {}
    others: bool = False
    unknown_lasting: Sequence[str] = ()
    truth_estimated: Sequence[str] = ()

    @property
    def minutes(self) -> float:
        """From the first look to the last."""
        return (self.scans[-1].time - self.scans[0].time) / 60 if len(self.scans) > 1 else 0.0


def track_jointly(flight: Flight, inputs: TrackingInputs, source: str | None = None) -> ManyTracks:
    """Track all targets by all sensors at once, whatever detections name.

    Parameters
    ----------
    inputs
        Of the flight, read for ``"joint"``.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Raises
    ------
    WildlabError
        Where no detection tells a place.
    """
    told = inputs.settings
    said = [one for one in inputs.said if one.what.startswith(("acceleration", "speed"))]
    notes = list(inputs.notes)
    places: dict[str, PlacedLooks] = {}
    for name, (looks, belief, _, more) in inputs.sensors.items():
        told_here, unused = _considered_apart(list(dict.fromkeys(more)), looks.kind)
        said += told_here
        if looks.kind == "pixel":
            said += said_of_pixels(flight, looks, told.sensors.get(name))
        if unused:
            bearing = looks.kind == "bearing"
            what = "Errors" if bearing else "An error of the clock"
            which = "that last are" if bearing else "is"
            notes.append(f"{what} of {name} {which} not considered where many targets are followed.")
        notes += order_notes(looks)
        found = places_of(flight, looks, belief, len(places), source, lasting_of(told.sensors.get(name)))
        if found.bearings and np.isfinite(belief.thinning_s):
            kept = thinned(found, belief.thinning_s)
            if len(kept.scans) < len(found.scans):
                notes.append(
                    f"Of {len(found.scans)} looks of {name} {len(kept.scans)} are used, "
                    f"{belief.thinning_s:.3g} s apart: errors of bearings last."
                )
            found = kept
        places[name] = found
        if found.without:
            notes.append(f"{found.without} detections of {name} have no place on the ground.")
    if all(one.bearings for one in places.values()):
        raise WildlabError(
            " ".join([BEARINGS_ALONE, *inputs.strays]).rstrip("."),
            "give detections the source of their sensor's name"
            if inputs.strays
            else "follow one target by its bearings: wildlab track without --many",
            file=flight.folder, field="detections.kind",
        )  # fmt: skip
    beliefs = of_many(told, inputs.targets, list(places.values()))
    lasting_s, shared = laid_out(
        [(one.errors, [scan.shared for scan in one.scans]) for one in places.values()]
    )
    pairs = [
        (scan._replace(shared=common) if len(common) else scan._replace(shared=None), names)
        for one, looks_of in zip(places.values(), shared, strict=True)
        for scan, names, common in zip(one.scans, one.named, looks_of, strict=True)
    ]
    pairs.sort(key=lambda pair: pair[0].time)
    scans = [scan for scan, _ in pairs]
    shown = run_many(scans, beliefs.sensors, beliefs.targets, lasting_s)
    truth: dict[str, Array] = {}
    truth_sd: dict[str, float] = {}
    estimated: list[str] = []
    if flight.truth is not None and len(flight.truth):
        times = np.array([scan.time for scan in scans])
        known = truths_at(flight, times)
        truth = {one.target: one.position for one in known}
        truth_sd, estimated = truth_deviations(flight)
    return ManyTracks(
        scans,
        [names for _, names in pairs],
        shown,
        places,
        beliefs.sensors,
        beliefs.targets,
        truth,
        [*said, *beliefs.said],
        notes,
        lasting_s,
        inputs.targets.reach_m if np.isfinite(inputs.targets.reach_m) else CUTOFF_M,
        truth_sd,
        bool(told.targets.many is not None and told.targets.many.others),
        unknown_lasting(told, places),
        estimated,
    )


def _considered_apart(said: list[ToldValue], kind: str) -> tuple[list[ToldValue], list[ToldValue]]:
    """What a sensor of this kind is told, and which considered errors have no part in it.

    What [uncertainty] says of a camera's pose is said with all that pixels share, and is in neither.
    """
    considered = [one for one in said if one.what.startswith("considered")]
    unused = [one for one in considered if kind == "bearing" or one.what.endswith(f": {UNKNOWN_EFFECT}")]
    elsewhere = [one for one in considered if kind == "pixel" and one.source != STATED]
    return [one for one in said if one not in unused and one not in elsewhere], unused


def known_looks(followed: ManyTracks) -> NDArray[np.bool_]:
    """(N,) looks at which any target's true place is known: elsewhere nothing is judged."""
    return np.asarray(_true_places(followed).any(axis=0))


def complete_looks(followed: ManyTracks) -> NDArray[np.bool_]:
    """(N,) looks at which every target's true place is known: elsewhere no track is false."""
    return known_looks(followed) & _true_places(followed).all(axis=0) & (not followed.others)


def _true_places(followed: ManyTracks) -> NDArray[np.bool_]:
    """(M, N) where they are known."""
    ways = [np.isfinite(way).all(axis=1) for way in followed.truth.values()]
    return np.array(ways, bool).reshape(-1, len(followed.scans))


def judged(
    followed: ManyTracks, reach: Mapping[str, float] | None = None, at: Sequence[str] = ()
) -> Identities | None:
    """Tracks against the true targets at the looks of `known_looks`; None where there are none, or no truth.

    A target can be seen where a detection names it, and where it lies in the camera's view, or within reach
    of any of the sensors. One that cannot costs nothing, with a track or without. Where not every true place
    is known, tracks on none of the known targets are not judged.

    Parameters
    ----------
    reach
        Metres by target's name, in place of the sensors' own.
    at
        Names of the sensors at whose looks it is judged; all where none is named.
    """
    known, complete = known_looks(followed), complete_looks(followed)
    if at:
        names_of = [one.name for one in followed.sensors]
        known &= np.array([names_of[scan.sensor] in at for scan in followed.scans], bool)
    if not followed.truth or not known.any():
        return None
    far = max(one.far_m for one in followed.sensors)
    compared = []
    for row, (scan, shown) in enumerate(zip(followed.scans, followed.shown, strict=True)):
        if not known[row]:
            continue
        names = [name for name, way in followed.truth.items() if np.isfinite(way[row]).all()]
        places = np.array([followed.truth[name][row] for name in names])
        distance = np.linalg.norm(places - scan.platform, axis=1)
        limit = np.array([far if reach is None else reach[name] for name in names])
        visible = distance <= limit
        if scan.sees is not None:
            visible &= scan.sees(places)
        visible |= np.array([name in followed.named[row] for name in names])
        compared.append(
            Compared(
                scan.time,
                shown.x[:, :2],
                shown.P[:, :2, :2],
                shown.identity.tolist(),
                places,
                names,
                visible,
                np.zeros(len(names), bool),
                bool(complete[row]),
                np.array([followed.truth_sd.get(name, 0.0) for name in names]),
            )
        )
    return compare_identities(compared, followed.cutoff_m)


def tracks_table(followed: ManyTracks) -> pd.DataFrame:
    """Every track at every look at which it was shown.

    Returns
    -------
    DataFrame
        ``time_s``, ``sensor`` of the look, ``track``; the state in metres and m/s in n, ``p_ij`` its
        covariance, the upper triangle; ``existence``; the probability of each kind of hull; and the place
        once the flight is over (`smooth_many`), ``smoothed_``. Its covariance is left out where nobody says
        of a sensor how long its errors last: an error that lasts is averaged by no smoother, which would take
        it for noise and report a third of the error that is there.
    """
    names = [one.name for one in followed.sensors]
    rows = []
    lasting_s = (*followed.lasting_s, *own_lasting(followed.sensors))
    after = smooth_many(followed.shown, followed.targets.density, lasting_s)
    for shown, (later_x, later_P) in zip(followed.shown, after, strict=True):
        for i, identity in enumerate(shown.identity):
            row: dict[str, object] = {
                "time_s": shown.time, "sensor": names[shown.sensor], "track": int(identity),
                "north_m": shown.x[i, 0], "east_m": shown.x[i, 1],
                "v_north_m_s": shown.x[i, 2], "v_east_m_s": shown.x[i, 3],
            }  # fmt: skip
            row |= {f"p_{a}{b}": shown.P[i, a, b] for a in range(4) for b in range(a, 4)}
            row["existence"] = shown.existence[i]
            kinds = zip(followed.targets.hulls, shown.kinds[i], strict=True)
            row |= {f"kind_{number}": share for number, (_, share) in enumerate(kinds, start=1)}
            row |= {"smoothed_north_m": later_x[i, 0], "smoothed_east_m": later_x[i, 1]}
            if not followed.unknown_lasting:
                row |= {f"smoothed_p_{a}{b}": later_P[i, a, b] for a in range(2) for b in range(a, 2)}
            rows.append(row)
    columns = ["time_s", "sensor", "track", "north_m", "east_m"]
    return pd.DataFrame(rows, columns=None if rows else columns)
