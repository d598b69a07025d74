"""The words of the report on wrong poses, each from the numbers it states."""

from __future__ import annotations

from collections.abc import Mapping

#: Offsets of the tables that turn the camera, and those that move it.
ANGLES, PLACES = ("roll", "pitch", "yaw"), ("north", "east", "down")
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
