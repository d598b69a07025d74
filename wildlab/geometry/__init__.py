"""Geometry of a flying camera: frames, camera, mount, pixel <-> ground with uncertainty, and calibration.

Stands on the ground: imports nothing else of wildlab but its errors. Sections and equations are those of the
theses: H is Helgesen (2019), who tracks vessels with the camera of an unmanned aircraft; F is Flodell and
Christensson (2016), who look for animals with one. Where a print has a slip, the function says so.

Arrays in, arrays out, one row per item, SI units and radians, pixels for what is in the image; a single value
may stand for all rows. What cannot be had (a ray over the horizon, a point behind the camera) is NaN in its
row. Frames as in H 5.2.2: ``n`` north-east-down with a fixed origin, ``b`` body (x forward, y right, z down),
``m`` mount, ``c`` camera (x right in the image, y down in the image, z out of the lens), ``e`` ECEF. ``R_nb``
takes a vector from b to n; ``p_nc`` is the position of c relative to n, in n.

`CameraPoses` brings a camera, its mount and N poses of the airframe together, and most else takes it:

>>> import numpy as np
>>> from wildlab.geometry.camera import Camera
>>> from wildlab.geometry.camera_poses import CameraPoses, Mount
>>> from wildlab.geometry.frames import euler_to_matrix
>>> from wildlab.geometry.georeference import georeference_pixels
>>> camera = Camera(640, 512, fx=1000.0, fy=1000.0, cx=320.0, cy=256.0)
>>> R_nb = euler_to_matrix(0.0, np.radians([-45.0, -30.0]), 0.0)
>>> poses = CameraPoses(camera, Mount("forward"), np.array([0.0, 0.0, -100.0]), R_nb)
>>> print(np.round(georeference_pixels(poses, np.tile([320.0, 256.0], (2, 1)), plane_down=0.0), 1))
[[100.    0.    0. ]
 [173.2   0.    0. ]]
"""
