"""Detectors: images as arrays in, `wildlab.detection.detections.Detections` out; files are read elsewhere.

An image is (H, W): uint8 grey levels, uint16 counts of the sensor, or floating kelvin; ``valid`` (H, W) says
which pixels show anything. A pixel is a square about its centre, and the centre of the upper left one is
(0, 0), as in OpenCV. H is H. H. Helgesen, Detection and Tracking of Floating Objects using UAVs with Optical
Sensors, doctoral thesis, NTNU 2019.

- `wildlab.detection.floating`: whatever floats on a homogeneous sea, by its edges (H 4.3).
- `wildlab.detection.border`: objects that the border of the image cuts (H 4.7).
- `wildlab.detection.features`: shape of a region, by its moments (H 4.5, 4.6).
"""
