"""A replay as one HTML file: map, image, and errors over time, drawn by a script of its own.

The page holds the arrays of a `wildlab.replay.scene.ReplayScene`, thinned and rounded, and some
pictures. Nothing in it says where on Earth they are.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping
from math import isfinite
from typing import Any

import cv2
import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.flight.clocks import longest_gap
from wildlab.geometry.covariances import ellipse_axes
from wildlab.geometry.frames import Indices
from wildlab.messages.quantities import duration
from wildlab.replay.images import spread_evenly
from wildlab.replay.scene import (
    Array,
    Estimates,
    Points,
    ReplayScene,
    heights,
    plain,
    relief,
)
from wildlab.reporting.figures import colour, filter_words
from wildlab.reporting.text import TEMPLATES, render

#: Rows of points and of a way, and detections in images, at most.
MOST_ROWS, MOST_SEEN = 3000, 10_000
#: By what tracks can be chosen; of more than so many, those of one filter are shown at first.
_CHOICES, MOST_AT_ONCE = ("target", "filter"), 6
#: What the browser may do: run the script with this hash, and show what is in the file.
POLICY = (
    "default-src 'none'; script-src 'sha256-{script}'; style-src 'sha256-{style}'; img-src data:; "
    "base-uri 'none'; form-action 'none'"
)


def page(scene: ReplayScene, shots: Mapping[int, bytes]) -> str:
    """One HTML file with all of it inside.

    Parameters
    ----------
    scene
        From `wildlab.replay.scene.scene_of`.
    shots
        Pictures by the row of the scene's views.

    Returns
    -------
    str
    """
    script, style = ((TEMPLATES / name).read_text(encoding="utf-8") for name in ("replay.js", "replay.css"))
    # No text ends the element that it stands in.
    found = drawn(scene, shots)
    data = json.dumps(found, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return (
        render(
            "replay",
            policy=POLICY.format(script=_hash(script), style=_hash(style)),
            name=plain(scene.name),
            kind="A simulated flight" if scene.kind == "twin" else "A recorded flight",
            lasts=duration(scene.length) if scene.timed else "",
            images=len(scene.views.times) if scene.views is not None else 0,
            filters={one["filter"]: one["colour"] for one in found["tracks"]},
            choices={key: list(dict.fromkeys(one[key] for one in found["tracks"])) for key in _CHOICES},
            preset="filter" if len(scene.tracks) > MOST_AT_ONCE else "",
            points=scene.points is not None,
            truth=bool(scene.truth),
            path=scene.path is not None,
            lacks=(*scene.lacks, *_thinned(scene)),
            style=Markup(style),  # noqa: S704 - ours
            script=Markup(script),  # noqa: S704 - ours
            data=Markup(data),  # noqa: S704 - without a mark
        )
        + "\n"
    )


def _thinned(scene: ReplayScene) -> list[str]:
    count = 0 if scene.sightings is None else len(scene.sightings.frame)
    return [f"every detection in the images: {MOST_SEEN} of {count} are, evenly"] if count > MOST_SEEN else []


def _hash(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def drawn(scene: ReplayScene, shots: Mapping[int, bytes]) -> dict[str, Any]:
    """What the page's script draws, as plain values: metres north and east, seconds, pixels; None: not known.

    Parameters
    ----------
    scene, shots
        As `page` takes them.

    Returns
    -------
    dict
    """
    low, high = scene.extent
    found: dict[str, Any] = {
        "timed": scene.timed,
        "length": scene.length,
        "extent": _rounded([low[0], low[1], high[0], high[1]]),
        "band": chi_square_interval(2),
        "tracks": [],
        "truth": [
            {"name": plain(one.name), "still": one.still}
            | _way(one.times, one.places, spread_evenly(len(one.times), 2 * MOST_ROWS // len(scene.truth)))
            for one in scene.truth
        ],
    }
    if scene.path is not None:
        kept = spread_evenly(len(scene.path.times), MOST_ROWS)
        found["path"] = _way(scene.path.times, scene.path.places, kept)
        found["path"]["height"] = _rounded(heights(scene)[kept], 1)
    if scene.views is not None:
        # Every other place of a border: its corners, and the middles of its sides.
        found["frames"] = {
            "t": _rounded(scene.views.times, 3),
            "outlines": _rounded(scene.views.outlines[:, ::2], 1),
        }
        found["pictures"] = [[row, _address("jpeg", shots[row])] for row in sorted(shots)]
    if scene.camera is not None:
        found["size"] = [scene.camera.width, scene.camera.height]
    if scene.sightings is not None:
        kept = spread_evenly(len(scene.sightings.frame), MOST_SEEN)
        found["seen"] = {
            "frame": scene.sightings.frame[kept].tolist(),
            "uv": _rounded(scene.sightings.uv[kept]),
            "names": [plain(name) for name in scene.sightings.names[kept]],
        }
    if scene.points is not None:
        found["points"] = _judged(scene.points, MOST_ROWS)
    for one in scene.tracks:
        rows = _judged(one, 2 * MOST_ROWS // len(scene.tracks))
        named = {"target": plain(one.target), "filter": filter_words(plain(one.filter))}
        found["tracks"].append({"colour": colour(one.filter), **named, **rows})
    if scene.terrain is not None:
        found["ground"] = _ground(scene)
    return found


def _way(times: Array, places: Array, rows: Indices) -> dict[str, Any]:
    """Places by time; between two that lie farther apart than ``gap``, s, nothing is known."""
    t = np.nan_to_num(times[rows])
    return {"t": _rounded(t, 3), "p": _rounded(places[rows, :2]), "gap": longest_gap(t)}


def _judged(of: Points | Estimates, most: int) -> dict[str, Any]:
    rows = spread_evenly(len(of.times), most)
    long_axis, short_axis, bearing = ellipse_axes(of.covariance[rows])
    return _way(of.times, of.places, rows) | {
        # Longer and shorter half axis, m, and turn of the longer one from the east, clockwise, rad.
        "ellipses": _rounded(np.column_stack([long_axis, short_axis, bearing - np.pi / 2])),
        "error": _rounded(of.error[rows]),
        "nees": _rounded(of.nees[rows]),
    }


def _ground(scene: ReplayScene) -> dict[str, Any]:
    """Terrain as a shaded picture, and the places of its south-western and north-eastern corners."""
    assert scene.terrain is not None  # noqa: S101 - for the type checker
    south, north, west, east = scene.terrain.extent
    h, shades = relief(scene.terrain.height, scene.terrain.step)
    clear = np.where(np.isfinite(h), 255, 0).astype(np.uint8)
    picture = np.dstack([shades[..., ::-1], clear])[::-1]
    png = cv2.imencode(".png", np.ascontiguousarray(picture))[1].tobytes()
    return {"picture": _address("png", png), "extent": _rounded([south, west, north, east])}


def _address(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def _rounded(values: ArrayLike, digits: int = 2) -> list[Any]:
    """Nested lists of numbers; None for what is not finite."""
    rounded: list[Any] = np.round(np.asarray(values, float), digits).tolist()
    return _finite(rounded)


def _finite(values: Iterable[Any]) -> list[Any]:
    return [_finite(one) if isinstance(one, list) else one if isfinite(one) else None for one in values]
