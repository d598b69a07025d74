"""Whose detection it is: targets that detections name, those with truth, or one that has no name."""

from __future__ import annotations

import numpy as np

from wildlab.analysis.following.noise_model import TargetModel
from wildlab.analysis.scans import Scans, Truth, truths_at
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight

#: What a target is called of which nobody says a name.
UNNAMED = "target"


def identified(scans: Scans, targets: TargetModel) -> Scans:
    """The scans with labels as far as they are to be believed."""
    if targets.identified in ("gate", "one"):
        return scans._replace(labels=np.full(scans.labels.shape, "", object))
    if targets.identified == "label" and not scans.labelled:
        raise WildlabError(
            f"no detection of the sensor {scans.sensor!r} names its target",
            'set identified = "gate" in [targets], or leave it out',
            field="targets.identified",
        )
    return scans


def targets_of(flight: Flight, scans: Scans) -> list[Truth]:
    """The targets that a sensor may follow, with their true places as far as they are known."""
    truths = [] if flight.truth is None or not len(flight.truth) else truths_at(flight, scans.times)
    if not scans.labelled:
        return truths or [_unknown(UNNAMED, scans)]
    by_name = {one.target: one for one in truths}
    names = dict.fromkeys(str(one) for one in scans.labels.ravel() if one)
    return [by_name.get(name) or _unknown(name, scans) for name in names]


def _unknown(name: str, scans: Scans) -> Truth:
    nowhere = np.full((len(scans.times), 2), np.nan)
    return Truth(name, nowhere, nowhere, 0.0)
