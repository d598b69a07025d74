"""Write the TOML that `tomllib` reads back: tables, arrays of tables, and the plain values of a manifest."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from datetime import date, datetime, time
from typing import Any

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def dump_toml(data: Mapping[str, Any], *, inline: bool = False) -> str:
    """TOML text of nested mappings.

    With `inline`, mappings of plain values inside others stand on one line, as people write recipes.

    Values are strings, booleans, integers, finite floats, dates, times, and lists of these; a list of
    mappings is written as an array of tables. Keys whose value is None are left out: TOML has no null.

    Raises
    ------
    ValueError
        For a float that is not finite.
    TypeError
        For any other kind of value.
    """
    lines: list[str] = []
    _table(data, (), lines, inline)
    return "\n".join(lines).strip("\n") + "\n"


def _table(data: Mapping[str, Any], path: tuple[str, ...], lines: list[str], inline: bool) -> None:
    below = []
    for key, value in data.items():
        if value is None:
            continue
        if inline and path and _is_plain(value):
            lines.append(f"{_key(key)} = {_value(value)}")
        elif isinstance(value, Mapping) or (
            isinstance(value, list | tuple) and value and all(isinstance(item, Mapping) for item in value)
        ):
            below.append((key, value))
        else:
            lines.append(f"{_key(key)} = {_value(value)}")
    for key, value in below:
        name = ".".join(_key(part) for part in (*path, key))
        for item, header in (
            [(value, f"[{name}]")]
            if isinstance(value, Mapping)
            else [(item, f"[[{name}]]") for item in value]
        ):
            lines += ["", header]
            _table(item, (*path, key), lines, inline)


def _is_plain(value: Any) -> bool:
    """Whether a mapping, or each mapping of a list, has plain values only."""
    several = value if isinstance(value, list | tuple) and value else [value]
    return all(
        isinstance(one, Mapping)
        and one
        and not any(isinstance(part, Mapping | list | tuple) for part in one.values())
        for one in several
    )


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _string(key)


def _string(text: str) -> str:
    # JSON's escapes are a subset of TOML's; JSON alone lets DEL through.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number")
        return repr(value)
    if isinstance(value, datetime):
        return value.isoformat().replace("+00:00", "Z")
    if isinstance(value, date | time):
        return value.isoformat()
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items() if one is not None)
        return f"{{ {inner} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    raise TypeError(f"TOML has no place for a {type(value).__name__}")
