"""Writing files so that a reader never meets half of one, and what a file's content is told by."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import tempfile
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildlab.names import csv_cell, from_csv_cell

if TYPE_CHECKING:
    import pandas as pd


def write_atomic(path: Path, content: str | bytes, mode: int = 0o644) -> None:
    """Write ``content`` beside ``path`` and rename it into place: readers see the old file or the new one."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        error.filename = str(path)  # nobody knows the part by name
        raise
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes files that only their owner reads; a report is there to be shared.
        part.chmod(mode)
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


def digest(about: Any, files: Iterable[tuple[str, Path]] = ()) -> str:
    """SHA-256 of plain values and of named files, whether they are there or not, as 64 hexadecimal digits."""
    whole = hashlib.sha256(json.dumps(about, sort_keys=True, allow_nan=False).encode())
    for name, path in files:
        whole.update(f"{name} {sha256(path) if path.is_file() else 'absent'}\n".encode())
    return whole.hexdigest()


def write_csv(path: Path, table: pd.DataFrame, float_format: str | None = None) -> None:
    """A table as CSV (`csv_text`), atomically."""
    write_atomic(path, csv_text(table, float_format))


def csv_text(table: pd.DataFrame, float_format: str | None = None) -> str:
    """A table as CSV. Names that a spreadsheet would take for a formula begin with an apostrophe
    (`wildlab.names`): what things are called comes from files of strangers."""
    safe = table.rename(columns=_cell)
    # By place: columns may share a name.
    texts = [at for at in range(safe.shape[1]) if not _is_number(safe.iloc[:, at])]
    for at in texts:
        safe.isetitem(at, safe.iloc[:, at].astype(object).map(_cell).to_numpy())
    # The csv module does not quote a lone carriage return, which ends a line for whoever reads it.
    broken = any("\r" in cell for at in texts for cell in safe.iloc[:, at] if isinstance(cell, str))
    how: dict[str, Any] = {"quoting": csv.QUOTE_NONNUMERIC if broken else csv.QUOTE_MINIMAL}
    return str(safe.to_csv(index=False, float_format=float_format, **how))


def read_csv(path: Path | io.StringIO, names: Collection[str], **how: Any) -> pd.DataFrame:
    """A table as `write_csv` writes it.

    Parameters
    ----------
    path
        Of the file, or what pandas reads it from.
    names
        Columns of names: nothing in them is taken for a number or for missing.
    **how
        As `pandas.read_csv` takes it.

    Returns
    -------
    pandas.DataFrame
    """
    import pandas as pd

    table: pd.DataFrame = pd.read_csv(path, converters=dict.fromkeys(names, from_csv_cell), **how)
    return table


def _cell(cell: Any) -> Any:
    return csv_cell(cell) if isinstance(cell, str) else cell


def _is_number(column: pd.Series) -> bool:
    return column.dtype.kind in "biufcmM"
