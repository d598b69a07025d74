"""A planted leak is found in each format; without it nothing is."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sharing.scan.packed import PACKED
from tests.sharing.scan.spelt import LEAKS, secrets
from wildlab.sharing.scan import scan


@pytest.mark.parametrize("leak", LEAKS)
@pytest.mark.parametrize("kind", PACKED)
def test_a_planted_leak_is_found(tmp_path: Path, kind: str, leak: str) -> None:
    wanted, text = LEAKS[leak]
    file = tmp_path / "sent.bin"
    file.write_bytes(PACKED[kind](text))
    found = scan([file], secrets())
    assert wanted in {finding.kind for finding in found}, [str(finding) for finding in found]


@pytest.mark.parametrize("kind", PACKED)
def test_the_same_without_a_leak_is_clean(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "sent.bin"
    file.write_bytes(PACKED[kind]("the error is 6.41 m, 5.9 to 7.0 over 200 flights"))
    assert [str(finding) for finding in scan([file], secrets())] == []
