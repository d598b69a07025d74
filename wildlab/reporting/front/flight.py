"""The flight on the front page: a part of a twin, computed once and kept in ``data/front-flight.json``.

Simulating it takes seconds, and compiles what a first look at a page should not wait for. The file holds
arrays, rounded to centimetres; ``python -m wildlab.reporting.front.flight`` makes it again, and a test
compares.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.paths import DATA
from wildlab.reporting.animation import Course, Ellipses, Outlines, ShownFlight

Array = NDArray[np.float64]

FILE = DATA / "front-flight.json"
#: Which twin, by which poses, from when, and at most how long, s: some rounds of its course.
TWIN, SEED, SOURCE, BEGIN, AT_LEAST, AT_MOST = "drifting-vessel-eight", 1, "autopilot", 430.0, 85.0, 125.0
#: Told to the Schmidt filter: m/s^2, and over how many seconds errors of the pose persist.
ACCELERATION, START_SPEED, PERSIST = 0.1, 5.0, 10.0
PROBABILITY = 0.9


class FrontFlight(NamedTuple):
    """What is shown, and what it comes to.

    Attributes
    ----------
    shown
        For `wildlab.reporting.animation.animated_flight`.
    twin
        Its name.
    height
        Mean height of the aircraft above the water, m.
    """

    shown: ShownFlight
    twin: str
    height: float

    @property
    def seconds(self) -> float:
        """How long that part of the flight takes, s."""
        return float(self.shown.path.times[-1] - self.shown.path.times[0])

    @property
    def images(self) -> int:
        """Images that show the target in that part of the flight; the file has one more on either side."""
        return int(self._inside.sum())

    @property
    def _inside(self) -> NDArray[np.bool_]:
        times, path = np.zeros(0), self.shown.path.times
        if self.shown.points is not None:
            times = self.shown.points.times
        return np.asarray((times >= path[0]) & (times <= path[-1]))

    @property
    def off(self) -> float:
        """Median distance of the position from one image to where the target was, m."""
        points, (truth,) = self.shown.points, self.shown.truth
        if points is None:
            return float("nan")
        missed = (points.points - _between(truth, points.times))[self._inside]
        return float(np.median(np.hypot(*missed.T)))

    @property
    def held(self) -> float:
        """Share of the instants at which the ellipse holds the target."""
        from wildlab.geometry.ellipses import inside_ellipse

        (ellipses,), (truth,) = self.shown.ellipses, self.shown.truth
        missed = _between(truth, ellipses.times) - ellipses.centres
        return float(np.mean(inside_ellipse(missed, ellipses.covariances, PROBABILITY)))


def _between(course: Course, times: Array) -> Array:
    return np.stack([np.interp(times, course.times, course.points[:, axis]) for axis in (0, 1)], axis=1)


def load_front_flight(path: Path = FILE) -> FrontFlight:
    """The kept flight.

    Raises
    ------
    WildlabError
        Where the file cannot be read, or is none such.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        parts = {name: [np.array(one, float) for one in content[name].values()] for name in _PARTS}
        path_, outlines, points, ellipses, truth = parts.values()
        shown = ShownFlight(
            Course(*path_), Outlines(*outlines), Course(*points), [Ellipses(*ellipses)], [Course(*truth)]
        )
        return FrontFlight(shown, str(content["twin"]), float(content["height_m"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise WildlabError(
            f"the flight of the front page cannot be read ({error})",
            "make it again: python -m wildlab.reporting.front.flight",
            file=path.name,
        ) from error


_PARTS = ("path", "footprints", "points", "ellipses", "truth")


def simulated() -> dict[str, Any]:
    """The content of the file, simulated and computed.

    Returns
    -------
    dict
        For JSON.
    """
    from wildlab.analysis.georeference import (
        assumed_deviations,
        assumed_pose_covariance,
        covariances_of,
        georeference,
        observe,
    )
    from wildlab.analysis.overviews.image_coverage import cover_images
    from wildlab.analysis.track import CvTuning, follow_schmidt, sighting
    from wildlab.simulation.twins import simulate_twin

    flight = simulate_twin(TWIN, SEED, ("imu", "gnss"))
    nav = flight.nav[SOURCE]
    when, flown = nav["time_s"].to_numpy(float), nav[["north_m", "east_m"]].to_numpy(float)
    # It ends where it began, so that the picture's next round goes on from there.
    later = np.flatnonzero((when >= BEGIN + AT_LEAST) & (when <= BEGIN + AT_MOST))
    start = flown[np.searchsorted(when, BEGIN)]
    end = float(when[later[np.argmin(np.hypot(*(flown[later] - start).T))]])

    def part(times: Array, *arrays: Array, every_s: float) -> list[Array]:
        """Rows within the part and beside it on either side, no nearer in time than told."""
        first, last = int(np.searchsorted(times, BEGIN, "right")) - 1, int(np.searchsorted(times, end))
        rows = np.arange(max(first, 0), min(last + 1, len(times)))
        kept = rows[np.unique(np.floor((times[rows] - BEGIN) / every_s), return_index=True)[1]]
        return [times[kept] - BEGIN, *(one[kept] for one in arrays)]

    points = georeference(flight, observe(flight, SOURCE), np.random.default_rng(0))
    # Per axis, root mean square.
    metres = float(np.sqrt(np.nanmean(np.trace(covariances_of(points), axis1=1, axis2=2) / 2)))
    assumed = assumed_deviations(flight)
    tuning = CvTuning(ACCELERATION, metres, START_SPEED, metres, assumed["pixel_px"])
    seen = sighting(flight, SOURCE)
    cover, why = cover_images(flight, SOURCE)
    if cover is None:
        raise WildlabError(f"the twin has no footprints: {why}", "choose another")
    pose = assumed_pose_covariance(seen.poses.R_nb, assumed)
    track = follow_schmidt(seen, tuning, pose, PERSIST)
    points = points.sort_values("time_s")
    frames = np.sort(flight.table("frames")["time_s"].to_numpy(float))
    truth = flight.table("truth")
    corners = cover.outlines[:, :: cover.outlines.shape[1] // 4]
    contents = {
        "path": part(when, flown, every_s=0.25),
        "footprints": part(frames, corners, every_s=0.5),
        "points": part(
            points["time_s"].to_numpy(float), points[["north_m", "east_m"]].to_numpy(float), every_s=0.01
        ),
        "ellipses": part(seen.times, track.x[:, :2], track.P[:, :2, :2], every_s=0.5),
        "truth": part(
            truth["time_s"].to_numpy(float), truth[["north_m", "east_m"]].to_numpy(float), every_s=1.0
        ),
    }
    inside = (when >= BEGIN) & (when <= end)
    return {
        "about": f"A part of the twin {TWIN}, seed {SEED}: s since {BEGIN:g} s, m north and east, m^2.",
        "twin": TWIN,
        "height_m": round(float(-nav["down_m"].to_numpy(float)[inside].mean()), 1),
        **{
            name: {f"{k}": np.round(one, 2).tolist() for k, one in enumerate(arrays)}
            for name, arrays in contents.items()
        },
    }


def main() -> None:
    """Write the file."""
    from wildlab.files import write_atomic

    write_atomic(FILE, json.dumps(simulated(), separators=(",", ":")) + "\n")
    print(FILE.name)


if __name__ == "__main__":
    main()
