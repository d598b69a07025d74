"""What heights count from: made-up streams, and a made-up grid of the geoid."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.flight import heights
from wildlab.flight.heights import choose_reference, undulation
from wildlab.flight.readers.logs.log import Stream, make_stream

GEOID = 40.0


def positions(unusable: np.ndarray | None = None, **columns: object) -> Stream:
    """Ten rows at one place; heights as given, a number for all."""
    rows = {name: np.broadcast_to(np.asarray(value, float), 10) for name, value in columns.items()}
    time = {"time_s": np.arange(10.0)} if "time_s" not in rows else {}
    place = {"latitude_deg": np.full(10, 10.0), "longitude_deg": np.full(10, 20.0)}
    return make_stream(
        "gnss", {**time, **place, **rows}, unusable={"no fix": unusable} if unusable is not None else {}
    )


@pytest.fixture(autouse=True)
def no_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heights, "installed_grid", lambda: None)


@pytest.fixture
def grid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The whole world, 30 m above the ellipsoid at 0, 0 and a tenth more for each degree of latitude."""
    from pyproj import datadir

    latitudes, columns = np.arange(-90.0, 90.1, 1.0), 361
    header = struct.pack(">4d2i", -90.0, -180.0, 1.0, 1.0, len(latitudes), columns)
    values = np.repeat(30.0 + 0.1 * latitudes[:, None], columns, axis=1).astype(">f4")
    (tmp_path / "egm96_15.gtx").write_bytes(header + values.tobytes())
    before = datadir.get_data_dir()
    monkeypatch.undo()
    datadir.append_data_dir(str(tmp_path))
    yield
    datadir.set_data_dir(before)


def test_undulation_by_the_grid(grid):
    found = undulation([10.0, -20.25, 45.5], [20.0, 170.0, -75.3])
    assert found is not None
    assert found == pytest.approx([31.0, 27.975, 34.55], abs=1e-4)
    plan = choose_reference(
        {"track": positions(height_sea_m=100.0), "marks": positions(height_ellipsoid_m=7.0)}
    )
    assert plan.reference == "ellipsoid"
    assert plan.uses["track"].add_m == pytest.approx(31.0, abs=1e-4)


def test_without_a_grid_there_is_none_and_nothing_is_fetched():
    assert undulation(10.0, 20.0) is None


def test_a_file_that_is_no_grid_is_none(tmp_path, monkeypatch):
    from pyproj import datadir

    (tmp_path / "egm96_15.gtx").write_bytes(b"no grid")
    before = datadir.get_data_dir()
    monkeypatch.undo()
    datadir.append_data_dir(str(tmp_path))
    try:
        assert undulation(10.0, 20.0) is None
    finally:
        datadir.set_data_dir(before)


def test_all_on_the_ellipsoid_stay_there():
    plan = choose_reference({"a": positions(height_ellipsoid_m=5.0), "b": positions(height_ellipsoid_m=8.0)})
    assert plan.reference == "ellipsoid"
    assert {use.add_m for use in plan.uses.values()} == {0.0}


@pytest.mark.parametrize(
    "receiver",
    [
        {"height_sea_m": 60.0, "undulation_m": GEOID},
        {"height_sea_m": 60.0, "height_ellipsoid_m": 60.0 + GEOID},
    ],
)
def test_a_receiver_s_own_geoid_serves_all(receiver):
    plan = choose_reference({"gnss": positions(**receiver), "poses": positions(height_sea_m=61.0)})
    assert plan.reference == "ellipsoid"
    assert plan.uses["poses"] == (
        "height_sea_m", GEOID, "counts from sea level, and the geoid's height as gnss has it is added",
    )  # fmt: skip
    use = plan.uses["gnss"]
    assert float(receiver[use.column]) + use.add_m == pytest.approx(100.0)


def test_a_stated_geoid_comes_first():
    streams = {"gnss": positions(height_sea_m=60.0, undulation_m=GEOID)}
    assert choose_reference(streams, geoid_m=25.0).uses["gnss"].add_m == 25.0


def test_sea_level_where_nothing_leads_to_the_ellipsoid():
    streams = {"a": positions(height_sea_m=60.0), "b": positions(height_sea_m=3.0)}
    plan = choose_reference(streams)
    assert plan.reference == "sea"
    assert all(use[:2] == ("height_sea_m", 0.0) for use in plan.uses.values())


@pytest.mark.parametrize(
    "nothing", [{"undulation_m": 0.0}, {"undulation_m": np.nan}, {"undulation_m": 500.0}]
)
def test_a_placeholder_is_no_geoid(nothing):
    assert choose_reference({"a": positions(height_sea_m=60.0, **nothing)}).reference == "sea"


def test_mixed_without_a_geoid_is_refused():
    streams = {"boat": positions(height_sea_m=2.0), "marks": positions(height_ellipsoid_m=44.0)}
    with pytest.raises(WildlabError, match="boat count from sea"):
        choose_reference(streams)
    assert choose_reference(streams, geoid_m=GEOID).reference == "ellipsoid"


def test_take_off_is_tied_by_the_first_used_fix():
    unusable = np.arange(10) < 3
    gnss = positions(unusable, height_sea_m=np.where(unusable, -9.0, 150.0 + np.arange(10)))
    poses = positions(height_home_m=np.arange(10.0), time_s=np.arange(10) + 0.5)
    plan = choose_reference({"poses": poses, "gnss": gnss}, own=["poses", "gnss"])
    assert plan.reference == "sea"
    # At 3 s the fix says 153 m, and the log 2.5 m above take-off.
    assert plan.uses["poses"].column == "height_home_m"
    assert plan.uses["poses"].add_m == pytest.approx(150.5)
    # With a geoid, on to the ellipsoid.
    plan = choose_reference({"poses": poses, "gnss": gnss}, own=["poses", "gnss"], geoid_m=GEOID)
    assert plan.uses["poses"].add_m == pytest.approx(150.5 + GEOID)


def test_another_vehicle_s_fix_ties_nothing():
    streams = {"drone": positions(height_home_m=50.0), "boat": positions(height_sea_m=1.0)}
    with pytest.raises(WildlabError, match="drone count from take-off"):
        choose_reference(streams, own=["drone"])
    plan = choose_reference(streams, own=["drone"], home_sea_m=12.0)
    assert plan.uses["drone"].add_m == 12.0 and plan.reference == "sea"


def test_a_fix_on_the_ellipsoid_ties_too():
    streams = {"poses": positions(height_home_m=0.0), "gnss": positions(height_ellipsoid_m=77.0)}
    plan = choose_reference(streams, own=["poses", "gnss"])
    assert plan.reference == "ellipsoid" and plan.uses["poses"].add_m == pytest.approx(77.0)


def test_streams_without_heights_are_named():
    streams = {"marks": positions(), "track": positions(height_sea_m=1.0)}
    plan = choose_reference(streams)
    assert plan.without == ("marks",) and list(plan.uses) == ["track"]
