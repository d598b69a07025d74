"""The moving picture of the front page, simulated and drawn anew; a test compares.

``python tools/front_flight.py`` writes ``data/front-flight.svg`` and, with the numbers of its caption,
``data/front-flight.json``.

It plays by itself, over and over: SMIL within one element, no script, no request. It is drawn twice. The
moving layer plays; the still one is one moment of it, and is what shows where motion is unwanted
(``prefers-reduced-motion``), on paper, and where the reader has stopped it. Metres, north up.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
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
from wildlab.analysis.overview import cover_images
from wildlab.analysis.tracks.pixels import CvTuning, read_pixels, start
from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.geometry.covariances import ellipse_axes, inside_ellipse
from wildlab.messages.quantities import nice_length
from wildlab.reporting.front_page import FLIGHT, PROBABILITY
from wildlab.simulation.twins import simulate_twin
from wildlab.tracking.kalman import Considered
from wildlab.tracking.run import run_filter
from wildlab.tracking.sensors import POSE, pixels

Array = NDArray[np.float64]

#: Which twin, by which poses, from when, and at most how long, s: some rounds of its course.
TWIN, SEED, SOURCE, BEGIN, AT_LEAST, AT_MOST = "drifting-vessel-eight", 1, "autopilot", 430.0, 85.0, 125.0
#: Told to the Schmidt filter: m/s^2, and over how many seconds errors of the pose persist.
ACCELERATION, START_SPEED, PERSIST = 0.1, 5.0, 10.0


def simulated() -> tuple[dict[str, list[Array]], float]:
    """Times and arrays of what is drawn, by name, and the mean height of the aircraft, m."""
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
    return contents, float(-nav["down_m"].to_numpy(float)[inside].mean())


def caption(contents: Mapping[str, Sequence[Array]], height: float) -> dict[str, Any]:
    """The numbers of the picture's caption: images that show the target, the median distance of a position
    from one image to where the target was, and the share of instants at which the ellipse holds it."""
    flown = contents["path"][0]
    (times, places), (when, centres, P) = contents["points"], contents["ellipses"]
    part = (times >= flown[0]) & (times <= flown[-1])
    off = places[part] - _at(times[part], *contents["truth"])
    missed = _at(when, *contents["truth"]) - centres
    return {
        "about": f"A part of the twin {TWIN}, seed {SEED}, from {BEGIN:g} s on.",
        "seconds": round(float(flown[-1] - flown[0]), 1),
        "height_m": round(height, 1),
        "images": int(part.sum()),
        "off_m": round(float(np.median(np.hypot(*off.T))), 2),
        "held": round(float(np.mean(inside_ellipse(missed, P, PROBABILITY))), 4),
    }


#: Size of the picture and its margin, in the units of its own coordinates; seconds that a round takes, at how
#: many instants it is drawn, and which of them is the still picture's.
WIDTH, HEIGHT, MARGIN = 620.0, 420.0, 26.0
LASTS, INSTANTS, STILL = 30.0, 175, 108
#: An aircraft's outline from above, nose up, in units of the picture.
AIRCRAFT = (
    "M0-15 2.6-9 2.6-4 24 2 24 6 2.6 4.5 1.8 11 8 15 8 17.5 0 16-8 17.5-8 15-1.8 11-2.6 4.5-24 6-24 2"
    "-2.6-4-2.6-9Z"
)


def drawn(contents: Mapping[str, Sequence[Array]]) -> str:
    """What is in the ``<svg>``."""
    (path_t, path), (held_t, centres, P), (true_t, true) = (
        contents[name] for name in ("path", "ellipses", "truth")
    )
    every = np.concatenate([path, true[(true_t >= path_t[0]) & (true_t <= path_t[-1])]])
    low, high = every.min(axis=0), every.max(axis=0)
    scale = float(((HEIGHT - 2 * MARGIN, WIDTH - 2 * MARGIN) / (high - low)).min())

    def put(points: Array) -> Array:
        """Units to the right and down of (..., 2) m north and east."""
        moved = (points - (low + high) / 2) * scale
        return np.stack([WIDTH / 2 + moved[..., 1], HEIGHT / 2 - moved[..., 0]], axis=-1)

    grid = np.linspace(path_t[0], path_t[-1], INSTANTS)
    way, vessel = put(_at(grid, path_t, path)), put(_at(grid, true_t, true))
    corners = np.clip(put(_at(grid, *contents["footprints"])), -2 * WIDTH, 3 * WIDTH)
    outlines = [" ".join(f"{_n(x)},{_n(y)}" for x, y in one) for one in corners]
    long_axis, short_axis, bearing = ellipse_axes(_at(grid, held_t, P), PROBABILITY)
    rx, ry = ([_n(one) for one in axis * scale] for axis in (short_axis, long_axis))
    # The bearing of a line is known up to half a turn: the nearest one to the last keeps it from spinning.
    turns = [_n(one) for one in np.degrees(np.unwrap(bearing, period=np.pi))]
    steps = np.gradient(way, axis=0)
    heads = [_n(one) for one in np.degrees(np.unwrap(np.arctan2(steps[:, 0], -steps[:, 1])))]
    held, crosses, crafts = (_pairs(one) for one in (put(_at(grid, held_t, centres)), vessel, way))
    times, places = contents["points"][0], put(contents["points"][1])
    there = (times >= grid[0]) & (times <= grid[-1])
    shares, places = (times[there] - grid[0]) / (grid[-1] - grid[0]), places[there]
    dots = "".join(f"M{_n(x)} {_n(y)}h0" for x, y in places[shares <= STILL / (INSTANTS - 1)])
    k, cross, craft = STILL, '<path class="cross" d="M-8 0H8M0-8V8"', f'<path class="craft" d="{AIRCRAFT}"'
    moving = [
        f'<polygon class="lit" points="{outlines[0]}">{_animate("points", outlines)}</polygon>',
        *map(_landing, shares, places),
        f'<g>{_turn("translate", held)}<g>{_turn("rotate", turns)}<ellipse class="held" rx="{rx[0]}" '
        f'ry="{ry[0]}">{_animate("rx", rx)}{_animate("ry", ry)}</ellipse></g></g>',
        f"{cross}>{_turn('translate', crosses)}</path>",
        f"<g>{_turn('translate', crafts)}{craft}>{_turn('rotate', heads)}</path></g>",
    ]
    still = [
        f'<polygon class="lit" points="{outlines[k]}"/><path class="points" d="{dots}" opacity=".6"/>',
        f'<ellipse class="held" rx="{rx[k]}" ry="{ry[k]}" '
        f'transform="translate({held[k]}) rotate({turns[k]})"/>',
        f'{cross} transform="translate({crosses[k]})"/>',
        f'{craft} transform="translate({crafts[k]}) rotate({heads[k]})"/>',
    ]
    lines = f'<path class="gone" d="M{"L".join(crafts)}"/><path class="true" d="M{"L".join(crosses)}"/>'
    layers = f'<g class="moves">{"".join(moving)}</g><g class="still">{"".join(still)}</g>'
    return f"{lines}{layers}{_rules(scale)}"


def _at(grid: Array, times: Array, values: Array) -> Array:
    """Values (N, ...) at other times, linear between neighbours."""
    flat = values.reshape(len(values), -1)
    found = np.stack([np.interp(grid, times, column) for column in flat.T], axis=1)
    return np.asarray(found.reshape(len(grid), *values.shape[1:]))


def _animate(attribute: str, values: Sequence[str]) -> str:
    much = f'attributeName="{attribute}" values="{";".join(values)}"'
    return f'<animate {much} dur="{LASTS:g}s" repeatCount="indefinite"/>'


def _turn(kind: str, values: Sequence[str]) -> str:
    much = f'attributeName="transform" type="{kind}" values="{";".join(values)}"'
    return f'<animateTransform {much} dur="{LASTS:g}s" repeatCount="indefinite"/>'


def _landing(share: float, place: Array) -> str:
    """A point that comes down at its time and fades until the round is over."""
    a, b = min(share, 0.985), min(share + 0.25 / LASTS + 0.004, 0.99)
    keys = f"0;{a:.4f};{b:.4f};{min(b + 2.5 / LASTS, 0.996):.4f};1"
    dur = f'dur="{LASTS:g}s" repeatCount="indefinite" keyTimes="{keys}"'
    return (
        f'<circle class="point" cx="{_n(place[0])}" cy="{_n(place[1])}" r="3" opacity="0">'
        f'<animate attributeName="opacity" values="0;0;1;.5;.28" {dur}/>'
        f'<animate attributeName="r" values="10;10;3.4;3;3" {dur}/></circle>'
    )


def _rules(scale: float) -> str:
    """Scale and north."""
    metres = nice_length(0.25 * WIDTH / scale)
    length, x, y = metres * scale, WIDTH - 22, HEIGHT - 20
    return (
        f'<path class="rule" d="M{_n(x - length)} {y:g}v-6v6H{_n(x)}v-6"/>'
        f'<text x="{_n(x - length / 2)}" y="{y - 9:g}" text-anchor="middle">{metres:g} m</text>'
        f'<path class="rule" d="M{WIDTH - 28:g} 48V20m-5 8 5-8 5 8"/>'
        f'<text x="{WIDTH - 28:g}" y="63" text-anchor="middle">N</text>'
    )


def _pairs(places: Array) -> list[str]:
    return [f"{_n(x)} {_n(y)}" for x, y in places]


def _n(value: float) -> str:
    """A coordinate to a tenth of a unit, as short as it can be written."""
    text = f"{value:.1f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def main() -> None:
    """Write the files."""
    contents, height = simulated()
    write_atomic(FLIGHT.with_suffix(".svg"), drawn(contents) + "\n")
    write_atomic(FLIGHT, json.dumps(caption(contents, height), indent=1) + "\n")
    print(FLIGHT.name)


if __name__ == "__main__":
    main()
