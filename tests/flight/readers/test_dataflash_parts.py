"""What messages of ArduPilot mean in three generations of names, against the flight they were made from."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.flight.readers.dataflash_logs import (
    HOME,
    LONGITUDE,
    Log,
    Truth,
    first_generation,
    second_generation,
    third_generation,
)
from tests.flight.readers.tracks import Columns, Reader, near
from wildlab.flight.readers import read_log
from wildlab.flight.readers.log import RawLog, Stream, in_order

dataflash, dataflash_text = Reader("dataflash"), Reader("dataflash-text")

SAID = {
    first_generation: "ArduCopter V3.1.3 (92cdd2a3)",
    second_generation: "ArduPlane V3.8.2-dev (8178ab40)",
    third_generation: "ArduPlane V4.2.3 (55685c43)",
}
TRUTH = Truth(2025)
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC).timestamp()


def second(seconds: float = 40.0) -> Log:
    return second_generation(TRUTH, seconds)


def place_near(columns: Columns, truth: Truth, stamp: Any) -> None:
    latitude, longitude, _ = truth.place(stamp)
    near(columns, 2e-7, latitude_deg=latitude, longitude_deg=longitude)


def read(log: Log, text: bool = False) -> RawLog:
    if text:
        return dataflash_text.read(Path("x.log"), log.text())
    return dataflash.read(Path("x.bin"), log.binary())


def whys(part: Stream) -> dict[str, int]:
    names, counts = np.unique(part.columns["why"].astype(str), return_counts=True)
    return dict(zip(names.tolist(), counts.tolist(), strict=True))


@pytest.mark.parametrize("make", SAID)
@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("year", [2014, 2025])
def test_a_flight_comes_back(make, text, year):
    truth = Truth(year)
    log = read(make(truth), text)
    assert (log.lost, log.vehicle, log.clock) == ((), SAID[make], "GPS weeks")
    for name, part in log.parts.items():
        columns = {one: values[part.used] for one, values in part.columns.items()}
        stamp = columns["time_log_s"]
        assert len(stamp) > 5
        # Weeks and their milliseconds became UTC by the leap seconds of the year.
        near(columns, 2e-3, time_s=truth.utc(stamp))
        if name in ("poses", "gnss") or (name == "triggers" and make is not first_generation):
            place_near(columns, truth, stamp)
        for height, counts_from in (("height_sea_m", 0), ("height_home_m", HOME)):
            if height in columns:
                near(columns, 0.011, **{height: truth.place(stamp)[2] - counts_from})
        if name == "poses":
            near(
                columns,
                0.006,
                **dict(zip(("roll_deg", "pitch_deg", "yaw_deg"), truth.attitude(stamp), strict=True)),
            )
        if name == "imu":
            near(columns, 1e-6, f_x_m_s2=0.1, f_y_m_s2=0.2, f_z_m_s2=-9.8)
            near(columns, 1e-8, w_x_rad_s=0.01, w_y_rad_s=0.02, w_z_rad_s=0.03)
        if name == "gnss" or "v_north_m_s" in columns:
            near(columns, 1e-3, v_north_m_s=9.9, v_east_m_s=-9.9, v_down_m_s=-0.5)
        if name == "magnetometer":
            # 200 milligauss are 20 microtesla.
            near(columns, field_x_ut=20.0, field_y_ut=-10.0, field_z_ut=40.0)


@pytest.mark.parametrize("rate", [0.9, 0.9998, 1.0, 1.001, 1.1])
def test_the_rate_of_the_clock(rate):
    truth = Truth(2025, rate)
    poses = read(second_generation(truth, 60.0)).parts["poses"].columns
    near(poses, 2e-3, time_s=truth.utc(poses["time_log_s"]))


def real(shared_data: Callable[..., Path], *parts: str) -> RawLog:
    path = shared_data("logs", *parts)
    return read_log(path, path.read_bytes(), "dataflash")


def test_a_short_log_cannot_tell_the_rate(shared_data):
    columns = real(shared_data, "damaged", "pymavlink_test.BIN").parts["poses"].columns
    assert np.ptp(columns["time_s"] - columns["time_log_s"]) < 1e-6


def test_gimbal_and_images():
    log = read(third_generation(TRUTH))
    k = np.arange(8)
    near(log.parts["gimbal"].columns, pitch_world_deg=-60, yaw_world_deg=110, pan_deg=20)
    near(log.parts["triggers"].columns, number=k + 1, yaw_deg=90 + 2.5 * k)
    # Images of the first generation know GPS time alone, and not what their heights count from.
    triggers = read(first_generation(Truth(2014))).parts["triggers"].columns
    near(triggers, 0.1, time_log_s=20.0 + 5 * k)
    assert "height_sea_m" not in triggers


def drop(log: Log, *names: str) -> Log:
    log.messages = [one for one in log.messages if one[0] not in names]
    return log


def change(log: Log, name: str, which: int, **values: float) -> Log:
    columns = log.kinds[name][2].split(",")
    at = [i for i, one in enumerate(log.messages) if one[0] == name][which]
    old = dict(zip(columns, log.messages[at][1], strict=True))
    log.messages[at] = (name, tuple((old | values).values()))
    return log


@pytest.mark.parametrize("week", [1, 2348, 65535])
def test_one_wrong_week_does_not_move_the_clock(week):
    poses = read(change(second(), "GPS", 30, GWk=week)).parts["poses"].columns
    near(poses, 2e-3, time_s=TRUTH.utc(poses["time_log_s"]))


def test_no_position_across_a_gap():
    log = second()
    log.messages = [
        one for one in log.messages if one[0] not in ("POS", "GPS") or not 30e6 < one[1][0] < 35e6
    ]
    poses = read(log).parts["poses"]
    assert whys(poses) == {"": 351, "no position": 49}
    inside = (poses.columns["time_log_s"] > 30.01) & (poses.columns["time_log_s"] < 34.99)
    assert not poses.used[inside].any() and poses.used[~inside].all()


def test_positions_across_the_date_line():
    log = drop(second(), "POS")
    for which, values in enumerate([values for name, values in log.messages if name == "GPS"]):
        turned = (values[7] - LONGITUDE + 180.002 + 180) % 360 - 180
        change(log, "GPS", which, Lng=turned)
    poses = read(log).parts["poses"]
    off = (poses.columns["longitude_deg"][poses.used] - 180 + 180) % 360 - 180
    assert (np.abs(off) < 0.003).all()


def test_a_board_that_was_switched_on_again():
    first = second(seconds=20.0)
    first.messages += second_generation(Truth(2025, boot_s=5.0), 60.0).messages
    log = read(first)
    poses = log.parts["poses"]
    # The last message of the time before stands behind that time's last stamp that was looked at.
    assert poses.used.sum() == 600 and len(poses) <= 601
    assert poses.columns["time_log_s"][poses.used][0] == 5.0
    assert len(log.lost) == 1
    assert (np.diff(poses.columns["time_s"][poses.used]) > 0).all()


def test_a_stamp_that_is_none_is_left_out():
    assert in_order([np.nan, 1.0]).tolist() == [False, True]


def test_a_log_with_a_bad_receiver(shared_data):
    gnss = real(shared_data, "plane42_bench_badgps", "pilot_0004.BIN").parts["gnss"]
    assert whys(gnss) == {"": 85, "no fix": 376}
    # Its rows without a fix carry the receiver's own time from 19.4 s on: GPS week 2347, 481474 s.
    row = int(np.argmin(np.abs(gnss.columns["time_log_s"] - 19.377493)))
    # 17 s of true fixes do not tell the rate of this clock, 1.0013: it is off by 0.1 s 69 s before them.
    assert gnss.columns["time_s"][row] == pytest.approx(GPS_EPOCH + 2347 * 604800 + 481474.0 - 18, abs=0.15)


def test_leap_seconds_of_2014(shared_data):
    log = real(shared_data, "copter_2014_joey", "2014-10-18 20-04-24.bin")
    first, stamp = (log.parts["gnss"].columns[name][0] for name in ("time_s", "time_log_s"))
    assert first == GPS_EPOCH + 1815 * 604800 + 3880.6 - 16
    # Fixes of before the log began were written down late, at its start: time is their own.
    imu = log.parts["imu"].columns
    assert 1.0 < stamp + np.median(imu["time_s"] - imu["time_log_s"]) - first < 1.5
    assert [(name, len(part)) for name, part in log.parts.items()] == [
        ("gnss", 1664), ("poses", 3326), ("imu", 16627),
    ]  # fmt: skip
