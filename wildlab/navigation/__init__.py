"""From inertial and GNSS measurements to the airframe's pose, and how wrong it may be. Arrays in and out."""
