"""Several targets at once: which measurement is whose, and when a track begins and ends.

A matrix of distances has a row for each measurement and a column for each track, H (3.10).

- `global_nearest`, `nearest`: firm association. `feature_distances`, `with_features`, `veto`: by what targets
  look like.
- `pair_scans`, `judge_start`, `outlived`: the life of a track.
"""

from wildlab.tracking.many.assignment import Assignment, global_nearest, nearest
from wildlab.tracking.many.features import feature_distances, image_features, veto, with_features
from wildlab.tracking.many.life import CONFIRMED, DROPPED, UNDECIDED, judge_start, outlived, pair_scans

__all__ = [
    "CONFIRMED",
    "DROPPED",
    "UNDECIDED",
    "Assignment",
    "feature_distances",
    "global_nearest",
    "image_features",
    "judge_start",
    "nearest",
    "outlived",
    "pair_scans",
    "veto",
    "with_features",
]
