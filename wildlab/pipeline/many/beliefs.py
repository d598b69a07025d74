"""What a tracker of many targets believes of a flight: stated, estimated from its detections, or assumed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.following import HullPart, ManyTargetsPart, Settings, read_settings
from wildlab.paths import DATA
from wildlab.pipeline.following.beliefs import ASSUMED, STATED, Said
from wildlab.pipeline.following.beliefs import TargetBeliefs as Following
from wildlab.pipeline.many.places import Places
from wildlab.tracking.many import Hull, SensorBeliefs, TargetBeliefs

Array = NDArray[np.float64]

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
    "birth": ("a detection of nothing known is a new target, probability", ""),
    "visible_s": ("in sight at a time", " s"),
    "hidden_s": ("out of sight at a time", " s"),
    "gate": ("gate, standard deviations", ""),
    "confirmed": ("a track is believed from a probability of existence of", ""),
    "hits": ("and from so many scans with a detection", ""),
    "shown": ("and shown while that is above", ""),
    "forgotten": ("a track ends below", ""),
    "lost_m": ("or where its place is known no better than", " m"),
    "fastest_m_s": ("nothing is faster than", " m/s"),
    "moves_m": ("a track is shown once it has moved by", " m"),
    "over_s": ("within", " s"),
    "apart_m": ("two tracks nearer to each other that move alike are one", " m"),
}


class Told(NamedTuple):
    """Of the targets, of each sensor in its order, and of each value where it is from."""

    targets: TargetBeliefs
    sensors: list[SensorBeliefs]
    said: list[Said]


def of_many(settings: Settings, following: Following, places: list[Places]) -> Told:
    """What the tracker is told.

    Parameters
    ----------
    settings
        From `wildlab.pipeline.following.beliefs.of_flight`.
    following
        What filters of one target are told of the targets.
    places
        Of every sensor.

    Raises
    ------
    WildlabError
        Where a sensor has another number of values for the hulls than there are hulls.
    """
    stated = settings.targets.many or ManyTargetsPart()
    usual = read_settings(DATA / "settings" / "many.toml").targets.many
    if usual is None:
        raise WildlabError("data/settings/many.toml lacks [targets.many]", "get it from the project again")
    said: list[Said] = []

    def one(name: str) -> float:
        own = getattr(stated, name)
        value = float(getattr(usual, name) if own is None else own)
        what, unit = _WORDS[name]
        said.append(Said("targets", what, f"{value:.3g}{unit}", ASSUMED if own is None else STATED))
        return value

    hulls = tuple(_hull(part) for part in stated.hulls or usual.hulls)
    said.append(
        Said(
            "targets",
            "kinds by size",
            ", ".join(f"{hull.name} {hull.length_m:g} m" if hull.length_m else hull.name for hull in hulls),
            STATED if stated.hulls else ASSUMED,
        )
    )
    told: dict[str, Any] = {name: one(name) for name in _WORDS}
    told["hits"] = int(told["hits"])
    targets = TargetBeliefs(hulls, following.density, following.start_speed_m_s, **told)
    sensors = []
    for looks in places:
        found, more = _of_sensor(settings, looks, len(hulls))
        sensors.append(found)
        said += more
    return Told(targets, sensors, said)


def _hull(part: HullPart) -> Hull:
    return Hull(part.name, part.length_m, part.beam_m, part.share)


def _of_sensor(settings: Settings, looks: Places, kinds: int) -> tuple[SensorBeliefs, list[Said]]:
    part = settings.sensors.get(looks.sensor)
    stated = None if part is None else part.many
    said: list[Said] = []

    def one(name: str, what: str, unit: str, other: float, source: str) -> float:
        own = None if stated is None else getattr(stated, name)
        value = other if own is None else float(own)
        said.append(Said(looks.sensor, what, f"{value:.3g}{unit}", source if own is None else STATED))
        return value

    distance = looks.distances()
    near = one("near_m", "sees nothing nearer than", " m", 0.0, ASSUMED)
    far = one("far_m", "or farther than", " m", BEYOND * float(distance.max(initial=1.0)), HERE)
    # What is left over if every scan had one target: a guess that is too high where there are many.
    each = len(distance) / max(len(looks.scans), 1)
    area = looks.area(far)
    clutter = max(each - 1.0, LEAST_FALSE) / area
    interval = looks.interval_s
    found = SensorBeliefs(
        looks.sensor,
        one("detection", "detects what is in view, probability", "", DETECTION, ASSUMED),
        one("clutter_per_m2", "false detections a look on a square metre", "", clutter, HERE),
        near,
        far,
        one("patience_s", "shown unseen for", " s", max(LOOKS_SHOWN * interval, SECONDS_SHOWN), ASSUMED),
        _of_hulls(stated, "rough_m", kinds, looks.sensor),
        _of_hulls(stated, "along_m", kinds, looks.sensor),
        _of_hulls(stated, "near_side_m", kinds, looks.sensor),
        bool(stated is not None and stated.several),
    )
    return found, said


def _of_hulls(stated: object, name: str, kinds: int, sensor: str) -> tuple[float, ...]:
    own: tuple[float, ...] = getattr(stated, name, ())
    if own and len(own) != kinds:
        raise WildlabError(
            f"{name} of the sensor {sensor!r} has {len(own)} values, and there are {kinds} kinds of hulls",
            "give one for each of [[targets.many.hulls]]",
            field=f"sensors.{sensor}.many.{name}",
        )
    return own or (0.0,) * kinds
