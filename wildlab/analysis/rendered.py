"""A twin's images, rendered from its true poses, and what the detector of H 4.3 finds in them.

What a twin's ``detections`` hold is drawn: the true pixel and noise. Here a camera looks at the scene, and a
detector that knows nothing of it looks for what floats; the labels of the scene only say afterwards which
of its detections are of which target.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.detection.centres import adjust_at_border
from wildlab.detection.detections import Detections, no_detections
from wildlab.detection.floating import FloatingObjects, find_objects
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import load_twin
from wildlab.simulation.scene.flights import SceneFlight, VesselLook, Window, corner_of
from wildlab.simulation.scene.render import RenderedView, SeenBody
from wildlab.simulation.scene.response import CameraResponse, Sensor, expose, sensor_of

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
        view = self.flight.view(exposure, waves_move=False, window=window)
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
