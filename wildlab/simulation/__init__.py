"""Twins: simulated flights that nothing downstream can tell from logged ones.

Sensors are simulated, never results. Frames as in H 5.2.2: ``n`` is north-east-down with a fixed origin on
the ground or the sea, ``b`` is the body (x forward, y right, z down); ``R_nb`` takes a vector from b to n.
Units are SI and radians; only the files in ``data/twins`` have others, each number with its own. Times are
(N,) s from the start of the flight; positions, velocities, accelerations, specific forces and angular rates
are (N, 3), attitudes (N, 3, 3), one row per time. All randomness comes from `stream`, which is keyed by the
seed and the sensor's name.

Where a change belongs:

- parameters: `parameters` (a twin's file); which there are, in which unit: ``data/twin_parameters.toml``;
- motion: `trajectory`, with attitudes and disturbances, along `courses`; what a twin looks for is in
  `target_motion`, and the ground in `landscape`;
- sensors: `onboard_sensors`, and the `error_models` that they share; what is said of them, and what they are:
  `manifest`;
- speed: `kernels`, compiled;
- tables: `camera_detections`;
- the whole flight: `twins`; what its camera would have seen, as images with labels: `scene`.
"""
