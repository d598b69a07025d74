"""What a tracker of many targets believes of a flight: stated, estimated from its detections, or assumed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from wildlab.analysis.tracks.noise_model import ASSUMED, STATED, ToldValue
from wildlab.analysis.tracks.noise_model import TargetModel as Following
from wildlab.analysis.tracks.places import PLACED, PlacedLooks
from wildlab.errors import WildlabError
from wildlab.flight.tracking_settings import HullPart, ManyTargetsPart, SensorPart, Settings, read_settings
from wildlab.paths import DATA
from wildlab.tracking.many import Hull, ManySensorModel, ManyTargetModel

#: How probable it is that what is in view is detected, where nobody says.
DETECTION = 0.8
#: A sensor reaches a little farther than the farthest that it detected.
BEYOND = 1.05
#: Even what detects nothing false in a flight might: so many times a scan at least.
LEAST_FALSE = 0.02
#: For how many usual looks, and how many seconds at least, a target is shown that is not seen.
LOOKS_SHOWN, SECONDS_SHOWN = 4.0, 5.0
#: Where a value is from that this flight's detections tell.
HERE = "estimated here"

_WORDS = {
    "lifetime_s": ("how long a target is about", " s"),
    "birth": ("probability that a detection of nothing known is a new target", ""),
    "visible_s": ("how long a target is in sight at a time", " s"),
    "hidden_s": ("how long it is out of sight", " s"),
    "gate": ("gate, in standard deviations", ""),
    "confirmed": ("probability of existence from which a track is believed", ""),
    "hits": ("looks with a detection from which a track is believed", ""),
    "shown": ("probability of existence above which it is shown", ""),
    "forgotten": ("probability of existence below which a track ends", ""),
    "lost_m": ("standard deviation of its place above which a track ends", " m"),
    "fastest_m_s": ("speed that no target has", " m/s"),
    "moves_m": ("way after which a track is shown", " m"),
    "over_s": ("time within which it has to go that way", " s"),
    "apart_m": ("distance within which two tracks that move alike are one", " m"),
    "calm": ("calm motion: share of the usual acceleration, 1: there is none", ""),
    "stay_s": ("how long either motion lasts", " s"),
}
_HULLS = {
    "rough_m": "which part of a hull is seen, SD of each axis, by kind",
    "along_m": "the same along its heading",
    "near_side_m": "how far on this side of its middle a hull is seen from its side, by kind",
    "near_end_m": "the same of a hull that heads here or away, by kind",
}


class Told(NamedTuple):
    """Of the targets, of each sensor in its order, and of each value where it is from."""

    targets: ManyTargetModel
    sensors: list[ManySensorModel]
    said: list[ToldValue]


def of_many(settings: Settings, following: Following, places: list[PlacedLooks]) -> Told:
    """What the tracker is told.

    Parameters
    ----------
    settings
        From `wildlab.analysis.tracks.noise_model.of_flight`.
    following
        What filters of one target are told of the targets.
    places
        Of every sensor.

    Raises
    ------
    WildlabError
        Where a sensor has another number of values for the hulls than there are hulls, or sees nothing.
    """
    refuse_unfit(settings)
    stated, usual = settings.targets.many or ManyTargetsPart(), _usual()
    said: list[ToldValue] = []
    told: dict[str, Any] = {}

    def one(name: str) -> float:
        own = getattr(stated, name)
        value = float(getattr(usual, name) if own is None else own)
        what, unit = _WORDS[name]
        if name != "stay_s" or told["calm"] < 1:
            said.append(ToldValue("targets", what, f"{value:.3g}{unit}", ASSUMED if own is None else STATED))
        return value

    hulls = tuple(_hull(part) for part in stated.hulls or usual.hulls)
    said.append(
        ToldValue(
            "targets",
            "kinds by size",
            ", ".join(f"{hull.name} {hull.length_m:g} m" if hull.length_m else hull.name for hull in hulls),
            STATED if stated.hulls else ASSUMED,
        )
    )
    for name in _WORDS:
        told[name] = one(name)
    told["hits"] = int(told["hits"])
    targets = ManyTargetModel(hulls, following.density, following.start_speed_m_s, **told)
    sensors = []
    farthest = max((float(looks.distances().max(initial=0.0)) for looks in places), default=0.0)
    for looks in places:
        found, more = _of_sensor(settings, looks, len(hulls), farthest)
        sensors.append(found)
        said += more
    return Told(targets, sensors, said)


def _hull(part: HullPart) -> Hull:
    return Hull(part.name, part.length_m, part.beam_m, part.share)


def _of_sensor(
    settings: Settings, looks: PlacedLooks, kinds: int, farthest: float
) -> tuple[ManySensorModel, list[ToldValue]]:
    """``farthest``: m, the farthest detection of any sensor, for one that knows no distances."""
    part = settings.sensors.get(looks.sensor)
    stated = None if part is None else part.many
    said: list[ToldValue] = []

    def one(name: str, what: str, unit: str, other: float, source: str) -> float:
        own = None if stated is None else getattr(stated, name)
        value = other if own is None else float(own)
        said.append(ToldValue(looks.sensor, what, f"{value:.3g}{unit}", source if own is None else STATED))
        return value

    if looks.bearings and stated is not None and stated.several:
        raise WildlabError(
            f"the sensor {looks.sensor!r} has bearings, and several of one hull cannot be told as one",
            "leave out several",
            field=f"sensors.{looks.sensor}.many.several",
        )
    distance = looks.distances()
    near = one("near_m", "distance below which it sees nothing", " m", 0.0, ASSUMED)
    reach = farthest if looks.bearings else float(distance.max(initial=1.0))
    far = one("far_m", "distance above which it sees nothing", " m", BEYOND * reach, HERE)
    # What is left over if every scan had one target: a guess that is too high where there are many.
    each = sum(len(look.z) for look in looks.scans) / max(len(looks.scans), 1)
    over = 2 * np.pi if looks.bearings else looks.area(far)
    clutter = max(each - 1.0, LEAST_FALSE) / over
    if near >= far:
        raise WildlabError(
            f"the sensor {looks.sensor!r} sees nothing nearer than {near:g} m or farther than {far:g} m",
            "state near_m and far_m so that something lies between them",
            field=f"sensors.{looks.sensor}.many",
        )
    interval = looks.interval_s
    hull_values = {name: getattr(stated, name, ()) or (0.0,) * kinds for name in _HULLS}
    hull_values["near_end_m"] = getattr(stated, "near_end_m", ()) or hull_values["near_side_m"]
    found = ManySensorModel(
        looks.sensor,
        one("detection", "probability that what is in view is detected", "", DETECTION, ASSUMED),
        one(
            "clutter_per_rad" if looks.bearings else "clutter_per_m2",
            f"false detections in a look {'within a radian' if looks.bearings else 'on a square metre'}",
            "",
            clutter,
            HERE,
        ),
        near,
        far,
        one(
            "patience_s",
            "how long a target is shown after it saw it last",
            " s",
            max(LOOKS_SHOWN * interval, SECONDS_SHOWN),
            ASSUMED,
        ),
        hull_values["rough_m"],
        hull_values["along_m"],
        hull_values["near_side_m"],
        bool(stated is not None and stated.several),
        looks.bearings,
        hull_values["near_end_m"],
    )
    if looks.kind in PLACED and looks.kind != "pixel":
        share, lasts = lasting_share(part)
        words = f"{share:.2g}, for {lasts:.3g} s" if share else "0"
        source = ASSUMED if part is None or part.correlation is None else STATED
        said.append(ToldValue(looks.sensor, "share of the errors' variance that lasts", words, source))
        found = found._replace(correlation=share, lasting_s=lasts)
    for name, what in _HULLS.items():
        own = stated is not None and bool(getattr(stated, name))
        values = ", ".join(f"{value:.3g}" for value in hull_values[name])
        said.append(ToldValue(looks.sensor, what, f"{values} m", STATED if own else ASSUMED))
    said.append(
        ToldValue(
            looks.sensor,
            "whether one hull may give several detections",
            "yes" if found.several else "no",
            STATED if stated is not None and stated.several is not None else ASSUMED,
        )
    )
    return found, said


def lasting_share(part: SensorPart | None) -> tuple[float, float]:
    """Share of the variance of a sensor's errors that lasts, and for how long, s; zero where nobody says."""
    if part is None or not part.correlation:
        return 0.0, 0.0
    return part.correlation, part.correlation_time_s or np.inf


