"""A folder of images as a raw log: one row for each, with what stands in its headers.

A row with ``use`` 1 has a place and a height that can be a pose; one without is still an image, and its stamp
may be as good. Two images may have one stamp (cameras beside each other, or clocks that count whole seconds).
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.files import unreadable
from wildlab.flight.readers.frames.frame import file_name
from wildlab.flight.readers.frames.image import SUFFIXES
from wildlab.flight.readers.logs.log import TEXTS, RawLog, Stream, make_stream
from wildlab.flight.readers.photos import values
from wildlab.flight.readers.photos.said import images, said_of
from wildlab.flight.readers.photos.tags import Tags, read_tags, size_of
from wildlab.flight.readers.photos.times import times_of

Array = NDArray[np.float64]

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

    Parameters
    ----------
    name
        Of a file.

    Returns
    -------
    list

    Examples
    --------
    >>> sorted(["b10", "b9", "A1"], key=natural_key)
    ['A1', 'b9', 'b10']
    """
    parts = re.findall(r"[0-9]{1,18}|[^0-9]+", name.lower())
    return [(0, int(one), "") if one[0] in "0123456789" else (1, 0, one) for one in parts]


def is_photos(folder: Path) -> bool:
    """Whether a folder itself holds images that can be read.

    Parameters
    ----------
    folder
        Any path.

    Returns
    -------
    bool
    """
    try:
        return folder.is_dir() and any(one.suffix.lower() in SUFFIXES for one in folder.iterdir())
    except OSError:
        return False


def read_photos(folder: Path, zone: str | None = None) -> RawLog:
    """The images of a folder, in the order of their names, with what stands in their headers.

    Parameters
    ----------
    folder
        Of images; folders in it are not looked at.
    zone
        Of the camera's clock where images do not say it: ``"Europe/Oslo"``, ``"+02:00"``.

    Returns
    -------
    RawLog
        With the part ``photos``. Angles of the airframe are ``roll_deg`` and so on, those of the optical axis
        ``roll_world_deg`` and so on. Sizes are those of the pixels that are read: of FLIR's raw image, where
        there is one.

    Raises
    ------
    WildlabError
        Where there is no image, or the zone is none.
    """
    paths, left = _files(folder)
    tags = [read_tags(path) for path in paths]
    sizes = [size_of(one) for one in tags]
    places = [values.place_of(one) for one in tags]
    columns: dict[str, Any] = {"file": [file_name(path) for path in paths]}
    columns["latitude_deg"], columns["longitude_deg"] = [p[0] for p in places], [p[1] for p in places]
    for names, of in (
        (_HEIGHTS, values.heights_of),
        (("roll_deg", "pitch_deg", "yaw_deg"), values.airframe_of),
        (("roll_world_deg", "pitch_world_deg", "yaw_world_deg"), values.camera_angles_of),
        (("sd_horizontal_m", "sd_vertical_m"), values.spreads_of),
    ):
        table = np.array([of(one) for one in tags], float).reshape(len(tags), len(names))
        columns |= {name: table[:, at] for at, name in enumerate(names) if np.isfinite(table[:, at]).any()}
    columns["fix"] = [values.fix_of(one) for one in tags]
    columns["width_px"], columns["height_px"] = (np.array([s[i] or np.nan for s in sizes]) for i in (0, 1))
    columns["focal_mm"] = [values.focal_mm_of(one) for one in tags]
    columns["focal_35mm"] = [values.film_of(one) for one in tags]
    stated = [values.focal_px_of(one, *size) for one, size in zip(tags, sizes, strict=True)]
    columns["focal_px"] = [one[0][1] if one else np.nan for one in stated]
    columns["focal_from"] = [one[0][0] if one else "" for one in stated]
    columns["camera"] = _cameras(columns["file"], tags, sizes)
    wall, time, clock, said = times_of(tags, zone)
    columns |= {"time_log_s": wall, "time_s": time}
    why = np.array([p[2] for p in places], dtype=object)
    heights = [columns[name] for name in _HEIGHTS if name in columns]
    high = np.isfinite(np.array(heights)).any(axis=0) if heights else np.zeros(len(tags), bool)
    unusable: dict[str, Any] = {reason: why == reason for reason in dict.fromkeys(why) if reason}
    unusable["no height"] = ~high
    part = make_stream("photos", columns, counted_in="image", unusable=unusable)
    notes = [*said, *said_of(tags, columns["camera"], stated, part.columns["why"])]
    lost = [
        f"{images(count)}: {what}" for what, count in Counter(o.problem for o in tags if o.problem).items()
    ]
    makers = Counter(name for name in columns["camera"] if name)
    return RawLog(
        "photos",
        {"photos": part},
        vehicle=makers.most_common(1)[0][0] if len(makers) == 1 else "",
        clock=clock,
        lost=tuple(lost + left),
        notes=tuple(notes),
    )


