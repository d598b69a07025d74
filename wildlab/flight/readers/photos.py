"""A folder of images as a raw log: one row for each, with what stands in its headers.

A row with ``use`` 1 has a place and a height that can be a pose; one without is still an image, and its stamp
may be as good. Two images may have one stamp (cameras beside each other, or clocks that count whole seconds).
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.files import unreadable
from wildlab.flight.readers import photo_tags as values
from wildlab.flight.readers.frames.image import SUFFIXES, file_name, no_images
from wildlab.flight.readers.log import ANGLES, TEXTS, WORLD, Array, Clock, Decoded, RawLog, Readings, any_of
from wildlab.flight.readers.photo_tags import Tags, read_tags, size_of
from wildlab.flight.readers.text import plural
from wildlab.flight.time_scales import wall_to_utc

#: Images of a folder at most.
MOST_IMAGES = 200_000
#: Endings of images that are none of `SUFFIXES`.
OTHERS = frozenset(
    {".dng", ".heic", ".heif", ".raw", ".arw", ".cr2", ".cr3", ".nef", ".rw2", ".webp", ".bmp"}
)
#: Endings of names, and of DJI's ImageSource, by what the camera beside others is.
_LENSES = {"t": "thermal", "w": "wide", "z": "zoom", "v": "visual", "r": "thermal"}
_SOURCES = {"infrared": "thermal", "thermal": "thermal", "wide": "wide", "zoom": "zoom", "visible": "visual"}


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """A key that sorts names as people count: ``b9`` before ``b10``.

    Examples
    --------
    >>> sorted(["b10", "b9", "A1"], key=natural_key)
    ['A1', 'b9', 'b10']
    """
    parts = re.findall(r"[0-9]{1,18}|[^0-9]+", name.lower())
    return [(0, int(one), "") if one[0] in "0123456789" else (1, 0, one) for one in parts]


def is_photos(folder: Path) -> bool:
    """Whether a folder itself holds images that can be read."""
    try:
        return folder.is_dir() and any(one.suffix.lower() in SUFFIXES for one in folder.iterdir())
    except OSError:
        return False


_HEIGHTS = ("height_ellipsoid_m", "height_sea_m", "height_home_m")
_SIDES = (("width_px", "wide"), ("height_px", "high"))
#: Columns -> what gives them of the tags of an image.
_COLUMNS: dict[tuple[str, ...], Any] = {
    _HEIGHTS: values.heights_of,
    ANGLES: values.airframe_of,
    WORLD: values.camera_angles_of,
    ("sd_horizontal_m", "sd_vertical_m"): values.spreads_of,
}
#: A camera's clock that scatters more about GPS than this is not one clock, s.
ONE_CLOCK_S = 5.0
#: A clock that differs more from GPS than a stamp of whole seconds and a slow shutter explain, s.
OFF_S = 2.0
#: What is said of a clock without a zone, and what others are known from.
LOCAL, BY_GPS, BY_ZONE = "local time without a zone", "GPS time of the images", "zones that the images state"


def folder_decode(folder: Path, zone: str | None) -> Decoded:
    """The images of a folder and of all folders below it, as a card has them: ``100MEDIA``, ``101MEDIA``.

    Parameters
    ----------
    folder
        Of images, or of folders of images.
    zone
        Of the camera's clock where images do not say it: ``"Europe/Oslo"``, ``"+02:00"``.

    Returns
    -------
    Decoded
        With the part ``photos``, by folders and in the order of names; files of folders below have names
        with ``/``. Angles of the airframe are ``roll_deg`` and so on, those of the optical axis
        ``roll_world_deg`` and so on. Sizes are those of the pixels that are read: of FLIR's raw image,
        where there is one.

    Raises
    ------
    WildlabError
        Where there is no image, or the zone is none.
    """
    folders = sorted(
        (one for one in (folder, *folder.rglob("*")) if not _hidden(one, folder) and is_photos(one)),
        key=lambda one: natural_key(one.relative_to(folder).as_posix()),
    )
    logs = [_one_folder(one, zone) for one in folders or [folder]]
    tables = []
    for one, log in zip(folders, logs, strict=False):
        tables.append(pd.DataFrame(log.parts["photos"].columns))
        if one != folder:
            tables[-1]["file"] = f"{one.relative_to(folder).as_posix()}/" + tables[-1]["file"]
    table = pd.concat(tables, ignore_index=True)
    why = table.pop("why").to_numpy()
    columns = {
        str(name): one.fillna("").to_numpy(object) if name in TEXTS else one.to_numpy(float)
        for name, one in table.items()
    }
    unusable = {reason: why == reason for reason in dict.fromkeys(why) if reason}
    makers = {one.vehicle for one in logs}
    clocks = [one.clock for one in logs if one.clock is not None]
    return Decoded(
        {"photos": Readings(columns, None, "image", unusable)},
        vehicle=makers.pop() if len(makers) == 1 else "",
        clock=max(clocks, key=lambda one: one.pairs, default=None),
        lost=list(dict.fromkeys(one for log in logs for one in log.lost)),
        notes=[one for log in logs for one in log.notes],
    )


def _hidden(path: Path, folder: Path) -> bool:
    return path.is_symlink() or any(part.startswith(".") for part in path.relative_to(folder).parts)


def _one_folder(folder: Path, zone: str | None) -> Decoded:
    """The images of a folder alone, with the column ``why``."""
    paths, lost = _files(folder)
    tags = [read_tags(path) for path in paths]
    sizes = [size_of(one) for one in tags]
    latitude, longitude, reasons = zip(*[values.place_of(one) for one in tags], strict=True)
    columns: dict[str, Any] = {"file": [file_name(path) for path in paths]}
    columns |= {"latitude_deg": latitude, "longitude_deg": longitude}
    for names, of in _COLUMNS.items():
        table = np.array([of(one) for one in tags], float)
        columns |= {name: table[:, at] for at, name in enumerate(names) if np.isfinite(table[:, at]).any()}
    stated = [values.focal_px_of(one, *size) for one, size in zip(tags, sizes, strict=True)]
    focal = [one[0] if one else ("", np.nan) for one in stated]
    cameras = _cameras(columns["file"], tags, sizes)
    high = any_of([np.isfinite(columns[name]) for name in _HEIGHTS if name in columns], len(tags))
    columns |= {
        "fix": [values.fix_of(one) for one in tags],
        **{name: [size[i] or np.nan for size in sizes] for i, (name, _) in enumerate(_SIDES)},
        "focal_mm": [values.focal_mm_of(one) for one in tags],
        "focal_35mm": [values.film_of(one) for one in tags],
        "focal_px": [px for _, px in focal],
        "focal_from": [how for how, _ in focal],
        "camera": cameras,
        "why": [why or ("" if up else "no height") for why, up in zip(reasons, high, strict=True)],
    }
    columns["time_log_s"], columns["time_s"], clock, notes = _times(tags, zone)
    lost += [
        (count, "image", f": {what}") for what, count in Counter(o.problem for o in tags if o.problem).items()
    ]
    makers = Counter(name for name in cameras if name)
    return Decoded(
        {"photos": Readings(columns)},
        vehicle=next(iter(makers)) if len(makers) == 1 else "",
        clock=clock,
        lost=lost,
        notes=[*notes, *_notes(tags, cameras, stated, columns["why"])],
    )


def _files(folder: Path) -> tuple[list[Path], list[tuple[int, str, str]]]:
    try:
        there = [one for one in folder.iterdir() if not one.name.startswith(".")]
    except OSError as error:
        raise unreadable(error, folder) from None
    paths = [one for one in there if one.suffix.lower() in SUFFIXES]
    if not paths:
        raise no_images(folder)
    others = Counter(end for one in there if (end := one.suffix.lower()) in OTHERS)
    left = [(count, "image", f"{end}: this kind is not read") for end, count in sorted(others.items())]
    left.append((max(len(paths) - MOST_IMAGES, 0), "image", f"beyond the first {MOST_IMAGES:,}"))
    return sorted(paths, key=lambda one: (natural_key(one.name), one.name))[:MOST_IMAGES], left


def _times(tags: list[Tags], zone: str | None) -> tuple[Array, Array, Clock | None, list[str]]:
    """Stamps of images.

    The camera's clock has the intervals, and satellites or a zone bring it to UTC: a stamp of GPS may be of
    the second before, or of the last fix.

    Parameters
    ----------
    tags
        Of N images.
    zone
        Of the camera's clock where they do not state it.

    Returns
    -------
    wall, time, clock, notes
        (N,) s since 1970 by the camera's clock as if it were UTC, and in UTC, NaN where not known; how the
        one became the other, None where there are none; sentences.

    Raises
    ------
    WildlabError
        Where the zone is none.
    """
    wall, ahead = np.array([values.wall_of(one) for one in tags], float).reshape(-1, 2).T
    sky = np.array([values.satellite_time_of(one) for one in tags], float)
    if not np.isfinite(wall).any():
        if not np.isfinite(sky).any():
            return wall, sky, None, ["no image carries a time"]
        return sky, sky, Clock(BY_GPS), []
    notes: list[str] = []
    apart = (sky - wall)[np.isfinite(wall) & np.isfinite(sky)]
    middle = float(np.median(apart)) if len(apart) else np.nan
    left = np.abs(apart - middle)
    spread, largest = (1.4826 * float(np.median(left)), float(left.max())) if len(apart) else (0.0, 0.0)
    one_clock = spread <= ONE_CLOCK_S
    stated = np.isfinite(ahead)
    if stated.any() and (stated.all() or not len(apart)):
        # Where one image does not state its zone, the others' is that of the same clock.
        zone_s = float(np.median(ahead[stated]))
        time, clock = (
            wall - np.where(stated, ahead, zone_s),
            Clock(BY_ZONE, 1.0, -zone_s, pairs=int(stated.sum())),
        )
        off = middle + zone_s
        if len(apart) and one_clock and abs(off) > OFF_S:
            notes.append(
                f"the camera's clock, which is used, is {-off:+.0f} s from the GPS time in the images"
            )
    elif len(apart):
        time = np.where(np.isfinite(wall), wall + middle, sky) if one_clock else sky
        clock = Clock(BY_GPS, 1.0, middle, spread, largest, len(apart))
        if not one_clock:
            notes.append("the camera's clock does not run along with GPS time in its images, which is used")
    elif zone is not None:
        time = wall_to_utc(wall, zone)
        clock = Clock(f"local time of the zone {zone}", 1.0, float(np.nanmedian(time - wall)))
    else:
        time, clock = np.full(len(wall), np.nan), Clock(LOCAL)
        notes.append("the camera's clock is local time and no image says its zone: state it to know UTC")
    without = int((~np.isfinite(wall) & ~np.isfinite(sky)).sum())
    notes += [f"{plural(without, 'image')} without a time"] if without else []
    return wall, time, clock, notes


def _notes(
    tags: list[Tags], cameras: list[str], stated: list[list[tuple[str, float]]], why: list[str]
) -> list[str]:
    """What a user should know of a folder: cameras, sizes, tags that contradict each other, heights."""
    notes: Counter[str] = Counter(one for one in why if one)
    for focal in filter(None, stated):
        by, used = focal[0]
        for what, px in focal[1:]:
            if abs(px / used - 1) > values.CONTRADICTS:
                both = f"{used:.0f} px ({by}, used), {px:.0f} px ({what})"
                notes[f"tags contradict each other on the focal length: {both}"] += 1
    rtk = [values.rtk_of(one) for one in tags]
    fixed = [one in values.RTK_FIXES for one in rtk]
    notes["heights with RTK are taken to count from the ellipsoid"] = sum(fixed)
    if any(fixed):
        notes["RTK was lost: heights count from sea level"] = sum(one >= 0 for one in rtk) - sum(fixed)
    notes["of the maker's calibration (DewarpData) the focal length is used, the distortion is not"] = sum(
        math.isfinite(values.dewarped_of(one)) and one.xmp.get("dji:DewarpFlag", "0") != "1" for one in tags
    )
    notes["DJI's absolute altitude may be tens of metres off (barometer); above take-off is better"] = sum(
        "dji:AbsoluteAltitude" in one.xmp and not ok for one, ok in zip(tags, fixed, strict=True)
    )
    several = Counter(one or "a camera without a name" for one in cameras)
    names = "; ".join(f"{name} ({plural(count, 'image')})" for name, count in several.most_common(8))
    return [
        *([f"there are {len(several)} cameras: {names}"] if len(several) > 1 else []),
        *(f"{plural(count, 'image')}: {text}" for text, count in notes.items() if count),
    ]


def _cameras(files: list[str], tags: list[Tags], sizes: list[tuple[int, int]]) -> list[str]:
    names = []
    for file, one in zip(files, tags, strict=True):
        make, model = (
            values.text(one.exif.get(tag)) or values.text(one.xmp.get(f"tiff:{tag}"))
            for tag in ("Make", "Model")
        )
        name = (
            model if make and model.lower().startswith(make.split()[0].lower()) else f"{make} {model}".strip()
        )
        source = one.xmp.get("dji:ImageSource", "").lower()
        lens = next((what for part, what in _SOURCES.items() if part in source), "")
        ending = re.search(r"_([TWZVR])(?:_\w*)?\.\w+$", file, re.I)
        if not lens and ending and (name or one.exif):
            lens = _LENSES[ending[1].lower()]
        names.append(", ".join(part for part in (name, lens) if part))
    # One name with several sizes is several cameras in one housing.
    several: dict[str, set[tuple[int, int]]] = {}
    for name, size in zip(names, sizes, strict=True):
        if all(size):
            several.setdefault(name, set()).add((max(size), min(size)))
    return [
        f"{name}, {max(size)} x {min(size)}".removeprefix(", ")
        if len(several.get(name, ())) > 1 and all(size)
        else name
        for name, size in zip(names, sizes, strict=True)
    ]


def of_camera(log: RawLog, camera: str) -> RawLog:
    """The images of one camera, by its name as ``camera`` has it."""
    stream = log.parts["photos"]
    return replace(log, parts={**log.parts, "photos": stream.take(stream.columns["camera"] == camera)})


def camera_of(log: RawLog) -> dict[str, Any] | None:
    """Size and focal length of the one camera of a folder, as its tags have them.

    Parameters
    ----------
    log
        Of a folder of images.

    Returns
    -------
    dict or None
        ``camera`` (its name), ``width_px``, ``height_px``, ``focal_px``, ``how`` (a clause on where the focal
        length is from); None where no tag says a focal length in px, or a size.

    Raises
    ------
    WildlabError
        Where images are of several cameras, sizes or focal lengths.
    """
    columns = log.parts["photos"].columns
    known = np.isfinite(columns["width_px"]) & np.isfinite(columns["height_px"])
    if not known.any():
        return None
    names = sorted({str(one) for one in columns["camera"][known]})
    if len(names) > 1:
        known_as = ", ".join(one or "one without a name" for one in names)
        raise WildlabError(
            f"the images are of {len(names)} cameras: {known_as}",
            "give each camera a folder of its own, and name one",
            field="camera",
        )
    width, height = (_one(columns[name][known], what) for name, what in _SIDES)
    focal = columns["focal_px"][known]
    if not np.isfinite(focal).any():
        return None
    middle = float(np.nanmedian(focal))
    if np.nanmax(np.abs(focal / middle - 1)) > 0.02:
        least, most = np.nanmin(focal), np.nanmax(focal)
        raise WildlabError(
            f"the focal length changes from {least:.0f} to {most:.0f} px: the lens zooms",
            "give the images of each focal length a folder of their own",
            field="focal_px",
        )
    how = Counter(str(one) for one in columns["focal_from"][known] if one).most_common(1)[0][0]
    if how == values.BY_FILM:
        film = float(np.nanmedian(columns["focal_35mm"][known]))
        how += f" of {film:g} mm over the diagonal, rounded to within {50 / film:.0f} %"
    return {
        "camera": names[0],
        "width_px": int(width),
        "height_px": int(height),
        "focal_px": middle,
        "how": how,
    }


def _one(sizes: Array, what: str) -> float:
    if len(found := sorted(set(sizes.tolist()))) > 1:
        given = ", ".join(f"{one:.0f}" for one in found[:5])
        raise WildlabError(
            f"the images are {given} px {what}",
            "give the images of each size a folder of their own",
            field="camera",
        )
    return float(found[0])
