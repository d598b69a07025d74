"""What holds nothing is refused, others are not taken for it, damage costs little, and nothing takes long."""

import time
from pathlib import Path

import pytest

from tests.flight.readers import test_airdata as of_airdata
from tests.flight.readers import test_clicks as of_clicks
from tests.flight.readers import test_gpx as of_gpx
from tests.flight.readers import test_marks as of_marks
from tests.flight.readers import test_nmea as of_nmea
from tests.flight.readers import test_rtklib_pos as of_pos
from tests.flight.readers.dataflash_logs import Truth, first_generation, second_generation, third_generation
from tests.flight.readers.mavlink_logs import START_S, frame, joined, made, telemetry, ulog
from tests.flight.readers.test_dji_mrk import row
from tests.flight.readers.test_dji_srt import new, subtitles
from tests.flight.readers.test_ubx import message, pvt
from tests.flight.readers.test_ulog import flight
from tests.flight.readers.tracks import Reader, check, survives
from wildlab.errors import WildlabError
from wildlab.flight.readers.log import CUT_OFF

gpx, nmea, ubx, airdata = (Reader(one) for one in ("gpx", "nmea", "ubx", "airdata"))
mrk, srt, rtklib_pos = (Reader(one) for one in ("dji-mrk", "dji-srt", "rtklib-pos"))
px4, tlog, dataflash, dataflash_text = (
    Reader(one) for one in ("ulog", "tlog", "dataflash", "dataflash-text")
)
clicks = Reader("clicks")

GENERATIONS = (first_generation, second_generation, third_generation)
AIRDATA = of_airdata.table(of_airdata.rows(120))


@pytest.mark.parametrize(
    ("reader", "data", "words"),
    [
        (ubx, message("NAV-DOP", iTOW=5), "none with a position"),
        (ubx, b"", "none with a position"),
        (nmea, of_nmea.said("GPHDT,12.0,T"), "1 sentence"),
        (mrk, "hello", "1 line"),
        (srt, "hello", "0 subtitles"),
        (srt, subtitles("hello", "GPS(n/a, n/a, 0)"), "2 subtitles"),
        (gpx, '<gpx version="1.1"><wpt lat="1" lon="2"/></gpx>', "no point"),
        (gpx, '<gpx version="1.1"><trk><trkseg><trkpt lat="1" lon="2">', "1 are broken"),
        (
            gpx,
            of_gpx.document(of_gpx.point(0, inside="<a>" * 100000 + "</a>" * 100000)),
            "has no point of a track",
        ),
        (rtklib_pos, "%  GPST latitude(deg) longitude(deg) height(m)\nhello\n1,2\n", "no position; 2 lines"),
        (airdata, "time(millisecond),longitude\n1,2\n", "column 'latitude'"),
        (airdata, of_airdata.table([]), "no row"),
        (airdata, AIRDATA.replace("takeoff(meters)", "takeoff(cubits)"), "unit 'cubits'"),
    ],
)
def test_what_holds_nothing_is_refused(reader, data, words):
    with pytest.raises(WildlabError, match=words):
        reader.read(Path("x"), data.encode() if isinstance(data, str) else data)


