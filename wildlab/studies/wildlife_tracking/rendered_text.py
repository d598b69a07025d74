"""What the report says on tracks from rendered frames, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.analysis.animals.frames import NEAR, STONES, TOO_LARGE, TREES
from wildlab.analysis.animals.images import FURTHEST
from wildlab.evaluation.runs import share_interval
from wildlab.simulation.scene.animals import ANIMALS
from wildlab.studies.wildlife_detection.trial import AREA
from wildlab.studies.wildlife_tracking.rendered import CLOUDS, DAWN, Counted, Renderings, counted

METHOD = rf"""The rendered frames are those of the world shown, from the beginning of the multicopter's way:
every image, not only those with an animal in view. The ground is that of the world; grass, sand and rock lie
on it, and {STONES:g} stones and {TREES:g} trees a hectare are strewn over the enclosures. Each animal is of
one of {len(ANIMALS)} kinds, stands where its walk has it, and keeps its heading. A frame is rendered from
where the camera truly is, with the noise and faults of its sensor. The operator sets brightness and contrast
at the first frame (F 3.1) and leaves them. The chain is the one that the study of animals' detection calls
background subtraction (F figure 7.10a), with contours from {AREA[0]:g} to {AREA[1]:g} m² on the ground, by
where the camera is said to be (F 3.2): its numbers were set there, not on these frames. A detection is an
animal's if its middle lies on that animal's pixels or within {NEAR} px of them and it is not more than
{TOO_LARGE:g} times as large. What the filter believes of the detector stays as for drawn detections."""

#: What weathers are called, at the beginning of a sentence and in a table.
WHEN = {DAWN: "At dawn", CLOUDS: "Under clouds at noon"}
#: Row of the drawn detections.
DRAWN = "drawn detections"

COLUMNS = {
    "from": "from",
    "found": "animals in view that are detected",
    "false": "false detections",
    "with_false": "frames with one",
    "tracks": "tracks",
    "by_false": "begun by a false one",
    "rmse": "off (m)",
    "sd": "said (m)",
}
CAPTION = (
    "The same images three times. Shares have 95 % intervals, as if images were independent: neighbours are "
    "not, so these are too narrow. Off: RMS distance of tracks from animals out of sight; said: the standard "
    "deviation that they state, each way."
)


def counts_of(runs: Renderings) -> tuple[Counted, dict[str, Counted]]:
    """What came of the drawn detections, and of the frames in each weather."""
    return counted(runs.world, runs.world.images, runs.drawn), {
        name: counted(runs.world, one.framed.images, one.followed, one.framed)
        for name, one in runs.by_weather.items()
    }


def share_words(count: int, of: int) -> str:
    """A count of so many, with the interval of its share.

    Examples
    --------
    >>> share_words(8, 10), share_words(0, 0)
    ('8 of 10 (49 to 94 %)', 'none of 0')
    """
    if not of:
        return "none of 0"
    found = share_interval(count, of)
    return f"{count} of {of} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def _metres(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "–"


def frames_table(drawn: Counted, by_weather: Mapping[str, Counted], frames: int) -> pd.DataFrame:
    """One row for the drawn detections, and one for each weather."""
    rows = []
    for name, one in {DRAWN: drawn, **by_weather}.items():
        rows.append(
            {
                "from": "frames " + WHEN[name][0].lower() + WHEN[name][1:] if name in WHEN else name,
                "found": share_words(one.found, one.shown),
                "false": str(one.false),
                "with_false": share_words(one.with_false, frames),
                "tracks": str(one.tracks),
                "by_false": share_words(one.by_false, one.tracks),
                "rmse": _metres(one.sight["rmse"]),
                "sd": _metres(one.sight["sd"]),
            }
        )
    return pd.DataFrame(rows)


def summary_words(by_weather: Mapping[str, Counted]) -> str:
    """A sentence on how many tracks false detections begin."""
    parts = [
        f"{WHEN[name][0].lower()}{WHEN[name][1:]} {share_words(one.by_false, one.tracks)}"
        for name, one in by_weather.items()
    ]
    return f"Of the tracks from rendered frames of one world, false detections begin {', '.join(parts)}."


def opening_words(frames: int, seconds: float) -> str:
    """What was done, with how many frames over how long."""
    first = f"The first {frames} images of the multicopter" if frames != 1 else "One image of the multicopter"
    lasting = f"{seconds / 60:.0f} min" if seconds >= 90 else f"{seconds:.0f} s"
    return (
        f"{first}, {lasting}, {'are' if frames != 1 else 'is'} rendered whole, and F's chain looks at "
        f"{'each' if frames != 1 else 'it'}: background taken off, adaptive threshold, contours of an "
        "animal's size; the detections go to the ground and to the same particle filter."
    )


def frames_words(drawn: Counted, by_weather: Mapping[str, Counted], frames: int, believed: float) -> str:
    """What rendered frames give beside drawn detections, a paragraph for each weather.

    Parameters
    ----------
    drawn, by_weather
        From `counts_of`.
    frames
        How many.
    believed
        Probability of a detection that the filter takes the camera for.
    """
    return "\n\n".join(
        weather_words(WHEN[name], one, drawn, frames, believed) for name, one in by_weather.items()
    )


def weather_words(when: str, one: Counted, drawn: Counted, frames: int, believed: float) -> str:
    """What the frames of one weather give."""
    said = [_detected(when, one, believed), _false(one, frames), _tracks(one), _sight(one, drawn)]
    return " ".join(part for part in said if part)


def _detected(when: str, one: Counted, believed: float) -> str:
    if not one.shown:
        return f"{when} no animal is in view."
    found = share_interval(one.found, one.shown)
    if found.low > believed:
        held = "more than"
    elif found.high < believed:
        held = "fewer than"
    else:
        held = "not different for certain from"
    off = f", {one.off_px:.1f} px from their middles (RMS, an axis)" if np.isfinite(one.off_px) else ""
    times = "once" if one.further == 1 else f"{one.further} times"
    further = (
        f" Animals are detected {times} that do not count as in view: cut by the border, or more than "
        f"{FURTHEST:.0f} m off."
        if one.further
        else ""
    )
    return (
        f"{when}, of the times that an animal is in view {share_words(one.found, one.shown)} are detected"
        f"{off}: {held} the {100 * believed:.0f} % that the filter believes.{further}"
    )


def _false(one: Counted, frames: int) -> str:
    if not one.false:
        return f"No detection is false: {share_words(0, frames)} frames have one."
    said = "1 detection is false" if one.false == 1 else f"{one.false} detections are false"
    return (
        f"{said}, {one.false / frames:.1f} a frame, in "
        f"{share_words(one.with_false, frames)} frames; {share_words(one.standing, one.false)} of them lie "
        "on a stone, a tree or an animal that is much smaller, the others on bare ground."
    )


def _tracks(one: Counted) -> str:
    if not one.tracks:
        return "No track begins."
    said = "1 track begins" if one.tracks == 1 else f"{one.tracks} tracks begin"
    of = "1 animal" if one.animals == 1 else f"{one.animals} animals"
    if not one.by_false:
        return f"{said}, none by a false detection, where {of} are detected."
    share = share_words(one.by_false, one.tracks)
    begun = f"{said}, {share} of them by a false detection, where {of} are detected"
    if 2 * one.by_false > one.tracks:
        return f"{begun}. F's filter starts one on each detection that no track takes."
    return f"{begun}."


def _sight(one: Counted, drawn: Counted) -> str:
    here, there = one.sight["rmse"], drawn.sight["rmse"]
    if not (np.isfinite(here) and np.isfinite(there)):
        return ""
    return (
        f"Out of sight animals are known to {here:.1f} m (RMS), by drawn detections of the same images to "
        f"{there:.1f} m."
    )


def limit_words(runs: Renderings) -> str:
    """What the rendered frames leave out."""
    hours = " and ".join(
        f"{WHEN[name][0].lower()}{WHEN[name][1:]} ({one.weather.hour:.0f} h, "
        f"{100 * one.weather.clouds:.0f} % of clouds)"
        for name, one in runs.by_weather.items()
    )
    count = len(runs.world.images.times)
    return (
        f"The rendered frames are {count} of one world, {hours}; the weather stays. "
        "Bodies throw no shadow and warm no ground, stones and trees are strewn evenly over the enclosures, "
        "and the patches of warm ground are drawn. The detector's numbers are those F prints for its own "
        "images."
    )
