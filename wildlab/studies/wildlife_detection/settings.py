"""Tables of what was set in the study of animals: printed by F, or chosen."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.simulation.scene.animals import ANIMALS, HEAD, TAIL
from wildlab.simulation.scene.drawn_land import LandDraw
from wildlab.simulation.scene.ground import (
    CLOUD_BLANKET,
    GRASS,
    ROCK,
    SAND,
    SHADOW_DEPTH,
    Cover,
    Weather,
    rolling_land,
)
from wildlab.studies.wildlife_detection.text import NAMES, READ_AS
from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
    AREA,
    BY_MEAN,
    BY_MEDIAN,
    CONSTANT,
    ENHANCED,
    HOTTEST,
    LARGE,
    METHODS,
    MORNING,
    NIGHT,
    NOON,
    OVER_MEAN,
    SMALL,
    SMALLEST,
    SUBTRACTED,
    VIEWS,
    WEATHERS,
    WINDOW,
)

#: As `LandDraw.shares` has them.
COVERS = ("grass", "sand", "rock")


def _cover(one: Cover) -> str:
    return f"+{one.heating:g} K in full sun, -{one.cooling:g} K at night, {one.lag:g} h"


def _chosen() -> tuple[tuple[str, str, str], ...]:
    """What F leaves open about scenes and pictures, its value here, and why."""
    shares = [f"{100 * share:.0f} % {name}" for share, name in zip(LandDraw().shares, COVERS, strict=True)]
    bare = [100 * kind.bare for kind in ANIMALS.values()]
    air, near = Weather(), VIEWS[min(VIEWS)]
    return (
        (
            "hours",
            ", ".join(f"{name} {WEATHERS[name].hour:g}" for name in (NIGHT, MORNING, NOON)),
            "before dawn, two hours after sunrise, and when ground is hot",
        ),
        ("ground", ", ".join(shares), "an enclosure: mostly meadow, with trodden and stony places"),
        (
            "relief",
            f"{rolling_land(air).heights.std():.0f} m standard deviation, hills of some 60 m",
            "gently rolling, so that no hill hides an animal",
        ),
        ("grass", _cover(GRASS), "it evaporates water and radiates freely"),
        ("sand", _cover(SAND), "dry and dark ground becomes hottest"),
        ("rock and stones", _cover(ROCK), "they keep the day's heat into the night"),
        (
            "clouds",
            f"take {100 * SHADOW_DEPTH:.0f} % of the sun's heat and {100 * CLOUD_BLANKET:.0f} % of the "
            "night's cooling",
            "the rest is diffuse light",
        ),
        (
            "air",
            f"{air.air_mean:g} K, {air.air_swing:g} K up and down over the day",
            f"a mild day; the sun is {np.degrees(air.noon_elevation):.0f} degrees high at noon",
        ),
        (
            "animals' skin",
            f"{min(bare):.0f} to {max(bare):.0f} % of the way from air to blood",
            "thick coats keep nearer to the air",
        ),
        (
            "head and tail",
            f"{100 * HEAD:.0f} % and {100 * TAIL:.0f} % of the trunk's warmth",
            "extremities are cooler",
        ),
        (
            "kinds",
            ", ".join(f"{name} {kind.length:g} m" for name, kind in ANIMALS.items()),
            "lengths of trunks of such animals",
        ),
        (
            "gondola",
            f"{near.height:g} m above the ground, {np.degrees(near.tilt):.0f} degrees from straight down",
            "between 3 and 20 m, turned aside (F 8.2)",
        ),
        (
            "window",
            f"the middle between ground and animals, {WINDOW:g} times as wide as what is between",
            "F 3.1 sets the middle, and a high contrast",
        ),
        (
            "smallest contour",
            f"{SMALLEST:g} pixels",
            "F 3.2.6: sufficient size; an antelope from 60 m has about 150",
        ),
        ("apart", f"{METHODS[CONSTANT].apart_px:g} pixels", "F 3.2.6: detections too close are one"),
        (
            "sizes from the ground",
            f"{AREA[0]:g} to {AREA[1]:g} m2",
            "half a small antelope's area, twice a rhinoceros'",
        ),
        (
            "too hot",
            f"mean above {HOTTEST - 273.15:.0f} degrees C",
            "no skin is warmer than the blood below it",
        ),
    )


#: Where the numbers of each setting are printed, or why they are as they are.
SOURCES = {
    CONSTANT: "F figure 7.5",
    ADAPTIVE: "F figure 7.6",
    OVER_MEAN: "F figure 7.6, its level read the other way",
    SMALL: "F figure 7.7; no level is printed: that of figure 7.10a",
    LARGE: "F figure 7.8; no level is printed: that of figure 7.10a",
    SUBTRACTED: "F figures 7.10a, 7.11a",
    ENHANCED: "F figures 7.10b, 7.11b",
    BY_MEAN: "F 8.1.1; the level is chosen: that of figure 7.10a",
    BY_MEDIAN: "F 8.1.1 proposes it; the level is chosen: that of figure 7.10a",
}


def settings_table() -> pd.DataFrame:
    """F's settings, and where they are printed."""
    rows = []
    for name, one in METHODS.items():
        adaptive = one.threshold == "adaptive"
        rows.append(
            {
                "method": NAMES[name],
                "background": {"none": "as it is"}.get(one.background, one.background),
                "block": f"{one.block_px} px" if adaptive else "",
                "level": f"{one.level:g}",
                "read": READ_AS[one.level_is] if adaptive else "above the level",
                "source": SOURCES[name],
            }
        )
    return pd.DataFrame(rows)


def chosen_table() -> pd.DataFrame:
    """What was chosen for the scenes and the pictures, and why."""
    return pd.DataFrame(_chosen(), columns=["what", "value", "reason"])
