"""The flight on the front page: a part of a twin, computed once and kept in ``data/front-flight.json``.

Simulating it takes seconds, and compiles what a first look at a page should not wait for. The file holds
arrays, rounded to centimetres; ``python tools/front_flight.py`` makes it again, and a test
compares.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.paths import DATA
from wildlab.reporting.animation import Course, Ellipses, Outlines, ShownFlight

Array = NDArray[np.float64]

FILE = DATA / "front-flight.json"
#: Share of a normal distribution that its ellipses hold.
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
        from wildlab.geometry.covariances import inside_ellipse

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
            "make it again: python tools/front_flight.py",
            file=path.name,
        ) from error


_PARTS = ("path", "footprints", "points", "ellipses", "truth")
