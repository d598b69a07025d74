"""A generalised flight: the same motion, and nothing of where, when and who."""

from __future__ import annotations

import dataclasses
import math
import re
from datetime import UTC, datetime, timedelta

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.sharing.canary import EPOCH, HASH, START, canary, place, velocity
from wildlab.analysis.georeference import observe
from wildlab.analysis.navigate import REFERENCES, reference_of
from wildlab.errors import WildlabError
from wildlab.flight.calibration_files import ZONE_S
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import PREFERRED, Flight, save_flight
from wildlab.geometry.camera import normalise
from wildlab.geometry.frames import local_earth
from wildlab.navigation.strapdown import ImuSamples, integrate_strapdown
from wildlab.sharing.generalisation import (
    Generalised,
    first_stamp,
    generalise,
    new_origin,
    reach,
)
from wildlab.sharing.tiers import treatment_of

POSITION = ["north_m", "east_m", "down_m"]
FELT = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2", "w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]


def made(flight: Flight, tier: str = "public") -> Generalised:
    return generalise(flight, treatment_of(flight.manifest.locations, tier))  # type: ignore[arg-type]


def numbers_of(flight: Flight) -> dict[str, np.ndarray]:
    tables = {**flight.nav, **flight.tables}
    return {
        f"{name}.{column}": table[column].to_numpy(float)
        for name, table in tables.items()
        for column in table.columns
        if pd.api.types.is_numeric_dtype(table[column])
    }


def test_two_places_give_the_same_copy_where_the_place_is_withheld():
    """Nothing can be recovered of what the result does not depend on."""
    south = made(canary()).flight
    north = made(canary((69.6, -18.9, 1204.0), corner=(-300.0, 90.0, 40.0), field=(53.0, 9.2, 77.1))).flight
    # What is magnetic on board is as much larger in the copy as the field was weaker there.
    one, other = south.manifest.magnetometer, north.manifest.magnetometer
    assert np.multiply(one.hard_iron_ut, 31.2) == pytest.approx(np.multiply(other.hard_iron_ut, 53.0))
    assert south.manifest == north.manifest.model_copy(update={"magnetometer": one})
    here, there = numbers_of(south), numbers_of(north)
    assert here.keys() == there.keys()
    for name, values in here.items():
        if name.startswith("magnetometer.field"):
            continue
        # Attitudes between poses, and rounding, are all that is left.
        loose = 5e-5 if name.split(".")[1] in FELT else 1e-8
        np.testing.assert_allclose(values, there[name], atol=loose, err_msg=name)
    assert south.terrain is not None and north.terrain is not None
    np.testing.assert_allclose(south.terrain.height, north.terrain.height, atol=1e-4)
    assert (south.terrain.north, south.terrain.east) == pytest.approx(
        (north.terrain.north, north.terrain.east)
    )


def test_two_days_of_a_month_give_the_same_copy():
    one, other = made(canary()), made(canary(epoch=datetime(2023, 9, 2, 3, 0, 0, tzinfo=UTC)))
    assert one.flight.manifest == other.flight.manifest
    assert one.when == other.when == "September 2023 (UTC)"
    for name, values in numbers_of(one.flight).items():
        np.testing.assert_array_equal(values, numbers_of(other.flight)[name])


@pytest.mark.parametrize("category", [1, 2, 3, 4])
def test_the_moved_sensors_feel_the_same_flight(category):
    """Dead reckoning over the copy, on the Earth of its origin, leads where the true one does."""
    flight = canary(locations={"category": category})
    copy = made(flight).flight
    ends = []
    for one in (flight, copy):
        imu = one.table("imu")
        samples = ImuSamples(*(imu[names].to_numpy(float) for names in ("time_s", FELT[:3], FELT[3:])))
        nav = next(iter(one.nav.values()))
        latitude, _, height = one.manifest.origin_tuple()
        start = [nav[names].iloc[0].to_numpy(float) for names in (POSITION, list(VELOCITY), list(QUATERNION))]
        found = integrate_strapdown(samples, *start, local_earth(latitude, height))
        ends.append(found.position - nav[POSITION].iloc[0].to_numpy(float))
        truth = place(samples.times - samples.times[0], np.zeros(3))
        np.testing.assert_allclose(ends[-1], truth - truth[0], atol=0.2)
    np.testing.assert_allclose(ends[0], ends[1], atol=0.02)


