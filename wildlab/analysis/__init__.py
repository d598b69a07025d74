"""Where flights meet algorithms: flight in, tables out. Thin; what notebooks and commands call.

Positions are metres north, east and down from the flight's origin (frame ``n``), attitudes take a vector from
``b`` to ``n``, times are flight time, s. Ground points are (N, 2) or (N, 3) with covariances (N, 2, 2) in
m^2; pixels (N, 2) right and down; poses have covariances (N, 6, 6), position (m, in n) before attitude (rad,
in b). Errors of points are point minus truth; those of tracks and poses truth minus estimate, H (3.11).
"""
