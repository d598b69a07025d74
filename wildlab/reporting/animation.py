"""A flight that moves on a page without a script: arrays in, one SVG out, still where that is asked for.

It plays by itself, over and over: SMIL within one element, no script, no request. It is drawn twice. The
moving layer plays; the still one is one moment of it, and is what shows where motion is unwanted
(``prefers-reduced-motion``), on paper, and where the reader has stopped it. Every place comes out of the
arrays; nothing is placed by hand. The map is in metres, north up, east and north at one scale.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import ellipse_axes
from wildlab.messages.quantities import nice_length
from wildlab.reporting.text import escape, read_style

Array = NDArray[np.float64]


class Course(NamedTuple):
    """Places over time: of the aircraft, of a target, of points on the ground.

    Attributes
    ----------
    times
        (N,) s, in order; one row with any time stands for what does not move.
    points
        (N, 2) m north and east; NaN where the place is not known.
    """

    times: Array
    points: Array


class Outlines(NamedTuple):
    """What the camera sees of the ground over time.

    Attributes
    ----------
    times
        (N,) s, in order.
    corners
        (N, K, 2) m north and east, in order about the image, not closed; rows of NaN where the image shows no
        ground.
    """

    times: Array
    corners: Array


class Ellipses(NamedTuple):
    """Where something is held to be over time.

    Attributes
    ----------
    times
        (N,) s, in order.
    centres
        (N, 2) m north and east; NaN where there is no estimate.
    covariances
        (N, 2, 2) m^2, north before east.
    """

    times: Array
    centres: Array
    covariances: Array


class ShownFlight(NamedTuple):
    """A flight, or a part of it, to be animated.

    Attributes
    ----------
    path
        The aircraft's.
    footprints
        Of its camera; None without one.
    points
        Places on the ground, each at the time at which it was measured; None without any.
    ellipses, truth
        One a target.
    """

    path: Course
    footprints: Outlines | None = None
    points: Course | None = None
    ellipses: Sequence[Ellipses] = ()
    truth: Sequence[Course] = ()


def check_arrays(shown: ShownFlight) -> ShownFlight:
    """The same with arrays of floats whose shapes and times are in order.

    Raises
    ------
    WildlabError
        Where shapes do not fit together, a time is not finite or goes back, or the path has less than two
        known places.
    """
    path = _course(shown.path, "path")
    known = np.isfinite(path.points).all(axis=1)
    if known.sum() < 2:
        raise WildlabError(f"the path has {int(known.sum())} known places", "give two at least", field="path")
    return ShownFlight(
        path,
        None if shown.footprints is None else Outlines(*_aligned(shown.footprints, "footprints", (-1, 2))),
        None if shown.points is None else _course(shown.points, "points"),
        [Ellipses(*_aligned(one, "ellipses", (2,), (2, 2))) for one in shown.ellipses if len(one.times)],
        [_course(one, "truth") for one in shown.truth if len(one.times)],
    )


def _course(given: Course, field: str) -> Course:
    return Course(*_aligned(given, field, (2,)))


def _aligned(given: Sequence[ArrayLike], field: str, *shapes: tuple[int, ...]) -> list[Array]:
    """Times and arrays of a part; each row of the arrays is shaped as told (-1: any)."""
    times, *arrays = (np.asarray(one, float) for one in given)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise WildlabError(
            "its times are no increasing row of seconds",
            "sort the rows by time, drop those without",
            field=field,
        )
    for array, shape in zip(arrays, shapes, strict=True):
        fits = array.ndim == 1 + len(shape) and all(
            want in (-1, have) for want, have in zip((len(times), *shape), array.shape, strict=True)
        )
        if not fits:
            wanted = ", ".join(["N", *("K" if one < 0 else str(one) for one in shape)])
            raise WildlabError(
                f"an array of shape {array.shape} beside {len(times)} times",
                f"give one of shape ({wanted})",
                field=field,
            )
    return [times, *arrays]


#: Size of the picture and its margin, in the units of its own coordinates.
WIDTH, HEIGHT, MARGIN = 620.0, 420.0, 26.0
#: Seconds that one round takes: at least, at most; between them the aircraft crosses so many units a second.
SHORTEST, LONGEST, PACE = 12.0, 90.0, 85.0
#: How far the drawn aircraft may be off its path between two instants, and the most instants there are.
OFF_PATH, FEWEST, MOST = 0.8, 48, 3000
#: Points that are drawn at most; of more, every so many-th.
MOST_POINTS = 400
#: The still picture's moment, as a share of the flight.
STILL_AT = 0.62
#: An aircraft's outline from above, nose up, in units of the picture.
AIRCRAFT = (
    "M0-15 2.6-9 2.6-4 24 2 24 6 2.6 4.5 1.8 11 8 15 8 17.5 0 16-8 17.5-8 15-1.8 11-2.6 4.5-24 6-24 2"
    "-2.6-4-2.6-9Z"
)

# The page's own colours where it has them. Only water and the sheet that the camera lights have none there.
STYLE = read_style("flight")


class _Map(NamedTuple):
    """From metres north and east to the picture: units a metre, and the centre in metres."""

    scale: float
    middle: Array

    def at(self, points: Array) -> Array:
        """(..., 2) units to the right and down, of points (..., 2) m north and east."""
        moved = (points - self.middle) * self.scale
        return np.stack([WIDTH / 2 + moved[..., 1], HEIGHT / 2 - moved[..., 0]], axis=-1)


def animated_flight(
    shown: ShownFlight,
    *,
    alt: str,
    seconds: float | None = None,
    probability: float = 0.9,
    most_bytes: int = 1_000_000,
) -> str:
    """A flight as an SVG element that plays over and over, without a script.

    The aircraft goes along its path, the outline of its image sweeps over the ground, each point lands at the
    time at which it was measured, and each ellipse is where and as large as it was held to be. A cross is
    where the target truly was.

    Parameters
    ----------
    shown
        The arrays. What lies before or after the path in time is left out.
    alt
        What a reader who cannot see it should know.
    seconds
        Of one round; left out, as many as let the eye follow the aircraft.
    probability
        Share of a normal distribution that an ellipse holds.
    most_bytes
        Of the element; the flight is drawn at fewer instants, and with fewer points, until it fits.

    Returns
    -------
    str
        ``<svg>`` with its own style, to be put into a page. Colours are the page's.

    Raises
    ------
    WildlabError
        Where the arrays do not fit together, the alt text is empty, or not even a few instants fit.

    Examples
    --------
    >>> path = Course(np.arange(3.0), np.array([[0.0, 0.0], [50.0, 80.0], [0.0, 160.0]]))
    >>> drawn = animated_flight(ShownFlight(path), alt="An aircraft turns.")
    >>> drawn[:4], drawn.count("<script")
    ('<svg', 0)
    """
    if not alt.strip():
        raise WildlabError("an animated flight has no alt text", "say in words what it shows", field="alt")
    flown = _within(check_arrays(shown))
    onto = _map_of(flown, probability)
    begin, end = flown.path.times[0], flown.path.times[-1]
    lasts = _seconds(flown, onto) if seconds is None else seconds
    instants, points = _instants(flown, onto), MOST_POINTS
    while True:
        grid = np.linspace(begin, end, instants)
        drawn = _drawn(flown, onto, grid, lasts, probability, points, alt)
        if len(drawn.encode()) <= most_bytes:
            return drawn
        if instants <= FEWEST:
            raise WildlabError(
                f"the flight takes {len(drawn.encode())} bytes at {instants} instants",
                "show fewer targets, or allow more bytes",
                field="most_bytes",
            )
        instants, points = max(FEWEST, int(instants * 0.8)), max(40, int(points * 0.8))


def with_pause(svg: str) -> str:
    """An animated flight with what stops it: a fold beside it, since there is no script.

    Parameters
    ----------
    svg
        From `animated_flight`.

    Returns
    -------
    str
        HTML.
    """
    return (
        '<div class="motion"><details class="plain halt"><summary><span class="stop">Stop the picture</span>'
        f'<span class="go">Let it move</span></summary></details>{svg}</div>'
    )


#: How the fold of `pausable` looks; for the page's style.
PAUSE_STYLE = read_style("pause")


def _within(shown: ShownFlight) -> ShownFlight:
    """What lies within the time of the path, whose unknown rows are left out."""
    known = np.isfinite(shown.path.points).all(axis=1)
    path = Course(shown.path.times[known], shown.path.points[known])
    begin, end = path.times[0], path.times[-1]
    if end <= begin:
        raise WildlabError("the path is over as it begins", "give places at different times", field="path")
    points = shown.points
    if points is not None:
        there = np.isfinite(points.points).all(axis=1) & (points.times >= begin) & (points.times <= end)
        points = Course(points.times[there], points.points[there])
    return shown._replace(path=path, points=points)


def _map_of(shown: ShownFlight, probability: float) -> _Map:
    """Everything fits but footprints, which may reach far ahead: of those, the middle of the outline does."""
    begin, end = shown.path.times[0], shown.path.times[-1]
    parts = [shown.path.points]
    if shown.points is not None and len(shown.points.points):
        parts.append(np.quantile(shown.points.points, [0.02, 0.98], axis=0))
    for truth in shown.truth:
        there = (truth.times >= begin) & (truth.times <= end)
        parts.append(truth.points[there] if there.any() else truth.points[:1])
    for held in shown.ellipses:
        there = (held.times >= begin) & (held.times <= end)
        if there.any():
            parts.append(held.centres[there])
    every = np.concatenate(parts)
    every = every[np.isfinite(every).all(axis=1)]
    low, high = every.min(axis=0), every.max(axis=0)
    extent = np.maximum(high - low, 1e-6)
    room = np.array([HEIGHT - 2 * MARGIN, WIDTH - 2 * MARGIN])
    return _Map(float((room / extent).min()), (low + high) / 2)


def _seconds(shown: ShownFlight, onto: _Map) -> float:
    steps = np.diff(onto.at(shown.path.points), axis=0)
    return float(np.clip(np.hypot(*steps.T).sum() / PACE, SHORTEST, LONGEST))


def _instants(shown: ShownFlight, onto: _Map) -> int:
    """How many instants, evenly spaced, keep the aircraft on its path."""
    times, places = shown.path.times, onto.at(shown.path.points)
    count = FEWEST
    while count < MOST:
        grid = np.linspace(times[0], times[-1], count)
        there = _over(grid, times, places)
        back = np.stack([np.interp(times, grid, there[:, axis]) for axis in (0, 1)], axis=1)
        if np.hypot(*(back - places).T).max() <= OFF_PATH:
            break
        count = int(count * 1.3)
    return min(count, MOST)


def _over(grid: Array, times: Array, values: Array) -> Array:
    """Values (N, ...) at other times, linear between neighbours; NaN outside, and beside a NaN."""
    flat = values.reshape(len(values), -1)
    if len(times) == 1:
        return np.repeat(values, len(grid), axis=0)
    found = np.stack(
        [np.interp(grid, times, flat[:, k], np.nan, np.nan) for k in range(flat.shape[1])], axis=1
    )
    return np.asarray(found.reshape(len(grid), *values.shape[1:]))


def _drawn(
    shown: ShownFlight, onto: _Map, grid: Array, lasts: float, probability: float, most: int, alt: str
) -> str:
    begin, end = grid[0], grid[-1]
    moving: list[str] = []
    still: list[str] = []
    at = round(STILL_AT * (len(grid) - 1))

    def both(draw: Callable[[_Instants], str]) -> None:
        moving.append(draw(_Instants(grid, lasts, None)))
        still.append(draw(_Instants(grid, lasts, at)))

    if shown.footprints is not None and len(shown.footprints.times):
        outlines = shown.footprints
        both(lambda when: _footprint(outlines, onto, when))
    if shown.points is not None and len(shown.points.times):
        every = -(-len(shown.points.times) // most)
        times, places = shown.points.times[::every], onto.at(shown.points.points[::every])
        moving += [
            _landing((t - begin) / (end - begin), place, lasts)
            for t, place in zip(times, places, strict=True)
        ]
        done = places[times <= grid[at]]
        if len(done):
            dots = "".join(f"M{_n(x)} {_n(y)}h0" for x, y in done)
            still.append(f'<path class="points" d="{dots}" opacity=".6"/>')
    for held in shown.ellipses:
        both(lambda when, held=held: _ellipse(held, onto, when, probability))  # type: ignore[misc]
    for truth in shown.truth:
        both(lambda when, truth=truth: _cross(truth, onto, when))  # type: ignore[misc]
    both(lambda when: _aircraft(shown.path, onto, when))
    lines = [_line(shown.path, onto, grid, "gone")]
    lines += [_line(truth, onto, grid, "true") for truth in shown.truth if len(truth.times) > 1]
    return (
        f'<svg class="flown" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(alt)}">'
        f"<style>{STYLE}</style>"
        f'{"".join(lines)}<g class="moves">{"".join(moving)}</g><g class="still">{"".join(still)}</g>'
        f"{_rules(onto)}</svg>"
    )


class _Instants(NamedTuple):
    """When things are drawn: at all instants of a round of so many seconds, or at one of them."""

    grid: Array
    lasts: float
    one: int | None

    def animate(self, attribute: str, values: list[str]) -> str:
        """The attribute over the round; all values alike make it no motion."""
        return (
            f'<animate attributeName="{attribute}" values="{";".join(values)}" dur="{self.lasts:.2f}s" '
            'repeatCount="indefinite"/>'
        )

    def turn(self, kind: str, values: list[str]) -> str:
        return (
            f'<animateTransform attributeName="transform" type="{kind}" values="{";".join(values)}" '
            f'dur="{self.lasts:.2f}s" repeatCount="indefinite"/>'
        )

    def shown(self, there: NDArray[np.bool_]) -> str:
        """Hides what is not there at an instant; nothing where it always is."""
        if there.all():
            return ""
        values = ";".join("1" if one else "0" for one in there)
        return (
            f'<animate attributeName="opacity" values="{values}" calcMode="discrete" dur="{self.lasts:.2f}s" '
            'repeatCount="indefinite"/>'
        )


def _footprint(outlines: Outlines, onto: _Map, when: _Instants) -> str:
    corners = onto.at(_over(when.grid, outlines.times, outlines.corners))
    there = _known(corners)
    if not there.any():
        return ""
    # Nothing is drawn far outside of the picture: a camera that looks towards the horizon sees kilometres.
    corners = np.clip(_filled(corners, there), -2 * WIDTH, 3 * WIDTH)
    values = [" ".join(f"{_n(x)},{_n(y)}" for x, y in one) for one in corners]
    if when.one is not None:
        return f'<polygon class="lit" points="{values[when.one]}"/>' if there[when.one] else ""
    moves = when.animate("points", values) + when.shown(there)
    return f'<polygon class="lit" points="{values[0]}">{moves}</polygon>'


def _landing(share: float, place: Array, lasts: float) -> str:
    """A point that comes down at its time and fades until the round is over."""
    a, b = min(share, 0.985), min(share + 0.25 / lasts + 0.004, 0.99)
    c = min(b + 2.5 / lasts, 0.996)
    keys = f"0;{a:.4f};{b:.4f};{c:.4f};1"
    dur = f'dur="{lasts:.2f}s" repeatCount="indefinite" keyTimes="{keys}"'
    return (
        f'<circle class="point" cx="{_n(place[0])}" cy="{_n(place[1])}" r="3" opacity="0">'
        f'<animate attributeName="opacity" values="0;0;1;.5;.28" {dur}/>'
        f'<animate attributeName="r" values="10;10;3.4;3;3" {dur}/></circle>'
    )


def _ellipse(held: Ellipses, onto: _Map, when: _Instants, probability: float) -> str:
    centres = _over(when.grid, held.times, held.centres)
    P = _over(when.grid, held.times, held.covariances)
    there = _known(centres) & _known(P)
    if not there.any():
        return ""
    long_axis, short_axis, bearing = ellipse_axes(_filled(P, there), probability)
    # The bearing of a line is known up to half a turn: the nearest one to the last keeps it from spinning.
    turned = np.degrees(np.unwrap(bearing, period=np.pi))
    places = onto.at(_filled(centres, there))
    rx, ry = ([_n(one) for one in axis * onto.scale] for axis in (short_axis, long_axis))
    moves, turns = [f"{_n(x)} {_n(y)}" for x, y in places], [_n(one) for one in turned]
    if when.one is not None:
        k = when.one
        if not there[k]:
            return ""
        turned_there = f'transform="translate({moves[k]}) rotate({turns[k]})"'
        return f'<ellipse class="held" rx="{rx[k]}" ry="{ry[k]}" {turned_there}/>'
    return (
        f"<g>{when.shown(there)}{when.turn('translate', moves)}<g>{when.turn('rotate', turns)}"
        f'<ellipse class="held" rx="{rx[0]}" ry="{ry[0]}">{when.animate("rx", rx)}{when.animate("ry", ry)}'
        "</ellipse></g></g>"
    )


def _cross(truth: Course, onto: _Map, when: _Instants) -> str:
    places = _over(when.grid, truth.times, truth.points)
    there = _known(places)
    if not there.any():
        return ""
    values = [f"{_n(x)} {_n(y)}" for x, y in onto.at(_filled(places, there))]
    mark = '<path class="cross" d="M-8 0H8M0-8V8"'
    if when.one is not None:
        return f'{mark} transform="translate({values[when.one]})"/>' if there[when.one] else ""
    if len(set(values)) == 1 and there.all():
        return f'{mark} transform="translate({values[0]})"/>'
    return f"{mark}>{when.shown(there)}{when.turn('translate', values)}</path>"


def _aircraft(path: Course, onto: _Map, when: _Instants) -> str:
    places = onto.at(_over(when.grid, path.times, path.points))
    moves = [f"{_n(x)} {_n(y)}" for x, y in places]
    turns = [_n(one) for one in np.degrees(_headings(places))]
    body = f'<path class="craft" d="{AIRCRAFT}"'
    if when.one is not None:
        k = when.one
        return f'{body} transform="translate({moves[k]}) rotate({turns[k]})"/>'
    return f"<g>{when.turn('translate', moves)}{body}>{when.turn('rotate', turns)}</path></g>"


def _headings(places: Array) -> Array:
    """(N,) rad clockwise from north, of the way that is gone; kept while it stands still."""
    steps = np.gradient(places, axis=0)
    moved = np.hypot(*steps.T)
    heading = np.arctan2(steps[:, 0], -steps[:, 1])
    # Wind and noise move what hovers by less than this share of its usual step, in any direction.
    still = moved < 0.05 * max(float(np.median(moved)), 1e-9)
    going = np.flatnonzero(~still)
    if len(going) == 0:
        return np.zeros(len(places))
    last = going[np.clip(np.searchsorted(going, np.arange(len(places)), side="right") - 1, 0, None)]
    return np.asarray(np.unwrap(heading[last]))


def _line(course: Course, onto: _Map, grid: Array, name: str) -> str:
    """All of a course, as the moving picture goes along it; broken where it is not known."""
    places = onto.at(_over(grid, course.times, course.points))
    known = _known(places)
    begins = np.flatnonzero(np.diff(known.astype(int)) != 0) + 1
    drawn = ""
    for part, there in zip(np.split(places, begins), np.split(known, begins), strict=True):
        if len(part) > 1 and there[0]:
            drawn += f"M{'L'.join(f'{_n(x)} {_n(y)}' for x, y in part)}"
    return f'<path class="{name}" d="{drawn}"/>' if drawn else ""


def _rules(onto: _Map) -> str:
    """Scale and north."""
    metres = nice_length(0.25 * WIDTH / onto.scale)
    length, x, y = metres * onto.scale, WIDTH - 22, HEIGHT - 20
    words = f"{metres / 1000:g} km" if metres >= 1000 else f"{metres:g} m"
    return (
        f'<path class="rule" d="M{_n(x - length)} {y:g}v-6v6H{_n(x)}v-6"/>'
        f'<text x="{_n(x - length / 2)}" y="{y - 9:g}" text-anchor="middle">{words}</text>'
        f'<path class="rule" d="M{WIDTH - 28:g} 48V20m-5 8 5-8 5 8"/>'
        f'<text x="{WIDTH - 28:g}" y="63" text-anchor="middle">N</text>'
    )


def _known(values: Array) -> NDArray[np.bool_]:
    """(N,) rows (N, ...) without a NaN."""
    return np.asarray(np.isfinite(values.reshape(len(values), -1)).all(axis=1), bool)


def _filled(values: Array, there: NDArray[np.bool_]) -> Array:
    """Rows that are not there take those of the nearest that are: hidden then, and nothing flies across."""
    known = np.flatnonzero(there)
    rows = np.arange(len(values))
    right = np.clip(np.searchsorted(known, rows), 0, len(known) - 1)
    left = np.clip(right - 1, 0, None)
    nearer = np.where(np.abs(known[left] - rows) <= np.abs(known[right] - rows), known[left], known[right])
    return np.asarray(values[nearer])


def _n(value: float) -> str:
    """A coordinate to a tenth of a unit, as short as it can be written."""
    text = f"{value:.1f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") or not math.isfinite(value) else text
