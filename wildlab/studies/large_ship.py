"""A ship of 70 m from 100 m: detected in rendered images, put on the sea, and tracked, H 6.4.1.

The border of the image cuts it in most of them. Every step is done twice on the same detections: with their
centres moved by H (4.7), and with them as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from wildlab.analysis.tracks.pixels import CvTuning, PixelMeasurements, read_pixels, track_pixels
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.reporting.charts.drawing import (
    draw_errors,
    draw_line,
    draw_marks,
    draw_picture,
    finish,
    new_strips,
)
from wildlab.reporting.figures import BLUE, INK, VERMILLION, map_axes, new_figure
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.vessel_detection import (
    Marks,
    Photographer,
    Shot,
    exposures_of,
    marks_of,
    with_detections,
)
from wildlab.tracking.run import Track

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
#: Below what the two estimates differ for most of the time, m (H 6.4.1).
APART_M = 5.0


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

    seen: PixelMeasurements
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
    seen = read_pixels(flight, SOURCE)
    # A sighting begins and ends with a detection.
    rows = np.flatnonzero(marks.found)
    inside = slice(int(rows[0]), int(rows[-1]) + 1)
    groups = flight.table("frames")["group"].to_numpy(object)[inside]
    seen = seen._replace(times=merged_times(seen.times, groups))
    within = marks.take(inside)
    return Tracked(seen, within, track_pixels(seen, TUNING))


def errors_of(one: Tracked) -> tuple[Array, Array]:
    """Errors (N, 2) of the positions on the sea and of the estimates, truth minus these, m."""
    truth = one.seen.truth[:, :2]
    return truth - one.seen.positions, truth - one.track.x[:, :2]


def centres_of(taken: Photographs, one: Tracked) -> Array:
    """Where the ship's centre truly is at each image, (N, 2), m: not its receiver, which is ahead of it."""
    return np.array([taken.camera.flight.bodies(int(row))[0].centre[:2] for row in one.marks.exposure])


def time_to_rest(times: Array, speed: Array) -> float:
    """From when on a speed (N,) stays below `AT_REST_M_S`, s; NaN where it does not at the end.

    Examples
    --------
    >>> time_to_rest(np.arange(5.0), np.array([3.0, 0.5, 2.0, 0.5, 0.1]))
    3.0
    """
    above = np.flatnonzero(~(speed < AT_REST_M_S))
    if not len(above):
        return float(times[0])
    return float(times[above[-1] + 1]) if above[-1] + 1 < len(times) else np.nan


def numbers_of_track(taken: Photographs, one: Tracked) -> dict[str, float]:
    """What the detections on the sea and their track are worth, by the names of `UNITS`."""
    measured, estimated = errors_of(one)
    known, marks, times = one.seen.detected, one.marks, one.seen.times
    positions, distance = one.seen.positions[known], np.hypot(*estimated.T)
    speed, later = np.hypot(*one.track.x[:, 2:4].T), times >= START_S
    exact = taken.camera.flight.poses.take(marks.exposure)
    on_sea = georeference_pixels(exact, marks.uv, one.seen.plane_down)[:, :2]
    off = (one.seen.truth[:, :2] - on_sea)[known]
    e, near = measured[known], np.hypot(*(centres_of(taken, one)[known] - positions).T)
    return {
        "mean_north": e[:, 0].mean(),
        "mean_east": e[:, 1].mean(),
        "error_of_mean": np.hypot(*e.mean(axis=0)),
        "sd_north": positions[:, 0].std(ddof=1),
        "sd_east": positions[:, 1].std(ddof=1),
        "sd_both": np.hypot(*positions.std(axis=0, ddof=1)),
        "mae": np.nanmean(distance),
        "mae_after_start": np.nanmean(distance[later]),
        "speed_after_start": np.nanmean(speed[later]),
        "time_to_rest": time_to_rest(times, speed),
        **{f"share_near_{limit}": (near < limit).mean() for limit in NEAR_M},
        "pixel_error": np.nanmean(np.hypot(*(marks.uv - marks.centre)[marks.found].T)),
        "sd_true_poses": np.hypot(*off.std(axis=0, ddof=1)),
    }


