"""What the report says on the crossing from rendered frames, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np
import pandas as pd

from wildlab.analysis.rendered import OVERLAP
from wildlab.detection.thresholds import FloatingThresholds
from wildlab.reporting.text import listed
from wildlab.simulation.scene.flights import VesselLook
from wildlab.studies.crossing_vessels.rendered import SEA_EVERY, Associated, CrossingTracks, Rendering
from wildlab.studies.crossing_vessels.spotted import Counted
from wildlab.studies.crossing_vessels.text import NAMES, beyond_chance, counted
from wildlab.studies.crossing_vessels.trial import DISTANCE, FEATURES
from wildlab.studies.crossing_vessels.trial.crossing import APART_M, WINDOW_S
from wildlab.studies.crossing_vessels.trial.joint import JOINT

#: What is tracked, and how it is taken from a flight.
WAYS: dict[str, Callable[[Rendering], CrossingTracks]] = {
    "drawn detections": lambda one: one.drawn,
    "rendered frames": lambda one: one.frames,
    "the same, none at the border": lambda one: one.inside,
}
DRAWN, FRAMES, INSIDE = WAYS

_TOLD = FloatingThresholds()
METHOD = f"""Rendered frames are of the flights after that of the other figures, since the study's own is
chosen by how its drawn detections turn out. They are taken with the true pose, whole, with the noise and
faults of the sensor, and searched with the seven steps of H 4.3: the gradient of {_TOLD.gradient:g} and the
{_TOLD.smallest_area:g} pixels of H 4.4.1 and what the study of vessels' detection uses beside these, set
there and not on these frames. A detection goes to the sea by the autopilot's pose, its size is by the
distance that this pose has, and what it looks like is its own. It is a vessel's if {100 * OVERLAP:.0f} % of
its pixels are, of several the one's with most; one that also holds more than half of the other vessel, which
has none of its own, is of both, and is right on either's track. Tracking, spreads and what joint association
is told are as for drawn detections. These are those of the same flight and time, tracked anew from its
beginning, and look as rendered images of the flight do, drawn one by one; here they are put on the level of
the sea, as those from frames are, and elsewhere in this report at the height of the vessel's receiver."""

DETECTED_COLUMNS = {
    "flight": "flight",
    "whole": "whole in view: detected alone",
    "joined": "in one with the other",
    "missed": "missed",
    "cut": "cut by the border: detected alone",
    "false": "false detections",
    "sea": "frames without a vessel near that have one",
}
DETECTED_CAPTION = (
    "Vessels in rendered frames, each time one is in view. Shares have 95 % intervals, as if frames were "
    "independent: neighbours are not, so these are too narrow."
)
OUTCOME_CAPTION = (
    "None at the border: without detections that touch the border of their image. Wrong: detections of one "
    "vessel alone that went to a track which the other one's detection started, of all such. Then those that "
    "no track took; how many tracks, where they are not two; how often a track goes over to the other "
    "vessel, at any time; and whether each vessel has the other's track in the "
    "two minutes after the crossing. Wrong ones have no interval: after one swap all that follow are wrong. "
    "Shared by probability no detection is one track's, so none is counted."
)


def flights_words(flights: Sequence[Rendering]) -> str:
    """Their names in a sentence.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> flights_words([SimpleNamespace(seed=seed) for seed in (7, 8, 9)])
    'flights 7, 8 and 9'
    """
    return f"flight{'s' * (len(flights) != 1)} {listed([str(one.seed) for one in flights])}"


def opening_words(flights: Sequence[Rendering], seed: int) -> str:
    """Which flights and frames, out of how many."""
    near, sea, taken = (
        sum(values)
        for values in zip(*((one.near.frames, one.sea.frames, one.exposures) for one in flights), strict=True)
    )
    first = flights_words(flights)
    those = "those" if len(flights) > 1 else "that"
    chosen = f"{those} after flight {seed}, which the other figures show"
    return (
        f"{first[0].upper()}{first[1:]}, {chosen}, from {WINDOW_S / 60:.0f} min before the two come within "
        f"{APART_M:.0f} m of each other to {WINDOW_S / 60:.0f} min after they are that far apart again. Of "
        f"the {taken} frames in that time every one with a vessel near is rendered, {near}, and the detector "
        f"looks at all of each; these are tracked. Of the others one in {SEA_EVERY}, {sea} in all, is looked "
        "at for false detections alone."
    )


