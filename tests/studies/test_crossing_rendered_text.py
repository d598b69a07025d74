"""The words and the table on crossings from rendered frames turn with the numbers."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.studies.crossing_vessels import rendered_text as text
from wildlab.studies.crossing_vessels.rendered import Associated, Followed, Rendering
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


def followed(off: float = 10.0, count: int = 4, **rules: Associated) -> Followed:
    """By every rule without a mistake but for those that are given, by their subjects with underscores."""
    looks = Looks(np.arange(count), np.zeros((count, 2)), 0.5)
    truth = np.array([np.zeros((count, 2)), np.full((count, 2), 3.0)])
    crossing = Crossing(looks, np.zeros(count, int), np.arange(count) * 0.5, truth)
    by_rule = dict.fromkeys(NAMES, GOOD) | {JOINT: SHARED}
    by_rule |= {name.replace("_", "-"): one for name, one in rules.items()}
    return Followed(crossing, np.full(count, off), by_rule)


def flight(seed: int = 7, near: Counted = NEAR, sea: Counted = SEA, **ways: Followed) -> Rendering:
    three = {"frames": followed(), "inside": followed(), "drawn": followed()} | ways
    return Rendering(seed, (0.0, 60.0), 400, None, near, sea, **three)  # type: ignore[arg-type]


def flights(count: int, **ways: Followed) -> list[Rendering]:
    return [flight(7 + number, **ways) for number in range(count)]


BY_DISTANCE = {DISTANCE.replace("-", "_"): SWAPPED}
BY_LOOKS = {FEATURES.replace("-", "_"): SWAPPED}


def test_the_opening_says_how_many_frames_of_how_many() -> None:
    said = text.opening_words(flights(3), 6)
    assert said.startswith("Flights 7, 8 and 9, those after flight 6, which the other")
    assert "Of the 1200 frames in that time every one with a vessel near is rendered, 300," in said
    assert "one in 10, 60 in all" in said
    assert text.opening_words(flights(1), 6).startswith("Flight 7, that after flight 6")


def test_words_on_detections_turn_with_them() -> None:
    said = text.detected_words(flights(1))
    assert "118 of 120 (94 to 100 %) are detected alone" in said
    assert "0 of 120 (0 to 3 %) lie in one detection with the other vessel, and 2 are missed." in said
    assert "cut by the border, 8 of 10 (49 to 94 %) are." in said
    assert "No detection is false, in 100 frames with a vessel near and 20 without." in said
    one = flight(near=NEAR._replace(joined=1, false=1), sea=SEA)
    assert "and 1 is missed" in text.detected_words([one]) and "1 detection is false" in text.detected_words(
        [one]
    )
    two = flight(near=NEAR._replace(false=1), sea=SEA._replace(false=1))
    assert "2 detections are false" in text.detected_words([two])
    none = flight(near=Counted(5, *[0] * 9))
    assert text.detected_words([none]).startswith("No vessel is ever whole in view. No detection is false")


def test_words_on_places_are_of_both_ways() -> None:
    said = text.detected_words([flight(frames=followed(12.0, 40), drawn=followed(3.0, 30))])
    assert "40 detections, 12.0 m from the vessels' receivers (median)" in said
    assert "drawn for the same times are 30, 3.0 m from them" in said


def test_the_table_of_detections_has_a_row_for_all_where_there_are_several() -> None:
    table = text.detected_table(flights(2))
    assert table["flight"].tolist() == ["7", "8", "all"]
    assert set(table.columns) == set(text.DETECTED_COLUMNS)
    assert table["whole"][2].startswith("236 of 240") and table["missed"][2].startswith("4 of 240")
    assert table["sea"][2].startswith("0 of 40") and table["false"].tolist() == ["0", "0", "0"]
    assert text.detected_table(flights(1))["flight"].tolist() == ["7"]


def test_the_table_of_tracks_never_adds_up_two_ways() -> None:
    many = flights(2, frames=followed(**BY_DISTANCE))
    table = text.outcome_table(many)
    assert set(table.columns) == set(text.outcome_columns(many))
    assert len(table) == len(NAMES) * len(text.WAYS)
    own = table[table["rule"] == NAMES[DISTANCE]].set_index("from")
    assert own.loc[text.FRAMES, "swapped"].startswith("2 of 2")
    assert own.loc[text.DRAWN, "swapped"].startswith("0 of 2")
    assert own.loc[text.FRAMES, "flight-8"] == "59 of 118 wrong, 2 go over, swapped"
    assert own.loc[text.INSIDE, "flight-8"] == "0 of 118 wrong, not swapped"
    shared = table[table["rule"] == NAMES[JOINT]]
    assert set(shared["flight-7"]) == {"not swapped"}, "no detection is one track's"


def test_swaps_are_told_from_chance_only_where_enough_flights_differ() -> None:
    few = text.swaps_words(flights(3, frames=followed(**BY_DISTANCE)))
    assert (
        few.startswith("Flights, of 3, on which") and "detections: distance alone, 3 and 0; distance" in few
    )
    assert few.endswith("cannot be told from 3 flights: it takes 6 that all differ one way.")
    assert "cannot be told from 1 flight:" in text.swaps_words(flights(1))
    many = text.swaps_words(flights(6, frames=followed(**BY_DISTANCE)))
    assert many.endswith("Beyond chance, on the same flights: by distance alone, more from frames.")
    fewer = text.swaps_words(flights(6, drawn=followed(**BY_LOOKS)))
    assert fewer.endswith("by distance and features, fewer from frames.")
    same = text.swaps_words(flights(6))
    assert same.endswith("than drawn detections do cannot be told.") and "it takes" not in same


def test_words_on_the_border_turn_with_what_leaving_it_out_changes() -> None:
    bad = followed(**{FEATURES.replace("-", "_"): SWAPPED._replace(by_cut=1)})
    said = text.border_words(flights(3, frames=bad))
    assert "3 of 6 (19 to 81 %) tracks from frames start on a detection that touches the border" in said
    assert "away from the border, 110, 110, 110, flight by flight" in said
    assert "with features: 50, 50, 50; where" in said
    assert "not tracked, 0, 0, 0: fewer on 3 of 3, more on 0" in said
    assert said.endswith("which chance may have done too.")
    assert text.border_words(flights(6, frames=bad)).endswith("more on 0.")
    assert "fewer on 0 of 2, more on 2" in text.border_words(flights(2, inside=bad))
    assert "fewer on 0 of 2, more on 0" in text.border_words(flights(2))


def test_the_summary_is_of_rendered_frames_alone() -> None:
    said = text.summary_words(flights(2, frames=followed(**BY_LOOKS), drawn=followed(**BY_DISTANCE)))
    assert "of flights 7 and 8" in said
    assert "by distance alone on 0 of 2" in said and "with features on 2 of 2" in said
    assert "shared by probability on 0 of 2" in said


def test_limits_say_how_near_the_two_come() -> None:
    said = text.limit_words(flights(1))
    assert "Rendered frames are of 1 flight about" in said
    assert "as near as 4 m, middle to middle, with hulls of 11 m and 7 m" in said  # 3 m each way


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({}, "0 of 118 wrong, not swapped"),
        ({"unassigned": 3}, "0 of 118 wrong, 3 to no track, not swapped"),
        ({"tracks": 1}, "0 of 118 wrong, 1 track, not swapped"),
        ({"tracks": 3, "by_false": 1}, "0 of 118 wrong, 3 tracks, 1 by a false one, not swapped"),
        ({"swaps": 1}, "0 of 118 wrong, 1 goes over, not swapped"),
        ({"swapped": True}, "0 of 118 wrong, swapped"),
    ],
)
def test_what_a_rule_made_is_said_in_full(changed: dict[str, int], said: str) -> None:
    assert text.outcome_words(GOOD._replace(**changed)) == said
