"""All targets of a flight tracked at once, as by `wildlab track --many`, and what the tracker is given:
stated, estimated from the detections, or assumed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.tracks.ground_positions import (
    UNKNOWN_EFFECT,
    PlacedScans,
    align_errors,
    given_of_pixels,
    place_scans,
    pose_correlation_time,
    thinned,
)
from wildlab.analysis.tracks.noise_model import (
    ASSUMED,
    HERE,
    STATED,
    GivenValue,
    GivenValues,
    TargetModel,
    Tuned,
)
from wildlab.analysis.tracks.scans import PLACED, truth_deviations, truths_at
from wildlab.analysis.tracks.single_target import STATE
from wildlab.analysis.tracks.tracker import read_inputs
from wildlab.errors import WildlabError
from wildlab.evaluation.identities import Identities, compare_identities
from wildlab.evaluation.identities import Moment as Compared
from wildlab.flight.manifest import (
    ManyTargetsPart,
    SensorPart,
    Settings,
    read_settings,
)
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.paths import DATA
from wildlab.tracking.multitarget import Shown, smooth_many
from wildlab.tracking.target_model import Hull, ManySensorModel, ManyTargetModel, Scan

#: How probable it is that what is in view is detected, where nobody says.
DETECTION = 0.8
#: A sensor reaches a little farther than the farthest that it detected.
BEYOND = 1.05
#: Even what detects nothing false in a flight might: so many times a scan at least.
LEAST_FALSE = 0.02
#: For how many usual scans, and how many seconds at least, a target is shown that is not seen.
SCANS_SHOWN, SECONDS_SHOWN = 4.0, 5.0

_WORDS = {
    "lifetime_s": ("how long a target is about", " s"),
    "birth": ("probability that a detection of nothing known is a new target", ""),
    "visible_s": ("time in sight", " s"),
    "hidden_s": ("time out of sight", " s"),
    "gate": ("gate, in standard deviations", ""),
    "confirmed": ("probability of existence from which a track is believed", ""),
    "hits": ("scans with a detection from which a track is believed", ""),
    "shown": ("probability of existence above which it is shown", ""),
    "forgotten": ("probability of existence below which a track ends", ""),
    "lost_m": ("SD of its position above which a track ends", " m"),
    "fastest_m_s": ("speed that no target has", " m/s"),
    "moves_m": ("way after which a track is shown", " m"),
    "over_s": ("time within which it has to go that way", " s"),
    "apart_m": ("distance within which tracks alike are one", " m"),
}
_HULLS = {
    "rough_m": "part of a hull that is seen, SD of each axis",
    "along_m": "the same along its heading",
    "near_side_m": "distance of what is seen from a hull's middle, from its side",
    "near_end_m": "the same from ahead or astern",
}


def model_jointly(
    settings: Settings, single: TargetModel, places: list[PlacedScans], says: Mapping[str, str] = {}
) -> tuple[ManyTargetModel, list[ManySensorModel], list[GivenValue]]:
    """What the tracker is given of the targets and of each sensor, and where each value is from.

    Parameters
    ----------
    settings
        From `wildlab.analysis.tracks.noise_model.settings_of`.
    single
        What filters of one target are given of the targets.
    places
        Of every sensor.
    says
        By sensor, who says how long errors last where the settings had not: of `with_tuned`.

    Raises
    ------
    WildlabError
        Where a sensor has another number of values for the hulls than there are hulls, or sees nothing.
    """
    refuse_unfit(settings)
    stated, usual = settings.targets.many or ManyTargetsPart(), _usual()
    given = GivenValues("targets")
    hulls = tuple(
        Hull(part.name, part.length_m, part.beam_m, part.share) for part in stated.hulls or usual.hulls
    )
    sizes = ", ".join(f"{hull.name} {hull.length_m:g} m" if hull.length_m else hull.name for hull in hulls)
    given.add("kinds by size", sizes, STATED if stated.hulls else ASSUMED)
    values: dict[str, Any] = {
        name: given.number(what, unit, getattr(stated, name), getattr(usual, name))
        for name, (what, unit) in _WORDS.items()
    }
    values["hits"] = int(values["hits"])
    targets = ManyTargetModel(hulls, single.density, single.start_speed_m_s, **values)
    farthest = max((float(one.distances().max(initial=0.0)) for one in places), default=0.0)
    each = [_of_sensor(settings, one, len(hulls), farthest, says) for one in places]
    return targets, [one for one, _ in each], [*given.values, *(value for _, more in each for value in more)]


def _of_sensor(
    settings: Settings, placed: PlacedScans, kinds: int, farthest: float, says: Mapping[str, str]
) -> tuple[ManySensorModel, list[GivenValue]]:
    """``farthest``: m, the farthest detection of any sensor, for one that knows no distances."""
    part = settings.sensors.get(placed.sensor, SensorPart())
    stated = part.many
    given = GivenValues(placed.sensor)

    def one(name: str, what: str, unit: str, other: float, source: str = ASSUMED) -> float:
        return given.number(what, unit, getattr(stated, name), other, source)

    if placed.bearings and stated.several:
        raise WildlabError(
            f"the sensor {placed.sensor!r} has bearings, and several of one hull are not merged",
            "leave out several",
            field=f"sensors.{placed.sensor}.many.several",
        )
    distance = placed.distances()
    near = one("near_m", "distance below which it sees nothing", " m", 0.0)
    reach = farthest if placed.bearings else float(distance.max(initial=1.0))
    far = one("far_m", "distance above which it sees nothing", " m", BEYOND * reach, HERE)
    # What is left over if every scan had one target: a guess that is too high where there are many.
    each = sum(len(scan.z) for scan in placed.scans) / max(len(placed.scans), 1)
    clutter = max(each - 1.0, LEAST_FALSE) / (2 * np.pi if placed.bearings else placed.area(far))
    if near >= far:
        raise WildlabError(
            f"the sensor {placed.sensor!r} sees nothing nearer than {near:g} m or farther than {far:g} m",
            "state near_m below far_m",
            field=f"sensors.{placed.sensor}.many",
        )
    hull_values: dict[str, Any] = {name: getattr(stated, name) or (0.0,) * kinds for name in _HULLS}
    hull_values["near_end_m"] = stated.near_end_m or hull_values["near_side_m"]
    unit, area = ("rad", "within a radian") if placed.bearings else ("m2", "on a square metre")
    shown_s = max(SCANS_SHOWN * placed.interval_s, SECONDS_SHOWN)
    found = ManySensorModel(
        placed.sensor,
        one("detection", "probability that what is in view is detected", "", DETECTION),
        one(f"clutter_per_{unit}", f"false detections in a scan {area}", "", clutter, HERE),
        near,
        far,
        one("patience_s", "time shown after it was last seen", " s", shown_s),
        several=bool(stated.several),
        bearings=placed.bearings,
        **hull_values,
    )
    if placed.kind in PLACED and placed.kind != "pixel":
        share, lasts = correlated_share(part)
        words = f"{share:.2g}, for {lasts:.3g} s" if share else "0"
        source = ASSUMED if part.correlation is None else says.get(placed.sensor, STATED)
        given.add("share of the errors' variance that lasts", words, source)
        found = found._replace(correlation=share, lasting_s=lasts)
    for name, what in _HULLS.items():
        shown = ", ".join(f"{value:.3g}" for value in hull_values[name])
        given.add(what, f"{shown} m", STATED if getattr(stated, name) else ASSUMED)
    several = "whether one hull may give several detections"
    given.add(several, "yes" if found.several else "no", ASSUMED if stated.several is None else STATED)
    return found, given.values


def correlated_share(part: SensorPart) -> tuple[float, float]:
    """Share of the variance of a sensor's errors that lasts, and for how long, s; zero where nobody says."""
    if not part.correlation:
        return 0.0, 0.0
    return part.correlation, part.correlation_time_s or np.inf


