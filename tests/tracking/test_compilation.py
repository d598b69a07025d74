"""What is compiled the first time is said, and what is there already is not."""

from __future__ import annotations

import logging
import subprocess
import sys

import pytest

from wildlab.geometry.compilation import ANNOUNCER, compiled
from wildlab.paths import ROOT


def test_the_first_use_is_announced_once(caplog, monkeypatch):
    caplog.set_level(logging.INFO, "wildlab.compilation")
    monkeypatch.setattr(ANNOUNCER, "said", False)

    @compiled
    def twice(x):
        return 2 * x

    @compiled
    def four_times(x):
        return twice(twice(x))

    assert four_times(1.5) == 6.0  # two functions, one line
    assert four_times(1) == 4  # another type
    assert len(caplog.records) == 1


INNER = "from wildlab.geometry.compilation import compiled\n\n\n@compiled\ndef inner(x):\n    return {} * x\n"
OUTER = (
    "from inner import inner\nfrom wildlab.geometry.compilation import compiled\n\n\n"
    "@compiled\ndef outer(x):\n    return inner(x) + 1\n"
)
PROGRAM = (
    "from numba.core import event\nimport outer\n"
    "with event.install_recorder('numba:compile') as seen:\n    print(outer.outer(2.0), bool(seen.buffer))"
)


@pytest.mark.slow
def test_copies_share_what_is_compiled_and_a_change_below_compiles_anew(tmp_path):
    def run(folder: str, factor: int) -> str:
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / "inner.py").write_text(INNER.format(factor))
        (tmp_path / folder / "outer.py").write_text(OUTER)
        # Within a second two sources of one size are the same to Python's own cache.
        environment = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONPATH": f"{tmp_path / folder}:{ROOT}"}
        environment |= {"PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-c", PROGRAM]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    assert run("one", 3) == "7.0 True"
    assert run("other", 3) == "7.0 False"
    assert run("other", 5) == "11.0 True"
    assert run("one", 3) == "7.0 False"
