"""The sea as a thermal camera sees it: waves and ripples that tilt a mirror of the sky, patches, sun glint.

Heights of a wind sea are a sum of waves of random phase that travel by the dispersion relation of deep water;
here only their slopes are wanted, which come out of one inverse Fourier transform per tile and time. Tiles
repeat: the long one every 256 m, the one of ripples every 16 m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from wildlab.errors import WildlabError

#: Side (m) and cells along it of the tiles of waves, of ripples, and of patches.
WAVES, RIPPLES, PATCHES = (256.0, 512), (16.0, 256), (512.0, 128)
_GRAVITY = 9.81
Tile = NDArray[np.float32]


@dataclass(frozen=True)
class Sea:
    """State of the sea and the sky above it; all chosen, none of H's flights says.

    Attributes
    ----------
    temperature
        Of the water, K.
    wind_speed, wind_from
        m/s, and where the wind comes from, rad.
    patches_sd
        Of slow changes of the temperature from place to place, K.
    air, zenith
        What the sky is like near the horizon and straight up, K.
    sun_azimuth, sun_elevation
        rad; None for the elevation is no sun.
    glint
        How much warmer a facet looks that mirrors the sun straight down, K.
    glint_width
        Over which angle about the mirrored sun, rad: ripples that no tile has.
    seed
        Of waves and patches.
    """

    temperature: float = 286.0
    wind_speed: float = 4.0
    wind_from: float = float(np.radians(225.0))
    patches_sd: float = 0.08
    air: float = 283.0
    zenith: float = 245.0
    sun_azimuth: float = float(np.radians(180.0))
    sun_elevation: float | None = None
    glint: float = 1.0
    glint_width: float = 0.06
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.wind_speed <= 20:
            raise WildlabError(
                f"a wind of {self.wind_speed} m/s", "give one from 0 to 20 m/s", field="wind_speed"
            )
        if not 200 < self.temperature < 330:
            raise WildlabError(
                f"a sea of {self.temperature} K", "give its temperature in kelvin", field="temperature"
            )


#: An even sea, as a test's truth wants it: no waves, no patches, and a sky that is as warm as the water.
EVEN = Sea(wind_speed=0.0, patches_sd=0.0, air=286.0, zenith=286.0)


class Tiles(NamedTuple):
    """Slopes north and east of waves and of ripples, (n, n, 2), and temperatures of patches, (n, n)."""

    waves: Tile
    ripples: Tile
    patches: Tile


def mean_square_slope(wind_speed: float) -> float:
    """Of a sea under that wind, upwind and crosswind together: Cox and Munk (1954)."""
    return 0.003 + 0.00512 * wind_speed if wind_speed > 0 else 0.0


@lru_cache(maxsize=8)
def _amplitudes(side: float, cells: int, wind_speed: float, wind_from: float, seed: int) -> tuple:  # type: ignore[type-arg]
    """Complex amplitudes of slopes per wave number, and frequencies: shape (cells, cells)."""
    k = 2 * np.pi * fft.fftfreq(cells, side / cells)
    kn, ke = np.meshgrid(k, k, indexing="ij")
    size = np.hypot(kn, ke)
    size[0, 0] = 1.0
    towards = wind_from + np.pi
    along = (kn * np.cos(towards) + ke * np.sin(towards)) / size
    peak = _GRAVITY / max(wind_speed, 0.5) ** 2  # wave number below which such a wind raises none
    # Slope spectrum of a wind sea: k^-2 per unit area, cut below the peak; most waves run with the wind.
    spectrum = np.exp(-0.7 * (peak / size) ** 2) / size**2 * (0.1 + np.where(along > 0, along**2, 0.05))
    spectrum[0, 0] = 0.0
    rng = np.random.default_rng([seed, cells])
    noise = rng.standard_normal((cells, cells)) + 1j * rng.standard_normal((cells, cells))
    return np.sqrt(spectrum) * noise, np.sqrt(_GRAVITY * size), kn / size, ke / size


def _slopes(side: float, cells: int, sea: Sea, variance: float, time: float) -> Tile:
    if variance <= 0:
        return np.zeros((cells, cells, 2), np.float32)
    amplitude, frequency, north, east = _amplitudes(side, cells, sea.wind_speed, sea.wind_from, sea.seed)
    now = amplitude * np.exp(-1j * frequency * time)
    field_north = fft.ifft2(now * north).real
    field_east = fft.ifft2(now * east).real
    size = np.sqrt(field_north.var() + field_east.var())
    factor = np.sqrt(variance) / size
    return np.stack([field_north * factor, field_east * factor], axis=-1).astype(np.float32)


@lru_cache(maxsize=8)
def tiles_at(sea: Sea, time: float) -> Tiles:
    """The sea's tiles at a time, s."""
    variance = mean_square_slope(sea.wind_speed)
    waves = _slopes(*WAVES, sea, 0.4 * variance, time)
    ripples = _slopes(*RIPPLES, sea, 0.6 * variance, time)
    return Tiles(waves, ripples, _patches(sea.patches_sd, sea.seed))


@lru_cache(maxsize=8)
def _patches(sd: float, seed: int) -> Tile:
    cells = PATCHES[1]
    k = fft.fftfreq(cells) * cells
    size2 = k[:, None] ** 2 + k[None, :] ** 2
    spectrum = np.where(size2 > 0, 1 / (1 + size2), 0.0)
    rng = np.random.default_rng([seed, 7])
    field = fft.ifft2(spectrum * fft.fft2(rng.standard_normal((cells, cells)))).real
    return np.asarray(sd * field / field.std(), np.float32)