VELOCITY = ("v_north_m_s", "v_east_m_s", "v_down_m_s")
QUATERNION = ("q_w", "q_x", "q_y", "q_z")


def test_the_magnetic_field_is_that_of_no_place():
    flight = canary()
    copy = made(flight).flight
    stated, iron = copy.manifest.magnetometer, copy.manifest.magnetometer.hard_iron_ut
    assert (stated.declination_deg, stated.inclination_deg) == (0.0, 60.0)
    assert iron is not None
    field = copy.table("magnetometer")[["field_x_ut", "field_y_ut", "field_z_ut"]].to_numpy(float) - iron
    # What is left points where the copy says, and as strongly everywhere as the usual field.
    np.testing.assert_allclose(np.linalg.norm(field, axis=1), 50.0, rtol=1e-6)
    attitude = next(iter(copy.nav.values()))[list(QUATERNION)].to_numpy(float)
    seen = Rotation.from_quat(attitude, scalar_first=True).apply(field)
    np.testing.assert_allclose(seen, np.tile([25.0, 0.0, 50 * math.sqrt(0.75)], (len(seen), 1)), atol=1e-4)


def test_the_day_is_that_of_the_aircrafts_first_pose():
    """A tracker on the ground that was started before midnight moves no flight to the day before."""
    midnight = datetime(2023, 9, 17, tzinfo=UTC)
    flight = canary(epoch=midnight - timedelta(seconds=START - 60), locations={"category": 3})
    truth = flight.table("truth")
    early = truth.iloc[:1].assign(time_s=START - 180 - flight.manifest.clocks.truth_offset_s)
    flight.tables["truth"] = pd.concat([early, truth], ignore_index=True)
    moment = midnight + timedelta(seconds=first_stamp(flight) - START + 60)
    assert moment.day == 16, "the first stamp is of the day before"
    copy = made(flight, "partner")
    assert copy.when == "17 September 2023 (UTC)"
    assert copy.flight.manifest.time.epoch == midnight
    assert first_stamp(copy.flight) == pytest.approx(0.0, abs=1e-6)


def test_nothing_of_where_when_and_who_is_in_the_copy(tmp_path):
    flight = canary(locations={"category": 2})
    saved = save_flight(made(flight).flight, tmp_path / "flight")
    assert saved.folder is not None
    text = "".join(
        path.read_bytes().decode("latin-1") for path in sorted(saved.folder.rglob("*")) if path.is_file()
    )
    names = "kifaru Olifants Letaba Skukuza Jonas Kestrel Sarah Thandi KIFARU rhino"
    for secret in (
        *names.split(),
        *("873165", "486297", "317.43", "13.57", "32736", "30.87", "28.02", "58.3", "17.4", HASH, HASH[:8]),
        *("2023-09-17", "lat_raw", "-7198"),
    ):
        assert secret not in text, secret
    assert "-24.9" in text and "31.5" in text  # the cell of category 2
    terrain = saved.manifest.terrain
    assert terrain is not None and terrain.cell_m == (40.0, 40.0)


def test_kinds_of_hulls_have_no_names_in_the_copy():
    hulls = [{"name": "Thandi's dinghy", "length_m": 4.0}, {"name": "patrol", "length_m": 9.0}]
    many = made(canary(targets={"many": {"hulls": hulls}})).flight.manifest.targets.many
    assert many is not None
    assert [(hull.name, hull.length_m) for hull in many.hulls] == [("kind A", 4.0), ("kind B", 9.0)]


