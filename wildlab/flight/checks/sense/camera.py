"""The numbers of a camera against each other: principal point and image, focal length and field of view."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wildlab.flight.checks.findings import Finding
from wildlab.flight.manifest_parts import CameraPart
from wildlab.flight.store import Flight

#: Fields of view (deg) across the image that a camera of a drone may have: long telephoto to fisheye.
NARROW, WIDE = 1.0, 150.0
#: Lenses are centred to a few percent of the image; further off, an image was cropped, or it is a mistake.
OFF_CENTRE, OFF_FAR, CENTRED = 0.08, 0.2, 0.03


def lens(flight: Flight) -> Iterator[Finding]:
    """What cannot be the calibration of this image."""
    camera = flight.manifest.camera
    if camera is None:
        return
    yield from _view(camera)
    yield from _centre(camera)


def _view(camera: CameraPart) -> Iterator[Finding]:
    across = float(
        np.degrees(2 * np.arctan(max(camera.width_px / camera.fx_px, camera.height_px / camera.fy_px) / 2))
    )
    if NARROW <= across <= WIDE:
        return
    wide = across > WIDE
    said = f"a focal length of {camera.fx_px:g} px is a field of view of {across:.3g} deg, and "
    if wide:
        said += "no lens of this kind is as wide: it looks like millimetres"
        fix = (
            "write `fx_px` and `fy_px` in pixels in [camera]: lens in mm times width in pixels over "
            "that in mm"
        )
    else:
        said += "hardly a lens is as narrow: it looks like another unit, or another image size"
        fix = "check `fx_px` and `fy_px` in [camera]: focal length in pixels of this image"
    yield Finding(
        "problem" if wide else "warning",
        "flight.toml",
        "camera.fx_px",
        said,
        fix,
        ("focal length in mm",) if wide else (),
    )


def _centre(camera: CameraPart) -> Iterator[Finding]:
    c = np.array([camera.cx_px, camera.cy_px])
    size = np.array([camera.width_px, camera.height_px], float)

    def off(point: np.ndarray, of: np.ndarray) -> float:
        return float(np.abs(point / of - 0.5).max())

    now = off(c, size)
    if now <= OFF_CENTRE:
        return
    ways = [
        (
            "cx and cy exchanged",
            off(c[::-1], size),
            "cx and cy are exchanged",
            f"cx_px = {c[1]:g}, cy_px = {c[0]:g}",
        ),
        (
            "width and height exchanged",
            off(c, size[::-1]),
            "the width and the height of the image are exchanged",
            f"width_px = {size[1]:g}, height_px = {size[0]:g}",
        ),
        (
            "principal point from the centre",
            float(np.abs(c / size).max()),
            "the principal point counts from the centre of the image",
            f"cx_px = {c[0] + size[0] / 2:g}, cy_px = {c[1] + size[1] / 2:g}",
        ),
    ] + [
        (
            f"calibration of an image {1 / k:g} times as large",
            off(k * c, size),
            f"the calibration is of an image {1 / k:g} times as large as this",
            f"width_px = {size[0] / k:g}, height_px = {size[1] / k:g}, or the four of fx_px to cy_px "
            f"times {k:g}",
        )
        for k in (0.5, 2.0, 0.25, 4.0)
    ]
    named = [way for way in ways if way[1] <= CENTRED]
    inside = bool(((c > 0) & (c < size)).all())
    if not named and (now <= OFF_FAR or not inside):  # outside of the image: said with the calibration
        return
    image = f"{size[0]:g} x {size[1]:g}"
    said = f"the principal point ({c[0]:g}, {c[1]:g}) is far from the middle of an image of {image}"
    if named:
        said += f": {' or '.join(way[2] for way in named)}"
    yield Finding(
        "warning",
        "flight.toml",
        "camera.cx_px",
        said,
        " or ".join(f"write `{way[3]}`" for way in named) + " in [camera], and import again"
        if named
        else "check that the calibration is for this image size, and not for a part of it",
        tuple(way[0] for way in named),
    )
