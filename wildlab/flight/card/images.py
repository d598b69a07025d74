"""The images of a card: which camera took them, and how their stamps meet the vehicle's log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.card.roles import QUARTER_S, CardItem, quarters_ahead, span_of
from wildlab.flight.files import printable
from wildlab.flight.manifest import CameraPart
from wildlab.flight.readers.log import Stream
from wildlab.flight.readers.photos import camera_of, of_camera
from wildlab.flight.recipe.raw import match_images
from wildlab.flight.units import Span


class ImageClock(NamedTuple):
    """How the images' stamps become flight time.

    Attributes
    ----------
    kind
        ``"utc"``, or ``"sequence"`` for images without any time.
    offset_s
        What to add to the stamps.
    note
        A sentence on it.
    triggers
        Name of the recipe's table of triggers that they have their times from, where there is one.
    """

    kind: Literal["utc", "sequence"]
    offset_s: float
    note: str
    triggers: str = ""


def one_camera(
    images: CardItem, wanted: str = "", stated: CameraPart | None = None
) -> tuple[CardItem, str | None, str]:
    """The images of one camera: of that whose name has what is wanted, else whose images are as large as
    those of the stated one, else of the thermal one, else of that with the most.

    Parameters
    ----------
    images
        With the part ``photos``.
    wanted
        A part of the camera's name, as the user states it.
    stated
        The camera, where the user states it.

    Returns
    -------
    CardItem, the camera's name (None where all images are of one), and a sentence ("": there is no choice)

    Raises
    ------
    WildlabError
        Where no camera's name has what is wanted.
    """
    if images.log is None or "photos" not in images.log.parts:
        return images, None, ""
    named = Counter(str(one) for one in images.log.parts["photos"].columns.get("camera", ()))
    if len(named) < 2 and not wanted:
        return images, None, ""
    those = [name for name in named if wanted.lower() in name.lower()]
    if not those:
        known = ", ".join(repr(name) for name in named)
        raise WildlabError(f"no camera's name has {wanted!r}", f"there are {known}", field="--role")
    if stated is not None and not wanted:
        columns = images.log.parts["photos"].columns
        fits = (columns["width_px"] == stated.width_px) & (columns["height_px"] == stated.height_px)
        those = sorted({str(one) for one in columns["camera"][fits]}) or those
    thermal = [name for name in those if "thermal" in name.lower()]
    chosen = max(thermal or those, key=lambda name: named[name])
    others = ", ".join(f"{count} of {name or 'no name'}" for name, count in named.items() if name != chosen)
    note = (
        f"Of {images.shown} {named[chosen]} images of {chosen or 'no named camera'} are taken, not {others}"
    )
    note = f"{note} (--role {images.name}=images:NAME chooses)." if others else ""
    return replace(images, log=of_camera(images.log, chosen)), chosen, note


def camera_of_images(
    images: CardItem, stated: CameraPart | None, focal_px: float | None = None
) -> tuple[CameraPart | None, str]:
    """The camera that took the images and how it is known; or None and why it is not.

    Parameters
    ----------
    images
        With the part ``photos``.
    stated
        By the user, which counts for more than the tags.
    focal_px
        Likewise, where the rest of the camera is to be that of the images.

    Returns
    -------
    camera, and a clause
    """
    if images.log is None:
        return None, images.problem
    columns = images.log.parts["photos"].columns
    sizes = np.column_stack([columns["width_px"], columns["height_px"]])
    sizes = np.unique(sizes[np.isfinite(sizes).all(axis=1)], axis=0)
    if stated is not None:
        own = (stated.width_px, stated.height_px)
        if len(sizes) and (sizes != own).any():
            seen = ", ".join("{:.0f} x {:.0f}".format(*one) for one in sizes[:4])
            return None, f"the stated camera has {own[0]} x {own[1]} px, and they have {seen}"
        return stated, "as you stated it"
    if focal_px is not None:
        if len(sizes) != 1:
            return None, "they are of several sizes" if len(sizes) else "nothing says how large they are"
        names = {str(one) for one in columns.get("camera", ())} - {""}
        found: dict[str, Any] | None = {
            **{"camera": names.pop() if len(names) == 1 else "", "focal_px": focal_px},
            **{"width_px": int(sizes[0, 0]), "height_px": int(sizes[0, 1]), "how": "as you stated it"},
        }
    else:
        try:
            found = camera_of(images.log)
        except WildlabError as error:
            return None, error.problem
    if found is None:
        return None, "no tag has the focal length in pixels"
    width, height, focal = found["width_px"], found["height_px"], found["focal_px"]
    camera = CameraPart(
        **{"name": found["camera"] or "not stated", "width_px": width, "height_px": height},
        **{"fx_px": focal, "fy_px": focal, "cx_px": (width - 1) / 2, "cy_px": (height - 1) / 2},
    )
    how = f"{width} x {height} px, focal length {focal:.0f} px ({found['how']})"
    return camera, f"{how}; a central principal point, no distortion"


def clock_of_images(
    images: CardItem,
    own: CardItem | None,
    stated_offset_s: float | None,
    triggers: tuple[str, Stream] | None = None,
    others: Sequence[CardItem] = (),
) -> ImageClock:
    """How the images meet the vehicle's log.

    By records of their triggers; by UTC where they have it; else by the only whole number of quarters of an
    hour that brings their camera's wall clock into the flight.

    Parameters
    ----------
    images
        With the part ``photos``.
    own
        The vehicle's own log.
    stated_offset_s
        What to add to the stamps, where the user states it.
    triggers
        Name of the recipe's table of triggers, and its rows, where there is one.
    others
        Tracks of targets: where the vehicle has no log, they say when the flight was.

    Returns
    -------
    ImageClock
    """
    photos = images.part("photos")
    columns: dict[str, NDArray[Any]] = {} if photos is None else photos.columns
    utc, wall = (_known(columns.get(name)) for name in ("time_s", "time_log_s"))
    if photos is not None and triggers is not None and stated_offset_s is None:
        clock = _by_triggers(photos, *triggers)
        if clock is not None:
            return clock
    if photos is None or not len(utc) + len(wall):
        return ImageClock("sequence", 0.0, "The images have no time.")
    offset = stated_offset_s or 0.0
    if len(utc):
        base = images.log.clock.base if images.log is not None and images.log.clock is not None else ""
        note = f"The images' stamps are {printable(base) if base.startswith('local') else 'in UTC'}."
        note += f" {offset:g} s are added to them, as you said." if offset else ""
        return ImageClock("utc", offset, note)
    if stated_offset_s is not None:
        return ImageClock("utc", offset, f"The camera's wall clock gets {offset:g} s, as you said.")
    flown = _flown(own, others)
    quarters = None if flown is None else quarters_ahead(wall, flown)
    if quarters is None:
        note = "The camera's clock is taken for UTC: --zone or --camera-offset."
        return ImageClock("utc", 0.0, note)
    note = (
        f"The camera's clock is taken to be {quarters / 4:+g} h from UTC, which alone brings the images into "
        "the flight; wildlab clock estimates seconds."
    )
    return ImageClock("utc", -quarters * QUARTER_S, note)


def _flown(own: CardItem | None, others: Sequence[CardItem]) -> Span | None:
    """When the flight was: by the vehicle's log, or where it has none by the tracks of targets."""
    spans = [span for one in others if (span := span_of(one)) is not None]
    if own is not None or not spans:
        return None if own is None else span_of(own)
    return min(span[0] for span in spans), max(span[1] for span in spans)


def _by_triggers(photos: Stream, name: str, triggers: Stream) -> ImageClock | None:
    """By the records of triggers; None where they do not fit for certain."""
    times = triggers.columns.get("time_s")
    match = None if times is None else match_images(photos, np.where(triggers.used, times, np.nan))
    if match is None:
        return None
    timed = len(_known(photos.columns.get("time_log_s", photos.columns.get("time_s"))))
    by = "the pattern of intervals" if timed else "their number and order"
    return ImageClock(
        "utc",
        0.0,
        f"{len(photos) - match.images_left} of {len(photos)} images have the time of a trigger, by {by} "
        f"({match.triggers_left} left over).",
        name,
    )


def _known(column: NDArray[Any] | None) -> NDArray[np.float64]:
    if column is None:
        return np.empty(0)
    values = np.asarray(column, float)
    return np.asarray(values[np.isfinite(values)])
