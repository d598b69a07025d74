"""The detectors that `wildlab detect` offers, each with what the command has to know of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from wildlab.detection.colour import Colour, find_coloured
from wildlab.detection.contrast import Contrast, find_by_contrast
from wildlab.detection.detections import Detections
from wildlab.detection.floating import detect_floating
from wildlab.detection.shape import Shape, find_by_shape
from wildlab.detection.thresholds import FloatingThresholds
from wildlab.detection.warm import Warm, block_from_distance, find_warm, gate_from_distance
from wildlab.errors import WildlabError

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
