"""What messages of ArduPilot mean in three generations of names, against the flight they were made from."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.flight.readers.dataflash_logs import (
    HEIGHT,
    HOME,
    LATITUDE,
    LONGITUDE,
    Log,
    Truth,
    first_generation,
    second_generation,
    third_generation,
)
from tests.flight.readers.tracks import near
from wildlab.flight.readers.ardupilot import binary as dataflash
from wildlab.flight.readers.ardupilot import text as dataflash_text
from wildlab.flight.readers.logs.formats import read_log
from wildlab.flight.readers.logs.log import RawLog, Stream
from wildlab.flight.readers.logs.order import in_order, leaps

ALL = pytest.mark.parametrize("make", [first_generation, second_generation, third_generation])
FORMS = pytest.mark.parametrize("text", [False, True])


def read(log: Log, text: bool = False) -> RawLog:
    if text:
        return dataflash_text.read(Path("x.log"), log.text())
    return dataflash.read(Path("x.bin"), log.binary())


def whys(part: Stream) -> dict[str, int]:
    names, counts = np.unique(part.columns["why"].astype(str), return_counts=True)
    return dict(zip(names.tolist(), counts.tolist(), strict=True))


@ALL
@FORMS
@pytest.mark.parametrize("year", [2014, 2025])
def test_a_flight_comes_back(make, text, year):
    truth = Truth(year)
    log = read(make(truth), text)
    assert log.lost == ()
    assert log.clock is not None and log.clock.base == "GPS weeks"
    for name, part in log.parts.items():
        used = part.used
        stamp = part.columns["time_log_s"][used]
        # Weeks and their milliseconds became UTC by the leap seconds of the year.
        np.testing.assert_allclose(part.columns["time_s"][used], truth.utc(stamp), atol=2e-3, err_msg=name)
        assert used.sum() > 5
        if name in ("poses", "gnss") or (name == "triggers" and make is not first_generation):
            np.testing.assert_allclose(part.columns["latitude_deg"][used], truth.latitude(stamp), atol=2e-7)
            np.testing.assert_allclose(part.columns["longitude_deg"][used], truth.longitude(stamp), atol=2e-7)
        if "height_sea_m" in part.columns:
            np.testing.assert_allclose(part.columns["height_sea_m"][used], truth.height(stamp), atol=0.011)
        if "height_home_m" in part.columns:
            above = truth.height(stamp) - HOME
            np.testing.assert_allclose(part.columns["height_home_m"][used], above, atol=0.011)
    poses = log.parts["poses"]
    stamp = poses.columns["time_log_s"]
    attitude = np.array([truth.attitude(one) for one in stamp])
    for i, name in enumerate(("roll_deg", "pitch_deg", "yaw_deg")):
        np.testing.assert_allclose(poses.columns[name], attitude[:, i], atol=0.006)
    imu = log.parts["imu"].columns
    for axis, force, turn in zip("xyz", (0.1, 0.2, -9.8), (0.01, 0.02, 0.03), strict=True):
        used = log.parts["imu"].used
        np.testing.assert_allclose(imu[f"f_{axis}_m_s2"][used], force, rtol=1e-6)
        np.testing.assert_allclose(imu[f"w_{axis}_rad_s"][used], turn, rtol=1e-6)
    gnss = log.parts["gnss"].columns
    for name, value in (("v_north_m_s", 9.9), ("v_east_m_s", -9.9), ("v_down_m_s", -0.5)):
        np.testing.assert_allclose(gnss[name], value, atol=1e-3)
        if name in poses.columns:
            np.testing.assert_allclose(poses.columns[name], value, rtol=1e-6)


@ALL
def test_what_each_generation_calls_itself(make):
    said = {
        first_generation: "ArduCopter V3.1.3 (92cdd2a3)",
        second_generation: "ArduPlane V3.8.2-dev (8178ab40)",
        third_generation: "ArduPlane V4.2.3 (55685c43)",
    }
    assert read(make(Truth(2025))).vehicle == said[make]


@pytest.mark.parametrize("make", [first_generation, third_generation])
def test_units_of_the_compass(make):
    """200 milligauss are 20 microtesla, said or not."""
    columns = read(make(Truth(2025))).parts["magnetometer"].columns
    for axis, value in zip("xyz", (20.0, -10.0, 40.0), strict=True):
        np.testing.assert_allclose(columns[f"field_{axis}_ut"], value)


@pytest.mark.parametrize("rate", [0.9, 0.9998, 1.0, 1.001, 1.1])
def test_the_rate_of_the_clock(rate):
    truth = Truth(2025, rate)
    clock = read(second_generation(truth, 60.0)).clock
    assert clock.rate == pytest.approx(rate, abs=1e-4)
    assert clock.offset_s + clock.rate * 50 == pytest.approx(float(truth.utc(50.0)), abs=2e-3)
    assert clock.pairs == 300 and clock.largest_s < 2e-3


def test_a_short_log_cannot_tell_the_rate(shared_data):
    path = shared_data("logs", "damaged", "pymavlink_test.BIN")
    clock = read_log(path, path.read_bytes(), "dataflash").clock
    assert clock is not None and clock.rate == 1.0 and clock.pairs == 5


def test_early_rows_are_dated_by_the_first_true_fix():
    """No fix for 10 s, with week 0 and a place elsewhere; receiver 2 is the one that finds itself."""
    truth = Truth(2025)
    log = read(third_generation(truth))
    gnss = log.parts["gnss"]
    assert whys(gnss) == {"": 150, "no fix": 50}
    near(gnss.columns, 0.002, time_s=truth.utc(gnss.columns["time_log_s"]))
    poses = log.parts["poses"]
    assert whys(poses) == {"": 300, "no position at that time": 100}
    assert poses.columns["time_s"][0] == pytest.approx(float(truth.utc(20.0)), abs=2e-3)
    np.testing.assert_allclose(gnss.columns["sd_horizontal_m"][gnss.used], 1.5)
    # What the receiver could not say, 655.35 m, is not known.
    assert np.isnan(gnss.columns["sd_vertical_m"][~gnss.used]).all()
    near(gnss.columns, undulation_m=48.5)


def test_gimbal_and_images():
    log = read(third_generation(Truth(2025)))
    gimbal, triggers = log.parts["gimbal"].columns, log.parts["triggers"].columns
    assert (gimbal["pitch_world_deg"][0], gimbal["yaw_world_deg"][0], gimbal["pan_deg"][0]) == (-60, 110, 20)
    assert triggers["number"].tolist() == list(range(1, 9))
    near(triggers, yaw_deg=[90 + 2.5 * i for i in range(8)])
    # Images of the first generation know GPS time alone, and not what their heights count from.
    old = read(first_generation(Truth(2014)))
    triggers = old.parts["triggers"].columns
    near(triggers, 0.1, time_log_s=[20.0 + 5 * i for i in range(8)])
    assert "height_sea_m" not in triggers


def test_images_before_the_first_fix_were_taken():
    triggers = read(change(second_generation(Truth(2025)), "TRIG", 0, Lat=0, Lng=0)).parts["triggers"]
    assert triggers.used.all() and np.isnan(triggers.columns["latitude_deg"]).tolist() == [True] + 7 * [False]


def test_a_vertical_velocity_that_the_receiver_does_not_have():
    gnss = read(change(second_generation(Truth(2025)), "GPA", 100, VV=0)).parts["gnss"]
    assert np.flatnonzero(np.isnan(gnss.columns["v_down_m_s"])).tolist() == [100] and gnss.used.all()


def test_quaternions_where_there_is_no_attitude():
    truth = Truth(2025)
    log = read(third_generation(truth, attitude=False))
    columns = log.parts["poses"].columns
    yaw = np.degrees(2 * np.arctan2(columns["q_z"], columns["q_w"])) % 360
    np.testing.assert_allclose(yaw, [truth.attitude(one)[2] for one in columns["time_log_s"]], atol=1e-3)


def test_without_an_origin_positions_are_those_of_the_receiver():
    poses = read(second_generation(Truth(2025), origin=False)).parts["poses"]
    stamp = poses.columns["time_log_s"][poses.used]
    np.testing.assert_allclose(
        poses.columns["latitude_deg"][poses.used], Truth(2025).latitude(stamp), atol=2e-7
    )


def drop(log: Log, *names: str) -> Log:
    log.messages = [one for one in log.messages if one[0] not in names]
    return log


def test_what_a_log_does_not_have():
    log = read(drop(second_generation(Truth(2025)), "IMU", "IMU2"))
    assert "imu" not in log.parts
    log = read(drop(second_generation(Truth(2025)), "GPS"))
    assert log.clock is not None and log.clock.base == "" and "gnss" not in log.parts
    assert np.isnan(log.parts["poses"].columns["time_s"]).all() and log.parts["poses"].used.all()
    log = read(drop(second_generation(Truth(2025)), "GPS", "NKF1"))
    assert whys(log.parts["poses"]) == {"no position at that time": 400}
    log = read(drop(second_generation(Truth(2025)), "ATT", "IMU"))
    assert "poses" not in log.parts and (log.parts["imu"].columns["f_x_m_s2"] == 9).all()


def rename(log: Log, name: str, **fields: str) -> Log:
    kind, characters, columns = log.kinds[name]
    log.kinds[name] = (kind, characters, ",".join(fields.get(one, one) for one in columns.split(",")))
    return log


def test_fields_that_are_missing_cost_what_they_say_and_no_more():
    truth = Truth(2025)
    log = read(rename(second_generation(truth), "GPS", GMS="G1", GWk="G2"))
    assert log.clock is not None and log.clock.base == "" and log.parts["gnss"].used.all()
    log = read(rename(second_generation(truth), "GPS", Spd="S", HDop="H", NSats="N"))
    assert {"v_north_m_s", "hdop", "satellites"}.isdisjoint(log.parts["gnss"].columns)
    assert log.parts["gnss"].used.all()
    log = read(rename(second_generation(truth), "GPS", Status="S"))
    assert whys(log.parts["gnss"]) == {"no fix": 200}
    log = read(rename(second_generation(truth), "GPS", Alt="A"))
    assert whys(log.parts["gnss"]) == {"no height": 200}
    log = read(rename(second_generation(truth), "ATT", Yaw="Y"))
    # Without a yaw messages ATT are no attitude, and this log has no other.
    assert "poses" not in log.parts


def change(log: Log, name: str, which: int, **values: float) -> Log:
    columns = log.kinds[name][2].split(",")
    at = [i for i, one in enumerate(log.messages) if one[0] == name][which]
    old = dict(zip(columns, log.messages[at][1], strict=True))
    log.messages[at] = (name, tuple((old | values).values()))
    return log


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"Status": 1}, "no fix"),
        ({"Status": 2}, "a fix without height"),
        ({"Lat": 0, "Lng": 0}, "no position"),
        ({"Lat": 91.0}, "no position"),
        ({"GWk": 0}, "no GPS week"),
        ({"HDop": 99.99}, "no dilution of precision"),
        ({"Spd": 800.0}, "an impossible speed"),
        ({"Spd": float("inf")}, "an impossible speed"),
        ({"Alt": 1e6}, "an impossible height"),
        ({"Lat": LATITUDE + 1}, "a place out of reach"),
        ({"Alt": HEIGHT + 45_000}, "a place out of reach"),
        ({"TimeUS": 1_000_000}, "a stamp out of order"),
        ({"TimeUS": 2**60}, "a stamp out of order"),
    ],
)
def test_rows_that_cannot_be_true_are_marked(values, why):
    gnss = read(change(second_generation(Truth(2025)), "GPS", 100, **values)).parts["gnss"]
    assert whys(gnss) == {"": 199, why: 1}
    assert gnss.columns["why"][100] == why


def test_a_stamp_that_repeats_is_marked():
    log = second_generation(Truth(2025))
    poses = read(change(log, "ATT", 50, TimeUS=round(24.9e6))).parts["poses"]
    assert poses.columns["why"][50] == "a repeated stamp" and poses.used.sum() == 399


def test_one_wrong_week_does_not_move_the_clock():
    truth = Truth(2025)
    for week in (1, 2348, 65535):
        clock = read(change(second_generation(truth), "GPS", 30, GWk=week)).clock
        assert clock.offset_s + 20 * clock.rate == pytest.approx(float(truth.utc(20.0)), abs=2e-3)


def test_no_position_across_a_gap():
    log = second_generation(Truth(2025))
    log.messages = [
        one for one in log.messages if one[0] not in ("NKF1", "GPS") or not 30e6 < one[1][0] < 35e6
    ]
    poses = read(log).parts["poses"]
    assert whys(poses) == {"": 351, "no position at that time": 49}
    inside = (poses.columns["time_log_s"] > 30.01) & (poses.columns["time_log_s"] < 34.99)
    assert not poses.used[inside].any() and poses.used[~inside].all()


def test_positions_across_the_date_line():
    log = second_generation(Truth(2025))
    at = log.kinds["GPS"][2].split(",").index("Lng")
    for i, (name, values) in enumerate(log.messages):
        if name == "GPS":
            turned = (values[at] - LONGITUDE + 180.002 + 180) % 360 - 180
            log.messages[i] = (name, (*values[:at], turned, *values[at + 1 :]))
    poses = read(drop(log, "NKF1")).parts["poses"]
    off = (poses.columns["longitude_deg"][poses.used] - 180 + 180) % 360 - 180
    assert (np.abs(off) < 0.003).all()


def test_a_board_that_was_switched_on_again():
    first, second = second_generation(Truth(2025), 20.0), second_generation(Truth(2025, boot_s=5.0), 60.0)
    first.messages += second.messages
    log = read(first)
    poses = log.parts["poses"]
    # The last message of the time before stands behind that time's last stamp that was looked at.
    assert poses.used.sum() == 600 and len(poses) <= 601
    assert poses.columns["time_log_s"][poses.used][0] == 5.0
    assert len(log.lost) == 1
    assert log.clock is not None and log.clock.largest_s < 2e-3


def test_text_with_holes():
    lines = second_generation(Truth(2025)).text().decode().split("\n")
    imu = [i for i, line in enumerate(lines) if line.startswith("IMU,")]
    lines[imu[10]] = lines[imu[10]].replace("0.01", "NaN")
    lines[imu[11]] = lines[imu[11]].replace(",", "", 2)
    lines[imu[12]] = lines[imu[12]] + ", 1, 2"
    lines[imu[13]] = lines[imu[13]].replace("0.02", "zero")
    lines[imu[14]] = "XYZ, 1, 2, 3"
    lines[imu[15]] = "something else"
    log = dataflash_text.read(Path("x.log"), "\n".join(lines).encode())
    assert [int(one.split()[0]) for one in log.lost] == [1, 1, 2]
    part = log.parts["imu"]
    assert whys(part) == {"": 394, "no value": 2}
    assert part.counted_in == "line" and part.rows[0] == imu[0] + 1


def test_texts_keep_their_commas():
    log = second_generation(Truth(2025), 2.0)
    log.messages[0] = ("MSG", (0, "Hello, this is ArduPlane V4.5.0 (abcdef01)"))
    assert read(log, text=True).vehicle == "ArduPlane V4.5.0 (abcdef01)"


def test_order():
    assert in_order([]).tolist() == []
    assert in_order([np.nan, 1.0]).tolist() == [False, True]
    rng = np.random.default_rng(3)
    stamps = np.arange(500.0)
    wrong = rng.choice(500, 40, replace=False)
    stamps[wrong] += rng.uniform(-1e6, 1e6, 40)
    kept = in_order(stamps)
    assert (np.diff(stamps[kept]) > 0).all() and kept.sum() >= 460
    assert leaps([1, 2], [0, 90], [0, 0], [0, 0]).tolist() == [False, False]
    t = np.arange(50.0)
    height = np.full(50, np.nan)
    longitude = (179.99 + 0.001 * t + 180) % 360 - 180
    assert not leaps(t, np.full(50, 60.0), longitude, height).any()


def test_a_log_with_a_bad_receiver(shared_data):
    path = shared_data("logs", "plane42_bench_badgps", "pilot_0004.BIN")
    log = read_log(path, path.read_bytes(), "dataflash")
    assert whys(log.parts["gnss"]) == {"": 85, "no fix": 376}
    # Its rows without a fix carry the receiver's own time from 19.4 s on: GPS week 2347, 481474 s.
    gnss = log.parts["gnss"].columns
    row = int(np.argmin(np.abs(gnss["time_log_s"] - 19.377493)))
    utc = datetime(1980, 1, 6, tzinfo=UTC).timestamp() + 2347 * 604800 + 481474.0 - 18
    # 17 s of true fixes do not tell the rate of this clock, 1.0013: it is off by 0.1 s 69 s before them.
    assert gnss["time_s"][row] == pytest.approx(utc, abs=0.15)


def test_leap_seconds_of_2014(shared_data):
    path = shared_data("logs", "copter_2014_joey", "2014-10-18 20-04-24.bin")
    log = read_log(path, path.read_bytes(), "dataflash")
    gps = datetime(1980, 1, 6, tzinfo=UTC).timestamp() + 1815 * 604800 + 3880.6
    assert log.parts["gnss"].columns["time_s"][0] == gps - 16
    # Fixes of before the log began were written down late, at its start: time is their own.
    late = log.parts["gnss"].columns["time_log_s"][0] * log.clock.rate + log.clock.offset_s - (gps - 16)
    assert 1.0 < late < 1.5
    assert {name: len(part) for name, part in log.parts.items()} == {
        "gnss": 1664,
        "poses": 3326,
        "imu": 16627,
    }


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, 30), max_size=25))
def test_no_more_rows_can_be_kept(stamps):
    kept = in_order(np.array(stamps, float))
    left = np.array(stamps)[kept]
    assert (np.diff(left) > 0).all()
    # The longest increasing subsequence, the slow way.
    longest: list[int] = []
    for i, one in enumerate(stamps):
        longest.append(1 + max((longest[j] for j in range(i) if stamps[j] < one), default=0))
    assert kept.sum() == max(longest, default=0)
