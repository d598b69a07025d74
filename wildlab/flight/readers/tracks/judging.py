"""What the readers of tracks share: text of any encoding, numbers that may be none, rows that cannot be true.

A row is judged by what it says and by its neighbours; nothing is dropped here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.readers.logs.log import HEIGHTS
from wildlab.flight.readers.logs.order import LONGEST_S, in_order
from wildlab.flight.schema import DOWN, SPEED
from wildlab.flight.time.leap_seconds import GPS_START_S

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: No log is from before GPS, none from after this, s since 1970.
LATEST_S = datetime(2100, 1, 1, tzinfo=UTC).timestamp()
#: Receivers that have no place say zero and zero; so near to it nobody flies, degrees.
_NOWHERE_DEG = 1e-6
#: Receivers that have no dilution of precision say 99, 99.9 or 99.99.
NO_DILUTION = 99.0
#: A gap is so many usual steps long, and at least as many seconds.
_GAP_STEPS, _GAP_S = 5.0, 2.0
_EARTH_M = 6371e3
#: So few stamps do not make a track of their own.
_HANDFUL = 5
#: Places of one moment may be so far apart by their noise, m.
_NOISE_M = 30.0
_HEIGHTS = tuple(name for name in HEIGHTS if name.startswith("height"))


def decode(data: bytes) -> str:
    """Text of a file in UTF-8, in UTF-16 with its mark, or else in Latin-1; never fails."""
    for mark, codec in ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if data.startswith(mark):
            return data[len(mark) :].decode(codec, "replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


#: Plain decimal numbers only: `float` would read "1_0", "nan" and "infinity" too.
_NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?\s*", re.ASCII)
#: What plain numbers have none of.
_STRANGE = re.compile(r"[^0-9eE+. -]")


def number(text: str | bytes | None) -> float:
    """A plain decimal number, NaN where the text is none."""
    if not text:
        return math.nan
    if isinstance(text, bytes):
        text = text.decode("latin-1")
    if len(text) > 64 or not _NUMBER.fullmatch(text):
        return math.nan
    value = float(text)
    return value if math.isfinite(value) else math.nan


def numbers(texts: Iterable[str | bytes | None]) -> Array:
    """(N,) plain decimal numbers, NaN where a text is none."""
    texts = list(texts)
    try:
        words = [text for text in texts if isinstance(text, str) and text]
        plain = all(isinstance(text, str) or text is None for text in texts)
        if plain and not _STRANGE.search("".join(words)):
            values = np.array([float(text) if text else np.nan for text in texts])
            return np.where(np.isfinite(values), values, np.nan)
    except ValueError:
        pass
    return np.array([number(text) for text in texts], dtype=float)


def plural(count: int, singular: str, several: str | None = None) -> str:
    """``"1 row"``, ``"2 rows"``."""
    return f"{count} {singular if count == 1 else several or singular + 's'}"


def _between(values: Array, bounds: tuple[float, float]) -> Mask:
    """True where a value is missing, too."""
    return ~((values < bounds[0]) | (values > bounds[1]))


def _metres(latitude: Array, longitude: Array, i: NDArray[np.int64], j: NDArray[np.int64]) -> Array:
    """m between the rows i and j, on a sphere: good to 0.5 %, which is enough for what is impossible."""
    p, q = np.radians(latitude[i]), np.radians(latitude[j])
    turned = np.radians(longitude[j] - longitude[i])
    half = np.sin((q - p) / 2) ** 2 + np.cos(p) * np.cos(q) * np.sin(turned / 2) ** 2
    return np.asarray(2 * _EARTH_M * np.arcsin(np.sqrt(np.clip(half, 0.0, 1.0))))


def _reachable(time: Array, latitude: Array, longitude: Array) -> Mask:
    """Rows that can be reached from the longest unbroken run of rows, at a speed that the schema allows."""
    count = len(time)
    every = np.arange(count)
    far = _metres(latitude, longitude, every[:-1], every[1:]) > _NOISE_M + SPEED[1] * np.diff(time)
    if not far.any():
        return np.ones(count, bool)
    starts = np.r_[0, np.flatnonzero(far) + 1]
    ends = np.r_[starts[1:], count]
    kept = np.zeros(count, bool)
    longest = int(np.argmax(ends - starts))
    kept[starts[longest] : ends[longest]] = True

    def near(one: int, begin: int, end: int) -> NDArray[np.intp]:
        """Rows from begin to end that can be reached from one."""
        rows = np.arange(begin, end)
        away = _metres(latitude, longitude, np.full(len(rows), one), rows)
        return np.asarray(rows[away <= _NOISE_M + SPEED[1] * np.abs(time[rows] - time[one])])

    last = int(ends[longest]) - 1
    for k in range(longest + 1, len(starts)):
        reached = near(last, starts[k], ends[k])
        if len(reached):
            kept[reached[0] : ends[k]] = True
            last = int(ends[k]) - 1
    first = int(starts[longest])
    for k in range(longest - 1, -1, -1):
        reached = near(first, starts[k], ends[k])
        if len(reached):
            kept[starts[k] : reached[-1] + 1] = True
            first = int(starts[k])
    return kept


def drop_rare_heights(columns: dict[str, Array]) -> list[str]:
    """Takes heights out of `columns` that fewer than half of the rows have; a sentence where it did.

    Rows without a height would be of no use beside rows with one, and most would be lost.
    """
    names = [name for name in (*_HEIGHTS, "undulation_m") if name in columns]
    heights = [columns[name] for name in names if name != "undulation_m"]
    known = np.logical_or.reduce([np.isfinite(one) for one in heights]) if heights else np.zeros(0, bool)
    if not known.any() or known.mean() >= 0.5:
        return []
    for name in names:
        del columns[name]
    return [f"only {plural(int(known.sum()), 'row')} of {len(known)} have a height: heights are left out"]


def judge(
    columns: Mapping[str, ArrayLike], unusable: Mapping[str, ArrayLike] | None = None
) -> dict[str, Mask]:
    """Why rows of a part with places cannot be used, beside what the format itself says of them.

    Parameters
    ----------
    columns
        As for `make_stream`; ``time_s``, ``latitude_deg`` and ``longitude_deg`` among them.
    unusable
        Reason -> (N,) bool, as the format has it; these come first.

    Returns
    -------
    dict
        Reason -> (N,) bool for `make_stream`. Rows without any reason have a place, a time (if any row has
        one), a height (if any has one) and strictly increasing times.
    """
    have = {name: np.asarray(values, float) for name, values in columns.items() if name not in ("file",)}
    latitude, longitude, time = have["latitude_deg"], have["longitude_deg"], have["time_s"]
    found = {reason: np.asarray(mask, bool) for reason, mask in (unusable or {}).items()}
    placed = np.isfinite(latitude) & np.isfinite(longitude)
    nowhere = (np.abs(latitude) < _NOWHERE_DEG) & (np.abs(longitude) < _NOWHERE_DEG)
    heights = [have[name] for name in _HEIGHTS if name in have]
    velocities = [have[name] for name in ("v_north_m_s", "v_east_m_s", "v_down_m_s") if name in have]
    never = np.zeros(len(time), bool)
    ours = {
        "no position": ~placed,
        "impossible position": placed & ((np.abs(latitude) > 90) | (np.abs(longitude) > 360)),
        "position is a placeholder": nowhere,
        "impossible height": np.logical_or.reduce([never, *(~_between(-one, DOWN) for one in heights)]),
        "impossible speed": np.logical_or.reduce([never, *(~_between(one, SPEED) for one in velocities)]),
        "no dilution of precision": have.get("hdop", np.full(len(time), np.nan)) >= NO_DILUTION,
    }
    if np.isfinite(time).any():
        ours["no time"] = np.isnan(time)
        ours["impossible time"] = (time < GPS_START_S) | (time > LATEST_S)
    for reason, mask in ours.items():
        found[reason] = found.get(reason, never) | mask
    bad = np.logical_or.reduce(list(found.values()))
    if heights:
        without = np.logical_and.reduce([np.isnan(height) for height in heights])
        if not without[~bad].all():
            found["no height"] = without
            bad |= without
    _judge_order(time, latitude, longitude, bad, found)
    return found


def _alone(time: Array) -> Mask:
    """Stamps of which fewer than a handful are within days of each other, where there are many others."""
    order = np.argsort(time, kind="stable")
    group = np.cumsum(np.r_[0, np.diff(time[order]) > LONGEST_S])
    sizes = np.bincount(group)
    alone = np.zeros(len(time), bool)
    alone[order] = (sizes < _HANDFUL)[group] & (sizes.max() >= 2 * _HANDFUL)
    return alone


def _judge_order(time: Array, latitude: Array, longitude: Array, bad: Mask, found: dict[str, Mask]) -> None:
    good = np.flatnonzero(~bad & np.isfinite(time))
    if not len(good):
        return
    alone = _alone(time[good])
    found["stamp far from all others"] = np.zeros(len(time), bool)
    found["stamp far from all others"][good[alone]] = True
    good = good[~alone]
    # A file of tracks may hold those of years.
    kept = in_order(time[good], longest_s=np.inf)
    stamps = np.sort(time[good[kept]])
    left = good[~kept]
    place = np.clip(np.searchsorted(stamps, time[left]), 0, len(stamps) - 1)
    again = stamps[place] == time[left]
    for reason, rows in (("repeated stamp", left[again]), ("stamp out of order", left[~again])):
        found[reason] = np.zeros(len(time), bool)
        found[reason][rows] = True
    good = good[kept]
    found["impossible jump"] = np.zeros(len(time), bool)
    found["impossible jump"][good[~_reachable(time[good], latitude[good], longitude[good])]] = True


def gaps(time: Array, use: ArrayLike) -> list[str]:
    """A sentence on where a track is silent, or none."""
    kept = time[np.asarray(use, bool)]
    steps = np.diff(kept[np.isfinite(kept)])
    if len(steps) < 3:
        return []
    usual = float(np.median(steps))
    long = steps[steps > max(_GAP_STEPS * usual, _GAP_S)]
    if not len(long):
        return []
    found = plural(len(long), "gap")
    return [f"{found} in it, the longest of {long.max():.4g} s, where steps are usually {usual:.3g} s"]
