"""Usual mistakes about pixels, calibration, mount, poses and clock, named by clicks on known points."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from wildlab.flight.checks.known_points import SightingGeometry, Sightings, calibration_mistakes, judge
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import Mount, camera_pose
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel

PLACE = (63.4, 10.4, 40.0)
LENS = Camera(640, 512, 700.0, 700.0, 330.0, 250.0, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
SIZE = np.array([640.0, 512.0])
Change = Callable[[Sightings], Sightings]


def straight_down(
    lens: Camera, p: Any, R: Any, points: Any, uv: Any, image: Any, sd: list[float], v: Any = 0.0
) -> Sightings:
    """Clicks on known points, seen straight down from poses that move with `v`."""
    zero, names = np.zeros(len(p)), np.arange(len(p)).astype(str).astype(object)
    return Sightings(
        "log", lens, Mount("down"), zero, zero, uv, p, R, points[None], image, np.tile(sd, (len(p), 1)),
        (np.radians(PLACE[0]), np.radians(PLACE[1]), PLACE[2]),
        lambda shift: SightingGeometry(p + shift * v, R, points[None], zero, zero),
        image.astype(str).astype(object), names,
    )  # fmt: skip


def sightings() -> Sightings:
    """Four clicks in each of 20 images, 0.5 px off, from about 90 m above uneven ground."""
    rng = np.random.default_rng(3)
    n, image = 80, np.arange(80) // 4
    p = np.column_stack([rng.uniform(-200, 200, (20, 2)), rng.uniform(-110, -80, 20)])[image]
    R = euler_to_matrix(*rng.uniform(-0.2, 0.2, (2, 20)), rng.uniform(-3, 3, 20))[image]
    points = np.column_stack([p[:, :2] + rng.uniform(-25, 25, (n, 2)), rng.uniform(-9, 0, n)])
    uv = ground_to_pixel(LENS, points, *camera_pose(Mount("down"), p, R)) + rng.normal(0, 0.5, (n, 2))
    return straight_down(LENS, p, R, points, uv, image, [0.002, 0.5, 0.5, 0.002])


def pixels(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda s: replace(s, uv=change(s.uv))


def camera(**stated: float) -> Change:
    return lambda s: replace(s, camera=replace(s.camera, **stated))


def mount(looks: str = "down", **stated: tuple[float, float, float]) -> Change:
    return lambda s: replace(s, mount=Mount(looks, **stated))


def poses(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda s: replace(s, p_nb=change(s.p_nb))


def geodetic(change: Callable[..., tuple[np.ndarray, ...]]) -> Change:
    def moved(p: np.ndarray) -> np.ndarray:
        there = change(*pymap3d.ned2geodetic(*p.T, *PLACE))
        return np.column_stack(pymap3d.geodetic2ned(*there, *PLACE))

    return poses(moved)


def everywhere(change: Callable[..., tuple[np.ndarray, ...]]) -> Change:
    """A change of latitude, longitude and height of poses, truth and the origin, which is the first pose."""
    origin = change(*PLACE)

    def moved(p: np.ndarray) -> np.ndarray:
        there = change(*pymap3d.ned2geodetic(*p.T, *PLACE))
        return np.column_stack(pymap3d.geodetic2ned(*there, *origin))

    def changed(s: Sightings) -> Sightings:
        at = (np.radians(origin[0]), np.radians(origin[1]), origin[2])
        return replace(s, p_nb=moved(s.p_nb), points=moved(s.points[0])[None], origin=at)

    return changed


def euler(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Of roll, pitch and yaw (N, 3), degrees."""

    def turned(s: Sightings) -> Sightings:
        angles = Rotation.from_matrix(s.R_nb).as_euler("ZYX", degrees=True)[:, ::-1]
        return replace(s, R_nb=Rotation.from_euler("ZYX", change(angles)[:, ::-1], degrees=True).as_matrix())

    return turned


