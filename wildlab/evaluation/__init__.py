"""Evaluation against the truth: errors of positions, tracks and sets of tracks, and consistency of filters.

Errors of estimates are truth minus estimate (H 3.11), metres, m/s and radians, north before east in n; N of
them are (N, n), their covariances (N, n, n) or (n, n) for all, and a row of NaN is one that is not known.
NEES and NIS are not divided by their degrees of freedom. H is H. H. Helgesen, Detection and Tracking of
Floating Objects using UAVs with Optical Sensors, doctoral thesis, NTNU 2019.

- `nees`, `nis`, `average`, `chi_square_interval`: is a filter consistent?
- `innovation_whiteness`, `autocorrelation`, `effective_sample_size`: are its innovations white?
- `track_errors.track_errors`, `summarise_track`: how far is a track from the truth?
- `ospa`, `gospa`: how far is a set of tracks? `compare_identities`: who follows whom, how long, and how well.
- `estimate_position_noise`: how rough is the truth itself?
- `mean_interval`, `mean_share_interval`, `share_interval`: what do so many independent runs say?
- `summarise`, `scatter_by_image`, `bootstrap_interval`, `estimate_pose_noise`: single positions, and why they
  err; `time_blocks`, `block_mean`, `compare_halves`: in blocks in time order.
- `held_out`, `gain_of`, `rank_models`: which constant error is behind them, `estimate_wander`: against noise
  that is correlated in time; `split_along`; `find_outliers`.
- `judge_ellipses`, `try_averaging`, `spread_of_sightings`, `ambiguous`: what they are worth.
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.evaluation.ambiguity import ambiguous, largest_visible
    from wildlab.evaluation.axes import AlongAxis, split_along
    from wildlab.evaluation.blocks import (
        Halves,
        Neighbours,
        block_mean,
        compare_halves,
        compare_neighbours,
        time_blocks,
    )
    from wildlab.evaluation.causes import Gain, Linear, Ranked, gain_of, held_out, rank_models
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
    from wildlab.evaluation.correlated_errors import WanderNoise, estimate_wander
    from wildlab.evaluation.ellipses import EllipseVerdict, judge_ellipses
    from wildlab.evaluation.errors import (
        ErrorSummary,
        Scatter,
        bootstrap_interval,
        scatter_by_image,
        summarise,
    )
    from wildlab.evaluation.identities import Identities, Moment, compare_identities, scan_gospa
    from wildlab.evaluation.outliers import Outlier, find_outliers
    from wildlab.evaluation.pose_noise import PoseNoise, estimate_pose_noise
    from wildlab.evaluation.position_noise import estimate_position_noise
    from wildlab.evaluation.runs import Interval, mean_interval, mean_share_interval, share_interval
    from wildlab.evaluation.sets import Gospa, Ospa, gospa, ospa
    from wildlab.evaluation.sightings import Averaged, Spread, spread_of_sightings, try_averaging
    from wildlab.evaluation.track_errors import TrackErrors, TrackSummary, summarise_track
    from wildlab.evaluation.whiteness import (
        Whiteness,
        autocorrelation,
        effective_sample_size,
        innovation_whiteness,
        portmanteau,
        white_bound,
    )
else:
    __getattr__, __dir__ = offer(__name__)

__all__ = [
    "ERROR_CONVENTION",
    "AlongAxis",
    "Average",
    "Averaged",
    "EllipseVerdict",
    "ErrorSummary",
    "Gain",
    "Gospa",
    "Halves",
    "Identities",
    "Interval",
    "Linear",
    "Moment",
    "Neighbours",
    "Ospa",
    "Outlier",
    "PoseNoise",
    "Ranked",
    "Scatter",
    "Spread",
    "TrackErrors",
    "TrackSummary",
    "WanderNoise",
    "Whiteness",
    "ambiguous",
    "autocorrelation",
    "average",
    "block_mean",
    "bootstrap_interval",
    "chi_square_interval",
    "compare_halves",
    "compare_identities",
    "compare_neighbours",
    "effective_sample_size",
    "estimate_pose_noise",
    "estimate_position_noise",
    "estimate_wander",
    "find_outliers",
    "gain_of",
    "gospa",
    "held_out",
    "innovation_whiteness",
    "judge_ellipses",
    "largest_visible",
    "mean_interval",
    "mean_share_interval",
    "nees",
    "nis",
    "ospa",
    "portmanteau",
    "position_nees",
    "rank_models",
    "scan_gospa",
    "scatter_by_image",
    "share_inside",
    "share_interval",
    "split_along",
    "spread_of_sightings",
    "summarise",
    "summarise_track",
    "time_blocks",
    "try_averaging",
    "white_bound",
    "whiten",
]
