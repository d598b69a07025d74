"""One part of a log as a recipe asks for it: heights from what it names, stamps moved by what it states."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.log import RawLog, Stream
from wildlab.flight.readers.photos import of_camera
from wildlab.flight.trigger_matching import match_triggers


class Wanted(Protocol):
    """What a recipe says of a log's table."""

    @property
    def part(self) -> str: ...
    @property
    def height(self) -> str | None: ...
    @property
    def add_m(self) -> float: ...
    @property
    def offset_s(self) -> float: ...
    @property
    def camera(self) -> str | None: ...


def stream_of(log: RawLog, wanted: Wanted, path: Path) -> Stream:
    """The part, with the columns ``height_m`` and ``stem`` (of ``file`` or ``image``) where they make sense.

    Parameters
    ----------
    log
        Read.
    wanted
        The part, what heights count from and what is added to them, what is added to stamps.
    path
        Only for messages.

    Returns
    -------
    Stream
        Rows without a stamp or a height that the recipe asked for are marked as not used.

    Raises
    ------
    WildlabError
        Where the log has no such part or no such heights.
    """
    if wanted.part not in log.parts:
        there = ", ".join(log.parts) or "nothing that can be used"
        raise WildlabError(
            f"this log has no {wanted.part}", f"use what it has: {there}", file=path, field="part"
        )
    if wanted.camera is not None and "photos" in log.parts:
        log = of_camera(log, wanted.camera)
    stream = log.parts[wanted.part]
    columns = dict(stream.columns)
    use, why = columns["use"].copy(), columns["why"].copy()
    if "time_s" in columns or "time_log_s" in columns:
        known = columns.get("time_s", np.full(len(stream), np.nan))
        # The log's own stamps, where the recipe says what they count from; those of images may stand alone.
        stated = wanted.offset_s or wanted.part == "photos"
        if stated and not np.isfinite(known).any() and "time_log_s" in columns:
            known = columns["time_log_s"]
        columns["time_s"] = known + wanted.offset_s
    if wanted.height is not None:
        name = f"height_{wanted.height}_m"
        if name not in columns:
            there = ", ".join(one for one in columns if one.startswith("height_")) or "none"
            problem = f"its {wanted.part} have no heights of the kind {wanted.height!r}"
            raise WildlabError(problem, f"there are {there}", file=path, field="height")
        columns["height_m"] = columns[name] + wanted.add_m
        lost = (use == 1.0) & ~np.isfinite(columns["height_m"])
        use[lost], why[lost] = 0.0, "no height"
    for name in ("file", "image"):
        if name in columns:
            columns["stem"] = np.array([Path(str(one)).stem for one in columns[name]], dtype=object)
    done = Stream({**columns, "use": use, "why": why}, stream.rows, stream.counted_in)
    return in_order(done) if wanted.part == "photos" else done


def in_order(stream: Stream) -> Stream:
    """Images in the order of their stamps: counters begin again, and copies have names of their own."""
    times = stream.columns.get("time_s")
    if times is None or not np.isfinite(times).any():
        return stream
    return stream.take(np.argsort(times, kind="stable"))


def of_images(pixels: Stream, images: Stream) -> Stream:
    """Pixels, those marked as not used that are of no image with a time.

    Parameters
    ----------
    pixels
        With ``image`` and ``stem``.
    images
        With ``file`` and ``stem``.

    Returns
    -------
    Stream
    """
    there = np.ones(len(images), bool)
    times = images.columns.get("time_s")
    if times is not None and np.isfinite(times).any():
        there = np.isfinite(times)
    known = {str(one) for name in ("file", "stem") for one in images.columns[name][there]}
    strange = np.array(
        [
            str(a) not in known and str(b) not in known
            for a, b in zip(pixels.columns["image"], pixels.columns["stem"], strict=True)
        ],
        bool,
    )
    use, why = pixels.columns["use"].copy(), pixels.columns["why"].copy()
    why[strange & (use == 1.0)] = "its image is not there"
    use[strange] = 0.0
    return Stream({**pixels.columns, "use": use, "why": why}, pixels.rows, pixels.counted_in)


def stamped_by(images: Stream, triggers: Stream, path: Path) -> Stream:
    """Images with the times of the records of their triggers; those without a record have none.

    Parameters
    ----------
    images
        With ``time_s`` or ``time_log_s``, by the camera's clock.
    triggers
        With ``time_s``.
    path
        Only for messages.

    Returns
    -------
    Stream

    Raises
    ------
    WildlabError
        Where neither has times, or no image belongs to a record for certain.
    """
    stamps = images.columns.get("time_log_s", images.columns.get("time_s"))
    times = triggers.columns.get("time_s")
    if stamps is None or times is None:
        problem = "the images or the records of their triggers have no times"
        raise WildlabError(problem, "take out triggers", file=path, field="triggers")
    of_record = np.where(triggers.used, times, np.nan)
    match = match_triggers(stamps, of_record)
    if not match.certain:
        raise WildlabError(
            "which image belongs to which record of a trigger is not certain",
            "take out triggers, and give camera_offset_s in [clocks]",
            file=path,
            field="triggers",
        )
    taken = np.where(match.trigger >= 0, of_record[np.maximum(match.trigger, 0)], np.nan)
    return in_order(Stream({**images.columns, "time_s": taken}, images.rows, images.counted_in))
