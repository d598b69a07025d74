"""Tracking filters: measurements with covariances in, estimates with covariances out; nothing kept between.

- `run`: a whole flight through the Kalman, extended or Schmidt filter; `coloured` through differences of
  measurements; `others` through the unscented filter and interacting models. `batch`: many runs at once.
- `motion`, `measurement`, `noise`: what the filters are told of target, sensor and errors.
- `kalman`, `schmidt`, `association`: the single steps.
"""