MISTAKES: dict[str, Change] = {
    "v counted from the bottom": pixels(lambda uv: uv * [1, -1] + [0, 512]),
    "the image upside down": pixels(lambda uv: SIZE - uv),
    "u and v exchanged": pixels(lambda uv: uv[:, ::-1]),
    "pixels of an image 0.5 times as large": pixels(lambda uv: uv / 2),
    "u and v from the centre": pixels(lambda uv: uv - SIZE / 2),
    "calibration of an image 0.5 times as large": camera(fx=350.0, fy=350.0, cx=165.0, cy=125.0),
    "cx and cy exchanged": camera(cx=250.0, cy=330.0),
    "the camera looks down": mount("forward"),
    "lever arm in mm": mount(lever_arm=(120.0, 0.0, 80.0)),
    "camera turned": mount(misalignment=(0.0, 0.15, 0.1)),
    "sign of roll": euler(lambda e: e * [-1, 1, 1]),
    "sign of yaw": euler(lambda e: e * [1, 1, -1]),
    "yaw off by 90 deg": euler(lambda e: e - [0, 0, 90]),
    "roll and pitch exchanged": euler(lambda e: e[:, [1, 0, 2]]),
    "attitude the other way round": lambda s: replace(s, R_nb=np.swapaxes(s.R_nb, 1, 2)),
    "poses: latitude and longitude exchanged": geodetic(lambda a, b, h: (b, a, h)),
    "poses: height in ft, read as m": geodetic(lambda a, b, h: (a, b, h / 0.3048)),
    "poses: north and east exchanged": poses(lambda p: p[:, [1, 0, 2]]),
    "poses: north negated": poses(lambda p: p * [-1, 1, 1]),
    "constant height": poses(lambda p: p - [0, 0, 40.0]),
    "poses and truth: latitude and longitude exchanged": everywhere(lambda a, b, h: (b, a, h)),
    "poses and truth: longitude negated": everywhere(lambda a, b, h: (a, -b, h)),
    "truth: east negated": lambda s: replace(s, points=s.points * [1, -1, 1]),
}


def test_right_ones_are_not_accused(make_flight):
    assert list(judge(make_flight(time={"kind": "sequence"}), sightings())) == []


@pytest.mark.parametrize("cause", MISTAKES)
def test_a_mistake_is_named(make_flight, cause):
    # Clocks are left out: here nothing moves with time.
    flight = make_flight(time={"kind": "sequence"})
    found = [one.causes for one in judge(flight, MISTAKES[cause](sightings()))]
    assert any(cause in one for one in found), found


@pytest.mark.parametrize(
    ("late", "tilt", "cause"),
    [(0.4, 2.0, "clock of the camera"), (0.0, 6.0, "camera turned"), (0.5, 6.0, "camera turned")],
)
def test_a_clock_that_is_late_is_not_blamed_on_the_mount(make_flight, late, tilt, cause):
    """Of lines flown there and back the turns tell which; 0.4 s are 3.4 deg at 12 m/s and 80 m."""
    rng = np.random.default_rng(5)
    t = np.repeat(np.arange(0.0, 240.0, 2.0), 2)
    leg, ahead = np.divmod(t, 30.0)
    back = leg % 2 == 1
    yaw, v = np.where(back, np.pi, 0.0) + 0.5 * np.sin(t / 4), 12.0
    speed = v * np.column_stack([np.cos(yaw), np.sin(yaw), 0 * t])
    p = np.column_stack([np.where(back, 360 - v * ahead, v * ahead), 20 * leg, np.full(len(t), -80.0)])
    R = euler_to_matrix(*rng.normal(0, np.radians(0.3), (2, len(t))), yaw)
    points = np.column_stack([p[:, :2] + rng.uniform(-20, 20, (len(t), 2)), 0 * t])
    seen_from = p + late * speed, R @ euler_to_matrix(0.0, np.radians(tilt), 0.0)
    uv = ground_to_pixel(LENS, points, *camera_pose(Mount("down"), *seen_from))
    image = np.arange(len(t)) // 2
    given = straight_down(LENS, p, R, points, uv, image, [0.006, 0.5, 1.0, 0.006], speed)
    (found,) = judge(make_flight(), given)
    assert found.causes == (cause,)


@pytest.mark.parametrize(("focal", "named"), [(700.0, False), (0.7, True)])
def test_no_focal_length_is_offered_that_no_lens_has(focal, named):
    camera = Camera(1000, 800, focal, focal, 500.0, 400.0)
    causes = {one.cause for one in calibration_mistakes(SimpleNamespace(camera=camera))}
    assert ("focal length a thousand times" in causes) == named