def with_tuned(stated: Settings, tuned: Tuned | None) -> tuple[Settings, dict[str, str]]:
    """The settings, with how long errors last from other flights with truth where nobody states it; and who
    says so, by sensor."""
    if tuned is None or tuned.against != "truth":
        return stated, {}
    filled = dict(stated.sensors)
    for name, one in tuned.sensors.items():
        part = stated.sensors.get(name, SensorPart())
        if part.correlation is None and part.correlation_time_s is None and part.thinning_s is None:
            lasts = {"correlation": one.next_correlation, "correlation_time_s": one.correlation_time_s}
            filled[name] = part.model_copy(update=lasts | {"thinning_s": one.thinning_s})
    changed = [name for name, part in filled.items() if part is not stated.sensors.get(name)]
    return stated.model_copy(update={"sensors": filled}), dict.fromkeys(changed, tuned.words)


def unknown_correlation(settings: Settings, places: Mapping[str, PlacedScans]) -> list[str]:
    """Sensors of which nobody says how long their errors last.

    It is stated by ``correlation``, zero too, or considered errors; of a camera's pixels by
    ``correlation_time_s`` or considered errors, of bearings by ``thinning_s``.
    """
    found = []
    for name, one in places.items():
        part = settings.sensors.get(name, SensorPart())
        key = {"pixel": "correlation_time_s", "bearing": "thinning_s"}.get(one.kind, "correlation")
        if getattr(part, key) is None and (one.bearings or not part.considered):
            found.append(name)
    return found


