"""Images of two twins, rendered, and what the detector of H 4.3 finds in them.

The ship is that of H 6.4.1, of which H 4.4.1 counts 441 images; the boats are the two of H 6.4.4, whose
flight is taken for that of the 27866 images. Both are rendered here and there along the flight.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.detection.centres import adjust_at_border
from wildlab.detection.detections import Detections, no_detections
from wildlab.detection.floating import (
    PUBLISHED,
    FloatingObjects,
    FloatingThresholds,
    find_edges,
    find_objects,
)
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.messages.catalogue import load_texts
from wildlab.reporting.charts.drawing import (
    Values,
    draw_dots,
    draw_picture,
    finish,
    name_rows,
    rows_chart,
    spread_points,
)
from wildlab.reporting.figures import BLUE, INK, ORANGE, VERMILLION, new_figure
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.flights import (
    CameraResponse,
    SceneFlight,
    Sensor,
    VesselLook,
    Window,
    corner_of,
    expose,
    sensor_of,
)
from wildlab.simulation.scene.render import RenderedView, SeenBody
from wildlab.studies.page import pooled_share

#: Of the pixels of a detection, the share on an object from which on it is one of that object.
OVERLAP = 0.25


class ImageScore(NamedTuple):
    """What detections of an image are worth.

    Attributes
    ----------
    found
        By the number of each body in view: the rows of its detections, the largest first.
    merged
        Numbers of bodies without their own that lie in the detection of another.
    false
        How many detections are of nothing.
    """

    found: dict[int, list[int]]
    merged: set[int]
    false: int


def judge(view: RenderedView, objects: FloatingObjects) -> ImageScore:
    """Which detection is of which body, by the pixels that they share.

    Parameters
    ----------
    view
        A rendered image with its labels.
    objects
        What was found in it.

    Returns
    -------
    Judged
    """
    found: dict[int, list[int]] = {seen.number: [] for seen in view.seen}
    inside: set[int] = set()
    false = 0
    for row in range(len(objects.detections)):
        under = view.labels[objects.labels == row + 1]
        count = np.bincount(under[under > 0], minlength=1)
        best = int(count.argmax()) if len(count) else 0
        if count.sum() >= OVERLAP * len(under) and best in found:
            found[best].append(row)
            inside |= {n for n in found if n < len(count) and 2 * count[n] > (view.labels == n).sum()}
        else:
            false += 1
    return ImageScore(found, {n for n in inside if not found[n]}, false)


class Shot(NamedTuple):
    """An image and what was found in it.

    Attributes
    ----------
    exposure
        Its number among the exposures of the flight.
    seen
        What there is to see, one for each body in view.
    detections
        All that was found, the largest first.
    judged
        Which of these is what.
    """

    exposure: int
    seen: tuple[SeenBody, ...]
    detections: Detections
    judged: ImageScore


class Photographer:
    """A camera along the flight of a twin: the same seed gives the same images, whichever are asked for.

    Attributes
    ----------
    flight
        The flight as scenes, with the camera's true poses.
    """

    def __init__(self, twin: str, seed: int, look: VesselLook | None = None) -> None:
        self.flight = SceneFlight(load_twin(twin), seed, look)
        self.response = CameraResponse()
        camera = self.flight.poses.camera
        self._seed = seed
        self._sensor = sensor_of(self.response, (camera.height, camera.width), stream(seed, "thermal sensor"))

    def image(self, exposure: int, window: Window | None = None) -> tuple[RenderedView, NDArray[np.uint16]]:
        """The scene with its labels, and the counts of the camera (H, W).

        Parameters
        ----------
        exposure
            Number of the exposure.
        window
            What part of it; None is all of it. A part has the same scene, sensor and kind of noise as it has
            in the whole image, and other draws of the noise.

        Returns
        -------
        (view, counts)
        """
        view = self.flight.view(exposure, window)
        sensor = self._sensor
        if window is not None:
            here = window.slices
            sensor = Sensor(sensor.offset[here], sensor.dead[here], sensor.stuck[here])
        rng = stream(self._seed, f"thermal image {exposure}")
        return view, expose(view.kelvin, self.response, sensor, rng)

    def shoot(
        self,
        exposures: Iterable[int],
        margin: int | None = None,
    ) -> Iterator[Shot]:
        """Take images, and look for what floats.

        Parameters
        ----------
        exposures
            Their numbers.
        margin
            Render only so many pixels around the vessels, which takes a fraction of the time where these are
            small; None is the whole image. False alarms elsewhere are not seen then.

        Yields
        ------
        Shot
            In pixels of the whole image.
        """
        for number in exposures:
            exposure = int(number)
            window = None if margin is None else self.flight.window(exposure, margin)
            if margin is not None and window is None:
                yield Shot(exposure, (), no_detections(), ImageScore({}, set(), 0))
                continue
            view, counts = self.image(exposure, window)
            objects = find_objects(counts)
            corner = corner_of(window)
            yield Shot(
                exposure,
                tuple(_seen_from(seen, corner) for seen in view.seen),
                _found_from(objects.detections, corner),
                judge(view, objects),
            )


def _seen_from(seen: SeenBody, corner: Array) -> SeenBody:
    return seen._replace(
        uv=seen.uv + corner,
        centre=seen.centre + corner,
        middle=seen.middle + corner,
        outline=seen.outline + corner,
    )


def _found_from(found: Detections, corner: Array) -> Detections:
    box = found.box.copy()
    box[:, :2] += corner
    return replace(found, uv=found.uv + corner, box=box)


def exposures_of(frames: pd.DataFrame) -> Indices:
    """Numbers of the exposures, (N,), that the frames of a twin are.

    Parameters
    ----------
    frames
        Of a twin, with ``frame_id``.

    Returns
    -------
    (N,)

    Examples
    --------
    >>> exposures_of(pd.DataFrame({"frame_id": ["f000001", "f000012"]})).tolist()
    [0, 11]
    """
    return np.asarray(frames["frame_id"].str[1:].astype(int).to_numpy() - 1, np.intp)


class Marks(NamedTuple):
    """One target in K images that may show it.

    Attributes
    ----------
    exposure
        (K,) numbers of the exposures.
    uv, covariance
        (K, 2) px and (K, 2, 2) px^2 of the largest detection that is the target's; NaN where there is none.
    centre
        (K, 2) px where the centre of its whole outline is; NaN where none of it is in view.
    share
        (K,) of its outline in view.
    moved
        (K,) whether the centre was moved by H (4.7).
    false
        (K,) how many detections are of nothing.
    """

    exposure: Indices
    uv: Array
    covariance: Array
    centre: Array
    share: Array
    moved: Mask
    false: Indices

    @property
    def found(self) -> Mask:
        """(K,) whether the target was detected."""
        return np.asarray(np.isfinite(self.uv).all(axis=1))

    def take(self, rows: slice) -> Marks:
        """The marks of some of the images."""
        return Marks(**{name: part[rows] for name, part in self._asdict().items()})


def marks_of(
    shots: Iterable[Shot],
    shape: tuple[int, int],
    number: int = 1,
    length: float = np.nan,
) -> Marks:
    """What images give of one target.

    Parameters
    ----------
    shots
        From `Photographer.shoot`.
    shape
        Rows and columns of the images.
    number
        Of the target's body, from 1.
    length
        Of the target, px: then centres are moved where the border cuts it, H (4.7); NaN moves none.

    Returns
    -------
    Marks
    """
    taken = list(shots)
    n = len(taken)
    uv, centre, covariance = np.full((n, 2), np.nan), np.full((n, 2), np.nan), np.full((n, 2, 2), np.nan)
    share, moved, false = np.zeros(n), np.zeros(n, bool), np.zeros(n, np.intp)
    for k, shot in enumerate(taken):
        false[k] = shot.judged.false
        for seen in shot.seen:
            if seen.number == number:
                centre[k], share[k] = seen.centre, seen.share
        rows = shot.judged.found.get(number, [])
        if not rows:
            continue
        one = shot.detections.select(rows[:1])
        found = adjust_at_border(one, shape, length) if np.isfinite(length) else one
        uv[k], covariance[k] = found.uv[0], found.covariance[0]
        moved[k] = bool((found.uv[0] != one.uv[0]).any())
    exposure = np.array([shot.exposure for shot in taken], np.intp)
    return Marks(exposure, uv, covariance, centre, share, moved, false)


def with_detections(
    flight: Flight, marks: Marks, target: str, plane_down: float = 0.0, *, all_frames: bool = False
) -> Flight:
    """A twin's flight with the detections of rendered images in place of the drawn ones, and their frames.

    Parameters
    ----------
    flight
        From `wildlab.simulation.twins.simulate_twin`.
    marks
        From `marks_of`, of images of the same twin and seed.
    target
        Its name.
    plane_down
        Down coordinate of the water, m.
    all_frames
        Whether the flight keeps all its frames, or those of the marks alone.

    Returns
    -------
    Flight

    Raises
    ------
    WildlabError
        Where none of the images shows the target, or one of them is no frame of the flight.
    """
    if not marks.found.any():
        raise WildlabError(
            f"in none of {len(marks.exposure)} images {target!r} is found",
            "render more of them, or lower the thresholds",
            field="detections",
        )
    frames = flight.table("frames")
    place = pd.Index(exposures_of(frames)).get_indexer(pd.Index(marks.exposure))
    if (place < 0).any():
        raise WildlabError(
            f"exposure {marks.exposure[place < 0][0]} of the marks is none of {len(frames)} frames",
            "render images of the same twin and seed",
            field="frame_id",
        )
    marked = frames.iloc[place].reset_index(drop=True)
    rows = np.flatnonzero(marks.found)
    table = pd.DataFrame(
        {
            "detection_id": [f"r{number:06d}" for number in range(1, len(rows) + 1)],
            "frame_id": marked["frame_id"].to_numpy()[rows],
            "source": "detector",
            "kind": "pixel",
            "u_px": marks.uv[rows, 0],
            "v_px": marks.uv[rows, 1],
            "target_id": target,
            "plane_down_m": plane_down,
        }
    )
    kept = frames if all_frames else marked
    return replace(flight, tables=flight.tables | {"frames": kept, "detections": table})


#: The ship, in whatever part; the boats with their whole contour in view, and cut; images without any.
SHIP, WHOLE, CUT, SEA = "ship", "boats-whole", "boats-cut", "sea"
#: All images of the second flight together.
BOATS = "boats"
SUBJECTS = (SHIP, WHOLE, CUT, BOATS, SEA)


class Image(NamedTuple):
    """One image of a flight: what it is of, what there is to see, and the camera's counts."""

    subject: str
    view: RenderedView
    counts: NDArray[np.uint16]