def unknown_lasting(settings: Settings, places: Mapping[str, PlacedLooks]) -> list[str]:
    """Sensors of which nobody says how long their errors last.

    It is said by ``correlation``, zero too, or considered errors; of a camera's pixels by
    ``correlation_time_s`` or considered errors, of bearings by ``thinning_s``.
    """
    found = []
    for name, one in places.items():
        part = settings.sensors.get(name)
        key = {"pixel": "correlation_time_s", "bearing": "thinning_s"}.get(one.kind, "correlation")
        if part is None or (getattr(part, key) is None and (one.bearings or not part.considered)):
            found.append(name)
    return found


def _usual() -> ManyTargetsPart:
    """What is assumed where nobody says anything."""
    usual = read_settings(DATA / "settings" / "many.toml").targets.many
    if usual is None:
        raise WildlabError("data/settings/many.toml lacks [targets.many]", "get it from the project again")
    return usual


def refuse_unfit(settings: Settings) -> None:
    """Refuse what can follow nothing: births that nothing survives, numbers for hulls that there are not.

    Raises
    ------
    WildlabError
        Where a new target exists with no more than one that is given up, two kinds of hulls have one name, or
        a sensor has another number of values for the hulls than there are hulls.
    """
    many = settings.targets.many
    usual = _usual()
    birth, forgotten = (
        getattr(usual if many is None or getattr(many, name) is None else many, name)
        for name in ("birth", "forgotten")
    )
    if birth <= forgotten:
        raise WildlabError(
            f"a new target exists with probability {birth:g}, and one that exists with {forgotten:g} or less "
            "is given up: no track would ever last",
            "state a birth that is above forgotten",
            field="targets.many.birth",
        )
    names = [hull.name for hull in many.hulls] if many is not None else []
    if twice := next((one for one in names if names.count(one) > 1), None):
        raise WildlabError(
            f"two kinds of hulls are called {twice!r}", "give each a name of its own",
            field="targets.many.hulls.name",
        )  # fmt: skip
    kinds = max(len(many.hulls), 1) if many is not None else 1
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