def _usual() -> ManyTargetsPart:
    """What is assumed where nobody says anything."""
    return read_settings(DATA / "settings" / "many.toml").targets.many or ManyTargetsPart()


def refuse_unfit(settings: Settings) -> None:
    """Refuse what can track nothing: births that nothing survives, numbers for hulls that there are not.

    Raises
    ------
    WildlabError
        Where a new target exists with no more than one that is given up, two kinds of hulls have one name, or
        a sensor has another number of values for the hulls than there are hulls.
    """
    many, usual = settings.targets.many or ManyTargetsPart(), _usual()
    birth, forgotten = many.birth or usual.birth or 0.0, many.forgotten or usual.forgotten or 0.0
    if birth <= forgotten:
        raise WildlabError(
            f"a new target exists with probability {birth:g}, and one that exists with {forgotten:g} or less "
            "is given up: no track would ever last",
            "state a birth that is above forgotten",
            field="targets.many.birth",
        )
    names = [hull.name for hull in many.hulls]
    if twice := next((one for one in names if names.count(one) > 1), None):
        raise WildlabError(
            f"two kinds of hulls are called {twice!r}", "give each a name of its own",
            field="targets.many.hulls.name",
        )  # fmt: skip
    kinds = max(len(names), 1)
    for sensor, part in settings.sensors.items():
        for name in _HULLS:
            own = getattr(part.many, name)
            if own and len(own) != kinds:
                values = "1 value" if len(own) == 1 else f"{len(own)} values"
                raise WildlabError(
                    f"{name} of the sensor {sensor!r} has {values}, and kinds of hulls there are {kinds}",
                    "give one for each of [[targets.many.hulls]]",
                    field=f"sensors.{sensor}.many.{name}",
                )


#: From this distance a track is on no target, and a target without a track: the cut-off of GOSPA, m, where no
#: ``reach_m`` is stated.
CUTOFF_M = 20.0


class ManyTracks(NamedTuple):
    """All targets of a flight.

    Attributes
    ----------
    scans, named, shown, filtered
        Looks of all sensors in order of time, the targets that detections of each name, what is believed of
        that moment in the end, and what was believed by then (`wildlab.tracking.multitarget.smooth_many`).
    places
        By sensor.
    sensors, targets
        What the tracker was given.
    truth
        By target's name (N, 2), where it was at each scan; NaN where that is not known. Empty without truth.
    given
        What the tracker was given, and who says so.
    notes
        What was done to the detections, in sentences.
    lasting_s
        Of each error that the detections of a scan share, for how long it lasts.
    cutoff_m
        From this distance a track is on no target: what is believed of how near detections are.
    truth_sd
        By target's name, m: how well its true place is known, each axis, as stated, else as its positions
        tell (`wildlab.evaluation.pose_noise`): errors that last for longer than from one to the next are
        not in it. Zero where they do not tell.
    truth_estimated
        Names of the targets for which it is estimated.
    others
        Whether targets are about of which no true place is known.
    unknown_correlation
        Sensors of which nobody says how long their errors last.
    """

    scans: list[Scan]
    named: list[frozenset[str]]
    shown: list[Shown]
    filtered: list[Shown]
    places: dict[str, PlacedScans]
    sensors: list[ManySensorModel]
    targets: ManyTargetModel
    truth: dict[str, Array]
    given: list[GivenValue]
    notes: list[str]
    lasting_s: tuple[float, ...] = ()
    cutoff_m: float = CUTOFF_M
    truth_sd: Mapping[str, float] = {}
    others: bool = False
    unknown_correlation: Sequence[str] = ()
    truth_estimated: Sequence[str] = ()

    @property
    def minutes(self) -> float:
        """From the first scan to the last."""
        return (self.scans[-1].time - self.scans[0].time) / 60 if len(self.scans) > 1 else 0.0


