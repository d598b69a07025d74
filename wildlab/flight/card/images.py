"""The images of a card: which camera took them, and how their stamps meet the vehicle's log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.card.found import Found
from wildlab.flight.card.roles import span_of
from wildlab.flight.files import printable
from wildlab.flight.manifest_parts import CameraPart
from wildlab.flight.readers.log import Stream
from wildlab.flight.readers.photos import camera_of, of_camera
from wildlab.flight.time_scales import hours_words, whole_hours
from wildlab.flight.trigger_matching import match_triggers

#: Time zones are whole quarters of an hour, s.
QUARTER_S = 900.0
#: The clock of a camera is set to within this of its zone's time, s.
SET_WITHIN_S = 300.0


@dataclass(frozen=True)
class ImageClock:
    """How the images' stamps become flight time.

    Attributes
    ----------
    kind
        ``"utc"``, or ``"sequence"`` for images without any time.
    offset_s
        What to add to the stamps.
    said
        A sentence on it.
    block
        What the recipe says of the images' table beside its file.
    """

    kind: Literal["utc", "sequence"]
    offset_s: float
    said: str
    block: dict[str, Any] = field(default_factory=dict)


def one_camera(
    images: Found, wanted: str = "", stated: CameraPart | None = None
) -> tuple[Found, str | None, str]:
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
    Found, the camera's name (None where all images are of one), and a sentence ("" where there is no choice)

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
    others = ", ".join(
        f"{count} of {name or 'none that is named'}" for name, count in named.items() if name != chosen
    )
    said = ""
    if others:
        said = (
            f"Of {images.shown} the {named[chosen]} images of {chosen or 'no named camera'} are taken"
            f"{', the thermal one' if len(those) > 1 and thermal else ''}; left out are {others}. "
            f"--role {images.name}=images:NAME takes another camera."
        )
    return replace(images, log=of_camera(images.log, chosen)), chosen, said


def camera_of_images(
    images: Found, stated: CameraPart | None, focal_px: float | None = None
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
    if stated is not None:
        sizes = _sizes(images.log.parts["photos"])
        if len(sizes) and (sizes != (stated.width_px, stated.height_px)).any():
            seen = ", ".join(f"{w:.0f} x {h:.0f}" for w, h in sizes[:4])
            own = f"{stated.width_px} x {stated.height_px}"
            return None, f"the stated camera has {own} px, and they have {seen}"
        return stated, "as you stated it"
    if focal_px is not None:
        return _by_focal_length(images.log.parts["photos"], focal_px)
    try:
        found = camera_of(images.log)
    except WildlabError as error:
        return None, error.problem
    if found is None:
        return None, "no tag of theirs says the focal length in pixels"
    focal = found["focal_px"]
    how = f"{focal:.0f} px by {found['how']}"
    return _pinhole(found["camera"], found["width_px"], found["height_px"], focal, how)


def _pinhole(name: str, width: int, height: int, focal_px: float, how: str) -> tuple[CameraPart | None, str]:
    """A camera whose centre and distortion are not known, and how its focal length is."""
    camera = CameraPart(
        name=name or "not stated",
        width_px=width,
        height_px=height,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=(width - 1) / 2,
        cy_px=(height - 1) / 2,
    )
    return camera, (
        f"{width} x {height} px with a focal length of {how}; its centre and a lens without distortion are "
        "assumed"
    )


def _sizes(photos: Stream) -> NDArray[np.float64]:
    """Widths and heights of the images, each pair once, (K, 2)."""
    sizes = np.column_stack([photos.columns["width_px"], photos.columns["height_px"]])
    return np.asarray(np.unique(sizes[np.isfinite(sizes).all(axis=1)], axis=0))


def _by_focal_length(photos: Stream, focal_px: float) -> tuple[CameraPart | None, str]:
    """A camera of that focal length, as large as the images."""
    sizes = _sizes(photos)
    if len(sizes) != 1:
        return None, "they are of several sizes" if len(sizes) else "nothing says how large they are"
    width, height = (int(one) for one in sizes[0])
    names = {str(one) for one in photos.columns.get("camera", ())} - {""}
    name = names.pop() if len(names) == 1 else ""
    return _pinhole(name, width, height, focal_px, f"{focal_px:g} px, as you stated it")


#: What the clock of images says of a zone that was stated, in front of it.
_ZONED = "local time of the zone "


def _stated_zone(images: Found) -> str | None:
    """That the stamps are local time of a zone that the user stated, in words; None where they are not."""
    clock = None if images.log is None else images.log.clock
    if clock is None or not clock.base.startswith(_ZONED):
        return None
    return f"local time of the zone that you gave, {printable(clock.base.removeprefix(_ZONED))}"


def clock_of_images(
    images: Found,
    own: Found | None,
    stated_offset_s: float | None,
    triggers: tuple[str, Stream] | None = None,
    others: Sequence[Found] = (),
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
    if photos is None:
        return ImageClock("sequence", 0.0, "No image can be used.")
    utc, wall = (_known(photos.columns.get(name)) for name in ("time_s", "time_log_s"))
    offset = 0.0 if stated_offset_s is None else stated_offset_s
    if triggers is not None and stated_offset_s is None and (len(wall) or len(utc)):
        clock = _by_triggers(photos, *triggers)
        if clock is not None:
            return clock
    flown = _flown(own, others)
    if len(utc):
        zone = _stated_zone(images)
        own_utc = "The images' own stamps are in UTC."
        said = own_utc if zone is None else f"The images' stamps are taken for {zone}."
        said += _added(offset)
        why = "one of the two clocks has another zone" if zone is None else "that zone may be wrong (--zone)"
        taken = (float(utc.min()) + offset, float(utc.max()) + offset)
        if (by := whole_hours(taken, flown)) is not None:
            said += (
                f" They are {hours_words(by)} {'ahead of' if by < 0 else 'behind'} the flight's log: none "
                f"was taken on it, and with that taken off they were, so {why}. Give --camera-offset "
                f"{offset + by:g} if it is the camera's."
            )
        return ImageClock("utc", offset, said)
    if not len(wall):
        return ImageClock("sequence", 0.0, "The images have no time: they are numbered in order.")
    if stated_offset_s is not None:
        return ImageClock(
            "utc", offset, f"The wall clock of the camera is corrected by {offset:g} s, as you said."
        )
    if flown is None:
        return ImageClock(
            "utc",
            0.0,
            "The camera's wall clock states no zone and is taken for UTC: times of day may be hours off.",
        )
    quarters = _quarters(wall, flown)
    if quarters is None:
        return ImageClock(
            "utc",
            0.0,
            "The wall clock of the camera states no zone, and no zone brings the images into the flight: "
            "give --zone or --camera-offset.",
        )
    offset = -quarters * QUARTER_S
    return ImageClock(
        "utc",
        offset,
        f"The camera's wall clock is taken to be {_hours(quarters)} UTC: only so do the images fall into the "
        "flight. By seconds it is not known: wildlab clock estimates that.",
    )


def _flown(own: Found | None, others: Sequence[Found]) -> tuple[float, float] | None:
    """When the flight was: by the vehicle's log, or where it has none by the tracks of targets."""
    spans = [span for one in others if (span := span_of(one)) is not None]
    if own is not None or not spans:
        return None if own is None else span_of(own)
    return min(span[0] for span in spans), max(span[1] for span in spans)


