"""The words of the report on a slowly moving vessel follow its numbers."""

from __future__ import annotations

import pandas as pd
import pytest

from wildlab.reporting.published import load_published
from wildlab.studies.slow_vessel import text


@pytest.fixture
def published():
    table = load_published("slow-vessel").set_index(["subject", "name"])
    return table["value"].to_dict()


def flights(**values):
    """Three flights: numbers by ``subject__name``, the second of them the median."""
    given = {"observer__mae": 9.0, "observer_exact__mae": 8.8, "reference__mae": 1.8, "filter__mean": 5.0,
             "filter_by_detections__mean": 6.0, "first_case__mae": 7.0, "observer__height": 245.0,
             "observer__mean_north": 0.5, "observer__mean_east": 0.2} | values  # fmt: skip
    rows = {
        (who.replace("_", "-"), what): [0.9 * value, value, 1.1 * value]
        for who, what, value in ((*key.split("__"), value) for key, value in given.items())
    }
    return pd.DataFrame(rows)


def test_the_summary_says_from_where_and_how_far_off():
    images, receiver, track = text.summary(flights())
    assert images == (
        "From 240 metres on average a single thermal image places a drifting vessel about 9 metres from "
        "where its own receiver says it is."
    )
    assert "the images are 8.8 metres off; the receiver is 1.8 metres off itself" in receiver
    assert track.endswith("less than the images it is made of.")
    assert "more than the images" in text.summary(flights(filter__mean=12.0))[2]


def test_no_sentence_puts_the_error_down_to_the_receiver(published):
    said = " ".join([*text.summary(flights()), *text.partings(flights(), published)])
    assert "explain" not in said
    assert "some of that" not in said.lower()


def test_partings_turn_with_the_numbers(published):
    few, height, mean = text.partings(flights(), published)
    assert "the median here 9.0 m; 0 % of the flights come up to the published one" in few
    assert "weigh 245/350 as much" in height
    assert "4.9 m" in height
    assert height.endswith("8.8 m off, more than that.")
    assert mean == "The mean of all positions is 0.5 m off here (median), 2.1 m in print."
    other = text.partings(flights(observer__mae=12.0, observer_exact__mae=4.0), published)
    assert "100 % of the flights" in other[0]
    assert other[1].endswith("4.0 m off, no more than that.")


def test_the_track_is_nearer_or_not():
    assert text.tracking(flights())[0].startswith("The track: nearer than single images")
    assert text.tracking(flights(filter__mean=9.5))[0].startswith("The track: no nearer than single images")
