"""The detectors that `wildlab detect` offers, what the command has to know of each, and their thresholds."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from wildlab.detection.colour import Colour, find_coloured
from wildlab.detection.contrast import Contrast, find_by_contrast
from wildlab.detection.detections import Detections
from wildlab.detection.floating import FloatingThresholds, detect_floating
from wildlab.detection.shape import Shape, find_by_shape
from wildlab.detection.warm import Warm, block_from_distance, find_warm, gate_from_distance
from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.flight.files import read_regular

#: Bytes of a file of thresholds at most.
MOST_BYTES = 1_000_000


def write_thresholds(path: Path, method: str, thresholds: Any) -> None:
    """Write thresholds as JSON; infinity is null.

    Parameters
    ----------
    path
        Of the file.
    method, thresholds
        Which detector's.
    """
    write_json(path, {"method": method, "thresholds": _plain(dataclasses.asdict(thresholds))})


def _plain(value: Any) -> Any:
    """Without infinity, for which JSON has no word."""
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return None if value == math.inf else value


def read_thresholds(path: Path, method: str) -> Any:
    """Thresholds that `write_thresholds` wrote.

    Parameters
    ----------
    path
        Of the file.
    method
        Whose they have to be.

    Returns
    -------
    object
        Of ``METHODS[method].thresholds``.

    Raises
    ------
    WildlabError
        Where it is no such file, or another method's.
    """
    try:
        given = json.loads(read_regular(path, MOST_BYTES))
        named, values = given["method"], dict(given["thresholds"])
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path", file=path) from None
    except (ValueError, TypeError, KeyError):
        raise WildlabError(
            "holds no thresholds", "name the thresholds.json of an earlier run", file=path
        ) from None
    if named != method:
        raise WildlabError(
            f"holds thresholds of {named!r}", f"say --method {named}, or leave it out", file=path
        )
    return _thresholds(METHODS[method].thresholds, method, values)


def _thresholds(kind: type[Any], method: str, values: dict[str, Any]) -> Any:
    """Plain values as a dataclass: null is infinity where the default is, a list a tuple."""
    defaults = {one.name: one.default for one in dataclasses.fields(kind)}
    made: dict[str, Any] = {}
    for name, value in values.items():
        default = defaults.get(name)
        if dataclasses.is_dataclass(default) and isinstance(value, dict):
            made[name] = _thresholds(type(default), method, value)
        elif value is None and default == math.inf:
            made[name] = math.inf
        else:
            made[name] = tuple(value) if isinstance(value, list) else value
    return thresholds_from(kind, made)


def thresholds_from(kind: type[Any], given: dict[str, Any]) -> Any:
    """Thresholds of a method from plain values, as they were written to a file.

    Parameters
    ----------
    kind
        Of thresholds: ``METHODS[method].thresholds``, or one inside it.
    given
        By the name of the field; what is not there keeps its default.

    Returns
    -------
    object
        Of that kind.

    Raises
    ------
    WildlabError
        Where a name is not known, or a value is not of the kind of the default.
    """
    known = {one.name: one.default for one in dataclasses.fields(kind)}
    for name, value in given.items():
        if name not in known:
            raise WildlabError(f"there is no threshold {name!r}", f"there are {', '.join(known)}")
        default = known[name]
        numbers = isinstance(default, int | float) and not isinstance(default, bool)
        plain = isinstance(value, int | float) and not isinstance(value, bool)
        good = plain if numbers else isinstance(value, type(default))
        if default is None:  # a limit, or two, that there may be
            several = value if isinstance(value, tuple) else (value,)
            good = value is None or all(isinstance(one, int | float) for one in several)
        if isinstance(default, tuple):
            good = isinstance(value, tuple) and all(isinstance(one, int | float) for one in value)
        if not good:
            like = "give a number, or leave it out" if default is None else f"give one like {default!r}"
            raise WildlabError(f"the threshold {name!r} is {value!r}", like)
    try:
        return kind(**given)
    except TypeError:  # one number in place of two, or the other way round
        raise WildlabError("the thresholds do not fit together", "write them anew with --fit") from None


#: Of the square of an animal's length, what is seen of it at least and at most, and how many lengths the
#: window of a background is wide. Chosen, not fitted: a thin leg to a stout body seen from above.
SMALLEST_PART, LARGEST_PART, WINDOW_LENGTHS = 0.03, 1.0, 4.0


class Method(NamedTuple):
    """A detector with its thresholds.

    Attributes
    ----------
    thresholds
        Frozen dataclass; made without arguments it holds the defaults.
    find
        Called with image, valid and thresholds.
    colours
        Whether it takes (H, W, 3) colours; others get the image in grey.
    black_hot
        Called with thresholds where warm is dark, gives those to take then; None where warmth is
        nothing to it.
    for_distance
        Called with thresholds, distance in m, focal length in px and length in m of what is looked for, gives
        thresholds of these lengths; None where no length of it follows from the ground.
    """

    thresholds: type[Any]
    find: Callable[[Any, Any, Any], Detections]
    colours: bool = False
    black_hot: Callable[[Any], Any] | None = None
    for_distance: Callable[[Any, float, float, float], Any] | None = None


def for_distance(method: str, thresholds: Any, distance_m: float, focal_px: float, animal_m: float) -> Any:
    """Thresholds whose lengths and areas are those of an animal at that distance (F 3.2, 8.1.1, 8.4).

    Parameters
    ----------
    method
        One of `METHODS`.
    thresholds
        Of that method.
    distance_m
        From the camera to the ground along the middle of the image, m.
    focal_px
        Focal length, px.
    animal_m
        Length of what is looked for, m.

    Returns
    -------
    object
        Of the same kind.

    Raises
    ------
    WildlabError
        Where no length of the method follows from a distance, or a length is not above zero.

    Examples
    --------
    >>> near, far = (for_distance("contrast", Contrast(), distance, 1000.0, 1.5) for distance in (50, 100))
    >>> near.window_px, far.window_px, near.largest_px, far.largest_px
    (121, 61, 900.0, 225.0)
    """
    scaled = METHODS[method].for_distance
    if scaled is None:
        some = ", ".join(name for name, one in METHODS.items() if one.for_distance is not None)
        raise WildlabError(
            f"no length of the method {method!r} follows from the distance to the ground",
            f"leave --distance out, or take one of {some}",
        )
    return scaled(thresholds, distance_m, focal_px, animal_m)


def _gate(distance_m: float, focal_px: float, animal_m: float) -> tuple[float, float]:
    seen = animal_m**2
    return gate_from_distance(distance_m, focal_px, SMALLEST_PART * seen, LARGEST_PART * seen)


def _warm(thresholds: Warm, distance_m: float, focal_px: float, animal_m: float) -> Warm:
    smallest, largest = _gate(distance_m, focal_px, animal_m)
    block = block_from_distance(distance_m, focal_px, animal_m)
    return replace(thresholds, smallest_px=smallest, largest_px=largest, block_px=block)


def _contrast(thresholds: Contrast, distance_m: float, focal_px: float, animal_m: float) -> Contrast:
    smallest, largest = _gate(distance_m, focal_px, animal_m)
    window = block_from_distance(distance_m, focal_px, animal_m, WINDOW_LENGTHS)
    return replace(thresholds, smallest_px=smallest, largest_px=largest, window_px=window)


def _floating(
    thresholds: FloatingThresholds, distance_m: float, focal_px: float, animal_m: float
) -> FloatingThresholds:
    smallest, largest = _gate(distance_m, focal_px, animal_m)
    return replace(thresholds, smallest_area=smallest, largest_area=largest, area_of="filled")


def _dark_is_warm(thresholds: Any) -> Any:
    return replace(thresholds, warm_is_bright=False)


def _shape_dark_is_warm(thresholds: Shape) -> Shape:
    return replace(thresholds, regions=_dark_is_warm(thresholds.regions))


def _floating_dark_is_warm(thresholds: FloatingThresholds) -> FloatingThresholds:
    return replace(thresholds, warm=False)


#: What `wildlab detect --method` offers; `wildlab.commands.detect` has the same names, for a quick start.
METHODS: dict[str, Method] = {
    "contrast": Method(Contrast, find_by_contrast, black_hot=_dark_is_warm, for_distance=_contrast),
    "warm": Method(Warm, find_warm, black_hot=_dark_is_warm, for_distance=_warm),
    # Its regions are learnt with its weights: other lengths would be another classifier.
    "shape": Method(Shape, find_by_shape, black_hot=_shape_dark_is_warm),
    "floating": Method(
        FloatingThresholds, detect_floating, black_hot=_floating_dark_is_warm, for_distance=_floating
    ),
    # Its limits are px of a reduced image, which a focal length in px says nothing of.
    "colour": Method(Colour, find_coloured, colours=True),
}
