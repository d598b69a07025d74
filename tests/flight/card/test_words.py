"""Clocks of logs: fast or slow by their rate, and stamps that move by what is stated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wildlab.flight.card.found import Found
from wildlab.flight.card.roles import Choice
from wildlab.flight.card.said import sentences_of
from wildlab.flight.readers.logs.log import Clock, RawLog, make_stream
from wildlab.flight.readers.logs.parts import stream_of
from wildlab.flight.recipe.series import LogTable


@pytest.mark.parametrize(
    ("rate", "sd", "said"),
    [
        (1 - 1e-4, 1e-6, "100 ppm fast"),
        (1 + 1e-4, 1e-6, "100 ppm slow"),
        (1 + 1e-4, 1e-4, "200 ppm"),
        (1.0, np.nan, "cannot be told"),
    ],
)
def test_how_a_clock_runs(rate, sd, said):
    """A second of a fast clock is less than one of UTC."""
    stream = make_stream("gnss", {"time_s": [1.0, 2.0]})
    clock = Clock("GPS weeks", rate, 0.0, 0.001, 0.002, 10, sd)
    found = Found("a.bin", 1, "dataflash", RawLog("dataflash", {"gnss": stream}, clock=clock))
    assert any(said in one for one in sentences_of([Choice(found, "own", "why")]))


def test_stamps_of_a_log_without_utc_count_from_what_is_stated():
    stream = make_stream("gnss", {"time_s": [np.nan, np.nan], "time_log_s": [0.5, 2.0]})
    wanted = LogTable(file="a.srt", format="dji-srt", part="gnss", offset_s=1000.0)
    found = stream_of(RawLog("dji-srt", {"gnss": stream}), wanted, Path("a.srt"))
    assert found.columns["time_s"].tolist() == [1000.5, 1002.0]