def track_jointly(
    flight: Flight,
    *,
    settings: Settings | None = None,
    tuned: Tuned | None = None,
    sensors: Sequence[str] = (),
    source: str | None = None,
) -> ManyTracks:
    """Track all targets by all sensors at once, whatever detections name.

    Parameters
    ----------
    settings, tuned, sensors, source
        As for `wildlab.analysis.tracks.tracker.track`.

    Raises
    ------
    WildlabError
        As that, and where no detection tells a place.
    """
    inputs = read_inputs(flight, settings=settings, tuned=tuned, sensors=sensors, source=source, joint=True)
    stated, says = with_tuned(inputs.settings, tuned)
    given = [one for one in inputs.given if one.what.startswith(("acceleration", "speed"))]
    notes = list(inputs.notes)
    places: dict[str, PlacedScans] = {}
    for name, (scanned, belief, _, more) in inputs.sensors.items():
        given_here, unused = _considered_apart(list(dict.fromkeys(more)), scanned.kind)
        given += given_here
        part = stated.sensors.get(name, SensorPart())
        if scanned.kind == "pixel":
            given += given_of_pixels(flight, scanned, part, says.get(name, STATED))
        if unused:
            bearing = scanned.kind == "bearing"
            what = "Errors" if bearing else "An error of the clock"
            which = "that last are" if bearing else "is"
            notes.append(f"{what} of {name} {which} not considered where many targets are followed.")
        found = place_scans(flight, scanned, belief, len(places), source, pose_correlation_time(part))
        if found.bearings and np.isfinite(belief.thinning_s):
            kept = thinned(found, belief.thinning_s)
            if len(kept.scans) < len(found.scans):
                notes.append(
                    f"Of {len(found.scans)} scans of {name} {len(kept.scans)} are used, "
                    f"{belief.thinning_s:.3g} s apart: errors of bearings last."
                )
            found = kept
        places[name] = found
        if found.without:
            notes.append(f"{found.without} detections of {name} have no place on the ground.")
    if all(one.bearings for one in places.values()):
        raise WildlabError(
            "bearings alone begin no track",
            "leave --many out",
            file=flight.folder,
            field="detections.kind",
        )
    targets, models, more_given = model_jointly(stated, inputs.targets, list(places.values()), says)
    lasting_s, shared = align_errors(
        [(one.errors, [scan.shared for scan in one.scans]) for one in places.values()]
    )
    pairs = [
        (scan._replace(shared=common) if len(common) else scan._replace(shared=None), names)
        for one, scans_of_one in zip(places.values(), shared, strict=True)
        for scan, names, common in zip(one.scans, one.named, scans_of_one, strict=True)
    ]
    pairs.sort(key=lambda pair: pair[0].time)
    scans = [scan for scan, _ in pairs]
    filtered, shown = smooth_many(scans, models, targets, lasting_s)
    truth, truth_sd, estimated = dict[str, Array](), dict[str, float](), list[str]()
    if flight.truth is not None and len(flight.truth):
        known = truths_at(flight, [scan.time for scan in scans])
        truth = {one.target: one.position for one in known}
        truth_sd, estimated = truth_deviations(flight)
    return ManyTracks(
        scans,
        [names for _, names in pairs],
        shown,
        filtered,
        places,
        models,
        targets,
        truth,
        [*given, *more_given],
        notes,
        lasting_s,
        inputs.targets.reach_m if np.isfinite(inputs.targets.reach_m) else CUTOFF_M,
        truth_sd,
        stated.targets.others,
        unknown_correlation(stated, places),
        estimated,
    )


