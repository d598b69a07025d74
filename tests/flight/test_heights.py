"""What heights count from: made-up streams, and a made-up grid of the geoid."""

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight import terrain
from wildlab.flight.readers.log import Stream, make_stream
from wildlab.flight.terrain import choose_reference, undulation

GEOID = 40.0


def ellipsoid(height: float, **more: object) -> Stream:
    return positions(height_ellipsoid_m=height, **more)


def sea(height: object, **more: object) -> Stream:
    return positions(height_sea_m=height, **more)


def home(height: object, **more: object) -> Stream:
    return positions(height_home_m=height, **more)


def positions(unusable: np.ndarray | None = None, **columns: object) -> Stream:
    """Ten rows at one place; heights as given, a number for all."""
    columns = {"time_s": np.arange(10.0), "latitude_deg": 10.0, "longitude_deg": 20.0, **columns}
    rows = {name: np.broadcast_to(np.asarray(value, float), 10) for name, value in columns.items()}
    return make_stream("gnss", rows, unusable={} if unusable is None else {"no fix": unusable})


@pytest.fixture(autouse=True)
def no_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terrain, "undulation", lambda *place: None)


@pytest.fixture
def grid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The whole world, 30 m above the ellipsoid at 0, 0 and a tenth more for each degree of latitude."""
    from pyproj import datadir

    latitudes, columns = np.arange(-90.0, 90.1, 1.0), 361
    header = struct.pack(">4d2i", -90.0, -180.0, 1.0, 1.0, len(latitudes), columns)
    values = np.repeat(30.0 + 0.1 * latitudes[:, None], columns, axis=1).astype(">f4")
    (tmp_path / "egm96_15.gtx").write_bytes(header + values.tobytes())
    before = datadir.get_data_dir()
    monkeypatch.undo()
    datadir.append_data_dir(str(tmp_path))
    yield tmp_path / "egm96_15.gtx"
    datadir.set_data_dir(before)


def test_undulation_by_the_grid(grid):
    found = [undulation(*place) for place in ((10.0, 20.0), (-20.25, 170.0), (45.5, -75.3))]
    assert found == pytest.approx([31.0, 27.975, 34.55], abs=1e-4)
    plan = choose_reference({"track": sea(100.0), "marks": ellipsoid(7.0)})
    assert plan.reference == "ellipsoid"
    assert plan.uses["track"].add_m == pytest.approx(31.0, abs=1e-4)


def test_without_a_grid_there_is_none_and_nothing_is_fetched():
    assert undulation(10.0, 20.0) is None


def test_a_file_that_is_no_grid_is_none(grid):
    grid.write_bytes(b"no grid")
    assert undulation(10.0, 20.0) is None


GNSS = sea(60.0, undulation_m=GEOID)
UNUSABLE = np.arange(10) < 3
FIXES = sea(np.where(UNUSABLE, -9.0, 150.0 + np.arange(10)), unusable=UNUSABLE)
# At 3 s the fix says 153 m, and the log 2.5 m above take-off.
LOG = home(np.arange(10.0), time_s=np.arange(10) + 0.5)


@pytest.mark.parametrize(
    ("streams", "stated", "reference", "added"),
    [
        ({"a": ellipsoid(5.0), "b": ellipsoid(8.0)}, {}, "ellipsoid", [0.0, 0.0]),
        # A receiver's own geoid serves all, a stated one comes first, a placeholder is none.
        ({"a": GNSS, "b": sea(61.0)}, {}, "ellipsoid", [GEOID, GEOID]),
        ({"a": sea(60.0, height_ellipsoid_m=60.0 + GEOID), "b": sea(61.0)}, {}, "ellipsoid", [0.0, GEOID]),
        ({"a": GNSS}, {"geoid_m": 25.0}, "ellipsoid", [25.0]),
        ({"a": sea(60.0, undulation_m=0.0)}, {}, "sea", [0.0]),
        ({"a": sea(60.0, undulation_m=np.nan)}, {}, "sea", [0.0]),
        ({"a": sea(60.0, undulation_m=500.0)}, {}, "sea", [0.0]),
        ({"a": sea(60.0), "b": sea(3.0)}, {}, "sea", [0.0, 0.0]),
        ({"a": sea(2.0), "b": ellipsoid(44.0)}, {"geoid_m": GEOID}, "ellipsoid", [GEOID, 0.0]),
        # Take-off is tied by the first used fix, and with a geoid on to the ellipsoid.
        ({"a": LOG, "b": FIXES}, {"own": "ab"}, "sea", [150.5, 0.0]),
        ({"a": LOG, "b": FIXES}, {"own": "ab", "geoid_m": GEOID}, "ellipsoid", [150.5 + GEOID, GEOID]),
        ({"a": home(0.0), "b": ellipsoid(77.0)}, {"own": "ab"}, "ellipsoid", [77.0, 0.0]),
        ({"a": home(50.0), "b": sea(1.0)}, {"own": "a", "home_sea_m": 12.0}, "sea", [12.0, 0.0]),
        ({"a": sea(1.0), "marks": positions()}, {}, "sea", [0.0]),
    ],
)
def test_what_heights_count_from(streams, stated, reference, added):
    plan = choose_reference(streams, **stated)
    assert plan.reference == reference
    assert [use.add_m for use in plan.uses.values()] == pytest.approx(added)
    assert plan.without == tuple(name for name in streams if name not in plan.uses)


@pytest.mark.parametrize(
    ("streams", "own", "problem"),
    [
        ({"boat": sea(2.0), "marks": ellipsoid(44.0)}, "", "boat count from sea"),
        # Another vehicle's fix ties nothing.
        ({"drone": home(50.0), "boat": sea(1.0)}, "drone", "drone count from take-off"),
    ],
)
def test_heights_that_cannot_be_compared_are_refused(streams, own, problem):
    with pytest.raises(WildlabError, match=problem):
        choose_reference(streams, own=[own])
