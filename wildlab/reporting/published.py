"""The numbers and claims of the theses, typed from their tables into ``data/published/*.toml``.

::

    kind = "one flight"         # what the file's numbers are; a number may say otherwise
    signs = "undefined"         # signed means are compared by size: nobody says which way round they are
    last_digit = "within one"   # of all tables: the print contradicts itself if rounded to nearest

    [[number]]
    study = "sensitivity"
    name = "horizontal_error"
    subject = "level/roll/100m"
    value = 5.3                 # as printed: 5.30 would mean two decimals
    unit = "m"
    source = "H table 5.1"
    within = 0.15               # optional: what the source leaves open besides the last digit
    runs = 10000                # of a mean of runs, or a share of images: how many
    again = true                # the same published number as another entry: shown, and counted there
    fitted = "..."              # what of ours was chosen by it: compared, and counted apart
    unjudged = "..."            # why it cannot be held against ours at all: what the thesis leaves out

    [[claim]]
    study = "schmidt"
    id = "nis-similar"
    text = "The NIS of both filters is similar."
    source = "H 7.5.3"
    premise = "..."             # what the twin must have for the sentence to be tested at all
    threshold = 0.25            # optional: what a vague word is taken to mean; shown at half and twice too
    reason = "..."              # why that threshold
    own = true                  # optional: a sentence of ours, not of a thesis

A number's ``kind`` is "calculated", "mean of runs", "one flight" or "share of images":
`wildlab.evaluation.replication` compares each in its own way, one flight's by what the quantity is
(`quantity_kind`).
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from decimal import Decimal
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildlab.errors import WildlabError
from wildlab.paths import DATA
from wildlab.reporting.metrics import metric

if TYPE_CHECKING:
    import pandas as pd

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
_OPTIONAL: dict[str, dict[str, Any]] = {
    "number": {
        "within": (Decimal, int),
        "kind": str,
        "runs": int,
        "again": bool,
        "fitted": str,
        "unjudged": str,
    },
    "claim": {
        "premise": str,
        "threshold": (Decimal, int),
        "reason": str,
        "own": bool,
        "fitted": str,
        "needs": str,
    },
}
CALCULATED, MEAN_OF_RUNS, ONE_FLIGHT = "calculated", "mean of runs", "one flight"
#: Of a rate: all images of all flights together are compared, not one flight's.
SHARE_OF_IMAGES = "share of images"
#: What a file says of all its numbers, and the words allowed; the first is taken where it says nothing.
_OF_FILE = {
    "kind": (ONE_FLIGHT, CALCULATED, MEAN_OF_RUNS, SHARE_OF_IMAGES),
    "signs": ("defined", "undefined"),
    "last_digit": ("rounded", "within one"),
}
_COLUMNS = [
    *("name", "subject", "value", "digits", "unit", "source", "rounding"),
    *("kind", "by_size", "runs", "again", "fitted", "unjudged"),
]
#: What a quantity is, by its name; the first pattern that fits.
_QUANTITIES = (
    (re.compile(r"(mean_)?sd_\w+"), "standard deviation"),
    (re.compile(r"(nees|nis)(_\w+)?"), "NEES or NIS"),
    (re.compile(r"(size_of_)?mean_(north|east|down|ahead|right)"), "signed mean"),
    (re.compile(r"(\w+_)?(rate|fraction|share)(_\w+)?"), "rate"),
    (re.compile(r"(mae|rmse|\w*error)(_\w+)?"), "error size"),
)


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
        ``source``, ``rounding`` (what the print leaves open to each side), ``runs`` (NaN where none is
        stated), ``kind``, ``by_size`` (a signed mean that is compared by its size), ``again``, ``fitted``,
        ``unjudged``; no rows where the study has none.

    Raises
    ------
    WildlabError
        If a file is not TOML, an entry has an unknown or missing key, or a number is given twice.

    Examples
    --------
    >>> len(load_published("consistency-bounds"))
    6
    """
    import pandas as pd  # `wildlab list` takes the rows alone, and is there in half the time

    return pd.DataFrame(published_rows(study, folder), columns=_COLUMNS)


def published_values(study: str, folder: Path = FOLDER) -> dict[tuple[str, str], float]:
    """The published numbers of one study by subject and name; parameters as of `load_published`.

    Examples
    --------
    >>> published_values("schmidt-fast-vessel")["ekf", "mae"]
    9.4
    """
    return {(row["subject"], row["name"]): float(row["value"]) for row in published_rows(study, folder)}


def quantity_kind(name: str) -> str:
    """What the quantity of that name is: a key of `wildlab.evaluation.replication.KINDS`.

    Parameters
    ----------
    name
        Of a metric.

    Returns
    -------
    str
        Empty where no margin is fixed for it.

    Examples
    --------
    >>> quantity_kind("mean_sd_roll"), quantity_kind("mean_north"), quantity_kind("mae")
    ('standard deviation', 'signed mean', 'error size')
    """
    return next((kind for pattern, kind in _QUANTITIES if pattern.fullmatch(name)), "")