def _considered_apart(given: list[GivenValue], kind: str) -> tuple[list[GivenValue], list[GivenValue]]:
    """What a sensor of this kind is given, and which considered errors have no part in it.

    What [uncertainty] says of a camera's pose is given with all that pixels share, and is in neither.
    """
    considered = [one for one in given if one.what.startswith("considered")]
    unused = [one for one in considered if kind == "bearing" or one.what.endswith(f": {UNKNOWN_EFFECT}")]
    elsewhere = [one for one in considered if kind == "pixel" and one.source != STATED]
    return [one for one in given if one not in unused and one not in elsewhere], unused


def known_scans(followed: ManyTracks) -> NDArray[np.bool_]:
    """(N,) scans at which any target's true place is known: elsewhere nothing is judged."""
    return np.asarray(_true_places(followed).any(axis=0))


def complete_scans(followed: ManyTracks) -> NDArray[np.bool_]:
    """(N,) scans at which every target's true place is known: elsewhere no track is false."""
    return known_scans(followed) & _true_places(followed).all(axis=0) & (not followed.others)


def _true_places(followed: ManyTracks) -> NDArray[np.bool_]:
    """(M, N) where they are known."""
    ways = [np.isfinite(way).all(axis=1) for way in followed.truth.values()]
    return np.array(ways, bool).reshape(-1, len(followed.scans))


def score_identities(
    followed: ManyTracks, reach: Mapping[str, float] | None = None, at: Sequence[str] = ()
) -> Identities | None:
    """Tracks against the true targets at the scans of `known_scans`; None where there are none, or no truth.

    A target can be seen where a detection names it, and where it lies in the camera's view, or within reach
    of any of the sensors. One that cannot costs nothing, with a track or without. Where not every true place
    is known, tracks on none of the known targets are not judged.

    Parameters
    ----------
    reach
        Metres by target's name, in place of the sensors' own.
    at
        Names of the sensors at whose scans it is judged; all where none is named.
    """
    known, complete = known_scans(followed), complete_scans(followed)
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
    """Every track at every scan at which it was shown, then or in the end.

    Returns
    -------
    DataFrame
        ``time_s``, ``sensor`` of the scan, ``track``; what was known by then, NaN where it was not believed
        yet: the state in metres and m/s in n, ``p_ij`` its covariance, the upper triangle, ``existence``, and
        the probability of each kind of hull. What is known in the end, from the first measurement of a track
        on: ``smoothed_`` place and ``smoothed_existence``. The covariance of that place is left out where
        nobody says of a sensor how long its errors last: an error that lasts is averaged by no smoother,
        which would take it for noise and report a third of the error that is there.
    """
    last = _rows_of(followed.shown)
    kept = {"north_m": "smoothed_north_m", "east_m": "smoothed_east_m", "existence": "smoothed_existence"}
    if not followed.unknown_correlation:
        kept |= {f"p_{a}{b}": f"smoothed_p_{a}{b}" for a in range(2) for b in range(a, 2)}
    last = last[["scan", "track", *kept]].rename(columns=kept)
    table = _rows_of(followed.filtered).merge(last, on=["scan", "track"], how="outer", sort=True)
    names = [followed.sensors[scan.sensor].name for scan in followed.scans]
    for name, values in (("sensor", names), ("time_s", [scan.time for scan in followed.scans])):
        table.insert(0, name, [values[row] for row in table["scan"]])
    return table.drop(columns="scan")


def _rows_of(shown: Sequence[Shown]) -> pd.DataFrame:
    """A row for every track of every scan."""
    x, P, existence, kinds, track = (
        np.concatenate([getattr(one, name) for one in shown])
        for name in ("x", "P", "existence", "kinds", "identity")
    )
    columns = {"scan": np.repeat(np.arange(len(shown)), [len(one.identity) for one in shown]), "track": track}
    columns |= dict(zip(STATE, x.T, strict=True))
    columns |= {f"p_{a}{b}": P[:, a, b] for a in range(4) for b in range(a, 4)}
    columns["existence"] = existence
    columns |= {f"kind_{number}": share for number, share in enumerate(kinds.T, start=1)}
    return pd.DataFrame(columns)
