"""Tables of what was set in the study of animals: printed by F, or chosen."""

from __future__ import annotations

import pandas as pd

from wildlab.studies.wildlife_detection.text import NAMES, READ_AS
from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
    BY_MEAN,
    BY_MEDIAN,
    CONSTANT,
    ENHANCED,
    LARGE,
    METHODS,
    OVER_MEAN,
    SMALL,
    SUBTRACTED,
)

#: What F leaves open about scenes and pictures, its value here, and why.
CHOSEN = (
    ("hours", "night 2, morning 8, noon 13", "before dawn, two hours after sunrise, and when ground is hot"),
    (
        "ground",
        "70 % grass, 20 % sand, 10 % rock",
        "an enclosure: mostly meadow, with trodden and stony places",
    ),
    (
        "relief",
        "2 m standard deviation, hills of some 60 m",
        "gently rolling, so that no hill hides an animal",
    ),
    ("grass", "+12 K in full sun, -4 K at night, 0.5 h", "it evaporates water and radiates freely"),
    ("sand", "+26 K, -3 K, 1 h", "dry and dark ground becomes hottest"),
    ("rock and stones", "+24 K, -0.5 K, 4 h", "they keep the day's heat into the night"),
    ("clouds", "take 75 % of the sun's heat and 80 % of the night's cooling", "the rest is diffuse light"),
    ("air", "288 K, 5 K up and down over the day", "a mild day; the sun is 55 degrees high at noon"),
    ("animals' skin", "35 to 50 % of the way from air to blood", "thick coats keep nearer to the air"),
    ("head and tail", "75 % and 50 % of the trunk's warmth", "extremities are cooler"),
    ("kinds", "rhinoceros 3.2 m, its calf 1.6 m, antelope 1.5 m", "lengths of trunks of such animals"),
    (
        "gondola",
        "15 m above the ground, 45 degrees from straight down",
        "between 3 and 20 m, turned aside (F 8.2)",
    ),
    (
        "window",
        "the middle between ground and animals, twice as wide",
        "F 3.1 sets the middle, and a high contrast",
    ),
    ("smallest contour", "50 pixels", "F 3.2.6: sufficient size; an antelope from 60 m has about 150"),
    ("apart", "10 pixels", "F 3.2.6: detections too close are one"),
    ("sizes from the ground", "0.2 to 8 m2", "half a small antelope's area, twice a rhinoceros'"),
    ("too hot", "mean above 37 degrees C", "no skin is warmer than the blood below it"),
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
    return pd.DataFrame(CHOSEN, columns=["what", "value", "reason"])
