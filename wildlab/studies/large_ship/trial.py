"""A ship of 70 m from 100 m: detected in rendered images, put on the sea, and tracked, H 6.4.1.

The border of the image cuts it in most of them. Every step is done twice on the same detections: with their
centres moved by H (4.7), and with them as they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe, pose_errors
from wildlab.analysis.rendered import (
    Marks,
    Photographer,
    Shot,
    exposures_of,
    marks_of,
    with_detections,
)
from wildlab.analysis.tracks.sighting import CvTuning, Sighting, follow_pixels, sighting
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.uncertainty import ground_covariance
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.twins import simulate_twin
from wildlab.tracking.run import Track

Array = NDArray[np.float64]
#: Numbers of a flight by (subject, name).
Numbers = dict[tuple[str, str], float]

#: With the centre moved at the border, H (4.7), and without.
WITH, WITHOUT = "with-adjustment", "without-adjustment"
SUBJECTS = (WITH, WITHOUT)
#: Whose poses H 6.4.1 uses.
SOURCE = "autopilot"
#: The detector alone, without and before any adjustment.
DETECTOR = "detector"

#: H 6.4.1 says of its filter only that its parameters are those of another article. These are the printed
#: ones for a slow vessel (H 6.4.2, flight 2).
TUNING = CvTuning(acceleration=0.01, position_0=10.0, velocity_0=10.0, measurement=10.0, pixel=30.0)
#: What H 6.4.1 leaves out as the initialisation, s.
START_S = 10.0
#: What counts as at rest, m/s: a speed of exactly zero is hard to achieve (H 6.4.1). Chosen.
AT_REST_M_S = 1.0
#: Within what distances of the ship's centre measurements are counted, m: the claim's, half and twice it.
NEAR_M = (5, 10, 20)
#: From what share of its outline on the ship is called more than a sliver.
SLIVER = 0.01
#: Below what the two estimates differ for most of the time, m (H 6.4.1).
APART_M = 5.0

#: Names of the numbers that are recorded, and their units.
UNITS = {
    "mean_north": "m", "mean_east": "m", "sd_north": "m", "sd_east": "m", "sd_both": "m",
    "error_of_mean": "m",
    "mae": "m", "mae_after_start": "m", "speed_after_start": "m/s", "time_to_rest": "s",
    **{f"share_near_{near}": "1" for near in NEAR_M},
    "centre_error_of_mean": "m", "centre_error_true_poses": "m", "centre_mae_after_start": "m",
    "receiver_off": "m", "rate_beyond_sliver": "1", "largest_missed": "1",
    "ellipse_coverage_90": "1", "ground_coverage_90": "1",
    "sd_true_poses": "m", "error_true_poses": "m", "pixel_error": "px",
    "detection_rate": "1", "share_cut": "1", "share_moved": "1", "share_within_5_m": "1", "images": "1",
    "share_in_pieces": "1",
    "false_alarms_per_image": "1",
}  # fmt: skip


class Photographs(NamedTuple):
    """What was photographed of the ship on one flight.

    Attributes
    ----------
    flight
        The twin's, with its own drawn detections.
    camera
        That took the images.
    shots
        The images and what was found in them, in order.
    length
        Of the ship, px: its printed length from the printed height, which the detector is given (H 6.4.1).
    """

    flight: Flight
    camera: Photographer
    shots: list[Shot]
    length: float

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of an image."""
        one = self.camera.flight.poses.camera
        return one.height, one.width

    def marks(self, *, moved: bool = True) -> Marks:
        """Detections of the ship, with their centres moved for its length, or as they are."""
        return marks_of(self.shots, self.shape, 1, self.length if moved else np.nan)


class Tracked(NamedTuple):
    """The ship's detections on the sea, and the filter's track of them.

    Attributes
    ----------
    seen
        With times as if the segments came one after another, as in H 6.4.1.
    marks
        The same detections in the images.
    track
        Of the extended Kalman filter on pixels, H 6.3.
    """

    seen: Sighting
    marks: Marks
    track: Track