def published_rows(study: str, folder: Path = FOLDER) -> list[dict[str, Any]]:
    """The rows of `load_published`, with its arguments and errors."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for entry in _entries("number", folder):
        if entry["study"] != study:
            continue
        name, subject = entry["name"], entry["subject"]
        if (name, subject) in rows:
            raise WildlabError(
                f"{name} of {subject} of study {study!r} is given twice", "keep one of them", file=folder.name
            )
        rows[name, subject] = {
            "name": name,
            "subject": subject,
            "value": float(entry["value"]),
            "digits": _decimals(entry["value"]),
            "unit": entry["unit"],
            "source": entry["source"],
            "rounding": _rounding(entry),
            "kind": entry["kind"],
            "by_size": entry["signs"] == "undefined" and quantity_kind(name) == "signed mean",
            "runs": float(entry.get("runs", math.nan)),
            "again": bool(entry.get("again", False)),
            "fitted": entry.get("fitted", ""),
            "unjudged": entry.get("unjudged", ""),
        }
    return list(rows.values())


def load_claims(study: str, folder: Path = FOLDER) -> list[dict[str, Any]]:
    """The claims of one study, in the order of the files, each with ``study``, ``id``, ``text`` and
    ``source``, and ``premise``, ``threshold``, ``reason``, ``own`` and ``needs`` where it has them.

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
    return [dict(entry) for entry in _entries("claim", folder) if entry["study"] == study]


def _entries(kind: str, folder: Path) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    for path in sorted(folder.glob("*.toml")):
        try:
            state = path.stat()
            entries += _read(path, kind, state.st_mtime_ns, state.st_size)
        except (OSError, ValueError) as error:
            raise WildlabError(f"it cannot be read ({error})", "mend the file", file=path.name) from error
    return entries


@lru_cache(maxsize=256)
def _read(path: Path, kind: str, changed: int, size: int) -> list[dict[str, Any]]:
    """The entries of a file, read once as long as it stays the same: each study asks for all of them."""
    # Decimals, so that 7.90 keeps its second digit: it says how far the print can be trusted.
    content = tomllib.loads(path.read_text(encoding="utf-8"), parse_float=Decimal)
    unknown = set(content) - set(_REQUIRED) - set(_OF_FILE)
    if unknown:
        raise WildlabError(
            f"the table [[{min(unknown)}]] is unknown", "use [[number]] or [[claim]]", file=path.name
        )
    of_file = {key: content.get(key, words[0]) for key, words in _OF_FILE.items()}
    for key, value in of_file.items():
        _check_word(key, value, path.name, key)
    values = [entry.get("value", 0) for entry in content.get("number", [])]
    of_file["digits"] = max((_decimals(one) for one in values if isinstance(one, (Decimal, int))), default=0)
    for index, entry in enumerate(content.get(kind, []), 1):
        _check_entry(entry, kind, f"[[{kind}]] {index}", path.name)
    return [of_file | entry if kind == "number" else dict(entry) for entry in content.get(kind, [])]


def _check_word(key: str, value: Any, file: str, where: str) -> None:
    words = _OF_FILE[key]
    if value not in words:
        raise WildlabError(f"{key!r} is {value!r}", f"use one of: {', '.join(words)}", file=file, field=where)


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
        if not isinstance(value, types[key]) or (isinstance(value, bool) and types[key] is not bool):
            raise WildlabError(
                f"{key!r} is {value!r}",
                "give text in quotes, a number without, or true",
                file=file,
                field=where,
            )
    if "kind" in entry:
        _check_word("kind", entry["kind"], file, where)
    if kind == "number":
        if not math.isfinite(entry["value"]) or not math.isfinite(entry.get("within", 0)):
            raise WildlabError("a number is not finite", "give the printed value", file=file, field=where)
        metric(entry["name"], entry["subject"], float(entry["value"]), entry["unit"])


def _rounding(entry: Mapping[str, Any]) -> float:
    """What the print leaves open to each side: half of the last digit, or of one of so many images."""
    if "within" in entry:
        return float(entry["within"])
    if entry["last_digit"] == "within one":
        # One table, one last digit: 21 stands beside 21.2, its zero left out.
        return float(10.0 ** -entry["digits"])
    if "runs" in entry and entry["kind"] != MEAN_OF_RUNS:
        return 0.5 / float(entry["runs"])
    return float(0.5 * 10.0 ** -_decimals(entry["value"]))


def _decimals(value: Decimal | int) -> int:
    exponent = Decimal(value).as_tuple().exponent
    return max(0, -exponent) if isinstance(exponent, int) else 0