@pytest.mark.parametrize("named", [True, False])
def test_a_sensors_clock_tells_no_zone_of_time(named):
    """Its looks are when they were, whatever zone its clock was in."""
    frames = canary(imu=False).table("frames")
    own = frames.assign(time_s=frames["time_s"] - 1000.5, **({"sensor": "Ranger Jonas"} if named else {}))
    other = canary(imu=False, sensors={"Ranger Jonas": {"clock_offset_s": 1000.5}})
    zone = own.assign(time_s=own["time_s"] - 6300.0)
    far = canary(imu=False, sensors={"Ranger Jonas": {"clock_offset_s": 7300.5}})
    one = made(dataclasses.replace(other, tables=other.tables | {"frames": own}))
    two = made(dataclasses.replace(far, tables=far.tables | {"frames": zone}))
    assert two.clocks == {"Ranger Jonas": 7200.0} and one.clocks == {"Ranger Jonas": 900.0}
    assert one.flight.manifest == two.flight.manifest
    assert two.flight.manifest.sensors["sensor-1"].clock_offset_s == pytest.approx(100.5)
    pd.testing.assert_frame_equal(one.flight.table("frames"), two.flight.table("frames"))
    pd.testing.assert_frame_equal(one.flight.nav["poses-1"], two.flight.nav["poses-1"])
    assert any("clock_offset_s: 7300.5 ->" in one for one in two.removed)


def test_clocks_of_several_zones_are_refused_where_no_frame_says_whose_it_is():
    flight = canary(imu=False, sensors={"Ranger Jonas": {"clock_offset_s": 7200.0}})
    seen = flight.table("detections")
    seen.loc[:9, "source"] = "radar"
    with pytest.raises(WildlabError, match=r"7200 s apart.*column sensor of frames"):
        made(flight)


def test_stamps_begin_at_zero_and_keep_their_distances():
    flight = canary()
    copy = made(flight).flight
    assert first_stamp(copy) == pytest.approx(0.0, abs=1e-9)
    assert frame_times(copy) == pytest.approx(frame_times(flight) - START, abs=1e-9)
    # A frame before the first pose, by a camera whose clock is ten seconds more ahead.
    early = canary(imu=False, clocks={"camera_offset_s": 1.5 - 7200.0 - 10.0})
    assert first_stamp(early) == pytest.approx(START + 5.0 - 10.0)
    # The zone of the camera's clock is gone, and what it is late by is still said.
    assert copy.manifest.clocks.camera_offset_s == pytest.approx(1.5)
    assert copy.table("frames")["time_s"].min() == pytest.approx(5.0 - 1.5)


@given(st.integers(-60, 60), st.floats(-449, 449))
@settings(max_examples=40, deadline=None)
def test_no_zone_of_time_is_left_in_an_offset(quarters, rest):
    flight = canary(imu=False, clocks={"truth_offset_s": quarters * ZONE_S + rest})
    assert made(flight).flight.manifest.clocks.truth_offset_s == pytest.approx(rest, abs=1e-6)


def test_what_is_computed_from_the_copy_is_what_is_computed_from_the_flight():
    flight = canary()
    copy = made(flight).flight
    true, same = observe(flight), observe(copy)
    np.testing.assert_allclose(same.poses.R_nb, true.poses.R_nb, atol=1e-9)
    np.testing.assert_allclose(
        same.poses.p_nb - same.poses.p_nb[0], true.poses.p_nb - true.poses.p_nb[0], atol=1e-8
    )
    np.testing.assert_allclose(
        same.plane_down - same.poses.p_nb[:, 2], true.plane_down - true.poses.p_nb[:, 2], atol=1e-4
    )
    np.testing.assert_allclose(
        velocity(np.zeros(1))[0], next(iter(copy.nav.values()))[list(VELOCITY)].iloc[0]
    )


