"""Writing files so that a reader never meets half of one, and what a file's content is told by."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd


def write_atomic(path: Path, content: str | bytes) -> None:
    """Write ``content`` beside ``path`` and rename it into place: readers see the old file or the new one."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes files that only their owner reads; a report is there to be shared.
        part.chmod(0o644)
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_json(path: Path, content: Any) -> None:
    """``content`` as JSON, atomically. NaN and infinity are refused: JSON has no word for them."""
    write_atomic(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def sha256(path: Path) -> str:
    """SHA-256 of a file, as 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_csv(path: Path, table: pd.DataFrame, float_format: str | None = None) -> None:
    """A table as CSV (`csv_text`), atomically."""
    write_atomic(path, csv_text(table, float_format))


def csv_text(table: pd.DataFrame, float_format: str | None = None) -> str:
    """A table as CSV. Names that a spreadsheet would take for a formula begin with an apostrophe: what things
    are called comes from files of strangers."""
    safe = table.copy()
    for name in safe.columns:
        if safe[name].dtype == object:
            safe[name] = [_no_formula(cell) for cell in safe[name]]
    safe.columns = [_no_formula(name) for name in safe.columns]
    return str(safe.to_csv(index=False, float_format=float_format))


def _no_formula(cell: Any) -> Any:
    return f"'{cell}" if isinstance(cell, str) and cell[:1] in ("=", "+", "-", "@", "\t", "\r") else cell
