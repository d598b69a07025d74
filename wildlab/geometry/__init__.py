"""Geometry of a flying camera: frames, camera, mount, pixel <-> ground with uncertainty, and calibration.

Stands on the ground: imports nothing else of wildlab. Arrays in, arrays out, one row per item, SI units and
radians. Frames as in H 5.2.2: ``n`` north-east-down with a fixed origin, ``b`` body (x forward, y right,
z down), ``m`` mount, ``c`` camera (x right in the image, y down in the image, z out of the lens), ``e`` ECEF.
``R_nb`` takes a vector from b to n; ``p_nc`` is the position of c relative to n, in n.
"""
