"""Where the flight is: about its origin, and its tables near each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from wildlab.flight.checks.findings import POSITION, Finding
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.places import place_mistakes
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, Origin, geodetic_to_ned, ned_to_geodetic

#: From here on a local level at the origin is worth a word, and from there on it cannot serve (m): attitudes
#: are against the level where the aircraft is, and turn by a degree in 111 km, more near the poles.
FAR, TOO_FAR = 20_000.0, 100_000.0
#: Tables whose middles are this much (m) further apart than they are long do not belong together.
APART = 20_000.0


def origin(flight: Flight) -> Iterator[Finding]:
    """The origin of the local frame against where the flight is."""
    places = middles(flight)
    flown = {name: at for name, at in places.items() if name.startswith("nav/") or name == "gnss"}
    if not flown:
        return
    at = min(flown.values(), key=lambda one: float(np.hypot(*one[:2])))
    away = float(np.hypot(*at[:2]))
    if away < FAR:
        return
    angle = turned(at, flight.manifest.origin_tuple())
    said = (
        f"the origin is {away / 1e3:.0f} km from the flight: level and north there and here differ by "
        f"{angle:.2g} "
        "deg, and so does every attitude"
    )
    ways = []
    o = flight.manifest.origin
    latitude, longitude = o.latitude_deg, o.longitude_deg
    changed = {
        "latitude and longitude of the origin exchanged": (longitude, latitude),
        "latitude of the origin negated": (-latitude, longitude),
        "longitude of the origin negated": (latitude, -longitude),
        "latitude and longitude of the origin negated": (-latitude, -longitude),
    }
    here = ned_to_geodetic(at, flight.manifest.origin_tuple())
    for cause, (lat, lon) in changed.items():
        if abs(lat) <= 90 and _away(here, lat, lon, o.height_m) < FAR:
            ways.append((cause, f"latitude_deg = {lat:g}, longitude_deg = {lon:g}"))
    fix = "give [origin] of the recipe a place beside the flight, or leave it out: then it is the first pose"
    if ways and flight.manifest.locations.sensitivity == "open":
        fix = " or ".join(f"write `{way[1]}` in [origin]" for way in ways)
    elif ways:
        fix = f"look at [origin] of the recipe: {' or '.join(way[0] for way in ways)}"
    yield Finding(
        "problem" if away > TOO_FAR else "warning",
        "flight.toml",
        "origin",
        said + "".join(f"; {way[0]}" for way in ways),
        f"{fix}, and import again",
        tuple(way[0] for way in ways) or ("origin far away",),
    )


def _away(here: Array, latitude_deg: float, longitude_deg: float, height: float) -> float:
    there = (float(np.radians(latitude_deg)), float(np.radians(longitude_deg)), height)
    return float(np.hypot(*geodetic_to_ned(here[0], here[1], here[2], there)[:2]))


def turned(at: Array, origin: Origin) -> float:
    """How far level and north at a place (3,) in n are turned against those of the origin, degrees.

    Examples
    --------
    >>> print(f"{turned(np.array([111_000.0, 0.0, 0.0]), (0.0, 0.0, 0.0)):.2f}")
    1.00
    """
    p = np.asarray(at, float)[None]
    step = np.eye(3)[:2] * 10.0
    latitude, longitude, height = ned_to_geodetic(p, origin)[0]
    north = geodetic_to_ned(latitude + 1e-6, longitude, height, origin) - p[0]
    up = geodetic_to_ned(latitude, longitude, height + step[0, 0], origin) - p[0]
    north, down = north / np.linalg.norm(north), -up / np.linalg.norm(up)
    R = np.stack([north, np.cross(down, north), down])
    return float(np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))))


def middles(flight: Flight) -> dict[str, Array]:
    """The middle (3,) in n of each table of positions."""
    tables: Mapping[str, object] = {
        **{f"nav/{name}": nav for name, nav in flight.nav.items()},
        **{name: flight.tables[name] for name in ("gnss", "truth") if name in flight.tables},
    }
    found = {}
    for name, table in tables.items():
        p = table[list(POSITION)].to_numpy(float)  # type: ignore[index]
        p = p[np.isfinite(p).all(axis=1)]
        if len(p):
            found[name] = np.asarray(np.median(p, axis=0))
    return found


def together(flight: Flight) -> Iterator[Finding]:
    """Tables that are nowhere near each other, and the mistake that brings one to the others.

    Which of two is wrong, the origin of the recipe may say: the right one is near it.
    """
    places = middles(flight)
    if len(places) < 2:
        return
    near = {name: float(np.hypot(*at[:2])) for name, at in places.items()}
    anchor = min(near, key=lambda name: near[name])
    for name, at in places.items():
        apart = float(np.hypot(*(at - places[anchor])[:2]))
        if name == anchor or apart < APART:
            continue
        other = places[anchor]
        ways = [*_nearer(name, at, other, flight), *_nearer(anchor, other, at, flight)]
        said = f"{name} is {apart / 1e3:.0f} km from {anchor}"
        if ways:
            said += ": " + " or ".join(way[1] for way in ways[:3])
        yield Finding(
            "problem",
            name,
            "north_m",
            said,
            " or ".join(f"write {way[2]}" for way in ways[:3]) + ", and import again"
            if ways
            else "check latitude and longitude of both, units and signs, and that both are of this flight",
            tuple(f"{name}: {way[0]}" for way in ways[:3]),
        )


def _nearer(name: str, at: Array, other: Array, flight: Flight) -> list[tuple[str, str, str]]:
    """Mistakes that bring a place to another: cause, clause, and what to write."""
    found = []
    undo: Callable[[Array], Array | None]
    for mistake in place_mistakes(words.part_of(name), flight.manifest.origin_tuple(), local=False):
        undo = mistake.undo
        if mistake.about == "height":
            continue
        moved = undo(at[None])
        if moved is not None and float(np.hypot(*(moved[0] - other)[:2])) < APART:
            found.append((mistake.cause, f"in {name} {mistake.said}", mistake.write))
    return found
