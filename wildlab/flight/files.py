"""Files as hostile input: names that may not leave a folder, and strict models of TOML files.

Manifests, recipes and the catalog are TOML files checked by a pydantic model. `check_model` turns the first
thing pydantic finds into the one sentence a user reads.
"""

from __future__ import annotations

import contextlib
import difflib
import errno
import json
import math
import os
import re
import stat
import tomllib
import typing
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date, datetime, time
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, ValidationInfo, field_validator

from wildlab.errors import WildlabError, system_error

#: What a flight, a nav source or a twin may be called: it becomes a file name on every system.
SAFE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,99}")
#: What to do about another name.
SAFE = "use letters, digits, - and _ only, 100 at most"

#: The most bytes of a TOML file that are read: a manifest has a few thousand.
TOML_LIMIT = 4_000_000


class Strict(BaseModel):
    """A part of a TOML file: no unknown keys, finite numbers; true is no number, 1 is not true."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False)

    @field_validator("*", mode="before")
    @classmethod
    def _true_is_no_number(cls, value: Any, info: ValidationInfo) -> Any:
        # Python takes True for 1: `correlation = true` would be a share of one.
        annotation = cls.model_fields[str(info.field_name)].annotation
        truths = [] if _takes(annotation, bool) or _model_in(annotation) else list(_truths(value))
        if annotation in (bool, bool | None) and not isinstance(value, bool) and value is not None:
            raise ValueError(f"{value!r} is neither true nor false; write one of them")
        if truths or (isinstance(value, bool) and not _takes(annotation, bool)):
            said = str(truths[0] if truths else value).lower()
            raise ValueError(f"{said} is no value for this key; write another")
        return value


def _truths(value: Any) -> Iterator[bool]:
    """Every true and false in values, lists and tables."""
    if isinstance(value, bool):
        yield value
    elif isinstance(value, list | tuple | dict):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _truths(one)


def _takes(annotation: Any, kind: type) -> bool:
    """Whether a type, or one of those that it is made of, is this kind or anything at all."""
    return annotation in (kind, Any) or any(_takes(one, kind) for one in typing.get_args(annotation))


Model = TypeVar("Model", bound=BaseModel)


def is_safe_name(name: str) -> bool:
    """Whether a name is letters, digits, ``-`` and ``_`` only, and so cannot leave a folder."""
    return SAFE_NAME.fullmatch(name) is not None


def safe_name(text: str, otherwise: str = "flight") -> str:
    """The nearest safe name to a text, or another one where it has no letter of those."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-_")[:100]
    return name if is_safe_name(name) else otherwise


def flight_name(folder: Path, stated: str) -> str:
    """What a flight and its reports are called: as its folder, or as stated where that has no such letters.

    Examples
    --------
    >>> flight_name(Path("flights/trial"), "slow-vessel-1"), flight_name(Path("flights/my day"), "card")
    ('trial', 'my-day')
    """
    name = folder.resolve().name
    return name if is_safe_name(name) else safe_name(name, stated)


def leaves_folder(name: str) -> bool:
    """Whether a relative file name is absolute or climbs out, read as POSIX and as Windows would read it."""
    windows = PureWindowsPath(name)
    return (
        not name
        or "\0" in name
        or PurePosixPath(name).is_absolute()
        or bool(windows.drive or windows.root)
        or ".." in windows.parts
    )


def _safe(name: str) -> str:
    if not is_safe_name(name):
        raise ValueError(f"{name[:40]!r} cannot be a name here; {SAFE}")
    return name


def _below(name: str) -> str:
    if leaves_folder(name):
        raise ValueError(f"the path {name!r} leaves its folder; name a file below it")
    return name


#: What becomes a file name on every system; a file below a folder.
SafeName = Annotated[str, AfterValidator(_safe)]
Below = Annotated[str, AfterValidator(_below)]


def inside(folder: Path, name: str, *, file: Path, field: str) -> Path:
    """Path of `name` below `folder`; `file` and `field` say who asked for it.

    Raises
    ------
    WildlabError
        Where the name is absolute, climbs out with ``..``, is a symbolic link to somewhere else or in a
        circle, or is too long.
    """
    path = folder / name
    try:
        stays = not leaves_folder(name) and path.resolve().is_relative_to(folder.resolve())
    except RuntimeError:  # how Python says that links go in a circle
        raise unreadable(OSError(errno.ELOOP, os.strerror(errno.ELOOP)), path, field) from None
    except OSError as error:
        raise unreadable(error, path, field) from None
    if not stays:
        raise WildlabError(
            f"the path {name!r} leaves its folder",
            "copy the file below it",
            file=file,
            field=field,
        )
    return path


def printable(text: str) -> str:
    """Text as it is, or quoted where it holds what a terminal would obey."""
    return text if text.isprintable() else repr(text)


def did_you_mean(wrong: str, known: Iterable[str]) -> str:
    """A clause that names the closest known word, and all of them (or the first 40)."""
    known = sorted(printable(word) for word in known)
    close = difflib.get_close_matches(wrong, known, n=1)
    every = ", ".join(known[:40]) + (", ..." if len(known) > 40 else "")
    return f"did you mean {close[0]!r}? Known are {every}" if close else f"use one of {every}"


