"""Logs on their way into a flight: real ones, and what is said of their clocks."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from wildlab.flight.card import Wishes, import_card, read_card
from wildlab.flight.raw_files import log_part
from wildlab.flight.readers.log import RawLog, make_stream
from wildlab.flight.recipes import LogTable
from wildlab.flight.store import Flight

Shared = Callable[..., Path]

#: Folder, file -> first stamp (UTC) and duration, s, each to within 2 s, as its description has them.
LOGS = {
    ("copter_2014_joey", "2014-10-18 20-04-24.bin"): ("2014-10-19T01:04:24", 332.5),
    ("cuav2018_sar", "flight.tlog"): ("2018-08-05T00:59:55", 185.0),
    ("px4_quad_clean_short", "test.ulg"): ("2024-02-24T19:51:00", 33.3),
    ("px4_quad_ekf_failure", "ekf_failure.ulg"): ("2025-02-10T13:56:29", 79.6),
    ("target_boat_nmea", "bundg_zeus_9.log"): ("2018-08-20T09:47:37", 147.0),
    ("target_car_rtk_pos", "demo5_b34f_f.pos"): ("2020-12-24T21:28:24", 4520.0),
    ("target_gpx", "around-visnjan-with-car.gpx"): ("2020-12-18T06:15:50", 514.0),
    ("target_gpx", "cerknicko-jezero.gpx"): ("2010-08-05T14:23:59", 7190.0),
    ("target_ubx_m8l", "ublox-neo-m8l.log"): ("2024-01-30T15:31:51", 19.0),
    ("damaged", "nan.log"): ("2014-01-26T15:44:18", 31.4),
    ("dji_airdata_p4rtk", "Jul-7th-2022-11-10AM-Flight-Airdata.csv"): ("2022-07-07T08:10:25", 1064.0),
}


def flight_of(shared: Shared, into: Path, *parts: str, **wishes: object) -> Flight:
    card = read_card([shared("logs", *parts)], Wishes("logged", **wishes), {})
    return import_card(card, into)


@pytest.mark.parametrize("log", LOGS, ids=lambda log: log[1])
def test_a_log_comes_in(shared_data, tmp_path, log):
    begins, lasts = LOGS[log]
    flight = flight_of(shared_data, tmp_path / "flight", *log)
    tables = {**flight.tables, **flight.nav}
    assert "gnss" in tables and ("imu" in tables) == log[1].endswith((".bin", ".tlog", ".ulg", "nan.log"))
    every = np.concatenate([table["time_s"].to_numpy() for table in tables.values()])
    first = flight.manifest.time.epoch.timestamp() + float(every.min())
    assert first == pytest.approx(datetime.fromisoformat(begins).replace(tzinfo=UTC).timestamp(), abs=2.0)
    assert np.ptp(every) == pytest.approx(lasts, abs=max(2.0, 0.03 * lasts))
    for name, table in tables.items():
        assert (np.diff(table["time_s"]) > 0).all(), name


def test_a_log_on_the_bench_keeps_only_true_fixes(shared_data, tmp_path):
    flight = flight_of(shared_data, tmp_path / "flight", "plane42_bench_badgps")
    assert flight.imu is None
    assert len(flight.gnss) == 461 - 376
    # The placeholders lay thousands of kilometres away, up to 17.8 km high.
    assert np.hypot(flight.gnss["north_m"], flight.gnss["east_m"]).max() < 500
    assert np.ptp(flight.gnss["down_m"]) < 200


@pytest.mark.parametrize("name", ["mavic_mini.SRT", "mavic_air2.srt", "p4_rtk.SRT"])
def test_subtitles_come_in(shared_data, tmp_path, name):
    """Their clocks are local or none at all: with what the user states, they are flights."""
    start = datetime(2020, 1, 1, tzinfo=UTC)
    flight = flight_of(shared_data, tmp_path / "flight", "dji_srt", name, zone="UTC", start=start)
    assert flight.gnss is not None
    assert len(flight.gnss) >= 6
    assert flight.manifest.vertical.reference == "take-off"


def test_stamps_of_a_log_without_utc_count_from_what_is_stated():
    stream = make_stream("gnss", {"time_s": [np.nan, np.nan], "time_log_s": [0.5, 2.0]})
    wanted = LogTable(file="a.srt", format="dji-srt", part="gnss", offset_s=1000.0)
    found = log_part(RawLog({"gnss": stream}), wanted, Path("a.srt"))
    assert found.columns["time_s"].tolist() == [1000.5, 1002.0]
