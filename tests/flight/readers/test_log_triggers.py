"""Images of a recipe that take the time of the record of their trigger."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs import parts
from wildlab.flight.readers.logs.log import make_stream

TIMES = 1.7e9 + np.cumsum(np.r_[0, 2.0, 2.1, 7.3, 1.9, 2.2, 9.0, 2.4, 3.1, 2.0])


def test_images_take_the_time_of_their_record() -> None:
    triggers = make_stream("triggers", {"time_s": TIMES}, unusable={"no time": np.arange(10) == 4})
    stamps = np.delete(TIMES, 7) - 7200.0 + 0.3
    images = make_stream("photos", {"time_log_s": stamps, "file": [f"{n}.jpg" for n in range(9)]})
    stamped = parts.stamped_by(images, triggers, Path("log.bin")).columns
    # In the order of time; those without one come last.
    of = dict(zip(stamped["file"], stamped["time_s"], strict=True))
    found = [of[f"{n}.jpg"] for n in range(9)]
    wanted = np.delete(np.where(np.arange(10) == 4, np.nan, TIMES), 7)
    assert found == pytest.approx(wanted, nan_ok=True)


def test_what_is_not_certain_is_refused() -> None:
    even = np.arange(0.0, 40.0, 2.0)
    triggers, images = (
        make_stream(part, {"time_s": of}) for part, of in (("triggers", even), ("photos", even[1:]))
    )
    with pytest.raises(WildlabError, match="is not certain"):
        parts.stamped_by(images, triggers, Path("log.bin"))
