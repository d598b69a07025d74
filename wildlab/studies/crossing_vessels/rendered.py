"""The crossing from rendered frames: what the detector finds is tracked, beside drawn detections.

Frame, detections, their places on the sea by the told poses, their own features, tracks: the labels of the
scene only say afterwards whose a detection is. The drawn detections of the same flight and time stand beside
it; nothing is counted over both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe
from wildlab.analysis.rendered import Photographer, Shot, exposures_of
from wildlab.detection.centres import cut_sides
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels
from wildlab.simulation.scene.flights import SceneFlight
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.crossing_vessels.trial import (
    BOATS,
    JOINT,
    NONE,
    SUBJECTS,
    TOLD_SD,
    WEIGHTS,
    WINDOW_S,
    Crossing,
    apart_times,
    arrange,
    dressed,
    follow_by,
    identities_of,
    joint_numbers,
    photograph,
    swapped,
    wrong_of,
)
from wildlab.tracking.association import Appearance, image_features
from wildlab.tracking.many.bank import Bank

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: A vessel of which so much is in view is whole.
WHOLE = 1 - 1e-9


class Spotted(NamedTuple):
    """What the detector made of F frames: D detections, and what there was to see.

    Attributes
    ----------
    frames
        (F,) exposures that were looked at.
    exposure
        (D,) exposure of each detection.
    uv, area, intensity, hu
        (D, 2) px, (D,) px^2, (D,) counts and (D,), Hu's first moment.
    boat
        (D,) whose each is; `NONE` where it is of nothing.
    both
        (D,) whether the other vessel lies in it too, and has no detection of its own.
    cut
        (D,) whether its box touches the border of the image.
    share
        (F, 2) of each vessel's outline in view.
    found, joined
        (F, 2) whether a vessel was detected on its own, and whether it lies in the other's detection.
    """

    frames: Index
    exposure: Index
    uv: Array
    area: Array
    intensity: Array
    hu: Array
    boat: Index
    both: Bools
    cut: Bools
    share: Array
    found: Bools
    joined: Bools

    def of(self, rows: Bools) -> Spotted:
        """With some of the detections, (D,) bool."""
        names = ("exposure", "uv", "area", "intensity", "hu", "boat", "both", "cut")
        return self._replace(**{name: getattr(self, name)[rows] for name in names})


class Counted(NamedTuple):
    """How the detector did, over some frames.

    Attributes
    ----------
    frames, false
        How many, and detections of nothing in them.
    whole, found, joined
        Times that a vessel was whole in view; of these detected on its own; and in one with the other.
    """

    frames: int
    false: int
    whole: int
    found: int
    joined: int

    @property
    def missed(self) -> int:
        """Times that a vessel was whole in view and in no detection."""
        return self.whole - self.found - self.joined


def spot(shots: Iterable[Shot], shape: tuple[int, int]) -> Spotted:
    """The detections in images of the two, with whose each is.

    Parameters
    ----------
    shots
        From `Photographer.shoot`; the vessels are numbered as in `BOATS`.
    shape
        Rows and columns of an image.

    Returns
    -------
    Spotted
    """
    taken = list(shots)
    n = len(taken)
    share, found, joined = np.zeros((n, 2)), np.zeros((n, 2), bool), np.zeros((n, 2), bool)
    boat, both = [np.zeros(0, np.int64)], [np.zeros(0, bool)]
    for k, shot in enumerate(taken):
        whose, with_other = np.full(len(shot.detections), NONE), np.zeros(len(shot.detections), bool)
        for seen in shot.seen:
            share[k, seen.number - 1] = seen.share
        for number, rows in shot.judged.found.items():
            whose[rows], found[k, number - 1] = number - 1, bool(rows)
        for number in shot.judged.merged:
            joined[k, number - 1] = True
            # It lies in the largest detection of the only other one.
            with_other[shot.judged.found[len(BOATS) + 1 - number][:1]] = True
        boat.append(whose)
        both.append(with_other)
    all_of = [shot.detections for shot in taken]
    return Spotted(
        frames=np.array([shot.exposure for shot in taken], np.int64),
        exposure=np.repeat([shot.exposure for shot in taken], [len(one) for one in all_of]).astype(np.int64),
        uv=np.concatenate([np.zeros((0, 2)), *(one.uv for one in all_of)]),
        area=np.concatenate([np.zeros(0), *(one.area for one in all_of)]),
        intensity=np.concatenate([np.zeros(0), *(one.intensity for one in all_of)]),
        hu=np.concatenate([np.zeros(0), *(one.hu[:, 0] for one in all_of)]),
        boat=np.concatenate(boat),
        both=np.concatenate(both),
        cut=np.array([cut_sides(box, shape).any() for one in all_of for box in one.box], bool),
        share=share,
        found=found,
        joined=joined,
    )


def count(spotted: Spotted) -> Counted:
    """How often what is in view was detected, and how often nothing was."""
    whole = spotted.share >= WHOLE
    return Counted(
        frames=len(spotted.frames),
        false=int((spotted.boat == NONE).sum()),
        whole=int(whole.sum()),
        found=int((whole & spotted.found).sum()),
        joined=int((whole & spotted.joined).sum()),
    )


#: Of the frames in which no vessel is near, one in so many is looked at, for false detections alone.
SEA_EVERY = 10
#: Told of progress: frames looked at, and of how many.
Tell = Callable[[int, int], None]


class Placed(NamedTuple):
    """D detections on the sea, what they look like, and `Spotted.both` of them."""

    crossing: Crossing
    appearance: Appearance
    both: Bools


class Associated(NamedTuple):
    """What one rule made of the detections of one flight; `None` where the rule gives no detection away.

    Attributes
    ----------
    swapped
        Whether each vessel has the other's track just after the crossing.
    swaps
        How often a track went over to the other vessel.
    own, wrong, unassigned
        Detections of one vessel alone; of these those that went to a track that the other started; and those
        that went to none.
    tracks
        That were started.
    """

    swapped: bool
    swaps: int
    own: int | None = None
    wrong: int | None = None
    unassigned: int | None = None
    tracks: int | None = None


class CrossingTracks(NamedTuple):
    """Detections, drawn or from frames, and what each rule made of them.

    Attributes
    ----------
    crossing
        The detections in the time that is looked at.
    off
        (D,) how far each vessel's detection is from the vessel's receiver, m; NaN for one of nothing.
    by_rule
        By the rules of `SUBJECTS`, and `JOINT`.
    """

    crossing: Crossing
    off: Array
    by_rule: dict[str, Associated]


class Rendering(NamedTuple):
    """One flight from rendered frames, and from its drawn detections over the same time.

    Attributes
    ----------
    seed
        Of the flight.
    span
        From when to when, s.
    exposures
        How many the camera took in that time.
    spotted
        In the frames in which a vessel is near.
    near, sea
        What is counted of these, and of frames without a vessel near.
    frames, inside, drawn
        Tracked from all detections of these frames; from those that do not touch the border; and from the
        drawn detections.
    """

    seed: int
    span: tuple[float, float]
    exposures: int
    spotted: Spotted
    near: Counted
    sea: Counted
    frames: CrossingTracks
    inside: CrossingTracks
    drawn: CrossingTracks


def on_the_sea(flight: Flight, spotted: Spotted, source: str = "autopilot") -> Placed:
    """Detections of frames on the sea, with the poses of a source, and what they look like.

    Whose a detection is has no part in where it is put; its size is by how far that is from the told pose.

    Parameters
    ----------
    flight
        Of the twin, with the frames.
    spotted
        In some of them.
    source
        Of the poses.

    Raises
    ------
    WildlabError
        If nothing was detected, or in an exposure that is none of the flight's frames.
    """
    names = flight.table("frames")["frame_id"]
    place = pd.Index(exposures_of(flight.table("frames"))).get_indexer(pd.Index(spotted.exposure))
    if not len(place) or (place < 0).any():
        lost = spotted.exposure[place < 0]
        problem = f"exposure {lost[0]} is none of {len(names)} frames" if len(lost) else "nothing is detected"
        raise WildlabError(
            f"in {len(spotted.frames)} rendered frames: {problem}",
            "render more frames of the same twin and seed",
            field="detections",
        )
    table = pd.DataFrame(
        {
            "detection_id": [f"r{number:06d}" for number in range(1, len(place) + 1)],
            "frame_id": names.to_numpy()[place],
            "source": "detector",
            "kind": "pixel",
            "u_px": spotted.uv[:, 0],
            "v_px": spotted.uv[:, 1],
            "plane_down_m": 0.0,
        }
    )
    seen = observe(replace(flight, tables=flight.tables | {"detections": table}), source)
    distance = np.linalg.norm(
        georeference_pixels(seen.poses, seen.uv, seen.plane_down) - seen.poses.p_nc, axis=1
    )
    per_px = distance / np.sqrt(seen.poses.camera.fx * seen.poses.camera.fy)
    features = image_features(spotted.area, spotted.intensity, spotted.hu, per_px)
    crossing, order = arrange(flight, seen, spotted.boat)
    appearance = Appearance(features[order], TOLD_SD, WEIGHTS)
    return Placed(crossing, appearance, spotted.both[order])


def drawn_at_sea(flight: Flight, source: str = "autopilot") -> Crossing:
    """The drawn detections as `on_the_sea` puts those of frames: on the sea's own level.

    `gather` takes the height of each vessel's receiver, which needs to know whose a detection is.
    """
    table = flight.table("detections")
    table = table[table["kind"] == "pixel"]
    boat = np.array([BOATS.index(name) for name in table["target_id"]])
    nameless = replace(flight, tables=flight.tables | {"detections": table.assign(target_id="")})
    return arrange(flight, observe(nameless, source), boat)[0]


def part_of(crossing: Crossing, span: tuple[float, float]) -> Crossing:
    """The detections from one time to another, s, both included."""
    kept = (crossing.times >= span[0]) & (crossing.times <= span[1])
    rows = kept[np.unique(crossing.looks.image, return_inverse=True)[1]]
    looks = crossing.looks._replace(
        image=crossing.looks.image[rows], positions=crossing.looks.positions[rows]
    )
    return Crossing(looks, crossing.boat[rows], crossing.times[kept], crossing.truth[:, kept])


def associate(placed: Placed, bank: Bank) -> Associated:
    """What is counted of one rule's tracks; a detection of both vessels is right on either's."""
    crossing = placed.crossing
    vessel, given = crossing.boat != NONE, bank.track >= 0
    own, wrong = vessel & ~placed.both, wrong_of(crossing, bank) & ~placed.both
    after, _ = swapped(crossing, bank)
    return Associated(
        own=int(own.sum()),
        wrong=int(wrong.sum()),
        unassigned=int((vessel & ~given).sum()),
        tracks=len(bank.started),
        swapped=after,
        swaps=identities_of(crossing, bank).swaps,
    )


def follow(placed: Placed) -> CrossingTracks:
    """The same detections by every rule, and shared by probability."""
    crossing = placed.crossing
    by_rule = {rule: associate(placed, follow_by(crossing, rule, placed.appearance)) for rule in SUBJECTS}
    joint = joint_numbers(crossing)
    by_rule[JOINT] = Associated(swapped=bool(joint[JOINT, "swapped"]), swaps=int(joint[JOINT, "swaps"]))
    at = np.unique(crossing.looks.image, return_inverse=True)[1]
    off = np.linalg.norm(crossing.looks.positions - crossing.truth[crossing.boat, at], axis=1)
    return CrossingTracks(crossing, np.where(crossing.boat == NONE, np.nan, off), by_rule)


def frames_in(scenes: SceneFlight, span: tuple[float, float]) -> tuple[Index, Index]:
    """Which exposures in a time are looked at: all with a vessel near; and one in `SEA_EVERY` of the others.

    Near is a vessel whose middle is within its own length of the image.
    """
    inside = (scenes.times >= span[0]) & (scenes.times <= span[1])
    near = scenes.near().any(axis=1)
    return np.flatnonzero(inside & near), np.flatnonzero(inside & ~near)[::SEA_EVERY]


def render_crossing(
    twin: str,
    seed: int,
    images: int,
    tell: Tell | None = None,
    flight: Flight | None = None,
    every: int = 1,
) -> Rendering:
    """One flight about the crossing, from rendered frames and from drawn detections.

    From `WINDOW_S` before the two were last apart to as long after they are apart again; tracks begin anew.

    Parameters
    ----------
    twin, seed
        The flight.
    images
        Rendered of each vessel, which the looks of drawn detections are drawn from.
    tell
        Is told of the progress.
    flight
        The flight, where it is at hand.
    every
        Take only one in so many of the frames.

    Raises
    ------
    WildlabError
        If there is no such twin, or nothing is detected.
    """
    flight = flight or simulate_twin(twin, seed, ("imu", "gnss"))
    whole = drawn_at_sea(flight)
    until, since = apart_times(whole)
    span = until - WINDOW_S, since + WINDOW_S
    camera = Photographer(twin, seed)
    near, sea = (one[::every] for one in frames_in(camera.flight, span))
    total, done = len(near) + len(sea), 0

    def shoot(exposures: Index) -> Iterable[Shot]:
        nonlocal done
        for shot in camera.shoot(exposures):
            done += 1
            if tell is not None:
                tell(done, total)
            yield shot

    shape = camera.flight.poses.camera.height, camera.flight.poses.camera.width
    spotted, of_sea = spot(shoot(near), shape), spot(shoot(sea), shape)
    drawn = part_of(whole, span)
    none = np.zeros(len(drawn.boat), bool)
    times = camera.flight.times
    return Rendering(
        seed=seed,
        span=span,
        exposures=int(((times >= span[0]) & (times <= span[1])).sum()),
        spotted=spotted,
        near=count(spotted),
        sea=count(of_sea),
        frames=follow(on_the_sea(flight, spotted)),
        inside=follow(on_the_sea(flight, spotted.of(~spotted.cut))),
        drawn=follow(Placed(drawn, dressed(drawn, photograph(twin, seed, flight, images), seed), none)),
    )


def render_flights(twin: str, seed: int, count: int, images: int) -> list[Rendering]:
    """The flights that follow ``seed``, one after the other; progress is printed.

    That of ``seed`` itself was chosen by how its drawn detections turned out, and these were not.

    Raises
    ------
    WildlabError
        If the count is negative.
    """
    if count < 0:
        raise WildlabError(f"{count} flights to be rendered", "give none or more", field="rendered")
    flights = []
    for one in range(seed + 1, seed + 1 + count):

        def tell(done: int, total: int, one: int = one) -> None:
            if done % 100 == 0 or done == total:
                end = "\n" if done == total else ""
                print(f"\rflight {one}: {done} of {total} frames", end=end, flush=True)

        flights.append(render_crossing(twin, one, images, tell))
    return flights