def choose(flight: SceneFlight, images: int, rng: np.random.Generator) -> dict[str, list[int]]:
    """Which exposures of a flight are looked at: with something whole, with something cut only, with nothing.

    ``images`` of each kind, or as many as there are among six times as many draws.
    """
    near = np.flatnonzero(flight.near().any(axis=1))
    kinds: dict[str, list[int]] = {"whole": [], "cut": [], "empty": []}
    for exposure in rng.permutation(near)[: 6 * images]:
        shares = flight.shares(int(exposure))
        # Where one boat is whole and the other cut, the image counts by the whole one, as in H 4.4.1.
        kind = "whole" if (shares > 1 - 1e-9).any() else "cut" if (shares > 0).any() else "empty"
        kinds[kind].append(int(exposure))
    far = np.setdiff1d(np.arange(len(flight.times)), near)
    kinds["empty"] = [int(one) for one in rng.permutation(far)[:images]]
    return {kind: chosen[:images] for kind, chosen in kinds.items()}


def images_of(twin: str, second: str, seed: int, images: int) -> Iterator[Image]:
    """The images of one simulated flight over the ship and one over the boats.

    Parameters
    ----------
    twin, second
        Of the ship, and of the boats.
    seed
        Of both flights and of the camera.
    images
        Of each subject.
    """
    response = CameraResponse()
    for name, subjects in (
        (twin, {"whole": SHIP, "cut": SHIP}),
        (second, {"whole": WHOLE, "cut": CUT, "empty": SEA}),
    ):
        flight = SceneFlight(load_twin(name), seed)
        camera = flight.poses.camera
        sensor: Sensor = sensor_of(response, (camera.height, camera.width), stream(seed, f"sensor of {name}"))
        rng = stream(seed, f"images of {name}")
        if name == twin:
            # Of the ship every image that shows some of it is of the same kind, as in H 4.4.1.
            near = np.flatnonzero(flight.near().any(axis=1))
            seen = [
                int(one) for one in rng.permutation(near)[: 3 * images] if flight.shares(int(one)).max() > 0
            ]
            chosen = {SHIP: seen[:images]}
        else:
            chosen = {subjects[kind]: numbers for kind, numbers in choose(flight, images, rng).items()}
        for subject, exposures in chosen.items():
            for exposure in sorted(exposures):
                view = flight.view(exposure)
                yield Image(subject, view, expose(view.kelvin, response, sensor, rng))


