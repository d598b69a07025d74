"""DataFlash: messages as pymavlink finds them, whatever stands between them, and files that lie."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import DFReader

from tests.flight.readers.dataflash_logs import (
    Log,
    Truth,
    second_generation,
)
from tests.flight.readers.tracks import Reader
from wildlab.errors import WildlabError
from wildlab.flight.readers.ardupilot import read_records

dataflash, dataflash_text = Reader("dataflash"), Reader("dataflash-text")

SLOW = pytest.mark.slow
REAL = (
    "copter_2014_joey/2014-10-18 20-04-24.bin",
    "plane42_bench_badgps/pilot_0004.BIN",
    "damaged/pymavlink_test.BIN",
)


def by_pymavlink(path: Path) -> dict[str, list[Any]]:
    reader = DFReader.DFReader_binary(str(path))
    found: dict[str, list[Any]] = {}
    while (message := reader.recv_match()) is not None:
        found.setdefault(message.get_type(), []).append(message)
    return found


def same(ours: Any, theirs: Any) -> bool:
    if isinstance(theirs, bytes):
        # Contents of files within the log: whole bytes there, up to the first 0 here.
        return str(ours).encode() == theirs.split(b"\0")[0] or not theirs.isascii()
    if isinstance(theirs, float) and math.isnan(theirs):
        return math.isnan(ours)
    return bool(ours == theirs)


def compare(path: Path) -> int:
    """Every field of every message equals pymavlink's; how many there were."""
    ours, theirs = read_records(path.read_bytes()).tables, by_pymavlink(path)
    assert {name: len(table) for name, table in ours.items()} == {
        name: len(messages) for name, messages in theirs.items()
    }
    count = 0
    for name, messages in theirs.items():
        # The first generation's definition of FMT leaves out its last column.
        for field in messages[0].fmt.columns:
            table = ours[name]
            is_text = table.characters[field] in "nNZ"
            values = table.texts(field) if is_text else table.fields[field].tolist()
            theirs_too = [getattr(message, field) for message in messages]
            differ = [pair for pair in zip(values, theirs_too, strict=True) if not same(*pair)]
            assert not differ, (name, field, differ[:3])
            count += len(values)
    return count


@pytest.mark.parametrize("name", [pytest.param(one, marks=SLOW) if "copter" in one else one for one in REAL])
def test_every_field_is_as_pymavlink_has_it(shared_data, name):
    assert compare(shared_data("logs", *name.split("/"))) > 10_000


def test_every_format_character(tmp_path):
    characters = "bBhHiIfdcCeELMqQ"
    columns = ",".join(f"A{i}" for i in range(len(characters)))
    log = Log(f"ALL {characters} {columns}\nTXT nNZg Name,Long,Text,Half")
    rng = np.random.default_rng(1)
    for _ in range(20):
        numbers = (*rng.integers(0, 100, 6), *rng.normal(size=2), *rng.uniform(0, 90, 5).round(2))
        log.add("ALL", *numbers, 3, 4, 5)
        log.add("TXT", "abcd", "sixteen letters!", "æ ø", 0.5)
    path = tmp_path / "all.bin"
    path.write_bytes(log.binary())
    compare(path)
    assert read_records(log.binary()).tables["TXT"].texts("Long")[0] == "sixteen letters!"


def texts_and_numbers(count: int, a: str = "QZ TimeUS,Text") -> Log:
    """Messages A, and B with their numbers as W, in turns."""
    log = Log(f"A {a}\nB QB TimeUS,W")
    for i in range(count):
        log.add("A", i, "a text" if "Z" in a else i / 2)
        log.add("B", i, i)
    return log


@settings(max_examples=60, deadline=None)
@given(st.lists(st.binary(max_size=30).map(lambda one: one.replace(b"\xa3", b"")), min_size=8, max_size=8))
def test_nothing_between_messages_hides_them(garbage):
    pieces = texts_and_numbers(4, "Qf TimeUS,V").pieces()
    # The definitions come first: what follows is 8 messages with something in front of each.
    ahead = [one for one in pieces if one[2] == 128]
    behind = [one for one in pieces if one[2] != 128]
    data = b"".join(ahead) + b"".join(g + one for g, one in zip(garbage, behind, strict=True))
    found = read_records(data)
    assert found.tables["A"].get("V").tolist() == [0, 0.5, 1, 1.5]
    assert found.tables["B"].get("W").tolist() == [0, 1, 2, 3]
    assert found.lost_bytes == sum(map(len, garbage))
    assert found.places == sum(map(bool, garbage))


def test_heads_within_messages_are_not_believed():
    log = texts_and_numbers(50)
    # In each text stands what looks like the head of a B.
    found = read_records(log.binary().replace(b"a text", b"at\xa3\x95" + bytes([log.kinds["B"][0]]) + b"t"))
    assert found.lost_bytes == 0
    assert found.tables["B"].get("W").tolist() == list(range(50))


def test_a_message_whose_kind_was_damaged_costs_itself():
    log = texts_and_numbers(20)
    longer, shorter = log.kinds["A"][0], log.kinds["B"][0]
    log.messages.sort(reverse=True, key=lambda one: one[0])
    pieces = log.pieces()
    at = next(i for i, one in enumerate(pieces) if one[2] == shorter) + 5
    pieces[at] = pieces[at][:2] + bytes([longer]) + pieces[at][3:]
    found = read_records(b"".join(pieces))
    assert found.tables["B"].get("W").tolist() == [i for i in range(20) if i != 5]
    assert (found.lost_bytes, found.places) == (len(pieces[at]), 1)


def test_filling_at_the_end_is_no_loss_and_a_cut_message_is():
    data = second_generation(Truth(2025), 3.0).binary()
    for filling in (b"\0" * 5000, b"\xff" * 5000):
        assert dataflash.read(Path("x.bin"), data + filling).lost == ()
    (said,) = dataflash.read(Path("x.bin"), data[:-1]).lost
    assert f"bytes of {len(data) - 1}" in said


def test_other_logs_with_the_same_heads_are_refused():
    log = Log("PARM Nf Name,Value")
    log.add("PARM", "SYSID", 1)
    with pytest.raises(WildlabError, match="holds no attitude"):
        dataflash.read(Path("flight.bin"), log.binary())
    log = Log("ATT fffffff qw,qx,qy,qz,Roll,Pitch,Yaw")
    log.add("ATT", 1, 0, 0, 0, 0, 0, 0)
    for reader, data in ((dataflash, log.binary()), (dataflash_text, log.text())):
        with pytest.raises(WildlabError, match="sdlog2"):
            reader.read(Path("flight.bin"), data)
