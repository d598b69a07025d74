"""PX4 logs that are damaged, lie, or lack what others have."""

import struct
import time
from typing import Any

import pytest

from tests.flight.readers.mavlink_logs import message, ulog
from tests.flight.readers.test_ulog import flight, new_gps, read, us
from tests.flight.readers.tracks import check, damaged
from wildlab.errors import WildlabError


def test_dropouts_are_counted():
    log = read(ulog(flight(), after=message("O", struct.pack("<H", 250)) * 3))
    assert any("3 times" in one and "0.750 s" in one for one in log.notes)


def test_appended_data_is_read():
    plain = ulog(flight())
    broken = plain + message("D", bytes(60))[:30]
    flags = bytes(8) + b"\x01" + bytes(7) + struct.pack("<3Q", len(broken), 0, 0)
    late = message("D", struct.pack("<H", 0) + struct.pack("<QQ4f", us(50), 0, 1.0, 0.0, 0.0, 0.0))
    data = ulog(flight(), flags=flags)[: len(plain)] + broken[len(plain) :] + late
    log = read(data)
    assert len(log.parts["poses"]) == 51


def test_what_cannot_be_read_is_refused():
    for data in (b"", b"ULog\x01\x12\x36" + bytes(100)):
        with pytest.raises(WildlabError, match="does not begin"):
            read(data)
    with pytest.raises(WildlabError, match="holds no message"):
        read(ulog({"battery_status": ("uint64_t timestamp;float voltage_v;", [(us(1), 12.0)])}))
    with pytest.raises(WildlabError, match=r"\(flags 0x4\)"):
        read(ulog(flight(), flags=bytes(8) + b"\x04" + bytes(31)))


def claims(form: str, name: str = "vehicle_attitude", before: bytes = b"") -> Any:
    topics = flight()
    topics.pop(name, None)
    claimed = message("F", f"{name}:{form}".encode()) + message(
        "A", struct.pack("<BH", 0, 77) + name.encode()
    )
    return read(ulog(topics, before=before, after=claimed + message("D", struct.pack("<H", 77) + bytes(100))))


@pytest.mark.parametrize(
    "form",
    [
        "uint64_t timestamp;uint8_t[99999] q;",
        "uint64_t timestamp;uint8_t[65535] q;",
        "uint64_t timestamp;vehicle_attitude again;",
        "uint64_t timestamp;absent q;",
        "float[4] q;",
        "uint64_t timestamp;float q;float q;",
        "uint64_t timestamp;float[4q;",
        "",
    ],
)
def test_absurd_definitions_are_left_out_and_said(form):
    log = claims(form)
    assert "poses" not in log.parts and "gnss" in log.parts
    assert any("'vehicle_attitude'" in one for one in log.lost)


def test_definitions_within_definitions_do_not_multiply():
    nested = b"".join(
        message("F", f"n{k}:{f'n{k + 1}' if k < 6 else 'float'}[60000] x;".encode()) for k in range(7)
    )
    began = time.monotonic()
    log = claims("uint64_t timestamp;n0 q;", before=nested)
    assert time.monotonic() - began < 2.0
    assert "poses" not in log.parts


def test_many_instances_of_a_wide_topic_take_little_memory():
    wide = message("F", b"sensor_mag:uint64_t timestamp;uint8_t[2000] x;")
    many = b"".join(
        message("A", struct.pack("<BH", 0, number) + b"sensor_mag") for number in range(100, 20_100)
    )
    began = time.monotonic()
    log = read(ulog(flight(), before=wide + many))
    assert time.monotonic() - began < 5.0
    assert "gnss" in log.parts


def test_rows_of_a_topic_that_lost_its_introduction_are_counted():
    data = bytearray(ulog(flight()))
    at = data.index(b"vehicle_attitude", data.index(b"A\x00\x00\x00"))
    data[at] ^= 1
    log = read(bytes(data))
    assert "poses" not in log.parts


def test_damage_anywhere():
    data = ulog(flight(), {"sys_name": "PX4"})
    kept = []
    for spoilt in damaged(data):
        try:
            log = read(spoilt)
        except WildlabError as error:
            assert "flight.ulg" in str(error)
            continue
        check(log)
        kept.append(sum(len(part) for part in log.parts.values()))
    assert len(kept) > 40


def test_one_wrong_length_costs_one_message():
    data = bytearray(ulog(flight()))
    at = data.index(struct.pack("<HB", 34, ord("D")), len(data) // 2)
    data[at] ^= 0x10
    log = read(bytes(data))
    assert len(log.parts["poses"]) == 49
    assert any(one.startswith(f"37 of {len(data)}") for one in log.lost)


@pytest.mark.parametrize(
    "unit", [b"\x02\x00D", b"\x00", b"\xff", b"\x03\x00A\x00\x09\x09", b"\x10\x00Q" + bytes(16)]
)
def test_no_input_takes_long(unit):
    began = time.monotonic()
    log = read(ulog(flight(), after=unit * (300_000 // len(unit))))
    assert time.monotonic() - began < 10.0
    assert len(log.parts["poses"]) == 50


def test_zero_above_the_ellipsoid_is_not_known():
    log = read(ulog(flight(vehicle_gps_position=new_gps(ellipsoid=0.0))))
    assert "height_ellipsoid_m" not in log.parts["gnss"].columns
