"""Animals followed once from rendered frames, through F's whole chain, beside drawn detections of the same.

Frame, detections, ground, tracks: of one world and the beginning of one way, for the figures; no seeds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.animals.images import (
    NONE,
    Frame,
    Framed,
    Images,
    Thermal,
    furnish,
    ground_distance,
    judge,
    render_frame,
    take_frames,
)
from wildlab.analysis.animals.tracking import FollowedAnimals, follow, out_of_sight, sight_numbers
from wildlab.detection.detections import Detections
from wildlab.detection.warm import find_warm, gate_from_distance, to_grey
from wildlab.errors import WildlabError
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.scene.ground import Weather
from wildlab.simulation.scene.response import CameraResponse, sensor_of
from wildlab.studies.wildlife_detection.trial import AREA, CLOUDY, METHODS, SUBTRACTED, WEATHERS, Operator
from wildlab.studies.wildlife_tracking.trial import NEGATIVE, World, follower_of

#: When frames are taken: at the twin's epoch, and under clouds, as most of F's images (F 7.4).
DAWN, CLOUDS = "dawn", "clouds"
#: The detections without frames.
SIMULATED = "simulated"


class Rendered(NamedTuple):
    """The beginning of a way in one weather.

    Attributes
    ----------
    framed
        What was found in them.
    followed
        The tracks through that.
    frame
        That of an image, by its number, rendered again.
    grey
        What the operator sees of counts.
    find
        What the detector finds in counts, with the distance to the ground, m.
    """

    framed: Framed
    followed: FollowedAnimals
    frame: Callable[[int], Frame]
    grey: Callable[[NDArray[np.uint16]], NDArray[np.uint8]]
    find: Callable[[NDArray[np.uint16], float], Detections]


class Renderings(NamedTuple):
    """The beginning of a way from frames, and from drawn detections.

    Attributes
    ----------
    world
        With the images of that beginning alone; their detections are drawn.
    drawn
        The tracks through these.
    by_weather
        From frames.
    """

    world: World
    drawn: FollowedAnimals
    by_weather: dict[str, Rendered]


class Counted(NamedTuple):
    """What came of images.

    Attributes
    ----------
    shown, found
        How often an animal was in view, and of these how often it was detected there.
    with_false
        How many images have a detection of no animal.
    tracks, by_false
        That were started, and of these by a false detection.
    rmse
        RMS distance of tracks from animals out of sight, m.
    """

    shown: int
    found: int
    with_false: int
    tracks: int
    by_false: int
    rmse: float


def weathers(twin: TwinParameters) -> dict[str, Weather]:
    """The clear sky of the twin's epoch, by the sun's time at its place; and clouds at noon."""
    at = datetime.fromisoformat(twin.place.epoch.text)
    hour = at.hour + at.minute / 60 + at.second / 3600 + float(np.degrees(twin.place.longitude.si)) / 15
    return {DAWN: Weather(hour=hour % 24), CLOUDS: WEATHERS[CLOUDY]}


def run_rendered(world: World, seed: int, count: int) -> Renderings:
    """The first images of a way rendered in each weather, and followed.

    Parameters
    ----------
    world
        Drawn from the seed.
    seed
        Of scenery, sensor and noise too.
    count
        How many images.

    Raises
    ------
    WildlabError
        Where that is none.
    """
    if count < 1:
        raise WildlabError(f"{count} frames to be rendered", "ask for one at least", field="frames")
    part = world._replace(images=world.images.first(count))
    by_weather = {name: _in_weather(part, seed, one) for name, one in weathers(world.twin).items()}
    return Renderings(part, _followed(part, part.images, seed), by_weather)


def _followed(world: World, images: Images, seed: int) -> FollowedAnimals:
    follower = follower_of(NEGATIVE, world, seed)
    return follow(images, world.land, world.detector, follower, world.motion)


def _in_weather(world: World, seed: int, weather: Weather) -> Rendered:
    images, true, camera = world.images, world.true, world.true.camera
    scenery = furnish(world.land, world.fences, images.truth.shape[1], weather, stream(seed, "scenery"))
    response, shape = CameraResponse(), (camera.height, camera.width)
    thermal = Thermal(response, sensor_of(response, shape, stream(seed, "sensor")))

    def frame(k: int) -> Frame:
        pose, noise = true.take(np.array([k])), stream(seed, f"frame {k}")
        return render_frame(world.land, scenery, pose, images.truth[k], thermal, noise)

    # The operator sets brightness and contrast once, at the first frame (F 3.1).
    operator = Operator(camera, response, thermal.sensor, stream(seed, "operator"))
    grey = partial(to_grey, window=operator.window(frame(0).view, weather))
    everywhere, focal = np.ones(shape, bool), float(np.sqrt(camera.fx * camera.fy))

    def find(counts: NDArray[np.uint16], distance: float) -> Detections:
        smallest, largest = gate_from_distance(distance, focal, *AREA)
        method = replace(METHODS[SUBTRACTED], smallest_px=smallest, largest_px=largest)
        return find_warm(grey(counts), everywhere, method)

    framed = take_frames(
        world.land, images, world.headings, frame, find, world.errors, world.detector,
        stream(seed, "covariances of frames"),
    )  # fmt: skip
    return Rendered(framed, _followed(world, framed.images, seed), frame, grey, find)


def counted(images: Images, followed: FollowedAnimals) -> Counted:
    """What came of images, drawn or rendered, and of the tracks through them."""
    false = images.animal == NONE
    hit = np.zeros(images.in_view.shape, bool)
    hit[images.image[~false], images.animal[~false]] = True
    away = out_of_sight(followed.known, followed.found, images.times, images.truth)
    return Counted(
        shown=int(images.in_view.sum()),
        found=int((images.in_view & hit).sum()),
        with_false=len(np.unique(images.image[false])),
        tracks=followed.tracks,
        by_false=sum(one.started and one.animal == NONE for one in followed.found),
        rmse=sight_numbers(away)["rmse"],
    )


def count_all(runs: Renderings) -> dict[str, Counted]:
    """What came of the simulated detections (`SIMULATED`), and of the frames in each weather."""
    by_weather = {name: counted(one.framed.images, one.followed) for name, one in runs.by_weather.items()}
    return {SIMULATED: counted(runs.world.images, runs.drawn)} | by_weather


def telling_image(runs: Renderings) -> int:
    """The image with most animals in view, of those with a false detection in any weather where there is one.

    The first of several.
    """
    in_view = runs.world.images.in_view
    with_false = np.zeros(len(in_view), bool)
    for one in runs.by_weather.values():
        images = one.framed.images
        with_false[images.image[images.animal == NONE]] = True
    return int((in_view.sum(axis=1) + (in_view.shape[1] + 1) * with_false).argmax())


def seen_again(world: World, run: Rendered, k: int) -> tuple[NDArray[np.uint8], Detections, NDArray[np.intp]]:
    """A frame as the operator sees it, with its detections and whose each is."""
    shot = run.frame(k)
    found = run.find(shot.counts, ground_distance(world.land, world.images.poses.take(np.array([k]))))
    return run.grey(shot.counts), found, judge(shot, found)