@pytest.mark.parametrize(
    ("reader", "data", "share"),
    [
        (ubx, b"".join(map(pvt, range(30))), 0.89),
        (nmea, of_nmea.track(of_nmea.datetime(2020, 1, 1, tzinfo=of_nmea.UTC), 40), 0.89),
        (mrk, "".join(map(row, range(1, 30))).encode(), 0.89),
        (srt, subtitles(*map(new, range(30))).encode(), 0.89),
        (gpx, of_gpx.document(of_gpx.track(40)), 0.64),
        (rtklib_pos, of_pos.WAYS["calendar GPST"].encode(), 0.89),
        (airdata, AIRDATA.encode(), 0.83),
        (px4, ulog(flight(), {"sys_name": "PX4"}), 0.65),
        (tlog, joined(telemetry(60), [(START_S, frame(made("SYSTEM_TIME", time_boot_ms=5), START_S))]), 0.8),
        *((dataflash, make(Truth(2025), 4.0).binary(), 0.5) for make in GENERATIONS),
        *((dataflash_text, make(Truth(2025), 2.0).text(), 0.5) for make in GENERATIONS),
        # XML and JSON are read whole or not at all.
        (of_marks.marks_kml, of_marks.kml(of_marks.POINTS * 5), -1),
        (of_marks.marks_geojson, of_marks.geojson(of_marks.POINTS * 5), -1),
        (of_marks.marks_csv, of_marks.table(of_marks.POINTS * 5, "name,lat,lon,height_sea"), 0.5),
        *((clicks, data, -1) for data in (of_clicks.COCO, of_clicks.CVAT, of_clicks.MEGADETECTOR)),
        (clicks, b"image,u,v\n" + b"a,1,2\n" * 9, 0.5),
    ],
)
def test_damage(reader, data, share):
    assert survives(reader.read, data) > share
    if reader is srt:
        assert survives(lambda path, data, zone: srt.read(path, data, "UTC"), data) > share


@pytest.mark.parametrize(
    ("reader", "data"),
    [(px4, ulog(flight(), {"sys_name": "PX4"})), (dataflash, third_generation(Truth(2025), 8.0).binary())],
)
def test_a_log_that_was_cut_off_is_called_so(reader, data):
    def cut_off(read: bytes) -> bool:
        return CUT_OFF in reader.read(Path("x"), read).notes

    assert not cut_off(data)
    # Here and there a cut falls between two messages.
    cuts = [len(data) // 2 + by for by in range(20)]
    assert sum(cut_off(data[:at]) for at in cuts) >= len(cuts) - 2


@pytest.mark.parametrize(
    ("reader", "name", "share"),
    [
        (ubx, "target_ubx_m8l/ublox-neo-m8l.log", 0.85),
        (nmea, "target_boat_nmea/bundg_zeus_9.log", 0.62),
        (srt, "dji_srt/p4_rtk.SRT", 0.89),
        (gpx, "target_gpx/around-visnjan-with-car.gpx", 0.63),
        (rtklib_pos, "target_car_rtk_pos/demo5_b34f_f.pos", 0.78),
        (airdata, "dji_airdata_p4rtk/Jul-7th-2022-11-10AM-Flight-Airdata.csv", 0.72),
        (dataflash, "copter_2014_joey/2014-10-18 20-04-24.bin", 0.5),
        (dataflash, "plane42_bench_badgps/pilot_0004.BIN", 0.5),
        (dataflash, "damaged/pymavlink_test.BIN", 0.5),
        (dataflash_text, "damaged/nan.log", 0.5),
    ],
)
def test_damaged_files_of_receivers(shared_data, reader, name, share):
    data = shared_data("logs", *name.split("/")).read_bytes()[:200_000]
    assert survives(reader.read, data, 4, 6) > share


@pytest.mark.parametrize(
    ("reader", "start", "unit"),
    [
        *((tlog, joined(telemetry(5)), one) for one in (
            b"\x00\x06" * 4 + b"\xfe", b"\x00" * 7 + b"\xfd\xff", b"\xfe", b"\x00",
        )),
        *((px4, ulog(flight()), one) for one in (
            b"\x02\x00D", b"\x00", b"\xff", b"\x03\x00A\x00\x09\x09", b"\x10\x00Q" + bytes(16),
        )),
        (ubx, pvt(0), b"\xb5\x62\x01\x07\xf0\xff"),
        (gpx, of_gpx.document(of_gpx.track()), b'<trkpt lat="1" lon="1">'),
    ],
)  # fmt: skip
def test_no_input_takes_long(reader, start, unit):
    began = time.monotonic()
    log = reader.read(Path("x"), start + unit * (900_000 // len(unit)))
    check(log)
    assert log.parts and time.monotonic() - began < 10.0
