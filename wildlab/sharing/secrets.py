"""What must not be in a copy: of the machine always, of a flight where it is generalised."""

from __future__ import annotations

import getpass
import re
import socket
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.heights import undulation
from wildlab.flight.manifest import Manifest, parse_settings
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, ned_to_geodetic
from wildlab.geometry.gravity import normal_gravity
from wildlab.paths import ROOT
from wildlab.sharing.generalisation import Generalised, first_stamp, new_origin
from wildlab.sharing.names import names_in
from wildlab.sharing.reports import Source
from wildlab.sharing.tiers import Treatment

#: So many places of each table are looked for; the scan finds what is near to one of them.
_PLACES_EACH = 20
#: A place that is written and lies no farther from the flight than this is a leak, m: beyond, it is chance.
_NEAR = 2000.0
#: So many digits of a hash tell it: what the foot of a report prints.
_SHORT = 8


@dataclass(frozen=True)
class Secrets:
    """What must not be in what is sent. Printed, it shows none of it.

    Attributes
    ----------
    places
        (N, 3) latitude and longitude (deg, WGS84), height above the ellipsoid (m; NaN where not known).
    near_m
        How near to one of them a written place is a leak.
    cell_deg
        Places on this grid may be written (0.1: 60.1 N 10.3 E); 0 means that none may.
    words
        Names, labels, file names, folders, users, hosts, hashes.
    moments
        UTC, with a zone: when it was, where only the month may be said.
    numbers
        Other numbers that locate: heights, the geoid's undulation, gravity, declination. Their sign does not
        count.
    """

    places: Array = field(default_factory=lambda: np.empty((0, 3)), repr=False)
    near_m: float = 1000.0
    cell_deg: float = 0.0
    words: tuple[str, ...] = field(default=(), repr=False)
    moments: tuple[datetime, ...] = field(default=(), repr=False)
    numbers: tuple[float, ...] = field(default=(), repr=False)


def machine_secrets() -> Secrets:
    """Who makes the copy, and where on which machine."""
    words = [str(folder) for folder in (Path.home(), ROOT, Path.cwd(), sys.prefix) if folder is not None]
    for ask in (getpass.getuser, socket.gethostname):
        try:
            words.append(ask())
        except (OSError, KeyError):
            continue
    return Secrets(words=tuple(dict.fromkeys(words)))


def flight_secrets(
    flight: Flight, made: Generalised, treatment: Treatment, source: Source, folder: Path
) -> Secrets:
    """What tells where, when and of whom a flight is.

    Parameters
    ----------
    flight, made
        The true one, and its generalised copy.
    treatment
        What may be told.
    source
        Its reports, with the hashes of its files.
    folder
        Where it lies.

    Returns
    -------
    Secrets
    """
    m = flight.manifest
    moments = []
    # A day may be told to those who are told it.
    if m.time.epoch is not None and treatment.date == "month":
        first = m.time.epoch.timestamp() + first_stamp(flight)
        moments = [datetime.fromtimestamp(t, UTC) for t in (first, first + _length(flight))]
    paths = (str(folder.resolve()), *(str(one.resolve()) for one in source.folders))
    words = (
        *_known_texts(m.model_dump()),
        *_known_names(made),
        *_told(source, made),
        *paths,
        *_hashes(source),
    )
    return Secrets(
        places=_known_places(flight),
        near_m=_NEAR,
        cell_deg=treatment.cell_deg or 0.0,
        words=tuple(dict.fromkeys(words)),
        moments=tuple(moments),
        numbers=tuple(_known_numbers(m)),
    )


def all_of(several: Sequence[Secrets]) -> Secrets:
    """The secrets of all: nobody's may be in the copy of another."""
    with_places = [one for one in several if len(one.places)]
    return Secrets(
        places=np.concatenate([one.places for one in several]),
        near_m=max((one.near_m for one in with_places), default=_NEAR),
        cell_deg=max((one.cell_deg for one in with_places), default=0.0),
        words=tuple(dict.fromkeys(word for one in several for word in one.words)),
        moments=tuple(moment for one in several for moment in one.moments),
        numbers=tuple(number for one in several for number in one.numbers),
    )


def _known_places(flight: Flight) -> Array:
    """(N, 3) latitude and longitude, deg, and height, m: the origin, the middle, and some of every table."""
    p = [np.zeros((1, 3)), new_origin(flight)[None]]
    for table in (*flight.nav.values(), *flight.tables.values()):
        if {"north_m", "east_m", "down_m"} <= set(table):
            rows = table[["north_m", "east_m", "down_m"]].to_numpy(float)
            rows = rows[np.isfinite(rows).all(axis=1)]
            p.append(
                rows[np.unique(np.linspace(0, len(rows) - 1, _PLACES_EACH).astype(int))]
                if len(rows)
                else rows
            )
    llh = ned_to_geodetic(np.concatenate(p), flight.manifest.origin_tuple())
    return np.column_stack([np.degrees(llh[:, 0]), np.degrees(llh[:, 1]), llh[:, 2]])


def _length(flight: Flight) -> float:
    tables = [*flight.nav.values(), *flight.tables.values()]
    spans = [table["time_s"].max() - table["time_s"].min() for table in tables if "time_s" in table]
    return float(max((span for span in spans if pd.notna(span)), default=0.0))


def _known_numbers(m: Manifest) -> Iterator[float]:
    """Other numbers that locate."""
    yield m.origin.height_m
    yield float(normal_gravity(np.radians(m.origin.latitude_deg), m.origin.height_m))
    geoid = undulation(m.origin.latitude_deg, m.origin.longitude_deg)
    if geoid is not None:
        yield float(geoid)
    if m.vertical.correction_m:
        yield m.vertical.correction_m
    for angle in (m.magnetometer.declination_deg, m.magnetometer.inclination_deg):
        if angle:
            yield angle
    if m.terrain is not None:
        yield from (one for one in (m.terrain.added_m, *m.terrain.cell_m) if one and one != m.terrain.step_m)


def _known_texts(value: Any) -> Iterator[str]:
    """All that is stated in words, whatever it is."""
    if isinstance(value, str):
        # Kinds of hulls of a generalised flight have letters.
        yield from () if re.fullmatch("kind [A-Z]", value) else (value,)
    elif isinstance(value, Mapping | list | tuple):
        for one in value.values() if isinstance(value, Mapping) else value:
            yield from _known_texts(one)


def _known_names(made: Generalised) -> Iterator[str]:
    for kind, known in made.names.by_kind.items():
        # A true name like target-7 is what a neutral one looks like, and says as little.
        yield from (name for name in _some(known) if not re.fullmatch(rf"{kind}[-_ ]?\d*", name))


def _told(source: Source, made: Generalised) -> Iterator[str]:
    """Names in the settings that reports were made with: of sensors that the flight may not have too."""
    for parameters in source.parameters.values():
        try:
            named = names_in(parse_settings(str(parameters.get("settings") or "")))
        except WildlabError:
            # Made by another wildlab; where the report is made again, this is said there.
            continue
        yield from (name for name in named if made.names.of("sensor", name) != name)


def _some(names: Iterable[str]) -> list[str]:
    """All names of a kind; of thousands of frames the first and last, whose parts are those of all."""
    known = list(names)
    return known if len(known) <= 1000 else [*known[:500], *known[-500:]]


def _hashes(source: Source) -> Iterator[str]:
    """What files are known by."""
    files = source.flight.get("files")
    sources = source.flight.get("sources")
    for digest in (*(files.values() if isinstance(files, dict) else ()), *(sources or ())):
        yield from (str(digest), str(digest)[:_SHORT])
