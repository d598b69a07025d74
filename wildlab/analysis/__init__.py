"""Where flights meet algorithms: flight in, tables out. Thin; what notebooks and commands call.

Positions are metres north, east and down from the flight's origin (frame ``n``), attitudes take a vector from
``b`` to ``n``, times are flight time, s. Ground points are (N, 2) or (N, 3) with covariances (N, 2, 2) in
m^2; pixels (N, 2) right and down; poses have covariances (N, 6, 6), position (m, in n) before attitude (rad,
in b). Errors of points are point minus truth; those of tracks and poses truth minus estimate, H (3.11).

Of each subject its file has more: `wildlab.analysis.georeference.georeference` (which has its file's name, so
that it is not repeated here), `diagnose` (likewise), `navigation_errors` (against a reference),
`following` (targets by any sensor: what `wildlab track` does).
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.analysis.accuracy import Accuracy, judge_accuracy
    from wildlab.analysis.calibrate import Calibrated, calibrate_flight
    from wildlab.analysis.evaluate import errors_of, recorded_answers, score_points, unlabelled_programs
    from wildlab.analysis.georeference import (
        USUAL,
        Observations,
        covariances_of,
        observe,
        pose_errors,
        truth_of,
    )
    from wildlab.analysis.learn import Applied, apply_learnt, corrected_flight, learn_flight
    from wildlab.analysis.navigate import (
        PUBLISHED_LIKE,
        MekfTuning,
        Navigated,
        navigate_mekf,
        navigate_observer,
    )
    from wildlab.analysis.navigation_errors import (
        NavigationErrors,
        Series,
        errors_against,
        mean_of_runs,
        navigation_series,
        worth,
    )
    from wildlab.analysis.receiver import Placement, Receiver, place_receiver, receiver_noise
    from wildlab.analysis.repeats import Repeats, judge_repeats
    from wildlab.analysis.tracks.sighting import (
        CvTuning,
        Scored,
        Sighting,
        evaluate_measurements,
        evaluate_track,
        follow_pixels,
        follow_positions,
        follow_schmidt,
        sighting,
    )
else:
    __getattr__, __dir__ = offer(__name__)

__all__ = [
    "PUBLISHED_LIKE",
    "USUAL",
    "Accuracy",
    "Applied",
    "Calibrated",
    "CvTuning",
    "MekfTuning",
    "Navigated",
    "NavigationErrors",
    "Observations",
    "Placement",
    "Receiver",
    "Repeats",
    "Scored",
    "Series",
    "Sighting",
    "apply_learnt",
    "calibrate_flight",
    "corrected_flight",
    "covariances_of",
    "errors_against",
    "errors_of",
    "evaluate_measurements",
    "evaluate_track",
    "follow_pixels",
    "follow_positions",
    "follow_schmidt",
    "judge_accuracy",
    "judge_repeats",
    "learn_flight",
    "mean_of_runs",
    "navigate_mekf",
    "navigate_observer",
    "navigation_series",
    "observe",
    "place_receiver",
    "pose_errors",
    "receiver_noise",
    "recorded_answers",
    "score_points",
    "sighting",
    "truth_of",
    "unlabelled_programs",
    "worth",
]
