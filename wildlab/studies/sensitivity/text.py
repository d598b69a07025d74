"""The words of the report on wrong poses, each from the numbers it states."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Offsets of the tables that turn the camera, and those that move it.
ANGLES, PLACES = ("roll", "pitch", "yaw"), ("north", "east", "down")
#: The share of an image that is called most of it: well over half.
MOST = 0.6
#: A ratio of errors nearer to one than this is no growth.
ALIKE = 1.1


def growth(errors: Mapping[str, float], near: str = "100m", far: str = "400m") -> tuple[float, float]:
    """How errors grow from the lower to the higher flight in level flight: of angles, and of places.

    Parameters
    ----------
    errors
        Metres, by ``attitude/offset/height``.

    Returns
    -------
    tuple of float
        The smallest ratio of roll and pitch, and the largest of north, east and down.
    """
    ratio = {
        name: errors[f"level/{name}/{far}"] / errors[f"level/{name}/{near}"]
        for name in (*ANGLES, *PLACES)
        if errors[f"level/{name}/{near}"] > 0
    }
    tilts = [ratio[name] for name in ("roll", "pitch") if name in ratio]
    return min(tilts), max(ratio[name] for name in PLACES if name in ratio)


def growth_words(errors: Mapping[str, float]) -> str:
    """Whether errors of angles and of places grow with height, and what to do."""
    of_angles, of_places = growth(errors)
    first = (
        "From four times the height an error of roll or pitch moves the point "
        f"{of_angles:.1f} times as far or more"
    )
    if of_angles <= ALIKE:
        return f"{first}: height hardly matters."
    if of_places <= ALIKE:
        return f"{first}, an error of position no farther: fly lower, or know the angles better."
    return f"{first}, an error of position up to {of_places:.1f} times: fly lower."


def heading(errors: Mapping[str, float], height: str = "400m") -> str:
    """Which of the offsets matters most, alone and over all attitudes."""
    largest = {
        name: max(value for key, value in errors.items() if key.split("/")[1:] == [name, height])
        for name in (*ANGLES, *PLACES)
    }
    worst = max(largest, key=lambda name: largest[name])
    if min(largest["roll"], largest["pitch"]) > max(largest[place] for place in PLACES):
        return "Angles matter more than places"
    return f"Most is moved by {worst}"


def distance_words(at_1km: float, at_10km: float) -> str:
    """Title of what a linear conversion of coordinates costs, metres at one and at ten kilometres."""
    return f"One kilometre costs {at_1km:.2g} m, ten cost {at_10km:.2g} m"


def image_words(over_image: Mapping[str, Array], middle: Mapping[str, float]) -> tuple[str, str, str]:
    """Whether the middle of the image, which the tables are about, is the best or the worst place.

    Parameters
    ----------
    over_image
        Errors over the image, metres, by attitude: arrays of any one shape.
    middle
        The error in the middle, metres, by attitude.

    Returns
    -------
    tuple of str
        Heading, sentence and alt text.
    """
    worst = max(over_image, key=lambda name: float(over_image[name].max()))
    largest = float(over_image[worst].max())
    smallest = min(float(errors.min()) for errors in over_image.values())
    shares = {name: float(np.mean(errors > middle[name])) for name, errors in over_image.items()}
    low, high = min(shares.values()), max(shares.values())
    at_edges = [
        f"{middle[name]:.0f} m in the middle, {errors.max():.0f} m at most in {name}"
        for name, errors in over_image.items()
    ]
    if low > MOST:
        title = "Over most of the image it is worse than in the middle"
    elif high < 1 - MOST:
        title = "Over most of the image it is better than in the middle"
    else:
        title = "The middle of the image does not stand for all of it"
    said = (
        "With 3\u00b0 of roll and pitch from 400 m the error is larger than in the middle over "
        f"{100 * low:.0f} to {100 * high:.0f} % of the image: {'; '.join(at_edges)}."
    )
    alt = (
        f"Contours of the error over the image for {', '.join(over_image)}: {smallest:.0f} m where it is "
        f"smallest, {largest:.0f} m where it is largest, in {worst}."
    )
    return title, said, alt


def printed_words(differences: Array, agree: int) -> str:
    """How many of the thesis's numbers come out.

    Parameters
    ----------
    differences
        Ours less the printed one, metres.
    agree
        How many agree to the last printed digit.

    Returns
    -------
    str
    """
    n = len(differences)
    who = "all" if agree == n else str(agree)
    said = f"The thesis prints {n} such numbers; {who} of them come out here to the last printed digit"
    if agree == n:
        return f"{said}."
    return f"{said}, the others within {np.abs(differences).max():.2f} metres."
