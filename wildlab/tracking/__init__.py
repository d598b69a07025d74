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
- `multitarget`: several targets at once, with `multitarget_tracks` and `target_model`; `particles`: particle
  filters of many animals, with what an image did not show.
"""
