"""Evaluation against the truth: errors of positions, tracks and sets of tracks, and consistency of filters.

Errors of estimates are truth minus estimate (H 3.11), metres, m/s and radians, north before east in n; N of
them are (N, n), their covariances (N, n, n) or (n, n) for all, and a row of NaN is one that is not known.
NEES and NIS are not divided by their degrees of freedom. H is H. H. Helgesen, Detection and Tracking of
Floating Objects using UAVs with Optical Sensors, doctoral thesis, NTNU 2019.

- `nees`, `nis`, `average`, `chi_square_interval`: is a filter consistent?
- `innovation_whiteness`, `autocorrelation`, `effective_sample_size`: are its innovations white?
- `track_errors`, `summarise_track`: how far is a track from the truth?
- `gospa`: how far is a set of tracks? `compare_identities`: who follows whom, how long, and how well.
- `estimate_position_noise`: how rough is the truth itself?
- `mean_interval`, `mean_share_interval`, `share_interval`: what do so many independent runs say?
- `summarise`, `scatter_by_image`, `bootstrap_interval`: single positions, and why they err;
  `time_blocks`, `block_mean`: in blocks in time order.
- `held_out`, `gain_of`, `rank_models`: which constant error is behind them, `estimate_wander`: against noise
  that is correlated in time; `split_along`; `find_outliers`.
- `judge_ellipses`, `spread_of_sightings`: what they are worth.
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.evaluation.causes import Gain, Linear, Ranked, gain_of, held_out, rank_models
    from wildlab.evaluation.consistency import (
        ERROR_CONVENTION,
        Average,
        Whiteness,
        autocorrelation,
        average,
        chi_square_interval,
        effective_sample_size,
        innovation_whiteness,
        nees,
        nis,
        portmanteau,
        position_nees,
        share_inside,
        white_bound,
        whiten,
    )
    from wildlab.evaluation.correlated_errors import WanderNoise, estimate_wander
    from wildlab.evaluation.ellipses import (
        EllipseVerdict,
        Spread,
        judge_ellipses,
        spread_of_sightings,
    )
    from wildlab.evaluation.errors import (
        AlongAxis,
        ErrorSummary,
        Scatter,
        TrackErrors,
        TrackSummary,
        bootstrap_interval,
        scatter_by_image,
        split_along,
        summarise,
        summarise_track,
    )
    from wildlab.evaluation.identities import Gospa, Identities, Moment, compare_identities, gospa
    from wildlab.evaluation.intervals import (
        Interval,
        block_mean,
        mean_interval,
        mean_share_interval,
        share_interval,
        time_blocks,
    )
    from wildlab.evaluation.outliers import Outlier, find_outliers, largest_visible
    from wildlab.evaluation.pose_noise import estimate_position_noise
else:
    __getattr__, __dir__ = offer(__name__)

__all__ = [
    "ERROR_CONVENTION",
    "AlongAxis",
    "Average",
    "EllipseVerdict",
    "ErrorSummary",
    "Gain",
    "Gospa",
    "Identities",
    "Interval",
    "Linear",
    "Moment",
    "Outlier",
    "Ranked",
    "Scatter",
    "Spread",
    "TrackErrors",
    "TrackSummary",
    "WanderNoise",
    "Whiteness",
    "autocorrelation",
    "average",
    "block_mean",
    "bootstrap_interval",
    "chi_square_interval",
    "compare_identities",
    "effective_sample_size",
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
    "portmanteau",
    "position_nees",
    "rank_models",
    "scatter_by_image",
    "share_inside",
    "share_interval",
    "split_along",
    "spread_of_sightings",
    "summarise",
    "summarise_track",
    "time_blocks",
    "white_bound",
    "whiten",
]
