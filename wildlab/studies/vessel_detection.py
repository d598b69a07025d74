"""Images of two twins, rendered, and what the detector of H 4.3 finds in them.

The ship is that of H 6.4.1, of which H 4.4.1 counts 441 images; the boats are the two of H 6.4.4, whose
flight is taken for that of the 27866 images. Both are rendered here and there along the flight.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.analysis.rendered import judge
from wildlab.detection.floating import (
    PUBLISHED,
    FloatingObjects,
    FloatingThresholds,
    find_edges,
    find_objects,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.shares import Check, Pooled
from wildlab.geometry.covariances import inside_ellipse
from wildlab.messages.catalogue import load_texts
from wildlab.reporting.charts.drawing import draw_dots, finish, name_rows
from wildlab.reporting.charts.forms import Values, draw_picture, rows_chart, spread_points
from wildlab.reporting.figures import BLUE, INK, ORANGE, VERMILLION, new_figure
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.flights import SceneFlight
from wildlab.simulation.scene.render import RenderedView, SeenBody
from wildlab.simulation.scene.response import CameraResponse, Sensor, expose, sensor_of
from wildlab.studies.monte_carlo import pooled_share

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
                view = flight.view(exposure, waves_move=False)
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


def _share(check: Check) -> float:
    count, of = check.pooled or Pooled(0, 0)
    return count / of if of else 0.0


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
    return finish(fig, "", "visible part of the outline (%)")
