"""Usual mistakes about cameras: pixels, calibration, mount. Functions of sightings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from wildlab.flight.checks.sense.attitudes import rotations_of_axes
from wildlab.flight.checks.sense.sightings import Sightings
from wildlab.flight.checks.sense.trial import Mistake
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array, euler_to_matrix, matrix_to_euler
from wildlab.geometry.mount import R_MC_DOWN, R_MC_FORWARD, Looks, camera_rotation

QUARTER = (0, 90, 180, -90)


def mount_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """The other of down and forward, and the 24 ways in which a camera can be turned by quarter turns."""
    other: Looks = "forward" if s.mount.looks == "down" else "down"
    yield Mistake(
        f"the camera looks {other}",
        f"your camera looks {other}; the recipe says {s.mount.looks}",
        f'`looks = "{other}"` in [mount]',
        lambda x: replace(x, mount=replace(x.mount, looks=other)),
    )
    base = euler_to_matrix(*s.mount.misalignment)
    now = camera_rotation(replace(s.mount, misalignment=(0.0, 0.0, 0.0), pan=0.0, tilt=0.0))
    done = [now, R_MC_DOWN if other == "down" else R_MC_FORWARD]
    for looks, way in ways_to_sit():
        R_bc = way @ (R_MC_DOWN if looks == "down" else R_MC_FORWARD)
        if any(np.allclose(R_bc, one) for one in done):
            continue
        done.append(R_bc)
        turned = matrix_to_euler(base @ way)
        keys = ("misalignment_roll_deg", "misalignment_tilt_deg", "misalignment_pan_deg")
        lines = [f'looks = "{looks}"'] + [
            f"{key} = {np.degrees(angle):.4g}"
            for key, angle in zip(keys, turned, strict=True)
            if abs(angle) > 1e-6
        ]
        lens, top = (_side(R_bc @ axis) for axis in (np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])))
        yield Mistake(
            f"the lens points {lens}, the top of the image {top}",
            f"the lens points {lens} and the top of the image {top}",
            f"`{', '.join(lines)}` in [mount]",
            lambda x, looks=looks, t=tuple(turned): replace(  # type: ignore[misc]
                x, mount=replace(x.mount, looks=looks, misalignment=t)
            ),
        )
    if any(abs(angle) > 1e-9 for angle in (*s.mount.misalignment,)):
        for signs, which in (
            ((-1, 1, 1), "roll"),
            ((1, -1, 1), "tilt"),
            ((1, 1, -1), "pan"),
            ((-1, -1, -1), "all"),
        ):
            yield Mistake(
                f"sign of misalignment ({which})",
                f"the misalignment of the mount has the wrong sign ({which})",
                "the other sign of `misalignment_..._deg` in [mount]",
                lambda x, g=signs: _misaligned(x, tuple(np.array(x.mount.misalignment) * g)),  # type: ignore[misc]
            )
        yield Mistake(
            "misalignment in radians",
            "the misalignment of the mount is in radians",
            "degrees for `misalignment_..._deg` in [mount]",
            lambda x: _misaligned(x, tuple(np.degrees(x.mount.misalignment))),
        )
    where = "[gimbal]" if s.own_gimbal else "[mount]"
    if (np.abs(s.pan) > 1e-9).any() or (np.abs(s.tilt) > 1e-9).any():
        for key, pan, tilt in (("pan", -1, 1), ("tilt", 1, -1), ("pan and tilt", -1, -1)):
            yield Mistake(
                f"sign of gimbal {key}",
                f"{key} of the gimbal has the wrong sign",
                f"the other sign of {key} in {where}",
                lambda x, a=pan, b=tilt: replace(x, pan=a * x.pan, tilt=b * x.tilt),  # type: ignore[misc]
            )
        yield Mistake(
            "pan and tilt exchanged",
            "pan and tilt of the gimbal are exchanged",
            f"exchange pan and tilt in {where}",
            lambda x: replace(x, pan=x.tilt, tilt=x.pan),
        )
        turn = float(np.degrees(1.0))
        if np.abs([s.pan, s.tilt]).max() * turn < 7:
            yield Mistake(
                "gimbal in radians, read as degrees",
                "pan and tilt of the gimbal are in radians, and the recipe says degrees",
                f'`unit = "rad"` for pan and tilt in {where}',
                lambda x: replace(x, pan=turn * x.pan, tilt=turn * x.tilt),
            )
        for angle in (90.0, -90.0):
            yield Mistake(
                f"gimbal tilt off by {angle:g} deg",
                f"the tilt of the gimbal is off by {angle:g} deg",
                f"the tilt plus {angle:g} deg in {where}, or the other of down and forward in [mount]",
                lambda x, t=angle: replace(x, tilt=x.tilt + np.radians(t)),  # type: ignore[misc]
            )
    if any(s.mount.lever_arm) and max(map(abs, s.mount.lever_arm)) > 5:
        for name, factor in (("mm", 1e-3), ("cm", 1e-2)):
            yield Mistake(
                f"lever arm in {name}",
                f"the lever arm of the camera is in {name}",
                "metres for `lever_arm_m` in [mount]",
                lambda x, f=factor: replace(  # type: ignore[misc]
                    x, mount=replace(x.mount, lever_arm=tuple(f * a for a in x.mount.lever_arm))
                ),
            )


def _misaligned(s: Sightings, angles: tuple[float, ...]) -> Sightings:
    roll, tilt, pan = angles
    return replace(s, mount=replace(s.mount, misalignment=(roll, tilt, pan)))


def ways_to_sit() -> list[tuple[str, Array]]:
    """Every way to write a mount turned by quarter turns: `looks`, and the misalignment as a matrix; those
    with the fewest words first."""
    turns = sorted(rotations_of_axes(), key=lambda R: int((np.abs(matrix_to_euler(R)) > 1e-6).sum()))
    return [(looks, R) for R in turns for looks in ("down", "forward")]


def _side(direction: Array) -> str:
    names = ("forward", "right", "down"), ("backward", "left", "up")
    axis = int(np.argmax(np.abs(direction)))
    return names[0 if direction[axis] > 0 else 1][axis]


def pixel_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """Where pixels are counted from, which is which, and in what."""
    width, height = s.camera.width, s.camera.height

    def pixels(change: Callable[[Array], Array]) -> Callable[[Sightings], Sightings]:
        return lambda x: replace(x, uv=change(x.uv))

    yield Mistake(
        "v counted from the bottom",
        "v counts upwards from the bottom of the image",
        "the height of the image minus v as `v` in [detections.pixel]",
        pixels(lambda uv: uv * [1, -1] + [0, height]),
    )
    yield Mistake(
        "u counted from the right",
        "u counts to the left from the right edge of the image",
        "the width of the image minus u as `u` in [detections.pixel]",
        pixels(lambda uv: uv * [-1, 1] + [width, 0]),
    )
    yield Mistake(
        "the image upside down",
        "u and v count from the lower right corner: the image is upside down",
        "the size of the image minus u and v in [detections.pixel]",
        pixels(lambda uv: [width, height] - uv),
    )
    yield Mistake(
        "u and v exchanged",
        "u and v are exchanged",
        "exchange the columns of u and v in [detections.pixel]",
        pixels(lambda uv: uv[:, ::-1]),
    )
    yield Mistake(
        "u and v from the centre",
        "u and v count from the centre of the image",
        "u plus half the width and v plus half the height in [detections.pixel]",
        pixels(lambda uv: uv + np.array([width / 2, height / 2])),
    )
    if np.nanmax(np.abs(s.uv)) <= 1.5:
        yield Mistake(
            "pixels as proportions",
            "u and v are shares of the size of the image, and the recipe says px",
            '`unit = "proportion-of-width"` for u and `"proportion-of-height"` for v in [detections.pixel]',
            pixels(lambda uv: uv * [width, height]),
        )
    for factor in (0.5, 2.0, 0.25, 4.0):
        yield Mistake(
            f"pixels of an image {1 / factor:g} times as large",
            f"the clicks are of an image {1 / factor:g} times as large as that of the calibration",
            f"u and v times {factor:g} in [detections.pixel], or the calibration for that size in [camera]",
            pixels(lambda uv, f=factor: f * uv),  # type: ignore[misc]
        )


def calibration_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """Focal length, principal point, distortion."""

    def camera(change: Callable[[Camera], Camera]) -> Callable[[Sightings], Sightings]:
        return lambda x: replace(x, camera=change(x.camera))

    for factor in (0.5, 2.0, 0.25, 4.0, 3.0, 1 / 3):
        yield Mistake(
            f"focal length times {factor:.3g}",
            f"the focal length fits an image {factor:.3g} times as wide, or another zoom",
            f"fx_px = {s.camera.fx * factor:.5g}, fy_px = {s.camera.fy * factor:.5g} in [camera]",
            camera(lambda c, f=factor: replace(c, fx=f * c.fx, fy=f * c.fy)),  # type: ignore[misc]
        )
        yield Mistake(
            f"calibration of an image {1 / factor:.3g} times as large",
            f"the calibration is of an image {1 / factor:.3g} times as large",
            f"fx_px, fy_px, cx_px and cy_px times {factor:.3g} in [camera]",
            camera(lambda c, f=factor: replace(c, fx=f * c.fx, fy=f * c.fy, cx=f * c.cx, cy=f * c.cy)),  # type: ignore[misc]
        )
    yield Mistake(
        "cx and cy exchanged",
        "cx and cy are exchanged",
        f"cx_px = {s.camera.cy:g}, cy_px = {s.camera.cx:g} in [camera]",
        camera(lambda c: replace(c, cx=c.cy, cy=c.cx)),
    )
    yield Mistake(
        "principal point",
        "the principal point is not in the middle of the image",
        f"cx_px = {s.camera.width / 2:g}, cy_px = {s.camera.height / 2:g} in [camera]",
        camera(lambda c: replace(c, cx=c.width / 2, cy=c.height / 2)),
    )
    for name, factor in (
        ("a tenth", 0.1),
        ("ten times", 10.0),
        ("a thousandth", 1e-3),
        ("a thousand times", 1e3),
    ):
        yield Mistake(
            f"focal length {name}",
            f"the focal length is {name} of what is stated",
            f"fx_px = {s.camera.fx * factor:.5g}, fy_px = {s.camera.fy * factor:.5g} in [camera]: "
            "pixels, not millimetres",
            camera(lambda c, f=factor: replace(c, fx=f * c.fx, fy=f * c.fy)),  # type: ignore[misc]
        )
    if any(s.camera.distortion):
        yield Mistake(
            "sign of the distortion",
            "the distortion has the wrong sign: its coefficients are of the inverse model",
            "the other sign of k1, k2, p1, p2 and k3 in [camera]",
            camera(lambda c: replace(c, distortion=tuple(-k for k in c.distortion))),  # type: ignore[arg-type]
        )
        yield Mistake(
            "sign of k1",
            "k1 has the wrong sign",
            f"k1 = {-s.camera.distortion[0]:.6g} in [camera]",
            camera(lambda c: replace(c, distortion=(-c.distortion[0], *c.distortion[1:]))),
        )
        yield Mistake(
            "distortion taken off already",
            "the pixels are free of distortion already",
            "k1, k2, p1, p2 and k3 = 0 in [camera]",
            camera(lambda c: replace(c, distortion=(0.0, 0.0, 0.0, 0.0, 0.0))),
        )
        k1, k2, p1, p2, k3 = s.camera.distortion
        yield Mistake(
            "order of the distortion",
            "the coefficients of the distortion are in the order k1, k2, k3, p1, p2",
            f"k3 = {p1:.6g}, p1 = {p2:.6g}, p2 = {k3:.6g} in [camera]",
            camera(lambda c: replace(c, distortion=(k1, k2, p2, k3, p1))),
        )
