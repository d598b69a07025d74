"""AirData tables: values as pandas has them, fractions of seconds, pauses, units, damage."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.flight.readers.tracks import Reader, check, columns_of, near

airdata = Reader("airdata")

START = datetime(2026, 6, 1, 10, tzinfo=UTC)
METRIC = (
    *("time(millisecond)", "datetime(utc)", "latitude", "longitude", "height_above_takeoff(meters)"),
    *("altitude_above_seaLevel(meters)", "satellites", " xSpeed(m/s)", " ySpeed(m/s)", " zSpeed(m/s)"),
    *(" compass_heading(degrees)", " pitch(degrees)", " roll(degrees)", "isPhoto", "gimbal_heading(degrees)"),
    *("gimbal_pitch(degrees)", "message"),
)


def rows(count: int = 300, begin: float = 0.37, pause: float = 0.0) -> list[dict[str, object]]:
    """10 Hz; UTC of a row is START + begin + its counter, and `pause` more from the middle on."""
    made = []
    for k in range(count):
        at = START + timedelta(seconds=begin + 0.1 * k + pause * (k >= count // 2))
        cells = (
            *(100 * k, f"{at:%Y-%m-%d %H:%M:%S}", f"{63.4 + 1e-6 * k:.7f}", f"{10.4 - 1e-6 * k:.7f}"),
            *(30.5, 120.25, 17, 3.0, -4.0, 0.5, 350.0, " -1.5", " 2.5", int(k % 50 in (10, 11)), k % 360),
            *(-89.5, '"<b>=1+1</b>, hello"' if k == 7 else ""),
        )
        made.append(dict(zip(METRIC, cells, strict=True)))
    return made


def table(made: list[dict[str, object]], names: tuple[str, ...] = METRIC) -> str:
    lines = [",".join(names), *(",".join(str(row[name]) for name in names) for row in made)]
    return "\n".join(lines) + "\n"


def test_equals_pandas(shared_data):
    path = shared_data("logs", "dji_airdata_p4rtk", "Jul-7th-2022-11-10AM-Flight-Airdata.csv")
    data = path.read_bytes()
    assert airdata.sniff(data[:8192])
    log = airdata.read(path, data)
    check(log)
    table = pd.read_csv(path, skipinitialspace=True)
    table.columns = table.columns.str.strip()
    assert set(log.parts) == {"gnss", "poses", "gimbal"}

    def same(part: str, **columns: str) -> None:
        near(log.parts[part].columns, 0, **{ours: table[theirs] for ours, theirs in columns.items()})

    same("gnss", latitude_deg="latitude", longitude_deg="longitude", satellites="satellites",
         height_home_m="height_above_takeoff(meters)")  # fmt: skip
    same("poses", height_sea_m="altitude_above_seaLevel(meters)", v_north_m_s="xSpeed(m/s)",
         v_east_m_s="ySpeed(m/s)", v_down_m_s="zSpeed(m/s)", roll_deg="roll(degrees)",
         pitch_deg="pitch(degrees)", yaw_deg="compass_heading(degrees)")  # fmt: skip
    same("gimbal", pitch_world_deg="gimbal_pitch(degrees)", yaw_world_deg="gimbal_heading(degrees)")
    stamps = pd.to_datetime(table["datetime(utc)"], utc=True)
    whole = (stamps - pd.Timestamp(0, tz="UTC")).dt.total_seconds().to_numpy()
    # A whole second was cut from each, but for the jitter of the rows.
    cut = log.parts["gnss"].columns["time_s"] - whole
    assert ((cut > -0.25) & (cut < 1.25)).all()
    assert log.parts["gnss"].used.all()


@pytest.mark.parametrize("begin", [0.0, 0.37, 0.95])
@pytest.mark.parametrize("pause", [0.0, 73.9])
def test_fraction_of_a_second(begin, pause):
    log = airdata.read(Path("x.csv"), table(rows(600, begin, pause)).encode())
    check(log)
    expected = START.timestamp() + begin + 0.1 * np.arange(600) + pause * (np.arange(600) >= 300)
    # Rows are 0.1 s apart, so that a second begins up to 0.05 s from the middle between two.
    near(log.parts["gnss"].columns, 0.06, time_s=expected)
    assert any("73" in one for one in log.notes) == (pause > 0)


def test_feet_and_miles_renamed_and_reordered():
    text = table(rows(), tuple(sorted(METRIC)))
    for old, new in (
        ("height_above_takeoff(meters)", "Height_Above_Takeoff (feet)"),
        ("altitude_above_seaLevel(meters)", "altitude_above_seaLevel(feet)"),
        ("Speed(m/s)", "Speed(mph)"),
    ):
        text = text.replace(old, new)
    columns = columns_of(airdata, text, "poses")
    near(columns, height_home_m=30.5 * 0.3048, height_sea_m=120.25 * 0.3048, v_east_m_s=-4.0 * 0.44704)
