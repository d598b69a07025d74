"""What a thermal camera makes of a scene: blur, vignetting, noise, dead pixels, 14 bits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError

#: Largest count of 14 bits.
LARGEST = 2**14 - 1


@dataclass(frozen=True)
class CameraResponse:
    """A thermal camera beyond its geometry. The sensitivity is H's (appendix A), the rest is chosen.

    Attributes
    ----------
    blur_sd
        Of lens and detector together, px.
    noise
        Temporal, per pixel, K: below 50 mK (H table A.1).
    pattern, stripes
        What stays from image to image, per pixel and per column, K.
    vignetting
        How much warmer the corners look, K: the housing seen past the lens.
    dead_share
        Of the pixels, that always show the same.
    counts_per_kelvin, counts_at, counts_level
        Linear: so many counts per kelvin, and which count stands for which temperature (K).
    """

    blur_sd: float = 0.6
    noise: float = 0.05
    pattern: float = 0.02
    stripes: float = 0.015
    vignetting: float = 0.4
    dead_share: float = 1e-4
    counts_per_kelvin: float = 25.0
    counts_at: float = 273.15
    counts_level: float = 7000.0


#: One that changes nothing but the unit.
IDEAL = CameraResponse(blur_sd=0.0, noise=0.0, pattern=0.0, stripes=0.0, vignetting=0.0, dead_share=0.0)


class Sensor(NamedTuple):
    """What one camera has and keeps: ``offset`` (H, W) K, and which pixels are ``dead``, at what count."""

    offset: NDArray[np.float32]
    dead: NDArray[np.bool_]
    stuck: NDArray[np.uint16]


def sensor_of(response: CameraResponse, shape: tuple[int, int], rng: np.random.Generator) -> Sensor:
    """Draws a camera of that kind: its fixed pattern, and its dead pixels.

    Parameters
    ----------
    response
        Which kind.
    shape
        Rows and columns.
    rng
        Of that camera.

    Returns
    -------
    Sensor
    """
    rows, columns = shape
    v, u = np.mgrid[:rows, :columns].astype(float)
    middle = np.array([(rows - 1) / 2, (columns - 1) / 2])
    radius2 = ((v - middle[0]) ** 2 + (u - middle[1]) ** 2) / max((middle**2).sum(), 1.0)
    offset = response.vignetting * radius2
    offset = offset + response.pattern * rng.standard_normal(shape)
    offset = offset + response.stripes * rng.standard_normal(columns)
    dead = rng.random(shape) < response.dead_share
    stuck = rng.choice(np.array([0, LARGEST], np.uint16), shape)
    return Sensor(offset.astype(np.float32), dead, stuck)


def expose(
    kelvin: NDArray[np.floating], response: CameraResponse, sensor: Sensor, rng: np.random.Generator
) -> NDArray[np.uint16]:
    """An image in counts of 14 bits.

    Parameters
    ----------
    kelvin
        (H, W) apparent temperatures, as `wildlab.simulation.scene.render` gives them.
    response, sensor
        The camera.
    rng
        Of the image.

    Returns
    -------
    (H, W) counts.

    Raises
    ------
    WildlabError
        Where the sensor has another number of pixels.
    """
    if sensor.offset.shape != kelvin.shape:
        raise WildlabError(
            f"a sensor of {sensor.offset.shape} pixels for an image of {kelvin.shape}",
            "draw one of that size with sensor_of",
            field="sensor",
        )
    seen: NDArray[Any] = np.asarray(kelvin, np.float32)
    if response.blur_sd > 0:
        seen = np.asarray(cv2.GaussianBlur(seen, (0, 0), response.blur_sd, borderType=cv2.BORDER_REPLICATE))
    seen = seen + sensor.offset
    if response.noise > 0:
        seen += np.float32(response.noise) * rng.standard_normal(seen.shape, np.float32)
    counts = np.clip(np.rint(to_counts(seen, response)), 0, LARGEST).astype(np.uint16)
    counts[sensor.dead] = sensor.stuck[sensor.dead]
    return np.asarray(counts)


def to_counts(kelvin: ArrayLike, response: CameraResponse) -> NDArray[Any]:
    """Counts of kelvin, by the gain and the level of ``response``, neither rounded nor cut."""
    above = np.asarray(kelvin) - np.float32(response.counts_at)
    return np.asarray(response.counts_level + above * response.counts_per_kelvin)
