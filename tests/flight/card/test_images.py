"""How images meet the log: by the records of their triggers, by UTC, by a zone, or not at all."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from wildlab.flight.card_items import CardItem, clock_of_images
from wildlab.flight.raw_files import stamped_by
from wildlab.flight.readers.log import RawLog, Stream, make_stream

START = 1.7e9
#: When images were truly taken: not evenly, as on the way from row to row.
TAKEN = START + np.cumsum(np.random.default_rng(5).uniform(1.5, 6.0, 40))


def images(wall: NDArray[np.float64] | None, utc: NDArray[np.float64] | None = None) -> CardItem:
    count = len(TAKEN)
    columns: dict[str, object] = {"file": [f"a{i}.jpg" for i in range(count)]}
    columns["time_log_s"] = np.full(count, np.nan) if wall is None else wall
    columns["time_s"] = np.full(count, np.nan) if utc is None else utc
    return CardItem("DCIM", "photos", RawLog({"photos": make_stream("photos", columns)}))


def triggers(times: NDArray[np.float64]) -> Stream:
    return make_stream("triggers", {"time_s": times, "number": np.arange(len(times))})


def own(first: float = START - 60, last: float = START + 400) -> CardItem:
    t = np.arange(first, last)
    columns = {"time_s": t, "latitude_deg": 0 * t + 59, "longitude_deg": 0 * t + 10, "height_sea_m": 0 * t}
    return CardItem("flight.bin", "dataflash", RawLog({"gnss": make_stream("gnss", columns)}))


def photos_of(found: CardItem) -> Stream:
    stream = found.part("photos")
    assert stream is not None
    return stream


def test_records_of_triggers_give_whole_seconds_their_fractions():
    """The camera counts whole seconds, an hour and three seconds ahead; one record has no image."""
    wall = np.floor(TAKEN + 3603.0)
    records = triggers(np.insert(TAKEN, 7, (TAKEN[6] + TAKEN[7]) / 2))
    found = images(wall)
    clock = clock_of_images(found, own(), None, ("triggers", records))
    assert clock.triggers == "triggers"
    stamped = stamped_by(photos_of(found), records, Path("x"))
    np.testing.assert_allclose(stamped.columns["time_s"], TAKEN)


def test_images_without_a_record_have_no_time():
    records = triggers(np.delete(TAKEN, [3, 20]))
    stamped = stamped_by(photos_of(images(TAKEN + 12.25)), records, Path("x"))
    lost = np.isnan(stamped.columns["time_s"])
    assert stamped.columns["file"][lost].tolist() == ["a3.jpg", "a20.jpg"]
    np.testing.assert_allclose(stamped.columns["time_s"][~lost], np.delete(TAKEN, [3, 20]))


@pytest.mark.parametrize("quarters", [-14, 0, 8, 22, 23])
def test_the_zone_that_brings_images_into_the_flight(quarters):
    wall = TAKEN + 900.0 * quarters + 2.0
    clock = clock_of_images(images(wall), own(), None)
    assert clock.offset_s == -900.0 * quarters
    assert clock.kind == "utc"


def test_a_clock_that_is_a_day_off_fits_no_zone():
    clock = clock_of_images(images(TAKEN + 86400.0 * 3), own(), None)
    assert clock.offset_s == 0.0


def test_images_without_any_time_are_numbered():
    assert clock_of_images(images(None), own(), None).kind == "sequence"
