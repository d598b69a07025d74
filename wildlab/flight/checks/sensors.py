"""Whose look a detection was: what its source says, and what its frame says."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from wildlab.flight.checks.findings import Finding
from wildlab.flight.following import Settings, absent_sensors
from wildlab.flight.store import Flight


def looks_of_others(frames: pd.DataFrame, detections: pd.DataFrame) -> pd.DataFrame:
    """The detections whose frame names another sensor than their source does.

    Parameters
    ----------
    frames, detections
        As in a flight.

    Returns
    -------
    DataFrame
        Those rows of the detections, with ``sensor``, that of their frame; "" where it names none. Without
        rows where the frames name no sensors at all, and so each source is one.
    """
    if "sensor" not in frames:
        return detections.iloc[:0].assign(sensor="")
    of_frame = frames.drop_duplicates("frame_id").set_index("frame_id")["sensor"]
    sensor = detections["frame_id"].map(of_frame)
    # A frame that is in no table is another fault, said elsewhere.
    return detections.assign(sensor=sensor)[sensor.notna() & (sensor != detections["source"])]


def sensors(flight: Flight) -> Iterator[Finding]:
    """Detections that a sensor made in the looks of another one, sources that are no sensor's, and sensors of
    ``[sensors]`` that there are not."""
    frames, detections = flight.frames, flight.detections
    if frames is None or detections is None:
        return
    named = {name for name in frames["sensor"] if name} if "sensor" in frames else set(detections["source"])
    told = Settings(sensors=flight.manifest.sensors)
    for name, meant in absent_sensors(told, named).items() if named else ():
        yield Finding(
            "warning",
            "flight.toml",
            f"sensors.{name}",
            "this sensor looked at nothing, so that what is stated of it is not used",
            f"{meant}; or take it out",
        )
    if "sensor" not in frames:
        return
    others = looks_of_others(frames, detections)
    for (source, sensor), rows in others.groupby(["source", "sensor"], sort=True):
        whose = f"looks of the sensor {sensor!r}" if sensor else "looks that name no sensor"
        n, of = len(rows), int((detections["source"] == source).sum())
        first = f"first {rows.iloc[0]['frame_id']!r}"
        said = f"{n} of {of} detections of the source {source!r} are in {whose}, {first}"
        if source in named:
            yield Finding(
                "problem",
                "detections",
                "source",
                f"frames.sensor and detections.source contradict each other: {said}",
                "give the detections of each sensor a source of its name (in a recipe a [[detections]] each, "
                "with a file or a `where` of its own), or name in frames.sensor who looked; where all are of "
                "one sensor, frames need no sensor",
            )
        elif sensor:
            yield Finding(
                "warning" if (detections["source"] == sensor).sum() == 0 else "note",
                "detections",
                "source",
                f"{said}: a sensor is followed by the detections of the source of its name, so these are "
                "left out there",
                f"if they are what {sensor!r} saw, give them the source {sensor!r}",
            )
