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
- `smooth`: back over a track, for flights that are over.
- `consider_all`: errors of poses, clocks and sensors that a filter keeps in mind.
- `motion`, `sensors`: what the filters are given of target and sensor. `merge`: several sensors into one
  track.
- `start_from_first`, `start_from_position`: where it begins.
- `kalman`, `association`: the single steps.
- `wildlab.tracking.many`: several targets at once; `wildlab.tracking.particles`: particle filters of many
  animals, with what an image did not show.
"""

from wildlab.tracking.batch import BatchCamera, run_batch
from wildlab.tracking.filters import run_coloured, run_imm, run_unscented, thin
from wildlab.tracking.kalman import Considered, consider_all
from wildlab.tracking.motion import (
    Motion,
    constant_velocity,
    in_steps,
    random_walk,
    rest,
    singer,
    white_acceleration,
)
from wildlab.tracking.run import Start, Track, run_filter, start_from_first, start_from_position
from wildlab.tracking.sensors import Merged, Sensor, SensorMeasurements, merge, pixels, positions, renamed
from wildlab.tracking.smoothing import smooth

__all__ = [
    "BatchCamera",
    "Considered",
    "Merged",
    "Motion",
    "Sensor",
    "SensorMeasurements",
    "Start",
    "Track",
    "consider_all",
    "constant_velocity",
    "in_steps",
    "merge",
    "pixels",
    "positions",
    "random_walk",
    "renamed",
    "rest",
    "run_batch",
    "run_coloured",
    "run_filter",
    "run_imm",
    "run_unscented",
    "singer",
    "smooth",
    "start_from_first",
    "start_from_position",
    "thin",
    "white_acceleration",
]
