"""Usual mistakes about positions: coordinates, their units and signs, heights; functions of those in n."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.trial import Mistake
from wildlab.flight.units import other_units
from wildlab.geometry.frames import Array, Origin, geodetic_to_ned, ned_to_geodetic

#: Units of length that a height or a coordinate may be in, by what they are called in recipes.
LENGTHS = other_units("length")


def place_mistakes(part: str, origin: Origin, local: bool = True) -> Iterator[Mistake[Array]]:
    """Mistakes about one table of positions, as they are undone.

    Parameters
    ----------
    part
        Of the recipe, as ``"poses.logged"``.
    origin
        Of frame n.
    local
        Whether coordinates about the origin count too, beside latitude and longitude.
    """
    where = f"{part}.position"

    def geodetic(
        change: Callable[[Array, Array, Array], tuple[Array, Array, Array]],
    ) -> Callable[[Array], Array | None]:
        def undo(p: Array) -> Array | None:
            llh = ned_to_geodetic(p, origin)
            lat, lon, height = change(*np.moveaxis(llh, -1, 0))
            if (np.abs(lat[np.isfinite(lat)]) > np.pi / 2).any() or (
                np.abs(lon[np.isfinite(lon)]) > 2 * np.pi
            ).any():
                return None
            return geodetic_to_ned(lat, lon, height, origin)

        return undo

    def linear(matrix: list[list[float]]) -> Callable[[Array], Array | None]:
        return lambda p: np.asarray(p @ np.array(matrix).T)

    yield Mistake(
        "latitude and longitude exchanged",
        "latitude and longitude are exchanged",
        words.exchange("latitude", "longitude", where),
        geodetic(lambda lat, lon, h: (lon, lat, h)),
    )
    for key, signs in (("latitude", (-1, 1)), ("longitude", (1, -1))):
        yield Mistake(
            f"{key} negated",
            f"the {key} has the wrong sign",
            words.negate(key, where),
            geodetic(lambda lat, lon, h, s=signs: (s[0] * lat, s[1] * lon, h)),  # type: ignore[misc]
        )
    yield Mistake(
        "latitude and longitude negated",
        "latitude and longitude have the wrong sign",
        words.negate("latitude and longitude", where),
        geodetic(lambda lat, lon, h: (-lat, -lon, h)),
    )
    for key, factors in (
        ("latitude and longitude", (1, 1)),
        ("latitude", (1, 0)),
        ("longitude", (0, 1)),
    ):
        scale = [np.degrees(1.0) if one else 1.0 for one in factors]
        yield Mistake(
            f"{key} in radians, read as degrees",
            f"{key} {'are' if all(factors) else 'is'} in radians, and the recipe says degrees",
            words.unit(key, where, "rad"),
            geodetic(lambda lat, lon, h, s=scale: (s[0] * lat, s[1] * lon, h)),  # type: ignore[misc]
        )
    if local:
        yield Mistake(
            "north and east exchanged",
            "north and east are exchanged",
            words.exchange("north", "east", where),
            linear([[0, 1, 0], [1, 0, 0], [0, 0, 1]]),
        )
        for axis, key in enumerate(("north", "east")):
            yield Mistake(
                f"{key} negated",
                f"{key} has the wrong sign",
                words.negate(key, where),
                linear(np.diag(np.where(np.arange(3) == axis, -1.0, 1.0)).tolist()),
            )
        yield Mistake(
            "north and east negated",
            "north and east have the wrong sign",
            words.negate("north and east", where),
            linear(np.diag([-1.0, -1.0, 1.0]).tolist()),
        )
        for name, factor in LENGTHS.items():
            yield Mistake(
                f"north and east in {name}, read as m",
                f"north and east are in {name}, and the recipe says m",
                words.unit("north and east", where, name),
                linear(np.diag([factor, factor, 1.0]).tolist()),
            )
            yield Mistake(
                f"north and east in m, read as {name}",
                f"north and east are in m, and the recipe says {name}",
                words.unit("north and east", where, "m"),
                linear(np.diag([1 / factor, 1 / factor, 1.0]).tolist()),
            )
    yield from _heights(part, origin, geodetic)


def _heights(
    part: str, origin: Origin, geodetic: Callable[..., Callable[[Array], Array | None]]
) -> Iterator[Mistake[Array]]:
    where = f"{part}.position"
    for name, factor in LENGTHS.items():
        yield Mistake(
            f"height in {name}, read as m",
            f"the height is in {name}, and the recipe says m",
            words.unit("height", where, name),
            geodetic(lambda lat, lon, h, f=factor: (lat, lon, f * h)),
            about="height",
        )
        yield Mistake(
            f"height in m, read as {name}",
            f"the height is in m, and the recipe says {name}",
            words.unit("height", where, "m"),
            geodetic(lambda lat, lon, h, f=factor: (lat, lon, h / f)),
            about="height",
        )
    yield Mistake(
        "height negated",
        "the height has the wrong sign",
        words.negate("height", where),
        geodetic(lambda lat, lon, h: (lat, lon, -h)),
        about="height",
    )
    yield Mistake(
        "down counted upwards",
        "down about the origin has the wrong sign: it counts upwards",
        f"`up` in place of `down` in [{where}], or the other way round",
        lambda p: p * np.array([1.0, 1.0, -1.0]),
        about="height",
    )
