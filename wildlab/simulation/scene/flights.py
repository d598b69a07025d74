"""A twin's flight as scenes, rendered from its own true poses over its own targets; and what a thermal camera
makes of a scene: blur, vignetting, noise, dead pixels, 14 bits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.camera_detections import Exposures, exposure_times, visible_part
from wildlab.simulation.courses import twin_trajectory
from wildlab.simulation.error_models import stream
from wildlab.simulation.manifest import as_flown
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.scene.render import (
    Body,
    RenderedView,
    Scene,
    Sea,
    fitted_out,
    outline_of,
    render,
    vessel,
)
from wildlab.simulation.target_motion import target_path
from wildlab.simulation.trajectory import camera_motion

#: Largest count of 14 bits.
LARGEST = 2**14 - 1


@dataclass(frozen=True)
class CameraResponse:
    """A thermal camera beyond its geometry. The sensitivity is H's (appendix A), the rest is chosen.

    Attributes
    ----------
    blur_sd
        Of lens and detector together, px.
    noise
        Temporal, per pixel, K: below 50 mK (H table A.1).
    pattern, stripes
        What stays from image to image, per pixel and per column, K.
    vignetting
        How much warmer the corners look, K: the housing seen past the lens.
    dead_share
        Of the pixels, that always show the same.
    counts_per_kelvin, counts_at, counts_level
        Linear: so many counts per kelvin, and which count stands for which temperature (K).
    """

    blur_sd: float = 0.6
    noise: float = 0.05
    pattern: float = 0.02
    stripes: float = 0.015
    vignetting: float = 0.4
    dead_share: float = 1e-4
    counts_per_kelvin: float = 25.0
    counts_at: float = 273.15
    counts_level: float = 7000.0


#: One that changes nothing but the unit.
IDEAL = CameraResponse(blur_sd=0.0, noise=0.0, pattern=0.0, stripes=0.0, vignetting=0.0, dead_share=0.0)


class Sensor(NamedTuple):
    """What one camera has and keeps: ``offset`` (H, W) K, and which pixels are ``dead``, at what count."""

    offset: NDArray[np.float32]
    dead: NDArray[np.bool_]
    stuck: NDArray[np.uint16]


def sensor_of(response: CameraResponse, shape: tuple[int, int], rng: np.random.Generator) -> Sensor:
    """Draws a camera of that kind: its fixed pattern, and its dead pixels.

    Parameters
    ----------
    response
        Which kind.
    shape
        Rows and columns.
    rng
        Of that camera.

    Returns
    -------
    Sensor
    """
    rows, columns = shape
    v, u = np.mgrid[:rows, :columns].astype(float)
    middle = np.array([(rows - 1) / 2, (columns - 1) / 2])
    radius2 = ((v - middle[0]) ** 2 + (u - middle[1]) ** 2) / max((middle**2).sum(), 1.0)
    offset = response.vignetting * radius2
    offset = offset + response.pattern * rng.standard_normal(shape)
    offset = offset + response.stripes * rng.standard_normal(columns)
    dead = rng.random(shape) < response.dead_share
    stuck = rng.choice(np.array([0, LARGEST], np.uint16), shape)
    return Sensor(offset.astype(np.float32), dead, stuck)


def expose(
    kelvin: NDArray[np.floating], response: CameraResponse, sensor: Sensor, rng: np.random.Generator
) -> NDArray[np.uint16]:
    """An image in counts of 14 bits.

    Parameters
    ----------
    kelvin
        (H, W) apparent temperatures, as `wildlab.simulation.scene.render.render` gives them.
    response, sensor
        The camera.
    rng
        Of the image.

    Returns
    -------
    (H, W) counts.
    """
    seen: NDArray[Any] = np.asarray(kelvin, np.float32)
    if response.blur_sd > 0:
        seen = np.asarray(cv2.GaussianBlur(seen, (0, 0), response.blur_sd, borderType=cv2.BORDER_REPLICATE))
    seen = seen + sensor.offset
    if response.noise > 0:
        seen += np.float32(response.noise) * rng.standard_normal(seen.shape, np.float32)
    counts = np.clip(np.rint(to_counts(seen, response)), 0, LARGEST).astype(np.uint16)
    counts[sensor.dead] = sensor.stuck[sensor.dead]
    return np.asarray(counts)


def to_counts(kelvin: ArrayLike, response: CameraResponse) -> NDArray[Any]:
    """Counts of kelvin, by the gain and the level of ``response``, neither rounded nor cut."""
    above = np.asarray(kelvin) - np.float32(response.counts_at)
    return np.asarray(response.counts_level + above * response.counts_per_kelvin)


#: Decks and engines over the sea, K; how many flights have the sun out; fittings over the deck, K (SD).
EXCESS, ENGINE, GLINT_SHARE, FITTING_EXCESS = 8.0, 15.0, 0.5, 5.0


@dataclass(frozen=True)
class VesselLook:
    """What a twin does not say of its vessels: how they look. All chosen.

    Attributes
    ----------
    lengths, slender
        Of targets without an outline, m, in their order, and how many times their beam that is.
    fittings
        How many small things, warm and cold, are on each deck: hatches, vents, winches; a hundredth of its
        length wide.
    """

    lengths: tuple[float, ...] = (11.0, 7.0)
    slender: float = 3.0
    fittings: int = 0


class Window(NamedTuple):
    """A part of an image, px."""

    left: int
    top: int
    width: int
    height: int

    def of(self, camera: Camera) -> Camera:
        """The camera that sees this part alone."""
        return replace(
            camera, width=self.width, height=self.height, cx=camera.cx - self.left, cy=camera.cy - self.top
        )

    @property
    def slices(self) -> tuple[slice, slice]:
        """Its rows and columns of the whole image."""
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)


def corner_of(window: Window | None) -> Array:
    """Where a window's first pixel lies in the whole image, (2,) px; None is the whole image.

    Examples
    --------
    >>> corner_of(Window(30, 40, 64, 48)).tolist(), corner_of(None).tolist()
    ([30.0, 40.0], [0.0, 0.0])
    """
    return np.zeros(2) if window is None else np.array([window.left, window.top], float)


class SceneFlight:
    """A flight of a twin whose images can be rendered, one exposure at a time.

    Attributes
    ----------
    times
        (N,) s, of all exposures.
    poses
        The camera's true poses at these.
    """

    def __init__(self, twin: TwinParameters, seed: int, look: VesselLook | None = None) -> None:
        flown, look = as_flown(twin, seed), look or VesselLook()
        trajectory = twin_trajectory(twin, stream(seed, "trajectory"))
        exposures = Exposures(flown, camera_motion(twin, trajectory, exposure_times(twin), seed))
        self.times: Array = exposures.times
        self.poses: CameraPoses = exposures.poses
        self._paths = [target_path(target, seed) for target in twin.targets]
        rng = stream(seed, "scene")
        self._vessels: list[Body] = []
        self._courses: list[float] = []
        for number, target in enumerate(twin.targets):
            length = look.lengths[number % len(look.lengths)]
            beam = length / look.slender
            if target.outline is not None:
                length, beam = target.outline.length.si, target.outline.beam.si
            speed = 0.0 if target.motion is None else target.motion.speed.si
            body = vessel(length, beam, EXCESS, speed=speed, engine=ENGINE, seed=int(rng.integers(2**31)))
            if look.fittings:
                own = stream(seed, f"fittings of {target.identifier.text}")
                body = fitted_out(body, look.fittings, FITTING_EXCESS, own)
            self._vessels.append(body)
            self._courses.append(0.0 if target.motion is None else target.motion.course.si)
        sun = float(np.radians(rng.uniform(10, 50))) if rng.random() < GLINT_SHARE else None
        self.sea = Sea(
            wind_speed=twin.flight.wind_speed.si,
            wind_from=twin.flight.wind_from.si,
            sun_azimuth=float(rng.uniform(-np.pi, np.pi)),
            sun_elevation=sun,
            seed=int(rng.integers(2**31)),
        )

    def bodies(self, exposure: int) -> tuple[Body, ...]:
        """The vessels where they are at an exposure, in the order of the twin's targets."""
        time = self.times[exposure : exposure + 1]
        places = [path(time)[0] for path in self._paths]
        return tuple(
            body.at(float(place[0]), float(place[1]), course)
            for body, place, course in zip(self._vessels, places, self._courses, strict=True)
        )

    def near(self) -> NDArray[np.bool_]:
        """(N, targets): at which exposures a target's middle is within its own length of the image.

        Quick, to choose which exposures to render; what an image shows is in `RenderedView.seen`.
        """
        camera, found = self.poses.camera, []
        size = np.array([camera.width, camera.height], float)
        for body, path in zip(self._vessels, self._paths, strict=True):
            points = path(self.times)
            uv = ground_to_pixel(camera, points, self.poses.p_nc, self.poses.R_nc)
            depth = np.linalg.norm(points - self.poses.p_nc, axis=1)
            length = max(x for layer in body.layers for x, _ in layer.outline) * 2
            reach = (length / depth * camera.fx)[:, None]
            with np.errstate(invalid="ignore"):
                found.append(((uv > -reach) & (uv < size + reach)).all(axis=1))
        return np.stack(found, axis=1)

    def shares(self, exposure: int) -> Array:
        """(targets,): which share of each target's outline lies within the image, without rendering it."""
        pose, camera = self.poses.take(exposure), self.poses.camera
        found = []
        for body in self.bodies(exposure):
            outline = outline_of(body, camera, pose.p_nc, pose.R_nc)
            if outline is None:
                found.append(0.0)
                continue
            whole = visible_part(outline - outline.min(axis=0), np.inf, np.inf).area
            found.append(visible_part(outline + 0.5, camera.width, camera.height).area / whole)
        return np.array(found)

    def window(self, exposure: int, margin: int) -> Window | None:
        """The part of an image about all vessels, ``margin`` px around their outlines; None without any."""
        pose, camera = self.poses.take(exposure), self.poses.camera
        found = [outline_of(body, camera, pose.p_nc, pose.R_nc) for body in self.bodies(exposure)]
        corners = [one for one in found if one is not None]
        if not corners:
            return None
        low = np.floor(np.concatenate(corners).min(axis=0)).astype(int) - margin
        high = np.ceil(np.concatenate(corners).max(axis=0)).astype(int) + margin + 1
        left, top = np.clip(low, 0, [camera.width, camera.height])
        right, bottom = np.clip(high, 0, [camera.width, camera.height])
        if right <= left or bottom <= top:
            return None
        return Window(int(left), int(top), int(right - left), int(bottom - top))

    def view(self, exposure: int, window: Window | None = None) -> RenderedView:
        """The image of an exposure in kelvin, with its labels.

        Waves stand still: each image shows another place of them. Of a ``window`` the pixels are those of the
        whole image, to the last bit, and pixels are counted from it.
        """
        pose = self.poses.take(exposure)
        scene = Scene(self.sea, self.bodies(exposure))
        camera = self.poses.camera if window is None else window.of(self.poses.camera)
        return render(scene, camera, pose.p_nc, pose.R_nc)
