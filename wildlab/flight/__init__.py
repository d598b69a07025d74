"""What a flight is: a folder with manifest and tables; import from raw files, checks, public data.

Frame ``n`` is north-east-down about the origin of the manifest, metres; attitudes are quaternions ``q_w`` to
``q_z`` that take a vector from ``b`` to ``n``; times are seconds of flight time (`gnss_times` and
`frame_times` take clocks off). Tables are DataFrames with one row for each sample, and their columns say
their units (`TABLES`, `NAV`); arrays made of them are (N, 3) positions, (N, 3, 3) rotations and (N, 6, 6)
covariances of position (m, in n) and attitude (rad, in b).
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.flight.catalog import fetch, is_fetched, read_catalog
    from wildlab.flight.checks.check import Use, check_flight, usable_for
    from wildlab.flight.checks.findings import Finding
    from wildlab.flight.clocks import (
        covariance_columns,
        covariances,
        frame_poses,
        frame_times,
        gimbal_angles,
        gnss_times,
        poses_at,
        truth_at,
    )
    from wildlab.flight.importing import import_flight
    from wildlab.flight.manifest import Manifest, make_manifest, manifest_toml, replace_in_manifest
    from wildlab.flight.schema import NAV, TABLES, conform
    from wildlab.flight.store import Flight, load_flight, save_flight
else:
    __getattr__, __dir__ = offer(__name__, folders=("checks", "readers", "terrain"))

__all__ = [
    "NAV",
    "TABLES",
    "Finding",
    "Flight",
    "Manifest",
    "Use",
    "check_flight",
    "conform",
    "covariance_columns",
    "covariances",
    "fetch",
    "frame_poses",
    "frame_times",
    "gimbal_angles",
    "gnss_times",
    "import_flight",
    "is_fetched",
    "load_flight",
    "make_manifest",
    "manifest_toml",
    "poses_at",
    "read_catalog",
    "replace_in_manifest",
    "save_flight",
    "truth_at",
    "usable_for",
]
