"""What a flight is: a folder with manifest and tables; import from raw files, checks, public data.

Frame ``n`` is north-east-down about the origin of the manifest, metres; attitudes are quaternions ``q_w`` to
``q_z`` that take a vector from ``b`` to ``n``; times are seconds of flight time (`gnss_times` and
`frame_times` take clocks off). Tables are DataFrames with one row for each sample, and their columns say
their units (`TABLES`, `NAV`); arrays made of them are (N, 3) positions, (N, 3, 3) rotations and (N, 6, 6)
covariances of position (m, in n) and attitude (rad, in b).
"""