def photograph(twin: str, seed: int, every: int) -> Photographs:
    """Render every ``every``-th image that shows the ship, and look for it.

    Parameters
    ----------
    twin
        Of the ship.
    seed
        Of the flight.
    every
        1 is all 441 images.

    Returns
    -------
    Photographs
    """
    flight = simulate_twin(twin, seed)
    camera = Photographer(twin, seed)
    parameters = load_twin(twin)
    outline = parameters.targets[0].outline
    if outline is None:
        raise ValueError("the target has no outline")
    shots = list(camera.shoot(exposures_of(flight.table("frames"))[::every]))
    nominal = flight.manifest.geometry_camera()
    per_metre = float(np.sqrt(nominal.fx * nominal.fy)) / parameters.flight.altitude.si
    return Photographs(flight, camera, shots, outline.length.si * per_metre)


def merged_times(times: Array, groups: NDArray[np.object_]) -> Array:
    """Times (N,) from zero on, s, as if groups of frames came one after another without a pause.

    From the last frame of a group to the first of the next it takes as long as between two frames.

    Examples
    --------
    >>> merged_times(np.array([3.0, 4.0, 9.0, 10.0]), np.array(["a", "a", "b", "b"])).tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    steps = np.diff(times)
    same = np.asarray(groups[1:] == groups[:-1], bool)
    usual = float(np.median(steps[same])) if same.any() else 0.0
    return np.concatenate([[0.0], np.cumsum(np.where(same, steps, usual))])


def track_marks(taken: Photographs, marks: Marks) -> Tracked:
    """Put detections on the sea with the autopilot's poses, and track them in the image, H 6.3."""
    target = str(taken.flight.table("detections")["target_id"].iloc[0])
    flight = with_detections(taken.flight, marks, target)
    seen = sighting(flight, SOURCE)
    # A sighting begins and ends with a detection.
    rows = np.flatnonzero(marks.found)
    inside = slice(int(rows[0]), int(rows[-1]) + 1)
    groups = flight.table("frames")["group"].to_numpy(object)[inside]
    seen = seen._replace(times=merged_times(seen.times, groups))
    within = marks.take(inside)
    return Tracked(seen, within, follow_pixels(seen, TUNING))


def errors_of(one: Tracked) -> tuple[Array, Array]:
    """Errors (N, 2) of the positions on the sea and of the estimates, truth minus these, m."""
    truth = one.seen.truth[:, :2]
    return truth - one.seen.positions, truth - one.track.x[:, :2]


def centres_of(taken: Photographs, one: Tracked) -> Array:
    """Where the ship's centre truly is at each image, (N, 2), m: not its receiver, which is ahead of it."""
    return np.array([taken.camera.flight.bodies(int(row))[0].centre(0.0)[:2] for row in one.marks.exposure])


def time_to_rest(times: Array, speed: Array, limit: float = AT_REST_M_S) -> float:
    """From when on a speed (N,) stays below a limit, s; NaN where it does not at the end.

    Examples
    --------
    >>> time_to_rest(np.arange(5.0), np.array([3.0, 0.5, 2.0, 0.5, 0.1]))
    3.0
    """
    above = np.flatnonzero(~(speed < limit))
    if not len(above):
        return float(times[0])
    return float(times[above[-1] + 1]) if above[-1] + 1 < len(times) else np.nan


def numbers_of_track(taken: Photographs, one: Tracked) -> dict[str, float]:
    """What the detections on the sea and their track are worth, by the names of `UNITS`."""
    measured, estimated = errors_of(one)
    known = one.seen.seen
    e = measured[known]
    times = one.seen.times
    distance = np.hypot(*estimated.T)
    speed = np.hypot(*one.track.x[:, 2:4].T)
    later = times >= START_S
    marks = one.marks
    exact = taken.camera.flight.poses.take(marks.exposure)
    on_sea = georeference_pixels(exact, marks.uv, one.seen.plane_down)[:, :2]
    off = (one.seen.truth[:, :2] - on_sea)[known]
    found = marks.found & np.isfinite(marks.centre).all(axis=1)
    apart = (marks.uv - marks.centre)[found]
    centre = centres_of(taken, one)
    from_centre = (centre - one.seen.positions)[known]
    near = np.hypot(*from_centre.T)
    tracked_off = np.hypot(*(centre - one.track.x[:, :2]).T)
    return {
        "mean_north": float(e[:, 0].mean()),
        "mean_east": float(e[:, 1].mean()),
        "error_of_mean": float(np.hypot(*e.mean(axis=0))),
        "sd_north": float(one.seen.positions[known, 0].std(ddof=1)),
        "sd_east": float(one.seen.positions[known, 1].std(ddof=1)),
        "sd_both": float(np.hypot(*one.seen.positions[known].std(axis=0, ddof=1))),
        "mae": float(np.nanmean(distance)),
        "mae_after_start": float(np.nanmean(distance[later])),
        "speed_after_start": float(np.nanmean(speed[later])),
        "time_to_rest": time_to_rest(times, speed),
        **{f"share_near_{limit}": float((near < limit).mean()) for limit in NEAR_M},
        "centre_error_of_mean": float(np.hypot(*from_centre.mean(axis=0))),
        "centre_error_true_poses": float(np.hypot(*(centre - on_sea)[known].mean(axis=0))),
        "centre_mae_after_start": float(np.nanmean(tracked_off[later])),
        "pixel_error": float(np.hypot(*apart.T).mean()),
        "ellipse_coverage_90": float(inside_ellipse(apart, marks.covariance[found], 0.9).mean()),
        "ground_coverage_90": float(ground_inside(taken, one).mean()),
        "sd_true_poses": float(np.hypot(*off.std(axis=0, ddof=1))),
        "error_true_poses": float(np.hypot(*off.mean(axis=0))),
    }


