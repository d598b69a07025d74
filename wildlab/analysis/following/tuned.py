"""What one flight teaches about sensors and targets, for another one to be judged by."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from wildlab.analysis.following.likelihood import tune_by_innovations
from wildlab.analysis.following.noise_model import TargetModel, ToldValue, of_flight, of_targets
from wildlab.analysis.following.sensor_tuning import SensorTuning, tune
from wildlab.errors import WildlabError
from wildlab.flight.checksums import checksums_of
from wildlab.flight.following import Settings
from wildlab.flight.store import Flight

Against = Literal["truth", "innovations"]


class Tuned(NamedTuple):
    """What a flight says of its sensors.

    ``flight`` is its name, ``against`` what its detections were held against. ``density`` (m/s per root
    second) of the targets, where it was found too.
    """

    flight: str
    against: Against
    sensors: dict[str, SensorTuning]
    density: float | None = None

    def said_of_density(self) -> ToldValue:
        """For the table of what filters were told."""
        words = "acceleration, SD of the velocity that grows in a second"
        return ToldValue("targets", words, f"{self.density or 0.0:.3g} m/s", f"tuned on {self.flight}")


def tuned_text(tuned: Tuned) -> str:
    """As text, which a notebook is given."""
    sensors = {name: one._asdict() for name, one in tuned.sensors.items()}
    return json.dumps(
        {"flight": tuned.flight, "against": tuned.against, "sensors": sensors, "density": tuned.density}
    )


def read_tuned(text: str) -> Tuned | None:
    """What `tuned_text` wrote; None of an empty text."""
    if not text:
        return None
    data: Mapping[str, Any] = json.loads(text)
    sensors = {
        name: SensorTuning(**{**one, "own_sds": tuple(one["own_sds"])})
        for name, one in data["sensors"].items()
    }
    return Tuned(data["flight"], data["against"], sensors, data["density"])


def tune_flight(
    flight: Flight,
    sensors: Sequence[str],
    settings: Settings | None = None,
    against: Against | None = None,
    source: str | None = None,
) -> Tuned:
    """Tune sensors on a flight: against truth where it has any, else by the likelihood of innovations.

    Raises
    ------
    WildlabError
        Where truth is asked for and not there, or the flight shows too little of a sensor.
    """
    has_truth = flight.truth is not None and len(flight.truth) > 0
    if against == "truth" and not has_truth:
        raise WildlabError(
            f"the flight {flight.name!r} has no truth to tune against",
            "tune by its innovations (--against innovations), or on another flight",
            file=flight.folder,
            field="--against",
        )
    if against == "innovations" or not has_truth:
        found, density = tune_by_innovations(flight, sensors, settings, source)
        return Tuned(flight.name, "innovations", found, density)
    targets: TargetModel = of_targets(of_flight(flight, settings).targets)[0]
    found = {sensor: tune(flight, sensor, targets.reach, source) for sensor in sensors}
    return Tuned(flight.name, "truth", found)


#: Fewest detections alike, stamp and values, by which two flights are one, and their share of the smaller.
ALIKE, SHARE = 5, 0.05
_VALUES = ("u_px", "v_px", "range_m", "azimuth_rad", "elevation_rad", "north_m", "east_m", "down_m",
           "v_north_m_s", "v_east_m_s")  # fmt: skip


def refuse_same(flight: Flight, other: Flight) -> None:
    """Refuse to tune on the flight that is judged: one that shares detections with it, whatever its name, its
    folder, or how much of it was imported.

    Raises
    ------
    WildlabError
        Where it is.
    """
    same = False
    if flight.folder is not None and other.folder is not None:
        mine, its = checksums_of(flight.folder), checksums_of(other.folder)
        same = "detections.parquet" in mine and mine["detections.parquet"] == its.get("detections.parquet")
    both = _as_measured(flight), _as_measured(other)
    alike = sum((both[0] & both[1]).values())
    if same or alike >= max(ALIKE, SHARE * min(map(Counter.total, both))):
        raise WildlabError(
            f"this is the flight that is judged, or part of it: {alike} of its detections have the same "
            "stamps and values, and nothing is tuned where it is judged",
            "tune on another flight",
            file=other.folder,
            field="--tune",
        )


def _as_measured(flight: Flight) -> Counter[tuple[object, ...]]:
    """Detections by sensor, UTC to the millisecond, and values as they were measured."""
    seen, frames = flight.detections, flight.frames
    if seen is None or not len(seen):
        return Counter()
    times = np.full(len(seen), np.nan)
    if frames is not None and "time_s" in frames and "frame_id" in seen:
        by_frame = frames.drop_duplicates("frame_id").set_index("frame_id")["time_s"]
        times = seen["frame_id"].map(by_frame).to_numpy(float)
    epoch = flight.manifest.time.epoch
    began = epoch.timestamp() if epoch is not None else 0.0
    # Places match only where they are counted from the same origin; ranges, bearings and pixels in any case.
    values = np.round(seen.reindex(columns=list(_VALUES)).to_numpy(float), 6) + 0.0
    known = np.asarray(np.isfinite(values).any(axis=1))
    stamps = np.where(np.isfinite(times), np.round(began + times, 3), -1.0)
    rows = zip(seen["source"], stamps, map(bytes, values), strict=True)
    return Counter(row for row, good in zip(rows, known, strict=True) if good)
