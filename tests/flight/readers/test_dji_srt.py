"""DJI subtitles: each family as its aircraft writes it, clocks with and without a zone, damage."""

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from tests.flight.readers.tracks import Reader, check, columns_of, near

dji_srt = Reader("dji-srt")

#: Sample -> subtitles, rows with a place, first latitude, longitude, height, first stamp (local), satellites.
SAMPLES = {
    "air2s.srt": (17, 17, 41.424724, 2.234156, 117.0, "2022-08-07T13:40:40.774808", None),
    "broken_incomplete.SRT": (19, 19, -34.7383, -58.4563, 20.1, "2017-07-03T10:15:03", 19),
    "matrice_300.srt": (381, 381, 36.6146, -6.1120, 0.3, "2022-06-21T16:06:17", None),
    "mavic_air2.srt": (25, 25, 41.420684, 2.162162, 27.3, "2022-05-01T15:01:58.531716", None),
    "mavic_mini.SRT": (117, 117, 48.0771, -121.7458, 200.7, None, 17),
    "mavic_pro_buggy.SRT": (546, 530, 42.4668, -1.2218, 0.0, "2018-08-19T08:00:36", 11),
    "mix_p4rtk_mavic2pro.srt": (12, 12, -34.650200, -59.409424, 17.39, None, 16),
    "p4_rtk.SRT": (55, 55, -34.237922, -58.851745, 85.80, None, 15),
}


def seconds(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


def subtitles(*bodies: str) -> str:
    stamps = [f"00:00:{k:02d},000 --> 00:00:{k + 1:02d},000" for k in range(len(bodies))]
    return "".join(
        f"{k + 1}\n{t}\n{body}\n\n" for k, (t, body) in enumerate(zip(stamps, bodies, strict=True))
    )


def new(k: int, **other: object) -> str:
    """As aircraft of these years write them."""
    stamp = other.get("stamp", f"2026-06-01 12:00:{k:02d}.123")
    names = other.get("names", ("latitude", "longitude"))
    return (
        f'<font size="28">FrameCnt: {k}, DiffTime: 33ms\n{stamp}\n[iso: 100] [shutter: 1/320.0] '
        f"[{names[0]}: {63.4 + 1e-5 * k:.6f}] [{names[1]}: {10.4:.6f}] "
        f"[rel_alt: {20 + k}.300 abs_alt: {140 + k}.500] [ct: 5500] "
        f"[gb_yaw: 77.4 gb_pitch: -90.0 gb_roll: 0.5] </font>"
    )


@pytest.mark.parametrize("name", SAMPLES)
def test_samples(name, shared_data):
    path = shared_data("logs", "dji_srt", name)
    data = path.read_bytes()
    blocks, places, latitude, longitude, height, stamp, satellites = SAMPLES[name]
    assert dji_srt.sniff(data[:8192])
    for zone, ahead in ((None, 0), ("+02:00", 7200), ("Europe/Madrid", 7200)):
        columns = columns_of(dji_srt, data, zone=zone)
        assert len(columns["use"]) == blocks
        assert np.isfinite(columns["latitude_deg"]).sum() == places
        first = {one: values[0] for one, values in columns.items()}
        near(first, 0, latitude_deg=latitude, longitude_deg=longitude, height_home_m=height)
        if satellites is not None:
            assert first["satellites"] == satellites
        if stamp is None:
            assert name == "mix_p4rtk_mavic2pro.srt" or (columns["use"] == 1).all()
            continue
        near(first, 1e-6, time_log_s=seconds(stamp))
        if zone is None:
            assert np.isnan(columns["time_s"]).all()
            assert first["why"] == "local time without a zone"
        else:
            near(first, 1e-6, time_s=seconds(stamp) - ahead, use=1)


def test_angles_of_the_phantom(shared_data):
    """Every angle as it stands in the text: pitch, roll, yaw."""
    path = shared_data("logs", "dji_srt", "p4_rtk.SRT")
    text = path.read_text("utf-8")
    log = dji_srt.read(path, path.read_bytes())
    for part, word, suffix in (("poses", r"F\.PRY", ""), ("gimbal", r"G\.PRY", "_world")):
        said = re.findall(word + r" \((\S+?)°, (\S+?)°, (\S+?)°\)", text)
        for name, values in zip(("pitch", "roll", "yaw"), zip(*said, strict=True), strict=True):
            np.testing.assert_array_equal(
                log.parts[part].columns[f"{name}{suffix}_deg"], list(map(float, values))
            )
    # It flies to its left, so that it leans to its left.
    columns = log.parts["poses"].columns
    north = np.diff(columns["latitude_deg"][[0, -1]])[0]
    east = np.diff(columns["longitude_deg"][[0, -1]])[0] * np.cos(np.radians(34.2))
    side = np.degrees(np.arctan2(east, north)) - columns["yaw_deg"].mean()
    assert side == pytest.approx(-90, abs=10)
    assert np.median(columns["roll_deg"]) < -10


def test_heights_and_gimbal_of_new_aircraft():
    log, k = dji_srt.read(Path("x.SRT"), subtitles(*map(new, range(5))).encode(), "Europe/Oslo"), np.arange(5)
    check(log)
    gnss, gimbal = log.parts["gnss"].columns, log.parts["gimbal"].columns
    near(gnss, height_home_m=20.3 + k, height_sea_m=140.5 + k)
    near(gnss, 1e-6, time_s=seconds("2026-06-01T10:00:00.123") + k)
    near(gimbal, yaw_world_deg=77.4, pitch_world_deg=-90.0, roll_world_deg=0.5)
    assert "poses" not in log.parts
    assert log.notes == ()