def _all(flights: Sequence[Rendering]) -> tuple[Counted, Counted]:
    return (
        reduce(Counted.plus, (one.near for one in flights)),
        reduce(Counted.plus, (one.sea for one in flights)),
    )


def detected_table(flights: Sequence[Rendering]) -> pd.DataFrame:
    """One row for each flight, and one for all where there are several."""
    rows = [(str(one.seed), one.near, one.sea) for one in flights]
    if len(rows) > 1:
        rows.append(("all", *_all(flights)))
    return pd.DataFrame(
        {
            "flight": name,
            "whole": counted(near.found, near.whole),
            "joined": counted(near.joined, near.whole),
            "missed": counted(near.missed, near.whole),
            "cut": counted(near.cut_found, near.cut),
            "false": str(near.false + sea.false),
            "sea": counted(sea.with_false, sea.frames),
        }
        for name, near, sea in rows
    )


def detected_words(flights: Sequence[Rendering]) -> str:
    """How the detector did, over all flights."""
    near, sea = _all(flights)
    if near.whole:
        said = (
            f"Of the times that a vessel is whole in view, {counted(near.found, near.whole)} are "
            f"detected alone, {counted(near.joined, near.whole)} lie in one detection with the other "
            f"vessel, and {near.missed} {'is' if near.missed == 1 else 'are'} missed."
        )
    else:
        said = "No vessel is ever whole in view."
    cut = f" Of those cut by the border, {counted(near.cut_found, near.cut)} are." if near.cut else ""
    false = near.false + sea.false
    over = f"in {near.frames} frames with a vessel near and {sea.frames} without"
    if not false:
        words = f"No detection is false, {over}."
    else:
        words = f"{false} detection{'s are' if false > 1 else ' is'} false, {over}."
    return f"{said}{cut} {words} {_counts_words(flights)}"


def _counts_words(flights: Sequence[Rendering]) -> str:
    """How many detections either way gives, and how far off they are."""
    frames, drawn = ([WAYS[way](one) for one in flights] for way in (FRAMES, DRAWN))
    counts = [sum(len(one.crossing.boat) for one in many) for many in (frames, drawn)]
    off = [float(np.nanmedian(np.concatenate([one.off for one in many]))) for many in (frames, drawn)]
    return (
        f"That gives {counts[0]} detections, {off[0]:.1f} m from the vessels' receivers (median); drawn for "
        f"the same times are {counts[1]}, {off[1]:.1f} m from them: the twin leaves out as many as the "
        "thesis's counts ask for."
    )


def outcome_words(one: Associated) -> str:
    """What one rule made of one flight.

    Examples
    --------
    >>> one = Associated(swapped=False, swaps=1, own=90, wrong=4, unassigned=2, tracks=3, by_false=1)
    >>> outcome_words(one)
    '4 of 90 wrong, 2 to no track, 3 tracks, 1 by a false one, 1 goes over, not swapped'
    """
    said = []
    if one.wrong is not None:
        said.append(f"{one.wrong} of {one.own} wrong")
    if one.unassigned:
        said.append(f"{one.unassigned} to no track")
    if one.tracks is not None and one.tracks != 2:
        said.append(f"{one.tracks} track{'s' * (one.tracks != 1)}")
    if one.by_false:
        said.append(f"{one.by_false} by a false one")
    if one.swaps:
        said.append("1 goes over" if one.swaps == 1 else f"{one.swaps} go over")
    said.append("swapped" if one.swapped else "not swapped")
    return ", ".join(said)


def outcome_columns(flights: Sequence[Rendering]) -> dict[str, str]:
    """Headings of `outcome_table`."""
    return {
        "rule": "association by",
        "from": "from",
        "swapped": "flights swapped",
        **{f"flight-{one.seed}": f"flight {one.seed}" for one in flights},
    }


def outcome_table(flights: Sequence[Rendering]) -> pd.DataFrame:
    """One row for each rule and way."""
    return pd.DataFrame(
        {
            "rule": words,
            "from": way,
            "swapped": counted(_swapped(flights, way, rule), len(flights)),
            **{f"flight-{one.seed}": outcome_words(take(one).by_rule[rule]) for one in flights},
        }
        for rule, words in NAMES.items()
        for way, take in WAYS.items()
    )


