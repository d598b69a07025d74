"""Detection: an image as an array in, pixels with their uncertainty out. Files are read elsewhere.

An image is (H, W) grey levels, counts or kelvin, and ``valid`` (H, W) says where it shows the scene. What is
found is a `Detections` with a row for each thing; (0, 0) is the middle of the upper left pixel. Thresholds
are frozen dataclasses with defaults. F is A. Flodell and C. Christensson, Wildlife Surveillance Using a UAV
and Thermal Imagery, master's thesis, Linköping University 2016; H is H. H. Helgesen, Detection and Tracking
of Floating Objects using UAVs with Optical Sensors, doctoral thesis, NTNU 2019.

- `wildlab.detection.contrast`, `warm`: warm things by local contrast, and animals as F finds them; `shape`:
  which of them are animals.
- `wildlab.detection.floating`: whatever floats on a homogeneous sea, by its edges (H 4.3); `centres`: where
  the centre of a region is, also of one that the border of the image cuts (H 4.5 to 4.7).
- `wildlab.detection.colour`: something of one colour in a colour image (H 4.4.2); `boards`: what calibrates;
  `flow`: the same features in two images (H 5.4).

>>> import numpy as np
>>> from wildlab.detection.contrast import find_by_contrast
>>> image = np.random.default_rng(1).normal(100, 2, (120, 160))
>>> image[60:66, 40:50] += 40
>>> print(len(find_by_contrast(image, np.ones((120, 160), bool))))
1
"""
