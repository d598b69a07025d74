"""Several targets at once: which measurement is whose, whether a target is there, and how large it is.

A matrix of distances has a row for each measurement and a column for each track, H (3.10).

- `run_many`: all targets of all sensors, by joint probabilities with existence, visibility and hulls (H 8.2).
- `smooth_many`: back over all tracks once the flight is over.
- `association_probabilities`, `belief_propagation`: which measurement is probably whose.
- `global_nearest`: firm association.
"""

from wildlab.tracking.association import (
    Assignment,
    association_probabilities,
    belief_propagation,
    global_nearest,
)
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
    "Assignment",
    "Hull",
    "ManySensorModel",
    "ManyTargetModel",
    "Scan",
    "Shown",
    "association_probabilities",
    "belief_propagation",
    "follow_many",
    "global_nearest",
    "own_lasting",
    "run_many",
    "smooth_many",
]
