"""Several targets at once: which measurement is whose, whether a target is there, and how large it is.

A matrix of distances has a row for each measurement and a column for each track, H (3.10).

- `run_many`: all targets of all sensors, by joint probabilities with existence, visibility and hulls (H 8.2).
- `smooth_many`: back over all tracks once the flight is over.
- `association_probabilities`, `belief_propagation`: which measurement is probably whose.
- `global_nearest`: firm association. `feature_distances`: by what targets look like.
- `run_bank`: a bank of filters on positions, with these.
"""

from wildlab.tracking.association import (
    Appearance,
    Assignment,
    association_probabilities,
    belief_propagation,
    feature_distances,
    global_nearest,
    image_features,
)
from wildlab.tracking.many.bank import Bank, Looks, Tuning, run_bank
from wildlab.tracking.many.run import Shown, follow_many, run_many, smooth_many
from wildlab.tracking.many.target_model import (
    POINT,
    Hull,
    ManySensorModel,
    ManyTargetModel,
    Scan,
    own_lasting,
)

__all__ = [
    "POINT",
    "Appearance",
    "Assignment",
    "Bank",
    "Hull",
    "Looks",
    "ManySensorModel",
    "ManyTargetModel",
    "Scan",
    "Shown",
    "Tuning",
    "association_probabilities",
    "belief_propagation",
    "feature_distances",
    "follow_many",
    "global_nearest",
    "image_features",
    "own_lasting",
    "run_bank",
    "run_many",
    "smooth_many",
]