def tally(images: list[Image], thresholds: FloatingThresholds) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What the detector finds in images.

    In an image of something whole, what the border cuts beside it is not counted.

    Parameters
    ----------
    images
        As `images_of` gives them.
    thresholds
        Of the detector.

    Returns
    -------
    (objects, frames)
        One row for each body in view (``subject``, ``share`` in view, ``found``, ``inside`` its 90 % ellipse,
        NaN where not found); one for each image (``subject``, ``false`` alarms, ``bodies``, ``missed``).
    """
    objects: list[dict[str, object]] = []
    frames: list[dict[str, object]] = []
    for subject, view, counts in images:
        result = find_objects(counts, thresholds=thresholds)
        judged = judge(view, result)
        missed = bodies = 0
        for seen in view.seen:
            if subject == WHOLE and seen.share < 1 - 1e-9:
                continue
            bodies += 1
            rows = judged.found[seen.number]
            missed += not rows
            objects.append(
                {
                    "subject": subject, "share": seen.share, "found": bool(rows),
                    "inside": _inside(seen, result, rows),
                }
            )  # fmt: skip
        frames.append({"subject": subject, "false": judged.false, "bodies": bodies, "missed": missed})
    return (
        pd.DataFrame(objects, columns=["subject", "share", "found", "inside"]),
        pd.DataFrame(frames, columns=["subject", "false", "bodies", "missed"]),
    )


def _inside(seen: SeenBody, result: FloatingObjects, rows: list[int]) -> float:
    """Whether the ellipse of the largest piece holds the centre of the outline: 1, 0, NaN where not found."""
    if not rows:
        return np.nan
    one = result.detections
    return float(inside_ellipse(one.uv[rows[:1]] - seen.centre, one.covariance[rows[:1]], 0.9)[0])


def numbers_of(objects: pd.DataFrame, frames: pd.DataFrame) -> dict[tuple[str, str], float]:
    """What `tally` gives, by (subject, name): see `RECORDED`.

    A rate is of images with something in view, where all of it was found.
    """
    numbers: dict[tuple[str, str], float] = {}
    for subject in SUBJECTS:
        own = [WHOLE, CUT, SEA] if subject == BOATS else [subject]
        shown, seen = frames[frames["subject"].isin(own)], objects[objects["subject"].isin(own)]
        numbers[subject, "images"] = len(shown)
        numbers[subject, "images_with_false"] = (shown["false"] > 0).sum()
        numbers[subject, "false_alarms_per_image"] = shown["false"].mean() if len(shown) else np.nan
        if subject in (BOATS, SEA):
            continue
        with_some = shown[shown["bodies"] > 0]
        rate = 1 - float((with_some["missed"] > 0).mean()) if len(with_some) else np.nan
        numbers[subject, "detection_rate"] = rate
        numbers[subject, "images_with_missed"] = (with_some["missed"] > 0).sum()
        found = seen[seen["found"].astype(bool)]
        numbers[subject, "ellipse_coverage_90"] = found["inside"].mean() if len(found) else np.nan
        missed = seen[~seen["found"].astype(bool)]
        numbers[subject, "missed"] = len(missed)
        numbers[subject, "largest_share_missed"] = missed["share"].max() if len(missed) else np.nan
    return numbers


def trial(seed: int, *, twin: str, second: str, images: int) -> dict[tuple[str, str], float]:
    """One simulated flight over the ship and one over the boats, by `numbers_of`.

    Raises
    ------
    WildlabError
        If there is no such twin, or one of them shows nothing of its targets.
    """
    rendered = list(images_of(twin, second, seed, images))
    for name, subject in ((twin, SHIP), (second, WHOLE)):
        if not any(image.subject == subject for image in rendered):
            raise WildlabError(
                f"on the flight of seed {seed} no image shows what is looked for",
                "look at the twin",
                file=name,
            )
    return numbers_of(*tally(rendered, FloatingThresholds()))


def thresholds_table(thresholds: FloatingThresholds) -> pd.DataFrame:
    """Every threshold with its value, published or chosen, and where it is published or why it is so."""
    reasons = load_texts("vessel-detection").quantities
    return pd.DataFrame(
        [
            {
                "name": field.name.replace("_", " "),
                "value": str(getattr(thresholds, field.name)),
                "status": "published" if field.name in PUBLISHED else "chosen",
                "reason": reasons[field.name],
            }
            for field in fields(thresholds)
        ]
    )


def plot_rates(
    runs: pd.DataFrame, published: Mapping[tuple[str, str], float], names: Mapping[str, str]
) -> Figure:
    """Detection rates over all images with their intervals; ``published`` by subject and name."""
    subjects = (SHIP, WHOLE, CUT)
    here, *ends = 100 * np.array([pooled_share(runs, one, "detection_rate")[0] for one in subjects]).T
    printed = [100 * published.get((one, "detection_rate"), np.nan) for one in subjects]
    series = {"here": Values(here, ends), "published": Values(printed, color=INK, look="D")}
    rows = [names[one] for one in subjects]
    return rows_chart(rows, series, "images in which all was found (%)", size=(5.6, 2.9), apart=0.0)


def plot_steps(image: Image, thresholds: FloatingThresholds) -> Figure:
    """One image as the detector sees it: grey, gradient, steep pixels, and what was found."""
    steps = find_edges(image.counts, None, thresholds)
    found = find_objects(image.counts, thresholds=thresholds).detections
    fig, axes = new_figure(5.9, 5.2, rows=2, columns=2)
    panels = {
        "8 bits": steps.grey,
        "Gradient": steps.gradient,
        f"At {thresholds.gradient:g} and above": steps.steep,
    }
    for ax, (title, picture) in zip(axes.flat, panels.items(), strict=False):
        draw_picture(ax, picture, title)
    last = axes.flat[3]
    draw_picture(last, steps.grey, "Found", boxes=found.box, colors=[ORANGE] * len(found.box))
    last.plot(*found.uv.T, "+", color=ORANGE, ms=8, mew=1.6)
    return fig


def plot_cut_shares(objects: pd.DataFrame) -> Figure:
    """The visible part of each object that the border cuts, found and missed."""
    fig, ax = new_figure(5.6, 2.6)
    cut = objects[objects["share"] < 1]
    for row, (found, colour) in enumerate(((True, BLUE), (False, VERMILLION))):
        share = 100 * cut[cut["found"].astype(bool) == found]["share"].to_numpy(float)
        draw_dots(ax, share, row + spread_points(len(share), 0.25), colour, size=10, alpha=0.8)
    name_rows(ax, ["found", "missed"])
    ax.set_xlim(-2, 102)
    return finish(fig, "visible part of the outline (%)")