@pytest.mark.parametrize(
    ("fx", "rounded"), [(1159.2, 1150.0), (765.0, 765.0), (1012.0, 1000.0), (4321.0, 4300.0)]
)
def test_the_camera_is_one_of_many_and_sees_the_same(fx, rounded):
    """Calibrated focal lengths and principal points would link all copies of one camera."""
    lens = {"fx_px": fx, "fy_px": 1.01 * fx, "cx_px": 311.7, "cy_px": 262.3, "skew_px": 0.4, "k1": -0.2}
    camera = {"name": "Boson of Letaba", "width_px": 640, "height_px": 512, **lens}
    flight = canary(imu=False, camera=camera, uncertainty={"pixel_px": 2.0})
    found = made(flight)
    there = found.flight.manifest.camera
    assert there is not None and (there.name, there.fx_px) == ("camera", pytest.approx(rounded))
    assert (there.cx_px, there.cy_px) == (319.5, 255.5)
    assert found.pixels == pytest.approx(rounded / fx)
    assert found.flight.manifest.uncertainty.pixel_px == pytest.approx(2.0 * rounded / fx)
    rays = [normalise(seen.poses.camera, seen.uv) for seen in (observe(flight), observe(found.flight))]
    np.testing.assert_allclose(rays[0], rays[1], atol=1e-9)


def test_the_new_origin_follows_from_the_flight_alone():
    one = canary()
    moved = canary(corner=(5_812.0, 9_545.0, -113.0))
    np.testing.assert_allclose(new_origin(moved) - new_origin(one), [5_000.0, 10_000.0, -100.0])
    for flight in (one, moved):
        p = made(flight).flight.nav["poses-1"][POSITION].to_numpy(float)
        np.testing.assert_allclose(p.min(axis=0)[:2], -p.max(axis=0)[:2], atol=1e-8)
    # Where nothing tells of the ground, it is at the height of the lowest pose: down is largest there.
    bare = dataclasses.replace(
        one, tables={}, terrain=None, manifest=one.manifest.model_copy(update={"terrain": None})
    )
    poses = one.nav["Kestrel-log"][POSITION].to_numpy(float)
    assert new_origin(bare)[2] == pytest.approx(poses[:, 2].max())
    far = np.linalg.norm(poses[:, :2], axis=1).max()
    assert reach(bare, np.zeros(3)) == pytest.approx(far) and far < reach(moved, np.zeros(3))


def test_a_flight_without_positions_or_stamps_is_no_trouble():
    flight = canary(imu=False, time={"kind": "sequence"})
    flight.nav, flight.terrain = {}, None
    flight.tables = {"frames": flight.table("frames")}
    flight = dataclasses.replace(flight, manifest=flight.manifest.model_copy(update={"terrain": None}))
    found = made(flight)
    assert found.when == "" and found.flight.manifest.time.epoch is None
    assert found.flight.table("frames")["frame_id"].iloc[0] == "frame-01"
    assert re.fullmatch(r"frame-\d\d", found.flight.table("frames")["frame_id"].iloc[-1])
    assert EPOCH.year == 2023


def test_poses_that_a_report_looks_up_keep_their_names():
    """By another name they would be held against another reference, and the verdict may turn round."""
    for name in (*REFERENCES, *PREFERRED):
        flight = canary()
        nav = {name: flight.nav["autopilot" if "autopilot" in flight.nav else next(iter(flight.nav))]}
        assert list(made(dataclasses.replace(flight, nav=nav)).flight.nav) == [name]
    flight = canary()
    table = next(iter(flight.nav.values()))
    both = dataclasses.replace(flight, nav={"truth-payload": table, "autopilot": table, "truth-Jonas": table})
    copied = made(both).flight
    assert reference_of(copied) == reference_of(both) == "truth-payload"
    # Of a name that is somebody's, it stays that it is a truth.
    assert [name.startswith("truth") for name in copied.nav] == [True, False, True]
    assert "truth-Jonas" not in copied.nav
