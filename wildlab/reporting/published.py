"""The numbers and claims of the theses, typed from their tables into ``data/published/*.toml``.

::

    [[number]]
    study = "sensitivity"
    name = "horizontal_error"
    subject = "level/roll/100m"
    value = 5.3                 # as printed: 5.30 would mean two decimals
    unit = "m"
    source = "H table 5.1"
    within = 0.15               # optional: how near counts as reproduced

    [[claim]]
    study = "schmidt"
    id = "skf-consistent"
    text = "The Schmidt filter's NEES lies within the 95 % bounds."
    source = "H 7.5.3"
"""

from __future__ import annotations

import math
import tomllib
from decimal import Decimal
from pathlib import Path
from typing import Any

import pandas as pd

from wildlab.errors import WildlabError
from wildlab.paths import DATA
from wildlab.reporting.metrics import metric

FOLDER = DATA / "published"

_REQUIRED: dict[str, dict[str, Any]] = {
    "number": {
        "study": str,
        "name": str,
        "subject": str,
        "value": (Decimal, int),
        "unit": str,
        "source": str,
    },
    "claim": {"study": str, "id": str, "text": str, "source": str},
}
_OPTIONAL: dict[str, dict[str, Any]] = {"number": {"within": (Decimal, int)}, "claim": {}}
_COLUMNS = ["name", "subject", "value", "digits", "unit", "source", "within"]


def load_published(study: str, folder: Path = FOLDER) -> pd.DataFrame:
    """The published numbers of one study, in the order of the files.

    Parameters
    ----------
    study
        Name of the case.
    folder
        That holds the files; left out, ``data/published``.

    Returns
    -------
    DataFrame
        ``name``, ``subject``, ``value`` (float), ``digits`` (decimals printed in the source), ``unit``,
        ``source``, ``within`` (NaN where no tolerance is stated); no rows where the study has none.

    Raises
    ------
    WildlabError
        If a file is not TOML, an entry has an unknown or missing key, or a number is given twice.

    Examples
    --------
    >>> len(load_published("consistency-bounds"))
    6
    """
    rows = [
        {
            **{key: entry[key] for key in ("name", "subject", "unit", "source")},
            "value": float(entry["value"]),
            "digits": _decimals(entry["value"]),
            "within": float(entry["within"]) if "within" in entry else math.nan,
        }
        for entry in _entries("number", folder)
        if entry["study"] == study
    ]
    frame = pd.DataFrame(rows, columns=_COLUMNS)
    twice = frame[frame.duplicated(["name", "subject"])]
    if len(twice):
        name, subject = twice.iloc[0]["name"], twice.iloc[0]["subject"]
        raise WildlabError(
            f"{name} of {subject} of study {study!r} is given twice", "keep one of them", file=folder.name
        )
    return frame


def load_claims(study: str, folder: Path = FOLDER) -> list[dict[str, str]]:
    """The claims of one study as ``{"study", "id", "text", "source"}``, in the order of the files.

    Parameters
    ----------
    study
        Name of the case.
    folder
        As for `load_published`.

    Returns
    -------
    list of dict
    """
    return [entry for entry in _entries("claim", folder) if entry["study"] == study]


def _entries(kind: str, folder: Path) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    for path in sorted(folder.glob("*.toml")):
        try:
            # Decimals, so that 7.90 keeps its second digit: it says how far the print can be trusted.
            content = tomllib.loads(path.read_text(encoding="utf-8"), parse_float=Decimal)
        except (OSError, ValueError) as error:
            raise WildlabError(f"it cannot be read ({error})", "mend the file", file=path.name) from error
        unknown = set(content) - set(_REQUIRED)
        if unknown:
            raise WildlabError(
                f"the table [[{min(unknown)}]] is unknown", "use [[number]] or [[claim]]", file=path.name
            )
        for index, entry in enumerate(content.get(kind, []), 1):
            _check_entry(entry, kind, f"[[{kind}]] {index}", path.name)
            entries.append(entry)
    return entries


def _check_entry(entry: dict[str, Any], kind: str, where: str, file: str) -> None:
    types = _REQUIRED[kind] | _OPTIONAL[kind]
    for key in _REQUIRED[kind]:
        if key not in entry:
            raise WildlabError(f"{key!r} is missing", "add it", file=file, field=where)
    for key, value in entry.items():
        if key not in types:
            raise WildlabError(
                f"the key {key!r} is unknown", f"use: {', '.join(types)}", file=file, field=where
            )
        if not isinstance(value, types[key]) or isinstance(value, bool):
            raise WildlabError(
                f"{key!r} is {value!r}", "give text, or a number without quotes", file=file, field=where
            )
    if kind == "number":
        if not math.isfinite(entry["value"]) or not math.isfinite(entry.get("within", 0)):
            raise WildlabError("a number is not finite", "give the printed value", file=file, field=where)
        metric(entry["name"], entry["subject"], float(entry["value"]), entry["unit"])


def _decimals(value: Decimal | int) -> int:
    exponent = Decimal(value).as_tuple().exponent
    return max(0, -exponent) if isinstance(exponent, int) else 0
