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
    FrameMatch,
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
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
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
    weather
        Of all its frames.
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

    weather: Weather
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
    further
        How often an animal was detected that does not count as in view: cut by the border, or too far.
    animals
        How many were detected at all.
    detections, false, standing, with_false
        All; those of no animal; of these those where something stands, and not bare ground; and how many
        images have a false one.
    off_px
        RMS distance, an axis, of detections from the middles of their animals, px.
    tracks, by_false
        That were started, and of these by a false detection.
    sight
        As `sight_numbers` has it.
    """

    shown: int
    found: int
    further: int
    animals: int
    detections: int
    false: int
    standing: int
    with_false: int
    off_px: float
    tracks: int
    by_false: int
    sight: dict[str, float]


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
    return Rendered(weather, framed, _followed(world, framed.images, seed), frame, grey, find)


def counted(world: World, images: Images, followed: FollowedAnimals, framed: Framed | None = None) -> Counted:
    """What came of images, drawn or rendered.

    Parameters
    ----------
    world
        Of which they are.
    images
        With their detections.
    followed
        The tracks through them.
    framed
        Where they are rendered.
    """
    false = images.animal == NONE
    hit = np.zeros(images.in_view.shape, bool)
    hit[images.image[~false], images.animal[~false]] = True
    return Counted(
        shown=int(images.in_view.sum()),
        found=int((images.in_view & hit).sum()),
        further=int((~images.in_view & hit).sum()),
        animals=int(hit.any(axis=0).sum()),
        detections=len(false),
        false=int(false.sum()),
        standing=0 if framed is None else int((false & framed.standing).sum()),
        with_false=len(np.unique(images.image[false])),
        off_px=np.nan if framed is None else off_px(world, framed),
        tracks=followed.tracks,
        by_false=sum(one.started and one.animal == NONE for one in followed.found),
        sight=sight_numbers(out_of_sight(followed.known, followed.found, images.times, images.truth)),
    )


def count_all(runs: Renderings) -> dict[str, Counted]:
    """What came of the simulated detections (`SIMULATED`), and of the frames in each weather."""
    return {SIMULATED: counted(runs.world, runs.world.images, runs.drawn)} | {
        name: counted(runs.world, one.framed.images, one.followed, one.framed)
        for name, one in runs.by_weather.items()
    }


def off_px(world: World, framed: Framed) -> float:
    """RMS distance, an axis, of detections from the middles of their animals, px; NaN without any."""
    images = framed.images
    own = images.animal != NONE
    if not own.any():
        return float("nan")
    image = images.image[own]
    places = images.truth[image, images.animal[own]]
    points: Array = np.column_stack([places, -world.land.heights_at(places) - world.detector.height])
    uv = ground_to_pixel(world.true.camera, points, world.true.p_nc[image], world.true.R_nc[image])
    return float(np.sqrt(((framed.uv[own] - uv) ** 2).mean()))


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


def seen_again(world: World, run: Rendered, k: int) -> tuple[NDArray[np.uint8], Detections, FrameMatch]:
    """A frame as the operator sees it, with its detections and whose each is."""
    shot = run.frame(k)
    found = run.find(shot.counts, ground_distance(world.land, world.images.poses.take(np.array([k]))))
    return run.grey(shot.counts), found, judge(shot, found)
