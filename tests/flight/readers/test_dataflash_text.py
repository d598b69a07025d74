"""DataFlash as text: every field of every message as pymavlink has it, NaN included."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink import DFReader

from tests.flight.readers.dataflash_logs import (
    Log,
    Truth,
    first_generation,
    second_generation,
    third_generation,
)
from wildlab.flight.readers.ardupilot.messages import Table
from wildlab.flight.readers.ardupilot.text import read_messages


def by_pymavlink(path: Path) -> dict[str, list[Any]]:
    reader = DFReader.DFReader_text(str(path))
    found: dict[str, list[Any]] = {}
    while (message := reader.recv_msg()) is not None:
        found.setdefault(message.get_type(), []).append(message)
    return found


def same(ours: Any, theirs: Any) -> bool:
    if isinstance(theirs, str):
        return bool(ours == theirs)
    return not isinstance(ours, str) and (ours == theirs or (math.isnan(ours) and math.isnan(theirs)))


def whole(tables: dict[str, Table]) -> dict[str, Table]:
    """Without messages that end in an empty text: pymavlink takes them for cut off and drops all but FMT."""
    made = {}
    for name, table in tables.items():
        ends = table.column(len(table.fields) - 1).tolist()
        kept = table.take(np.flatnonzero([one != "" or name == "FMT" for one in ends]))
        made |= {name: kept} if len(kept) else {}
    return made


def compare(path: Path) -> tuple[int, int]:
    """Every field of every message equals pymavlink's: how many there were, and how many of them are NaN."""
    ours, theirs = whole(read_messages(path.read_bytes())), by_pymavlink(path)
    assert {name: len(table) for name, table in ours.items()} == {
        name: len(messages) for name, messages in theirs.items()
    }
    count = lost = 0
    for name, messages in theirs.items():
        assert list(ours[name].fields) == list(messages[0].fmt.columns), name
        for at, field in enumerate(messages[0].fmt.columns):
            values = ours[name].column(at).tolist()
            theirs_too = [getattr(message, field) for message in messages]
            differ = [pair for pair in zip(values, theirs_too, strict=True) if not same(*pair)]
            assert not differ, (name, field, differ[:3])
            count += len(values)
            lost += sum(isinstance(one, float) and math.isnan(one) for one in values)
    return count, lost


def test_every_field_of_a_real_log_is_as_pymavlink_has_it(shared_data: Callable[..., Path]) -> None:
    count, lost = compare(shared_data("logs", "damaged", "nan.log"))
    assert count > 15_000 and lost > 0


@pytest.mark.parametrize("make", [first_generation, second_generation, third_generation])
def test_made_up_logs_too(tmp_path: Path, make: Callable[..., Log]) -> None:
    path = tmp_path / "made.log"
    path.write_bytes(make(Truth(2025), 8.0).text())
    assert compare(path)[0] > 1000


def test_a_text_that_is_empty_is_a_message_all_the_same() -> None:
    log = Log()
    log.define("MSG", "IZ", "TimeMS,Message")
    log.add("MSG", 7, "")
    assert read_messages(log.text())["MSG"].texts("Message") == [""]


def test_every_format_character_and_every_way_to_write_a_number(tmp_path: Path) -> None:
    log = Log()
    characters = "bBhHiIfdcCeELqQ"
    log.define("ALL", characters, ",".join(f"A{i}" for i in range(len(characters))))
    log.define("TXT", "IfffZ", "TimeMS,A,B,C,Text")
    rng = np.random.default_rng(1)
    for _ in range(20):
        log.add("ALL", *rng.integers(0, 100, 6), *rng.normal(size=2), *rng.uniform(0, 90, 5).round(2), 4, 5)
        log.add("TXT", 7, "nan", "-inf", "1e-07", "words of a text")
        log.add("TXT", 8, "-nan", "inf", "-0.0", "x")
    path = tmp_path / "all.log"
    path.write_bytes(log.text())
    assert compare(path)[1] == 40
