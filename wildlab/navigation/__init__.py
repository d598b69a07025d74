"""Inertial navigation aided by GNSS and magnetometer: position, velocity and attitude with their covariance.

Frames: n is north, east, down about the flight's origin, b the airframe's forward, right, down. Positions are
metres and velocities m/s in n; quaternions turn b into n, scalar first; specific force (m/s^2) and angular
rate (rad/s) are in b, and so are biases and lever arms. Times are seconds on one clock. N samples are (N, 3),
a state is (16,): position, velocity, quaternion, accelerometer bias, gyro bias; its errors are (15,), with
the attitude's as a rotation vector in b (rad). H is H. H. Helgesen, Detection and Tracking of Floating
Objects using UAVs with Optical Sensors, doctoral thesis, NTNU 2019.

- `run_mekf`: the multiplicative extended Kalman filter; `run_observer`: the nonlinear observer.
- `integrate_strapdown`: inertial measurements alone.
- `align_at`, `align_from_baseline`, `align_from_course`, `align_at_rest`: where they start.
- `positions`, `velocities`, `standstill`: aiding measurements.
- `signs_of_trouble`: what of an estimate should not be believed.
"""
