"""What of a twin is not published may be moved, to see what hangs on it.

`varied` holds for every twin that is loaded within it: a trial that asks for its twin by name gets it moved,
wherever it asks. Nothing that filters are told (the group ``assumed``, tunings in the code) is moved.

A moved twin need not show its target as often as is printed: see `TwinParameters.as_moved_from`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from wildlab.errors import WildlabError
from wildlab.simulation.parameters import CHANGE, TwinParameters, each_parameter

#: What filters are told of a twin's sensors: their tuning, not the flight.
TOLD = ("assumed",)
#: Kinds of parameters that mean something at half or twice their size, by how their names end.
_KINDS = (
    ("errors", re.compile(r"(\w+_)?(sd|noise|bias|latency)")),
    ("durations", re.compile(r"\w+_(period|time)")),
    ("share", re.compile(r"(\w+_)?share")),
    ("{name}", re.compile(r"(\w+_)?(speed|airspeed|radius)")),
)


def groups_of(twin: TwinParameters) -> dict[str, tuple[str, ...]]:
    """Parameters of a twin that are not published and can be moved, those of one kind in a part together.

    Parameters
    ----------
    twin
        As `wildlab.simulation.load_twin` gives it.

    Returns
    -------
    dict
        By the group's name (``"boresight: errors"``) the parameters' names (``"boresight.roll_sd"``).

    Examples
    --------
    >>> from wildlab.simulation import load_twin
    >>> groups_of(load_twin("fast-vessel"))["flight: wind speed"]
    ('flight.wind_speed',)
    """
    found: dict[str, tuple[str, ...]] = {}
    for part, name, parameter in each_parameter(twin):
        if parameter.status == "published" or part in TOLD or isinstance(parameter.value, str):
            continue
        kind = next((word for word, pattern in _KINDS if pattern.fullmatch(name)), None)
        if kind is None or parameter.value == 0:
            continue
        group = f"{part}: {kind.format(name=name)}".replace("_", " ").replace(".", ", ")
        found[group] = (*found.get(group, ()), f"{part}.{name}")
    return found


@contextmanager
def varied(factors: Mapping[str, float]) -> Iterator[None]:
    """Within it, every twin that is loaded has these parameters multiplied.

    Parameters
    ----------
    factors
        By the parameter's name, ``"flight.wind_speed"``; one that a twin has not is left out there.

    Raises
    ------
    WildlabError
        Where a parameter is published, no number, or none that can be moved; when a twin is loaded.
    """
    token = CHANGE.set(partial(apply, factors=dict(factors)) if factors else None)
    try:
        yield
    finally:
        CHANGE.reset(token)


def apply(twin: TwinParameters, factors: Mapping[str, float]) -> TwinParameters:
    """A twin with some of its parameters multiplied.

    Parameters
    ----------
    factors
        As for `varied`.

    Returns
    -------
    TwinParameters
        Checked anew: what the moved parameters do not allow is an error.

    Raises
    ------
    WildlabError
        As `varied`, or where the twin is not possible any more.
    """
    movable = {name for names in groups_of(twin).values() for name in names}
    there = {f"{part}.{name}" for part, name, _ in each_parameter(twin)}
    for path in factors:
        if path in there and path not in movable:
            raise WildlabError(
                f"the parameter {path!r} of the twin {twin.name!r} is published, or cannot be scaled",
                f"move one of: {', '.join(sorted(movable))}",
            )
    return scaled(twin, {path: factor for path, factor in factors.items() if path in there})


def scaled(twin: TwinParameters, factors: Mapping[str, float]) -> TwinParameters:
    """A twin with some of its numbers multiplied, published ones as well: to see what its flight stands.

    Parameters
    ----------
    factors
        As for `varied`; every parameter must be there.

    Returns
    -------
    TwinParameters
        Checked anew, and known to be moved: see `TwinParameters.as_moved_from`.

    Raises
    ------
    WildlabError
        Where the twin is not possible any more.
    KeyError
        Where it has no such parameter.
    """
    if not factors:
        return twin
    content = twin.model_dump(exclude_unset=True)
    for path, factor in factors.items():
        part = content
        *parts, name = path.split(".")
        for one in parts:
            part = part[one]
        part[name]["value"] *= factor
    try:
        return type(twin).model_validate(content).as_moved_from(twin)
    except ValueError as error:
        raise WildlabError(
            f"with {', '.join(f'{path} x {factor:g}' for path, factor in factors.items())} the twin "
            f"{twin.name!r} is not possible ({str(error).splitlines()[-2].strip()})",
            "move it less",
        ) from error
