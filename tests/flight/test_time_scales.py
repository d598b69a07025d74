"""GPS time and UTC, against the table of leap seconds as the world has it."""

from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.flight.clock_fitting import gps_to_utc, week_to_utc

#: TAI - UTC from each date on (IERS); GPS time is 19 s behind TAI.
TAI_MINUS_UTC = {
    (1981, 7): 20, (1982, 7): 21, (1983, 7): 22, (1985, 7): 23, (1988, 1): 24, (1990, 1): 25, (1991, 1): 26,
    (1992, 7): 27, (1993, 7): 28, (1994, 7): 29, (1996, 1): 30, (1997, 7): 31, (1999, 1): 32, (2006, 1): 33,
    (2009, 1): 34, (2012, 7): 35, (2015, 7): 36, (2017, 1): 37,
}  # fmt: skip


@pytest.mark.parametrize(("month", "tai"), TAI_MINUS_UTC.items())
def test_each_border(month, tai):
    start = datetime(*month, 1, tzinfo=UTC).timestamp()
    # GPS time runs on through the leap second; UTC, which has no number for it here, stands for it.
    gps = start - 315964800 + tai - 19
    at = gps_to_utc([gps - 2, gps - 1, gps, gps + 1]) - start
    assert at.tolist() == [-1.0, 0.0, 0.0, 1.0]


def test_known_instants():
    # The epoch; the two roll-overs of the ten-bit week, and one day between.
    cases = {
        (0, 0.0): "1980-01-06T00:00:00",
        (1024, 0.0): "1999-08-21T23:59:47",
        (2048, 0.0): "2019-04-06T23:59:42",
        (1834, 86400.0): "2015-03-01T23:59:44",
    }
    for (week, seconds), text in cases.items():
        utc = datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()
        assert float(week_to_utc(week, seconds)) == utc


@given(st.lists(st.floats(0, 1.8e9), min_size=2))
def test_utc_never_goes_back(gps):
    assert (np.diff(gps_to_utc(np.sort(gps))) >= 0).all()


def test_not_known_stays_so():
    assert np.isnan(gps_to_utc(np.nan))