def numbers_of(taken: Photographs, tracked: dict[str, Tracked]) -> Numbers:
    """Everything that is compared over flights, by (subject, name)."""
    numbers: Numbers = {
        (subject, name): value
        for subject, one in tracked.items()
        for name, value in numbers_of_track(taken, one).items()
    }
    marks = taken.marks(moved=False)
    visible = marks.share > 0
    within = tracked[WITH].marks
    return numbers | {
        (DETECTOR, "detection_rate"): marks.found[visible].mean(),
        (DETECTOR, "share_cut"): (marks.share[visible] < 1 - 1e-9).mean(),
        (DETECTOR, "share_moved"): within.moved[within.found].mean(),
        (DETECTOR, "share_within_5_m"): share_within(tracked),
    }


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


_COLOURS = {WITH: BLUE, WITHOUT: VERMILLION}


def images(taken: Photographs) -> Figure:
    """An image that shows much of the ship, and one that shows about half of it (H figures 6.2, 4.8)."""
    plain, moved = taken.marks(moved=False), taken.marks()
    whole = int(np.argmax(np.where(plain.found, plain.share, -1.0)))
    cut = moved.moved if moved.moved.any() else plain.found
    part = int(np.argmin(np.where(cut, np.abs(plain.share - 0.5), 2.0)))
    height, width = taken.shape
    beyond = [max(float((-at).max()), *(at - [width, height])) for at in plain.centre[[whole, part]]]
    reach = max(0.0, *beyond) + 25
    fig, axes = new_figure(5.9, 3.1, columns=2)
    for ax, row, name in zip(axes, (whole, part), ("Most in view", "Nearest to half"), strict=True):
        _, counts = taken.camera.image(int(plain.exposure[row]))
        draw_picture(ax, counts, f"{name}: {100 * plain.share[row]:.0f} %", limits=None)
        shot = taken.shots[row]
        one = shot.detections.select(shot.judged.found[1][:1])
        angle = float(np.degrees(one.orientation[0]))
        outline = Ellipse(tuple(one.uv[0]), *one.axes[0], angle=angle, fill=False, ec=VERMILLION, lw=1.6)
        ax.add_patch(outline)
        draw_marks(ax, {"found": plain.uv[row], "moved": moved.uv[row], "true": plain.centre[row]})
        ax.set(xlim=(-reach, width + reach), ylim=(height + reach, -reach), facecolor="0.92")
    return finish(fig)


def positions(tracked: Mapping[str, Tracked], names: Mapping[str, str]) -> Figure:
    """Georeferenced positions about the ship's receiver, with and without (H figure 6.3)."""
    fig, axes = new_figure(5.9, 3.7, columns=2)
    errors = {who: -errors_of(one)[0][one.seen.detected] for who, one in tracked.items()}
    reach = 1.08 * max(float(np.abs(e).max()) for e in errors.values())
    for ax, (who, e) in zip(axes, errors.items(), strict=True):
        draw_errors(ax, e, _COLOURS[who], reach)
        ax.set_title(names[who].capitalize())
        map_axes(ax, scale_bar=False, north="north (m)" if ax is axes[0] else "")
    return fig


def errors_and_speed(tracked: Mapping[str, Tracked], names: Mapping[str, str]) -> Figure:
    """Distance from the receiver and estimated speed over the joined segments (H figure 6.4)."""
    fig, (far, fast) = new_strips(2, 4.6)
    for who, one in tracked.items():
        draw_line(far, one.seen.times, np.hypot(*errors_of(one)[1].T), _COLOURS[who], names[who])
        draw_line(fast, one.seen.times, np.hypot(*one.track.x[:, 2:4].T), _COLOURS[who])
    for ax in (far, fast):
        ax.axvline(START_S, color=INK, lw=0.8, ls=":")
        ax.set_ylim(bottom=0)
    fast.set_ylabel("speed (m/s)")
    return finish(fig, "time, segments joined (s)", "distance (m)")
