"""A flight over a boat of a real log: raw files in, and the boat is seen where its own log has it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from click.testing import CliRunner

from tests.flight.card.boat import write_flight
from wildlab.api.points import georeference
from wildlab.cli import wildlab
from wildlab.flight.clocks import frame_times, truth_at
from wildlab.flight.store import load_flight


def test_the_boat_is_seen_where_it_was(shared_data: Callable[..., Path], tmp_path: Path):
    log = shared_data("logs", "target_boat_nmea", "bundg_zeus_9.log")
    card = tmp_path / "card"
    card.mkdir()
    clicks = write_flight(card, log)
    shutil.copy(log, card / "boat.log")
    arguments = [
        "import",
        str(card),
        "--into",
        str(tmp_path / "flight"),
        "--camera",
        str(card / "camera.toml"),
    ]
    result = CliRunner().invoke(wildlab, arguments)
    assert result.exit_code == 0, result.output
    flight = load_flight(tmp_path / "flight")
    points = georeference(flight).table
    assert len(points) == clicks
    times = dict(zip(flight.table("frames")["frame_id"], frame_times(flight), strict=True))
    assert flight.truth is not None
    _, where = truth_at(flight.truth, points["frame_id"].map(times).to_numpy(float))
    errors = np.hypot(*(points[["north_m", "east_m"]].to_numpy() - where[0, :, :2]).T)
    known = np.isfinite(errors)
    assert known.mean() > 0.9
    # A click is 1 px off (0.075 m on the water, each axis); the plane lies metres below the antenna, seen
    # from up to 8 m aside and 60 m above; a boat's positions come once a second.
    assert np.median(errors[known]) < 0.5
    assert errors[known].max() < 2.0