def read_toml(path: Path, what: str, fix: str = "check the path") -> dict[str, Any]:
    """Read a TOML file; `what` is what it is to the user ("the manifest of a flight"), `fix` what to do
    where it is missing.

    Raises
    ------
    WildlabError
        Where it is missing, not UTF-8 or not TOML.
    """
    try:
        content = read_regular(path, TOML_LIMIT)
    except FileNotFoundError:
        raise WildlabError(f"there is no such file, and it is {what}", fix, file=path) from None
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise WildlabError(f"is not valid TOML ({error})", "mend that line", file=path) from None
    return parse_toml(text, path)


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """TOML text as nested dicts; `path` is only for messages.

    Raises
    ------
    WildlabError
        Where it is not TOML.
    """
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise WildlabError(f"is not valid TOML ({error})", "mend that line", file=path) from None


def regular_size(path: Path, limit: int | None = None, field: str | None = None) -> int:
    """Size in bytes of a file that may be opened: a regular one, no pipe, no device, and not too large.

    Parameters
    ----------
    path
        Of the file; a link is followed.
    limit
        The most bytes it may have; None for any number.
    field
        Who asked for it, for messages.

    Returns
    -------
    int

    Raises
    ------
    FileNotFoundError
        Where there is none.
    WildlabError
        Where it is something else than a regular file, too large, or out of reach.
    """
    try:
        found = path.stat()
    except FileNotFoundError:
        raise
    except OSError as error:
        raise unreadable(error, path, field) from None
    if not stat.S_ISREG(found.st_mode):
        kind = next((word for is_one, word in _KINDS if is_one(found.st_mode)), "something else")
        raise WildlabError(f"is {kind} and no regular file", "check the path", file=path, field=field)
    if limit is not None and found.st_size > limit:
        raise WildlabError(
            f"has {found.st_size:,} bytes, more than {limit:,}",
            "check the path",
            file=path,
            field=field,
        )
    return found.st_size


_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def read_regular(path: Path, limit: int, field: str | None = None) -> bytes:
    """The content of a regular file of at most so many bytes.

    Raises
    ------
    FileNotFoundError
        Where there is none.
    WildlabError
        As `regular_size`, and where it cannot be read.
    """
    regular_size(path, limit, field)
    try:
        with path.open("rb") as stream:
            content = stream.read(limit + 1)
    except OSError as error:
        raise unreadable(error, path, field) from None
    if len(content) > limit:
        fix = "try again"
        raise WildlabError("grew while it was read", fix, file=path, field=field)
    return content


def unreadable(error: OSError, path: Path, field: str | None = None) -> WildlabError:
    """What the system said of a file, as a sentence with what to do."""
    return system_error(error, path, field, cannot="be read")


@contextlib.contextmanager
def gdal() -> Iterator[None]:
    """GDAL with a small cache, without a look at neighbouring files or the network, or a word on places."""
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    with warnings.catch_warnings(), rasterio.Env(GDAL_CACHEMAX=64, GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR"):
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        yield


def check_model(model: type[Model], data: Any, path: Path | None) -> Model:
    """Check parsed TOML against a model.

    Raises
    ------
    WildlabError
        With the file, the dotted name of the first wrong key, what was found and what to do.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        # An unknown key is often a misspelt one: naming it explains a "missing" key, so it comes first.
        faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
        fault = faults[0]
        # Of a name that cannot be one, pydantic says which and that it is a key.
        at = fault["loc"][:-2] if fault["loc"][-1:] == ("[key]",) else fault["loc"]
        problem, fix = _explain(model, fault["type"], at, fault["msg"], fault.get("input"))
        raise WildlabError(problem, fix, file=path, field=dotted(at) or None) from None


def dotted(location: Sequence[str | int]) -> str:
    """``("sources", 0, "file")`` -> ``"sources[0].file"``."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _explain(
    model: type[BaseModel], kind: str, location: tuple[str | int, ...], message: str, found: Any
) -> tuple[str, str]:
    if kind == "extra_forbidden":
        known = _keys_at(model, location[:-1])
        return "this key is not known", (did_you_mean(str(location[-1]), known) if known else "take it out")
    if kind == "missing":
        return "this key is missing", "add it"
    text = message.removeprefix("Value error, ").rstrip(".")
    text = text[:1].lower() + text[1:]
    if "; " in text:  # our own validators say problem and fix
        problem, fix = text.split("; ", 1)
        return problem, fix
    shown = repr(found)
    return f"{shown if len(shown) <= 80 else shown[:77] + '...'} does not fit ({text})", "mend that value"


def _keys_at(model: type[BaseModel], location: Sequence[str | int]) -> list[str]:
    """The keys a (nested) model knows at a place in it; empty where that cannot be told."""
    here: Any = model
    for part in location:
        here = _model_in(here)
        if here is None:
            return []
        if isinstance(part, str) and part in here.model_fields:
            here = here.model_fields[part].annotation
    here = _model_in(here)
    return list(here.model_fields) if here is not None else []


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in typing.get_args(annotation):  # of X | None, tuple[X, ...], Annotated[X, ...]
        found = _model_in(argument)
        if found is not None:
            return found
    return None


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
