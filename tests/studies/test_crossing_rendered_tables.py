"""The tables on crossings from rendered frames turn with the numbers."""

from __future__ import annotations

import numpy as np

from wildlab.studies.crossing_vessels import rendered_text as text
from wildlab.studies.crossing_vessels.rendered import Associated, CrossingTracks, Rendering
from wildlab.studies.crossing_vessels.spotted import Counted
from wildlab.studies.crossing_vessels.text import NAMES
from wildlab.studies.crossing_vessels.trial import DISTANCE, FEATURES
from wildlab.studies.crossing_vessels.trial.crossing import Crossing
from wildlab.studies.crossing_vessels.trial.joint import JOINT
from wildlab.tracking.many.bank import Looks

NEAR = Counted(
    frames=100, with_false=0, false=0, whole=120, found=118, joined=0, cut=10, cut_found=8, cut_joined=0,
    pieces=0,
)  # fmt: skip
SEA = Counted(20, 0, 0, 0, 0, 0, 0, 0, 0, 0)
GOOD = Associated(
    swapped=False, swaps=0, own=118, wrong=0, unassigned=0, own_inside=110, wrong_inside=0, mixed=0, tracks=2,
    by_false=0, by_cut=0,
)  # fmt: skip
SWAPPED = GOOD._replace(wrong=59, wrong_inside=50, swapped=True, swaps=2)
SHARED = Associated(swapped=False, swaps=0)


def followed(swapped: str = "") -> CrossingTracks:
    """By every rule without a mistake, but for the one that swaps the vessels."""
    looks = Looks(np.arange(4), np.zeros((4, 2)), 0.5)
    truth = np.array([np.zeros((4, 2)), np.full((4, 2), 3.0)])
    crossing = Crossing(looks, np.zeros(4, int), np.arange(4) * 0.5, truth)
    by_rule = {name: SWAPPED if name == swapped else GOOD for name in NAMES} | {JOINT: SHARED}
    return CrossingTracks(crossing, np.full(4, 10.0), by_rule)


def flights(count: int, **ways: CrossingTracks) -> list[Rendering]:
    three = {"frames": followed(), "inside": followed(), "drawn": followed()} | ways
    return [
        Rendering(7 + number, (0.0, 60.0), 400, None, NEAR, SEA, **three)  # type: ignore[arg-type]
        for number in range(count)
    ]


def test_the_table_of_detections_has_a_row_for_all_where_there_are_several():
    table = text.detected_table(flights(2))
    assert table["flight"].tolist() == ["7", "8", "all"]
    assert table["whole"][2].startswith("236 of 240") and table["missed"][2].startswith("4 of 240")
    assert table["sea"][2].startswith("0 of 40") and table["false"].tolist() == ["0", "0", "0"]
    assert text.detected_table(flights(1))["flight"].tolist() == ["7"]


def test_the_table_of_tracks_never_adds_up_two_ways():
    many = flights(2, frames=followed(DISTANCE))
    table = text.outcome_table(many)
    assert len(table) == len(NAMES) * len(text.WAYS)
    own = table[table["rule"] == NAMES[DISTANCE]].set_index("from")
    assert own.loc[text.FRAMES, "swapped"].startswith("2 of 2")
    assert own.loc[text.DRAWN, "swapped"].startswith("0 of 2")
    assert own.loc[text.FRAMES, "flight-8"].startswith("59 of 118")
    assert own.loc[text.INSIDE, "flight-8"].startswith("0 of 118")
    shared = table[table["rule"] == NAMES[JOINT]]
    assert set(shared["flight-7"]) == {"not swapped"}, "no detection is one track's"


def test_swaps_are_told_from_chance_only_where_enough_flights_differ():
    many = text.swaps_words(flights(6, frames=followed(DISTANCE)))
    assert "more" in many and "cannot" not in many
    fewer = text.swaps_words(flights(6, drawn=followed(FEATURES)))
    assert "fewer" in fewer and "cannot" not in fewer
    for none in (flights(5, frames=followed(DISTANCE)), flights(6)):
        assert "cannot" in text.swaps_words(none)
