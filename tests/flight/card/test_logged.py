"""Real logs through the whole way in: what their own descriptions say of them comes out."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from wildlab.flight.card.importing import import_card, read_card
from wildlab.flight.card.proposal import Wishes
from wildlab.flight.store import Flight

Shared = Callable[..., Path]

#: Folder, file -> first stamp (UTC) to within 2 s, duration to within 2 s, tables with their least rows.
LOGS = {
    ("copter_2014_joey", "2014-10-18 20-04-24.bin"): (
        "2014-10-19T01:04:24", 332.5, {"imu": 16600, "gnss": 1650, "autopilot": 3300},
    ),
    ("cuav2018_sar", "flight.tlog"): (
        "2018-08-05T00:59:55", 185.0, {"imu": 750, "gnss": 700, "autopilot": 600},
    ),
    ("px4_quad_clean_short", "test.ulg"): (
        "2024-02-24T19:51:00", 33.3, {"imu": 6000, "gnss": 160, "autopilot": 650},
    ),
    ("px4_quad_ekf_failure", "ekf_failure.ulg"): (
        "2025-02-10T13:56:29", 79.6, {"imu": 15800, "gnss": 390, "autopilot": 1580},
    ),
    ("target_boat_nmea", "bundg_zeus_9.log"): ("2018-08-20T09:47:37", 147.0, {"gnss": 130}),
    ("target_car_rtk_pos", "demo5_b34f_f.pos"): ("2020-12-24T21:28:24", 4520.0, {"gnss": 4520}),
    ("target_gpx", "around-visnjan-with-car.gpx"): ("2020-12-18T06:15:50", 514.0, {"gnss": 104}),
    ("target_gpx", "cerknicko-jezero.gpx"): ("2010-08-05T14:23:59", 7190.0, {"gnss": 290}),
    ("target_ubx_m8l", "ublox-neo-m8l.log"): ("2024-01-30T15:31:51", 19.0, {"gnss": 18}),
    ("damaged", "nan.log"): ("2014-01-26T15:44:18", 31.4, {"imu": 700, "gnss": 48}),
    ("dji_airdata_p4rtk", "Jul-7th-2022-11-10AM-Flight-Airdata.csv"): (
        "2022-07-07T08:10:25", 1064.0, {"gnss": 9000, "autopilot": 9000},
    ),
}  # fmt: skip


def flight_of(shared: Shared, into: Path, *parts: str, **wishes: object) -> Flight:
    card = read_card([shared("logs", *parts)], Wishes("logged", **wishes), {})
    return import_card(card, into)


@pytest.mark.parametrize("log", LOGS, ids=lambda log: log[1])
def test_a_log_comes_in(shared_data, tmp_path, log):
    begins, lasts, rows = LOGS[log]
    flight = flight_of(shared_data, tmp_path / "flight", *log)
    tables = {**flight.tables, **flight.nav}
    for name, least in rows.items():
        assert len(tables[name]) >= least, name
    epoch = flight.manifest.time.epoch
    every = np.concatenate([table["time_s"].to_numpy() for table in tables.values()])
    first = epoch.timestamp() + float(every.min())
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


@pytest.mark.parametrize(
    "name",
    [
        *("p4_rtk.SRT", "matrice_300.srt", "mavic_pro_buggy.SRT", "mavic_mini.SRT", "air2s.srt"),
        *("mavic_air2.srt", "mix_p4rtk_mavic2pro.srt", "broken_incomplete.SRT"),
    ],
)
def test_subtitles_come_in(shared_data, tmp_path, name):
    """Their clocks are local or none at all: with what the user states, they are flights."""
    start = datetime(2020, 1, 1, tzinfo=UTC)
    flight = flight_of(shared_data, tmp_path / "flight", "dji_srt", name, zone="UTC", start=start)
    assert flight.gnss is not None
    assert len(flight.gnss) >= 6
    assert flight.manifest.vertical.reference == "take-off"
