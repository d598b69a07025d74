"""The flight of the front page, simulated anew: writes ``data/front-flight.json``, which a test compares.

::

    python tools/front_flight.py
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.georeference import (
    assumed_deviations,
    assumed_pose_covariance,
    covariances_of,
    georeference,
    observe,
)
from wildlab.analysis.image_coverage import cover_images
from wildlab.analysis.tracks.pixels import CvTuning, read_pixels, start
from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.reporting.front_page import FILE
from wildlab.simulation.twins import simulate_twin
from wildlab.tracking.kalman import Considered
from wildlab.tracking.run import run_filter
from wildlab.tracking.sensors import POSE, pixels

Array = NDArray[np.float64]

#: Which twin, by which poses, from when, and at most how long, s: some rounds of its course.
TWIN, SEED, SOURCE, BEGIN, AT_LEAST, AT_MOST = "drifting-vessel-eight", 1, "autopilot", 430.0, 85.0, 125.0
#: Told to the Schmidt filter: m/s^2, and over how many seconds errors of the pose persist.
ACCELERATION, START_SPEED, PERSIST = 0.1, 5.0, 10.0


def simulated() -> dict[str, Any]:
    """The content of the file, simulated and computed.

    Returns
    -------
    dict
        For JSON.
    """
    flight = simulate_twin(TWIN, SEED, ("imu", "gnss"))
    nav = flight.nav[SOURCE]
    when, flown = nav["time_s"].to_numpy(float), nav[["north_m", "east_m"]].to_numpy(float)
    # It ends where it began, so that the picture's next round goes on from there.
    later = np.flatnonzero((when >= BEGIN + AT_LEAST) & (when <= BEGIN + AT_MOST))
    here = flown[np.searchsorted(when, BEGIN)]
    end = float(when[later[np.argmin(np.hypot(*(flown[later] - here).T))]])

    def part(times: Array, *arrays: Array, every_s: float) -> list[Array]:
        """Rows within the part and beside it on either side, no nearer in time than told."""
        first, last = int(np.searchsorted(times, BEGIN, "right")) - 1, int(np.searchsorted(times, end))
        rows = np.arange(max(first, 0), min(last + 1, len(times)))
        kept = rows[np.unique(np.floor((times[rows] - BEGIN) / every_s), return_index=True)[1]]
        return [times[kept] - BEGIN, *(one[kept] for one in arrays)]

    points = georeference(observe(flight, SOURCE), np.random.default_rng(0))
    # Per axis, root mean square.
    metres = float(np.sqrt(np.nanmean(np.trace(covariances_of(points), axis1=1, axis2=2) / 2)))
    assumed = assumed_deviations(flight)
    tuning = CvTuning(ACCELERATION, metres, START_SPEED, metres, assumed["pixel_px"])
    seen = read_pixels(flight, SOURCE)
    cover = cover_images(flight, SOURCE)
    if cover is None:
        raise WildlabError("the twin has no footprints", "choose another")
    pose = Considered(POSE, assumed_pose_covariance(seen.poses.R_nb, assumed), PERSIST)
    sensor, R = pixels(seen.poses, seen.plane_down), np.eye(2) * tuning.pixel**2
    track = run_filter(seen.times, seen.uv, R, sensor, tuning.motion, start(seen, tuning), pose=pose)
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
    write_atomic(FILE, json.dumps(simulated(), separators=(",", ":")) + "\n")
    print(FILE.name)


if __name__ == "__main__":
    main()
