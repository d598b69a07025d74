"""Images of two twins, rendered, and what the detector of H 4.3 finds in them.

The ship is that of H 6.4.1, of which H 4.4.1 counts 441 images; the boats are the two of H 6.4.4, whose
flight is taken for that of the 27866 images. Both are rendered here and there along the flight.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.rendered import judge
from wildlab.detection.floating import FloatingObjects, FloatingThresholds, find_objects
from wildlab.errors import WildlabError
from wildlab.evaluation.shares import Check, Pooled, columns_of
from wildlab.geometry.covariances import inside_ellipse
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.flights import SceneFlight
from wildlab.simulation.scene.render import RenderedView, SeenBody
from wildlab.simulation.scene.response import CameraResponse, Sensor, expose, sensor_of

#: The ship, in whatever part; the boats with their whole contour in view, and cut; images without any.
SHIP, WHOLE, CUT, SEA = "ship", "boats-whole", "boats-cut", "sea"
#: All images of the second flight together.
BOATS = "boats"
SUBJECTS = (SHIP, WHOLE, CUT, BOATS, SEA)
#: Names of the numbers that are recorded, and their units.
RECORDED = {
    "detection_rate": "1",
    "false_alarms_per_image": "1",
    "ellipse_coverage_90": "1",
    "images": "1",
}


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


def check_claims(runs: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for each claim of H 4.3 and 4.4.1, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each flight.
    """

    of = columns_of(runs)

    def together(count: str, *subjects: str) -> Check:
        """Each flight's share of images with something missed or false, and that of all flights' images."""
        some, images = (np.sum([of(one, name) for one in subjects], axis=0) for name in (count, "images"))
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.asarray(some / images)
        return Check(measured=share, pooled=Pooled(round(float(some.sum())), round(float(images.sum()))))

    # The worse of the two decides whether the rate is near perfect.
    missed = [together("images_with_missed", one) for one in (SHIP, WHOLE)]
    return {
        "near-perfect": max(missed, key=_share),
        "ship-without-false-alarm": together("images_with_false", SHIP),
        "whole-always-found": missed[1],
        "only-small-parts-missed": Check(
            measured=of(SHIP, "largest_share_missed"), premise=of(SHIP, "missed") > 0
        ),
        "no-blob-in-empty-images": together("images_with_false", SEA),
    }


def _share(check: Check) -> float:
    count, of = check.pooled or Pooled(0, 0)
    return count / of if of else 0.0
