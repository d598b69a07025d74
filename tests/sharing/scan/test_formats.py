"""Planted leaks are found in each format; without them nothing is."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sharing.scan.packed import PACKED
from tests.sharing.scan.spelt import LEAKS, secrets
from wildlab.sharing.scan import scan


@pytest.mark.parametrize("kind", PACKED)
def test_planted_leaks_are_found(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "sent.bin"
    file.write_bytes(PACKED[kind]("; ".join(text for _, text in LEAKS.values())))
    found = scan([file], secrets())
    assert {wanted for wanted, _ in LEAKS.values()} <= {finding.kind for finding in found}, found
    written = " ".join(finding.written for finding in found)
    assert all(one in written for one in ("decimal degrees", "minutes and seconds", "UTM zone")), written


@pytest.mark.parametrize("kind", PACKED)
def test_the_same_without_a_leak_is_clean(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "sent.bin"
    file.write_bytes(PACKED[kind]("the error is 6.41 m, 5.9 to 7.0 over 200 flights"))
    assert [str(finding) for finding in scan([file], secrets())] == []
