"""What readers of tracks share: numbers that are none, and rows that are never used together."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wildlab.flight.readers.log import Stream, judge
from wildlab.flight.readers.text import decode, number, numbers

WORDS = ["", " 1.5", "-2", "+.5", "1e3", "1_0", "nan", "inf", "1e999", "0x10", "1,5", "٣", "=1+1", "1" * 100]
VALUES = [np.nan, 1.5, -2.0, 0.5, 1000.0, *[np.nan] * 9]


def test_numbers():
    np.testing.assert_array_equal(numbers(WORDS), VALUES)
    np.testing.assert_array_equal([number(word) for word in WORDS], VALUES)
    plain = ["1.5", "", None, "2e2", " 3", "1e999"]
    np.testing.assert_array_equal(numbers(plain), [1.5, np.nan, np.nan, 200.0, 3.0, np.nan])


@pytest.mark.parametrize("codec", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_decode(codec):
    assert decode("Tromsø 1.0°".encode(codec)) == "Tromsø 1.0°"


def test_decode_of_anything():
    for k in range(100):
        decode(np.random.default_rng(k).bytes(101))


ROW = st.tuples(
    st.one_of(st.floats(0, 2e9), st.just(float("nan")), st.integers(1_600_000_000, 1_600_000_020)),
    st.one_of(st.floats(-400, 400), st.floats(60, 60.001), st.just(float("nan"))),
    st.one_of(st.floats(-400, 400), st.floats(10, 10.001), st.just(0.0)),
    st.one_of(st.floats(-1e6, 1e6), st.just(float("nan"))),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(ROW, min_size=1, max_size=40))
def test_rows_of_use_hold_together(rows):
    time, latitude, longitude, height = np.array(rows, float).T
    columns = {"time_s": time, "latitude_deg": latitude, "longitude_deg": longitude, "height_sea_m": height}
    use = ~np.logical_or.reduce(list(judge("gnss", Stream(columns)).values()))
    assert np.isfinite(np.column_stack([latitude, longitude])[use]).all()
    assert np.isfinite(height[use]).all() or np.isnan(height[use]).all()
    if np.isfinite(time).any():
        assert np.isfinite(time[use]).all()
        assert (np.diff(time[use]) > 0).all()
        # Chords between neighbours are no longer than what may be flown.
        p, q = np.radians(latitude[use]), np.radians(longitude[use])
        xyz = 6371e3 * np.column_stack([np.cos(p) * np.cos(q), np.cos(p) * np.sin(q), np.sin(p)])
        chords = np.linalg.norm(np.diff(xyz, axis=0), axis=1)
        assert (chords <= 30.1 + 700.0 * np.diff(time[use])).all()


def test_one_wrong_row_costs_one_row():
    """Whichever row is wrong, and in whichever way, no other is lost with it."""
    count = 30
    for row in range(count):
        for name, value in (("time_s", 1.9e9), ("time_s", 1.1e9), ("latitude_deg", 10.0)):
            columns = {
                "time_s": 1.6e9 + np.arange(count),
                "latitude_deg": 60 + 1e-5 * np.arange(count),
                "longitude_deg": np.full(count, 10.0),
            }
            columns[name][row] = value
            use = ~np.logical_or.reduce(list(judge("gnss", Stream(columns)).values()))
            assert np.flatnonzero(~use).tolist() == [row]


def test_two_tracks_of_which_one_cannot_be():
    time = 1.6e9 + np.arange(40.0)
    latitude = np.where((np.arange(40) >= 10) & (np.arange(40) < 14), -20.0, 60.0)
    found = judge(
        "gnss", Stream({"time_s": time, "latitude_deg": latitude, "longitude_deg": np.full(40, 10.0)})
    )
    assert np.flatnonzero(found["impossible jump"]).tolist() == [10, 11, 12, 13]


def test_degrees_of_longitude_are_short_up_north():
    """East at 650 m/s, which may be flown, and at 800 m/s, which may not."""
    time = 1.6e9 + np.arange(30.0)
    for speed, flown in ((650.0, True), (800.0, False)):
        longitude = np.degrees(speed * np.arange(30) / (6371e3 * np.cos(np.radians(80))))
        found = judge(
            "gnss", Stream({"time_s": time, "latitude_deg": np.full(30, 80.0), "longitude_deg": longitude})
        )
        assert found["impossible jump"].any() != flown