def read_tree(folder: Path, zone: str | None = None) -> RawLog:
    """The images of a folder and of all folders below it, as a card has them: ``100MEDIA``, ``101MEDIA``.

    Parameters
    ----------
    folder
        Of images, or of folders of images.
    zone
        As for `read_photos`.

    Returns
    -------
    RawLog
        As of `read_photos`; files of folders below have names with ``/``.

    Raises
    ------
    WildlabError
        Where there is no image.
    """
    folders = sorted(
        (one for one in (folder, *folder.rglob("*")) if not _hidden(one, folder) and is_photos(one)),
        key=lambda one: natural_key(one.relative_to(folder).as_posix()),
    )
    if folders in ([], [folder]):
        return read_photos(folder, zone)
    logs = [read_photos(one, zone) for one in folders]
    streams = [one.parts["photos"] for one in logs]
    columns: dict[str, Any] = {}
    for name in dict.fromkeys(name for one in streams for name in one.columns):
        empty: Any = "" if name in TEXTS else np.nan
        columns[name] = np.concatenate(
            [
                one.columns.get(name, np.full(len(one), empty, object if empty == "" else float))
                for one in streams
            ]
        )
    prefixes = [one.relative_to(folder).as_posix() for one in folders]
    names = [
        name if prefix == "." else f"{prefix}/{name}"
        for prefix, stream in zip(prefixes, streams, strict=True)
        for name in stream.columns["file"]
    ]
    columns["file"] = np.array(names, dtype=object)
    makers = {one.vehicle for one in logs}
    clock = max((one.clock for one in logs if one.clock is not None), key=lambda one: one.pairs, default=None)
    return RawLog(
        "photos",
        {"photos": Stream(columns, np.arange(1, len(names) + 1), "image")},
        vehicle=makers.pop() if len(makers) == 1 else "",
        clock=clock,
        lost=tuple(dict.fromkeys(text for one in logs for text in one.lost)),
        notes=tuple(dict.fromkeys(text for one in logs for text in one.notes)),
    )


def _hidden(path: Path, folder: Path) -> bool:
    return path.is_symlink() or any(part.startswith(".") for part in path.relative_to(folder).parts)


def of_camera(log: RawLog, camera: str) -> RawLog:
    """The images of one camera, by its name as ``camera`` has it.

    Parameters
    ----------
    log
        As `read_photos` gives it.
    camera
        Its name.

    Returns
    -------
    RawLog
    """
    stream = log.parts["photos"]
    rows = np.flatnonzero(stream.columns["camera"] == camera)
    part = Stream(
        {name: one[rows] for name, one in stream.columns.items()}, stream.rows[rows], stream.counted_in
    )
    return replace(log, parts={**log.parts, "photos": part})


def camera_of(log: RawLog) -> dict[str, Any] | None:
    """Size and focal length of the one camera of a folder, as its tags have them.

    Parameters
    ----------
    log
        As `read_photos` gives it.

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
        how += (
            f" of {film:g} mm over the diagonal: rounded to within {50 / film:.0f} %, and some makers count "
            "over the width instead"
        )
    return {
        "camera": names[0],
        "width_px": int(width),
        "height_px": int(height),
        "focal_px": middle,
        "how": how,
    }


_HEIGHTS = ("height_ellipsoid_m", "height_sea_m", "height_home_m")
_SIDES = (("width_px", "wide"), ("height_px", "high"))


def _one(sizes: Array, what: str) -> float:
    if len(found := sorted(set(sizes.tolist()))) > 1:
        given = ", ".join(f"{one:.0f}" for one in found[:5])
        raise WildlabError(
            f"the images are {given} px {what}",
            "give the images of each size a folder of their own",
            field="camera",
        )
    return float(found[0])


def _files(folder: Path) -> tuple[list[Path], list[str]]:
    try:
        there = list(
            islice((one for one in folder.iterdir() if not one.name.startswith(".")), 2 * MOST_IMAGES)
        )
    except OSError as error:
        raise unreadable(error, folder) from None
    paths = [one for one in there if one.suffix.lower() in SUFFIXES]
    if not paths:
        endings = ", ".join(sorted(SUFFIXES))
        raise WildlabError(
            "there are no images in this folder", f"name one with {endings} files", file=folder
        )
    others = Counter(end for one in there if (end := one.suffix.lower()) in OTHERS)
    left = [f"{images(count)} {end}: this kind is not read" for end, count in sorted(others.items())]
    if len(paths) > MOST_IMAGES:
        left.append(f"{images(len(paths) - MOST_IMAGES)} beyond the first {MOST_IMAGES:,}")
    return sorted(paths, key=lambda one: (natural_key(one.name), one.name))[:MOST_IMAGES], left


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
