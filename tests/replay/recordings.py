"""A recording read back: what stands under which name, at which time."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rerun.chunk import RrdReader


class Logged(NamedTuple):
    """Values of one component: times (N,) s, None of what never changes; a list for each."""

    times: np.ndarray | None
    values: list[Any]


def read_recording(path: Path) -> dict[tuple[str, str], Logged]:
    """All of a file's recording by entity and component."""
    found: dict[tuple[str, str], Logged] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = batch.schema.names
        times = None
        lines = [name for name in names if name == "time"]
        assert len(lines) <= 1 and not {"log_time", "log_tick"} & set(names), names
        if lines:
            stamps = np.asarray(batch.column(lines[0]).cast("int64"))
            times = stamps / 1e9
        for name in names:
            if name not in (*lines, "rerun.controls.RowId"):
                values = batch.column(name).to_pylist()
                before = found.get((chunk.entity_path, name))
                if before is not None and before.times is not None and times is not None:
                    whole = np.concatenate([before.times, times]), before.values + values
                    found[chunk.entity_path, name] = Logged(*whole)
                else:
                    found[chunk.entity_path, name] = Logged(times, values)
    return found
