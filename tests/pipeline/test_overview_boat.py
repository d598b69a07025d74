"""The overview of what never flew and has no camera: a boat with a radar."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from tests.pipeline.test_overview import page_of, values
from wildlab.flight.store import Flight
from wildlab.pipeline.overviews.overview import look_over
from wildlab.reporting.overview_sections import tiles
from wildlab.reporting.overview_words import height_words, subtitle


def test_detections_of_no_camera_are_not_held_against_the_ground(
    make_flight: Callable[..., Flight], tmp_path: Path
) -> None:
    flight = make_flight(n_images=10)
    pixels = len(flight.table("detections"))
    assert (f"{pixels} / {pixels}", "detections on the ground") in tiles(look_over(flight))
    radar = flight.table("detections").assign(
        source="radar", kind="position", north_m=0.0, east_m=0.0, down_m=0.0
    )
    flight.tables["detections"] = pd.concat([flight.table("detections"), radar], ignore_index=True)
    assert (f"{pixels} / {pixels}", "detections on the ground") in tiles(look_over(flight))
    flight.tables["detections"] = radar
    overview = look_over(flight)
    assert (str(pixels), "detections") in tiles(overview)
    assert "on the ground" not in str(tiles(overview))
    recorded = values(page_of(flight, tmp_path)[1])
    assert recorded["detections_in_images", "flight"] == 0
    assert ("detections_placed", "flight") not in recorded


def test_what_never_leaves_the_ground_is_at_no_height(make_flight: Callable[..., Flight]) -> None:
    flight = make_flight(n_images=10)
    overview = look_over(flight)
    assert overview.above is not None
    boat = replace(overview, above=(np.full_like(overview.above[0], -0.1), overview.above[1]))
    assert "height above" in str(tiles(overview)) and "m above" in subtitle(overview)
    assert "height above" not in str(tiles(boat)) and "m above" not in subtitle(boat)
    assert [height_words(*one) for one in ((58.7, 61.2), (59.9, 60.2), (-3.0, 0.4))] == [
        "59 to 61 m", "60 m", "-3 to 0 m",
    ]  # fmt: skip