def _swapped(flights: Sequence[Rendering], way: str, rule: str) -> int:
    return sum(WAYS[way](one).by_rule[rule].swapped for one in flights)


def swaps_words(flights: Sequence[Rendering]) -> str:
    """Swaps from frames beside those from drawn detections of the same flights, and what can be told."""
    n, parts, told = len(flights), [], []
    for rule, words in NAMES.items():
        frames, drawn = (
            np.array([WAYS[way](one).by_rule[rule].swapped for one in flights]) for way in (FRAMES, DRAWN)
        )
        parts.append(f"{words}, {frames.sum()} and {drawn.sum()}")
        more, fewer = int((frames & ~drawn).sum()), int((drawn & ~frames).sum())
        if beyond_chance(more, fewer):
            told.append(f"by {words}, {'more' if more > fewer else 'fewer'} from frames")
    said = (
        f"Flights, of {n}, on which the tracks are swapped from frames and from drawn detections: "
        f"{'; '.join(parts)}."
    )
    if told:
        return f"{said} Beyond chance, on the same flights: {'; '.join(told)}."
    if not beyond_chance(n, 0):
        need = next(count for count in range(n, 100) if beyond_chance(count, 0))
        return (
            f"{said} Whether frames make more flights swap than drawn detections do cannot be told from "
            f"{n} flight{'s' * (n != 1)}: it takes {need} that all differ one way."
        )
    return f"{said} That frames make more or fewer flights swap than drawn detections do cannot be told."


def border_words(flights: Sequence[Rendering]) -> str:
    """Tracks with features that began on what the border cuts, and what leaving that out does to the others.

    Compared are the same detections, those away from the border, with the others tracked beside them and not.
    """
    frames = [WAYS[FRAMES](one).by_rule[FEATURES] for one in flights]
    inside = [WAYS[INSIDE](one).by_rule[FEATURES] for one in flights]
    begun = counted(sum(one.by_cut or 0 for one in frames), sum(one.tracks or 0 for one in frames))
    with_cut, without = ([one.wrong_inside or 0 for one in many] for many in (frames, inside))
    fewer, more = (
        sum(pairs)
        for pairs in zip(*((b < a, b > a) for a, b in zip(with_cut, without, strict=True)), strict=True)
    )
    n = len(flights)
    of = ", ".join(str(one.own_inside) for one in inside)
    told = "" if beyond_chance(fewer, more) else ", which chance may have done too"
    return (
        f"A track keeps the looks of the detections that it starts with. With features, {begun} tracks from "
        "frames start on a detection that touches the border of its image, where a vessel may be cut and "
        f"look smaller than it is. Of the detections away from the border, {of}, flight by flight, so many "
        f"go wrong with features: {', '.join(map(str, with_cut))}; where those at the border are not "
        f"tracked, {', '.join(map(str, without))}: fewer on {fewer} of {n}, more on {more}{told}."
    )


def summary_words(flights: Sequence[Rendering]) -> str:
    """A sentence on swaps from rendered frames."""
    by_distance, with_looks = (
        counted(_swapped(flights, FRAMES, rule), len(flights)) for rule in (DISTANCE, FEATURES)
    )
    return (
        f"From rendered frames of {flights_words(flights)} the tracks are swapped by distance alone on "
        f"{by_distance}, with features on {with_looks}, and shared by probability on "
        f"{counted(_swapped(flights, FRAMES, JOINT), len(flights))}."
    )


def limit_words(flights: Sequence[Rendering]) -> str:
    """What the rendered frames leave out."""
    n = len(flights)
    nearest = min(float(np.nanmin(one.frames.crossing.apart)) for one in flights)
    long, short = VesselLook().lengths
    return (
        f"Rendered frames are of {n} flight{'s' * (n != 1)} about the crossing; the study's parameter "
        "rendered says how many, each about a minute's work. By their receivers the two come as near as "
        f"{nearest:.0f} m, middle to middle, with hulls of {long:.0f} m and {short:.0f} m: their paths are "
        "drawn without regard to each other. Waves stand still from frame to frame, the vessels keep their "
        "courses and warmth, and nothing else is afloat."
    )