def _by_triggers(photos: Stream, name: str, triggers: Stream) -> ImageClock | None:
    """By the records of triggers; None where they do not fit for certain."""
    stamps = photos.columns.get("time_log_s", photos.columns.get("time_s"))
    times = triggers.columns.get("time_s")
    if stamps is None or times is None:
        return None
    try:
        match = match_triggers(stamps, np.where(triggers.used, times, np.nan))
    except WildlabError:
        return None
    if not match.certain:
        return None
    matched = len(stamps) - match.images_left
    left = f"; {_have(match.images_left, 'image')} no record and no time" if match.images_left else ""
    left += f"; {_have(match.triggers_left, 'record')} no image" if match.triggers_left else ""
    return ImageClock(
        "utc",
        0.0,
        f"{matched} of {len(stamps)} images have the time of the record of their trigger, by the pattern of "
        f"the intervals{left}.",
        {"triggers": name},
    )


def _have(count: int, what: str) -> str:
    return f"{count} {what} has" if count == 1 else f"{count} {what}s have"


def _known(column: NDArray[Any] | None) -> NDArray[np.float64]:
    if column is None:
        return np.empty(0)
    values = np.asarray(column, float)
    return np.asarray(values[np.isfinite(values)])


def _added(offset: float) -> str:
    return f" {offset:g} s are added to them, as you said." if offset else ""


def _quarters(wall: NDArray[np.float64], flown: tuple[float, float]) -> int | None:
    """How many quarters of an hour the wall clock is ahead of UTC, where one number alone fits the flight."""
    shares = {}
    for quarters in range(-14 * 4, 14 * 4 + 1):
        at = wall - quarters * QUARTER_S
        inside = (at >= flown[0] - SET_WITHIN_S) & (at <= flown[1] + SET_WITHIN_S)
        shares[quarters] = float(inside.mean())
    best = max(shares.values())
    those = [quarters for quarters, share in shares.items() if share > best - 0.01]
    whole = [quarters for quarters in those if quarters % 4 == 0]
    chosen = those if len(those) == 1 else whole
    return chosen[0] if best > 0.5 and len(chosen) == 1 else None


def _hours(quarters: int) -> str:
    if quarters == 0:
        return "in"
    hours, minutes = divmod(abs(quarters) * 15, 60)
    length = f"{hours} h" + (f" {minutes} min" if minutes else "")
    return f"{length} {'ahead of' if quarters > 0 else 'behind'}"
