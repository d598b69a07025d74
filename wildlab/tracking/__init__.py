"""Target tracking: measurements with covariances in, estimates with covariances out; nothing kept between.

Positions are metres north and east in n, whose origin the flight chooses; the down coordinate of the plane
the target moves on is given. States are ``[pN, pE]``, ``[pN, pE, vN, vE]`` or with ``[aN, aE]`` behind, times
seconds, angles radians, pixels (u, v) to the right and down. N rows of measurements are (N, m), or (N, K, m)
with K detections in each; covariances have one axis more. A pose's errors are three of the position in n (m)
and a rotation vector in b (rad). H is H. H. Helgesen, Detection and Tracking of Floating Objects using UAVs
with Optical Sensors, doctoral thesis, NTNU 2019; F is A. Flodell and C. Christensson, Wildlife Surveillance
Using a UAV and Thermal Imagery, master's thesis, Linköping University 2016.

- `run_filter`: Kalman, extended or Schmidt filter over a whole flight; `run_batch`: many runs at once.
- `run_coloured`, `run_unscented`, `run_imm`: differenced measurements, sigma points, several motion models.
- `run_smoothed`, `smooth`: back over a track, for flights that are over. `follow`: any of them by its name.
- `consider`, `considering`: errors of poses, clocks, lenses and sensors that a filter keeps in mind.
- `motion`, `measurement`, `platforms`, `noise`, `maritime`: what the filters are told of target, sensor and
  errors.
- `start_from_measurement`, `start_from_rays`: where it begins. `merge`: several sensors into one track.
- `kalman`, `schmidt`, `association`: the single steps.
- `wildlab.tracking.particles`: particle filters of many animals, with what an image did not show.
"""

from wildlab.tracking.association import distances, nearest_within
from wildlab.tracking.batch import BatchCamera, BatchTracks, run_batch
from wildlab.tracking.coloured import run_coloured, thin
from wildlab.tracking.combined import Merged, SensorMeasurements, combined, merge
from wildlab.tracking.consider_parameters import Considered, consider, consider_all
from wildlab.tracking.considering import considering, renamed
from wildlab.tracking.following import FILTERS, follow
from wildlab.tracking.imm import ModeTrack, run_imm
from wildlab.tracking.initiation import start_from_measurement, start_from_position, start_from_rays
from wildlab.tracking.kalman import filter_at_rest
from wildlab.tracking.measurement import (
    Sensor,
    azimuths_elevations,
    bearings,
    pixels,
    positions,
    positions_or_velocities,
    ranges_bearings,
)
from wildlab.tracking.motion import (
    Motion,
    constant_position,
    constant_velocity,
    in_steps,
    random_walk,
    rest,
    singer,
)
from wildlab.tracking.noise import constant_noise, noise_by_altitude, noise_by_direction, own_noise
from wildlab.tracking.platforms import measured_from, polar
from wildlab.tracking.rays import Crossing, intersect_rays
from wildlab.tracking.run import Start, Track, run_filter, start_from_first
from wildlab.tracking.schmidt import PoseUncertainty
from wildlab.tracking.smoothing import run_smoothed, smooth
from wildlab.tracking.unscented import run_unscented

__all__ = [
    "FILTERS",
    "BatchCamera",
    "BatchTracks",
    "Considered",
    "Crossing",
    "Merged",
    "ModeTrack",
    "Motion",
    "PoseUncertainty",
    "Sensor",
    "SensorMeasurements",
    "Start",
    "Track",
    "azimuths_elevations",
    "bearings",
    "combined",
    "consider",
    "consider_all",
    "considering",
    "constant_noise",
    "constant_position",
    "constant_velocity",
    "distances",
    "filter_at_rest",
    "follow",
    "in_steps",
    "intersect_rays",
    "measured_from",
    "merge",
    "nearest_within",
    "noise_by_altitude",
    "noise_by_direction",
    "own_noise",
    "pixels",
    "polar",
    "positions",
    "positions_or_velocities",
    "random_walk",
    "ranges_bearings",
    "renamed",
    "rest",
    "run_batch",
    "run_coloured",
    "run_filter",
    "run_imm",
    "run_smoothed",
    "run_unscented",
    "singer",
    "smooth",
    "start_from_first",
    "start_from_measurement",
    "start_from_position",
    "start_from_rays",
    "thin",
]
