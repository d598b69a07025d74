"""Evaluation against the truth: errors of positions, tracks and sets of tracks, and consistency of filters.

Errors of estimates are truth minus estimate (H 3.11), metres, m/s and radians, north before east in n; N of
them are (N, n), their covariances (N, n, n) or (n, n) for all, and a row of NaN is one that is not known.
NEES and NIS are not divided by their degrees of freedom. H is H. H. Helgesen, Detection and Tracking of
Floating Objects using UAVs with Optical Sensors, doctoral thesis, NTNU 2019.

- `nees`, `worth_of_errors`, `average`, `chi_square_interval`: is a filter consistent?
- `innovation_whiteness`, `autocorrelation`, `worth`: are its innovations white?
- `track_errors`, `summarise_track`: how far is a track from the truth?
- `gospa`: how far is a set of tracks? `compare_identities`: who follows whom, how long, and how well.
- `estimate_position_noise`: how rough is the truth itself?
- `mean_interval`, `mean_share_interval`, `share_interval`: what do so many independent runs say?
- `summarise`, `bootstrap_interval`: single positions; `time_blocks`, `block_mean`: in blocks in time order.
- `held_out`, `gain_of`, `rank_models`: which constant error is behind them, `estimate_wander`: against noise
  that is correlated in time; `find_outliers`.
- `judge_ellipses`, `spread_of_sightings`: what they are worth.
"""
