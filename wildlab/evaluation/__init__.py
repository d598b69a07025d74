"""Evaluation against the truth: errors of positions, tracks and sets of tracks, and consistency of filters.

Errors of estimates are truth minus estimate (H 3.11), metres, m/s and radians, north before east in n; N of
them are (N, n), their covariances (N, n, n) or (n, n) for all, and a row of NaN is one that is not known.
NEES and NIS are not divided by their degrees of freedom. H is H. H. Helgesen, Detection and Tracking of
Floating Objects using UAVs with Optical Sensors, doctoral thesis, NTNU 2019.

- `nees`, `nis`, `average`, `chi_square_interval`: is a filter consistent?
- `innovation_whiteness`, `autocorrelation`, `effective_sample_size`: are its innovations white?
- `track_errors.track_errors`, `summarise_track`: how far is a track from the truth?
- `ospa`, `gospa`: how far is a set of tracks?
- `mean_interval`, `share_interval`: what do so many independent runs say?
- `summarise`, `scatter_by_image`, `bootstrap_interval`, `estimate_pose_noise`: single positions, and why they
  err.
"""

from wildlab.evaluation.consistency import (
    ERROR_CONVENTION,
    Average,
    average,
    chi_square_interval,
    nees,
    nis,
    position_nees,
    share_inside,
    whiten,
)
from wildlab.evaluation.errors import (
    ErrorSummary,
    Scatter,
    bootstrap_interval,
    scatter_by_image,
    summarise,
)
from wildlab.evaluation.pose_noise import PoseNoise, estimate_pose_noise
from wildlab.evaluation.runs import Interval, mean_interval, share_interval
from wildlab.evaluation.sets import Gospa, Ospa, gospa, ospa
from wildlab.evaluation.track_errors import TrackErrors, TrackSummary, summarise_track
from wildlab.evaluation.whiteness import (
    Whiteness,
    autocorrelation,
    effective_sample_size,
    innovation_whiteness,
    portmanteau,
    white_bound,
)

__all__ = [
    "ERROR_CONVENTION",
    "Average",
    "ErrorSummary",
    "Gospa",
    "Interval",
    "Ospa",
    "PoseNoise",
    "Scatter",
    "TrackErrors",
    "TrackSummary",
    "Whiteness",
    "autocorrelation",
    "average",
    "bootstrap_interval",
    "chi_square_interval",
    "effective_sample_size",
    "estimate_pose_noise",
    "gospa",
    "innovation_whiteness",
    "mean_interval",
    "nees",
    "nis",
    "ospa",
    "portmanteau",
    "position_nees",
    "scatter_by_image",
    "share_inside",
    "share_interval",
    "summarise",
    "summarise_track",
    "white_bound",
    "whiten",
]
