"""The clock of a vehicle in a telemetry log: time since it was switched on, brought to UTC.

The ground station stamps what it receives, late by up to seconds; the vehicle stamps what it measures, since
it was switched on. What goes with what is fitted along the lower edge of the receipts
(`wildlab.flight.time.fitting`), or, where the vehicle knows UTC, on what it says itself (``SYSTEM_TIME``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.logs.log import Clock
from wildlab.flight.readers.mavlink.frames import MavlinkFrames, Messages, messages
from wildlab.flight.time.fitting import ClockFit
from wildlab.flight.time.steady import fit_steady

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

DAY_S = 86400.0
#: Stamps that fall back by more than this mean that the vehicle was switched on again.
RESTART_S = 10.0
MOST_RUNS = 50
#: A stamp goes with its receipt if it lies within this of it, the clocks' difference taken off.
BESIDE_S = 60.0
#: Messages with time since start that each autopilot sends all the time.
_STAMPED = ("ATTITUDE", "GLOBAL_POSITION_INT", "SYSTEM_TIME", "LOCAL_POSITION_NED", "SCALED_IMU2")


class Boot(NamedTuple):
    """Runs of a vehicle from one start to the next, each with its clock.

    `first` (S,): number of the frame that each begins with. `rate`, `offset_s` (S,): to UTC. `behind_s` (S,):
    middle of what receipts are behind UTC. `clock`: of the longest run. `notes`: sentences.
    """

    first: NDArray[np.int64]
    rate: Array
    offset_s: Array
    behind_s: Array
    clock: Clock
    notes: tuple[str, ...]

    def utc(self, boot_s: Array, number: NDArray[np.int64]) -> Array:
        """UTC (N,) of stamps (N,) in frames with the numbers (N,), s since 1970."""
        run = self._run(number)
        return np.asarray(self.offset_s[run] + self.rate[run] * boot_s)

    def beside(self, utc_s: Array, found: Messages) -> Flags:
        """(N,) whether times in UTC go with the receipts of their messages."""
        behind = self.behind_s[self._run(found.number)]
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs(found.received_s - behind - utc_s) < BESIDE_S)

    def _run(self, number: NDArray[np.int64]) -> NDArray[np.intp]:
        return np.maximum(np.searchsorted(self.first, number, side="right") - 1, 0)


def find_boot(frames: MavlinkFrames, system: int, component: int) -> Boot | None:
    """The clock of an autopilot; None where nothing that it sent has a stamp."""
    kinds = [messages(frames, name, system, component) for name in _STAMPED]
    number = np.concatenate([one.number for one in kinds])
    order = np.argsort(number, kind="stable")
    number = number[order]
    own = np.concatenate([one["time_boot_ms"] for one in kinds])[order] / 1e3
    received = np.concatenate([one.received_s for one in kinds])[order]
    known = own > 0
    number, own, received = number[known], own[known], received[known]
    if not len(own):
        return None
    starts = np.r_[0, 1 + np.flatnonzero(np.diff(own) < -RESTART_S)]
    falls = len(starts) - 1
    if falls >= MOST_RUNS:
        # No vehicle is switched on so often: the stamps are of no use, and one line goes under most of them.
        starts = starts[:1]
    told = kinds[_STAMPED.index("SYSTEM_TIME")]
    unix = told["time_unix_usec"] / 1e6
    said = unix > 0
    near = said & (np.abs(unix - told.received_s) < DAY_S)
    believed = bool(near.sum() > said.sum() / 2)
    fits: list[ClockFit] = []
    behind = []
    from_vehicle = []
    for a, b in zip(starts, np.r_[starts[1:], len(own)], strict=True):
        fit = fit_steady(own[a:b], received[a:b], late=True)
        inside = near & (told.number >= number[a]) & (told.number <= number[b - 1])
        from_vehicle.append(believed and int(inside.sum()) > 2)
        if from_vehicle[-1]:
            fit = fit_steady(told["time_boot_ms"][inside] / 1e3, unix[inside])
        fits.append(fit)
        behind.append(float(np.median(received[a:b] - fit.to_reference(own[a:b]))))
    main = int(np.argmax(np.diff(np.r_[starts, len(own)])))
    fit = fits[main]
    left = np.abs(fit.residual[fit.used])
    base = "UTC of the messages SYSTEM_TIME" if from_vehicle[main] else "times of receipt"
    clock = Clock(
        base, fit.rate, fit.offset_s, fit.spread_s, float(left.max()), int(fit.used.sum()), fit.rate_sd
    )
    late = received - np.array([one.offset_s for one in fits])[_runs(starts, len(own))]
    late = late - np.array([one.rate for one in fits])[_runs(starts, len(own))] * own
    notes = _notes(unix[said], told.received_s[said], believed, len(starts), late, from_vehicle[main])
    if falls >= MOST_RUNS:
        notes.append(f"the vehicle's stamps fall back {falls} times: they are of several clocks")
    first = number[starts]
    return Boot(
        first,
        np.array([one.rate for one in fits]),
        np.array([one.offset_s for one in fits]),
        np.array(behind),
        clock,
        tuple(notes),
    )


def _runs(starts: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    return np.searchsorted(starts, np.arange(count), side="right") - 1


def _notes(
    unix: Array, received: Array, believed: bool, runs: int, late: Array, from_vehicle: bool
) -> list[str]:
    notes = []
    if len(unix) and not believed:
        far = int((np.abs(unix - received) >= DAY_S).sum())
        year = int(1970 + np.median(unix) // 31556952)
        notes.append(
            f"UTC of its messages SYSTEM_TIME is not believed: {far} of {len(unix)} are more than a day from "
            f"their receipt (the middle one in the year {year})"
        )
    middle, worst = (float(np.percentile(late, share)) for share in (50, 99))
    if from_vehicle:
        notes.append(f"the ground station received {middle:.3f} s after the vehicle's UTC, in the middle")
    else:
        notes.append(
            "UTC is the ground station's: the vehicle's clock is fitted along the earliest receipts, the "
            f"others are {middle:.3f} s later in the middle, 1 of 100 is more than {worst:.3f} s; what the "
            "quickest took is not known"
        )
    if runs > 1:
        notes.append(f"the vehicle was switched on {runs} times within it; each run has a clock of its own")
    return notes


def times(
    found: Messages, boot: Boot | None, field: str, own: bool = True
) -> tuple[dict[str, Array], dict[str, Flags]]:
    """Columns ``time_s`` and ``time_log_s`` of messages, and which rows have stamps that cannot be true.

    Parameters
    ----------
    found
        (N,) messages.
    boot
        The vehicle's clock.
    field
        ``"time_boot_ms"``, ``"time_usec"``, or ``""`` where the message has no stamp.
    own
        Whether the vehicle's autopilot sent them; the stamps of others are used only if they go by its clock.

    Returns
    -------
    columns, unusable
        Without a stamp that goes by a known clock, ``time_s`` is that of receipt.
    """
    none = np.full(len(found), np.nan)
    received = {"time_s": found.received_s, "time_log_s": none}
    if not field or field not in found.fields:
        return received, {}
    stamp = found[field] / (1e3 if field == "time_boot_ms" else 1e6)
    if field == "time_usec" and _most(np.abs(stamp - found.received_s) < DAY_S):
        return {"time_s": stamp, "time_log_s": stamp}, {}
    if boot is None:
        return received, {}
    utc = boot.utc(stamp, found.number)
    beside = boot.beside(utc, found)
    if not _most(beside) and not (own and field == "time_boot_ms"):
        return received, {}
    return {"time_s": utc, "time_log_s": stamp}, {"a stamp that its receipt contradicts": ~beside}


def _most(rows: Flags) -> bool:
    return bool(len(rows) and rows.mean() > 0.5)
