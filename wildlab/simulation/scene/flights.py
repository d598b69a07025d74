"""A twin's flight as scenes: rendered from its own true poses, over its own targets."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.camera_detections import Exposures, exposure_times, visible_part
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.perturbed_flight import as_flown
from wildlab.simulation.scene.bodies import Body, fitted_out, vessel
from wildlab.simulation.scene.render import RenderedView, Scene, outline_of, render
from wildlab.simulation.scene.sea import Sea
from wildlab.simulation.target_motion import target_path
from wildlab.simulation.trajectory import camera_motion
from wildlab.simulation.twin_trajectory import twin_trajectory

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

    def view(self, exposure: int, *, waves_move: bool = True, window: Window | None = None) -> RenderedView:
        """The image of an exposure in kelvin, with its labels.

        Waves that stand still are quicker, and as good for single images: each shows another place. Of a
        ``window`` the pixels are those of the whole image, to the last bit, and pixels are counted from it.
        """
        pose, time = self.poses.take(exposure), float(self.times[exposure])
        # The vessels are where they are already: their own motion from time zero on must not be added.
        bodies = tuple(replace(body, speed=0.0) for body in self.bodies(exposure))
        scene = Scene(self.sea, bodies)
        camera = self.poses.camera if window is None else window.of(self.poses.camera)
        return render(scene, camera, pose.p_nc, pose.R_nc, time if waves_move else 0.0)
