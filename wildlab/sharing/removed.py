"""What a copy does not have, as a list for the sender alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

import pandas as pd

from wildlab.flight.store import Flight
from wildlab.sharing.names import Names
from wildlab.sharing.settings import hulls_of


@dataclass(frozen=True)
class Removed:
    """One thing that the copy does not have: what it was, and what stands in its place. For the sender."""

    what: str
    was: str
    now: str


def removed_from(
    flight: Flight, made: Flight, names: Names, start: float, when: str, place: str
) -> Iterator[Removed]:
    """What is gone of the manifest and the tables, as the sender knows it.

    Parameters
    ----------
    flight, made
        The true one and its generalised copy.
    names
        Neutral names by the true ones.
    start
        First stamp of the true one, flight time, s.
    when, place
        What the copy says of them.
    """
    was, now = flight.manifest, made.manifest
    o = was.origin
    yield Removed("origin", f"{o.latitude_deg}, {o.longitude_deg}, {o.height_m} m", place)
    yield Removed("heights", "above the ellipsoid, by the origin", "above the flight's own ground")
    if was.time.epoch is not None:
        true = datetime.fromtimestamp(was.time.epoch.timestamp() + start, UTC)
        yield Removed("date and time", f"{true:%Y-%m-%d %H:%M:%S} UTC", f"{when}, time from the first sample")
    yield Removed("flight", was.name, now.name)
    for what, one, other in (
        ("description", was.description, ""),
        ("platform", was.platform.name, now.platform.name),
        ("camera", was.camera.name if was.camera else "", "camera"),
        ("inertial unit", f"{was.imu.name} {was.imu.note}".strip(), ""),
        ("receiver", f"{was.gnss.name} {was.gnss.note}".strip(), ""),
        ("magnetometer", f"{was.magnetometer.name} {was.magnetometer.note}".strip(), ""),
        ("note on heights", was.vertical.note, ""),
        ("note on uncertainty", was.uncertainty.note, ""),
        ("map", was.terrain.source if was.terrain else "", "map"),
        ("reference of the map", was.terrain.crs if was.terrain else "", "n"),
    ):
        if one and one != other:
            yield Removed(what, one, other or "left out")
    if was.vertical.correction_m or was.vertical.reference != "ellipsoid":
        v = was.vertical
        yield Removed("vertical reference", f"{v.reference}, {v.correction_m} m taken off", "left out")
    if was.magnetometer.declination_deg is not None:
        yield Removed("declination", f"{was.magnetometer.declination_deg} deg", "that of no place")
    for key, value in was.clocks.model_dump().items():
        kept = getattr(now.clocks, key)
        if value != kept:
            yield Removed(key.removesuffix("_s").replace("_", " "), f"{value} s", f"{kept:g} s")
    for name, part in was.sensors.items():
        kept = now.sensors[names.of("sensor", name)].clock_offset_s
        if part.clock_offset_s != kept:
            yield Removed(f"clock offset of {name}", f"{part.clock_offset_s} s", f"{kept:g} s")
    for one in hulls_of(was.targets):
        yield Removed("kind of target", one, "a letter")
    for source in was.sources:
        yield Removed("raw file", f"{source.file} ({source.sha256[:8]})", "left out")
    for key in sorted({*flight.tables} - {*made.tables}):
        yield Removed("table", key, "left out: what the field there did to it cannot be told")
    tables = {**{f"nav/{name}": nav for name, nav in flight.nav.items()}, **flight.tables}
    for name, table in tables.items():
        copied = _copied(made, name, flight)
        for column in [] if copied is None else [one for one in table if one not in copied]:
            yield Removed("column", f"{name}: {column}", "left out")
    if flight.folder is not None:
        yield Removed("folder", str(flight.folder.resolve()), "left out")
    yield from _renamed(names)


def _copied(made: Flight, name: str, flight: Flight) -> pd.DataFrame | None:
    if not name.startswith("nav/"):
        return made.tables.get(name)
    return list(made.nav.values())[list(flight.nav).index(name.removeprefix("nav/"))]


def _renamed(names: Names) -> Iterator[Removed]:
    for kind, known in sorted(names.by_kind.items()):
        for true, neutral in known.items():
            if kind not in ("frame", "detection"):
                yield Removed(kind, true, neutral)
        if kind in ("frame", "detection") and known:
            (a, first), *_, (b, last) = (*known.items(), *known.items())
            yield Removed(f"{len(known)} names of {kind}s", f"{a} to {b}", f"{first} to {last}")