def ground_inside(taken: Photographs, one: Tracked) -> NDArray[np.bool_]:
    """Whether the 90 % ellipses of the detections on the sea, pixel and pose together, hold the ship: (K,).

    The pixel's covariance is the detector's; the rest is what the flight states of its poses.
    """
    target = str(taken.flight.table("detections")["target_id"].iloc[0])
    seen = observe(with_detections(taken.flight, one.marks, target), SOURCE)
    errors = pose_errors(seen)._replace(pixel=one.marks.covariance[one.marks.found])
    found = ground_covariance(seen.poses, seen.uv, seen.plane_down, errors, np.random.default_rng(0))
    off = errors_of(one)[0][one.marks.found]
    return np.asarray(inside_ellipse(off, found.covariance, 0.9))


def numbers_of(taken: Photographs, tracked: dict[str, Tracked]) -> Numbers:
    """Everything that is compared over flights, by (subject, name)."""
    numbers: Numbers = {
        (subject, name): value
        for subject, one in tracked.items()
        for name, value in numbers_of_track(taken, one).items()
    }
    marks = taken.marks(moved=False)
    visible = marks.share > 0
    missed, clear = marks.share[visible & ~marks.found], marks.share >= SLIVER
    receiver = tracked[WITH].seen.truth[:, :2] - centres_of(taken, tracked[WITH])
    numbers |= {
        (DETECTOR, "images"): float(visible.sum()),
        (DETECTOR, "detection_rate"): float(marks.found[visible].mean()),
        (DETECTOR, "rate_beyond_sliver"): float(marks.found[clear].mean()) if clear.any() else np.nan,
        (DETECTOR, "largest_missed"): float(missed.max()) if len(missed) else np.nan,
        (DETECTOR, "receiver_off"): float(np.nanmean(np.hypot(*receiver.T))),
        (DETECTOR, "false_alarms_per_image"): float(marks.false.mean()),
        (DETECTOR, "share_cut"): float((marks.share[visible] < 1 - 1e-9).mean()),
        (DETECTOR, "share_moved"): float(tracked[WITH].marks.moved[tracked[WITH].marks.found].mean()),
        (DETECTOR, "share_in_pieces"): float((marks.pieces[marks.found] > 1).mean()),
        (DETECTOR, "share_within_5_m"): share_within(tracked),
    }
    return numbers


def share_within(tracked: dict[str, Tracked]) -> float:
    """Of the time after the start, the share in which the two estimates' errors differ by less than 5 m."""
    distances = [np.hypot(*errors_of(tracked[who])[1].T) for who in SUBJECTS]
    later = tracked[WITH].seen.times >= START_S
    return float((np.abs(distances[0] - distances[1])[later] < APART_M).mean())


def track_both(taken: Photographs) -> dict[str, Tracked]:
    """With the adjustment and without it, by subject."""
    return {WITH: track_marks(taken, taken.marks()), WITHOUT: track_marks(taken, taken.marks(moved=False))}


def trial(seed: int, *, twin: str, every: int) -> Numbers:
    """One simulated flight, rendered, searched and tracked, by `numbers_of`.

    Raises
    ------
    WildlabError
        If there is no such twin, or the ship is found nowhere.
    """
    taken = photograph(twin, seed, every)
    return numbers_of(taken, track_both(taken))
