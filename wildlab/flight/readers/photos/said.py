"""What a user should know of a folder of images: cameras, sizes, tags that contradict each other, heights."""

from __future__ import annotations

import math
import re
from collections import Counter
from typing import Any

from numpy.typing import NDArray

from wildlab.flight.readers.photos import values
from wildlab.flight.readers.photos.tags import Tags

#: Names of a lens in FLIR's records are rounded to whole mm, and small ones further.
LENS_MM = 2.0


def images(count: int) -> str:
    """``1 image``, ``1,200 images``."""
    return f"{count:,} image{'' if count == 1 else 's'}"


def said_of(
    tags: list[Tags], cameras: list[str], stated: list[list[tuple[str, float]]], why: NDArray[Any]
) -> list[str]:
    """Sentences on a folder of N images.

    Parameters
    ----------
    tags
        Of each.
    cameras
        What each is of.
    stated
        As of `photo_values.focal_px_of`.
    why
        (N,) why the place of each is not used, "" where it is.

    Returns
    -------
    list of str
    """
    return [
        *_cameras(cameras),
        *_sizes(tags),
        *_contradictions(tags, stated),
        *_places(why),
        *_conventions(tags),
    ]


def _cameras(cameras: list[str]) -> list[str]:
    found = Counter(one or "a camera without a name" for one in cameras)
    if len(found) < 2:
        return []
    several = "; ".join(f"{name} ({images(count)})" for name, count in found.most_common(8))
    return [f"there are {len(found)} cameras: {several}"]


def _sizes(tags: list[Tags]) -> list[str]:
    found = Counter(
        (one.width, one.height, one.raw_width, one.raw_height)
        for one in tags
        if one.raw_width and one.width and (one.raw_width, one.raw_height) != (one.width, one.height)
    )
    return [
        f"{images(count)} of {w} x {h} px hold a raw thermal image of {rw} x {rh} px, which is what is read"
        for (w, h, rw, rh), count in found.items()
    ]


def _contradictions(tags: list[Tags], stated: list[list[tuple[str, float]]]) -> list[str]:
    said: Counter[str] = Counter()
    for one, focal in zip(tags, stated, strict=True):
        for what, px in focal[1:]:
            used, by = focal[0][1], focal[0][0]
            if abs(px / used - 1) > values.CONTRADICTS:
                said[
                    "tags contradict each other on the focal length: "
                    f"{used:.0f} px ({by}, used) and {px:.0f} px ({what})"
                ] += 1
        if focal and focal[0][0] == values.BY_SIZE:
            said[
                "the tags for pixels per mm hold the size of the sensor instead: only read so are pixels "
                "square, and it is used so"
            ] += 1
        lens, mm = re.search(r"FOL(\d{1,3})", one.lens), values.focal_mm_of(one)
        if lens and math.isfinite(mm):
            other = float(lens[1])
            if abs(other - mm) > max(LENS_MM, values.CONTRADICTS * mm):
                said[
                    f"tags contradict each other on the lens: {mm:g} mm in EXIF, {other:g} mm in FLIR's"
                ] += 1
    return [f"{text} ({images(count)})" for text, count in said.items()]


def _places(why: NDArray[Any]) -> list[str]:
    return [f"{images(count)}: {reason}" for reason, count in Counter(one for one in why if one).items()]


def _conventions(tags: list[Tags]) -> list[str]:
    said = []
    by_rtk = sum(values.rtk_of(one) in values.RTK_FIXES for one in tags)
    without = sum(values.rtk_of(one) >= 0 and values.rtk_of(one) not in values.RTK_FIXES for one in tags)
    if by_rtk:
        said.append(f"heights of {images(by_rtk)} with RTK are taken to count from the ellipsoid")
    if by_rtk and without:
        said.append(f"RTK was lost in {images(without)}, whose heights are taken to count from sea level")
    curved = sum(
        math.isfinite(values.dewarped_of(one)) and one.xmp.get("dji:DewarpFlag", "0") != "1" for one in tags
    )
    if curved:
        said.append(
            f"{images(curved)} with the maker's calibration of the lens (DewarpData): its focal length is "
            "used, its distortion is not"
        )
    if any("dji:AbsoluteAltitude" in one.xmp and values.rtk_of(one) not in values.RTK_FIXES for one in tags):
        said.append(
            "DJI's absolute altitude without RTK hangs on the barometer and may be tens of metres off; the "
            "height above take-off is the better one"
        )
    nadir = any("camera:Pitch" in one.xmp and "dji:GimbalPitchDegree" not in one.xmp for one in tags)
    if nadir:
        said.append("angles of the name space Camera count from looking straight down, as Pix4D has them")
    return said
