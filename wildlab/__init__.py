"""wildlab: a reproducible offline analysis and reporting workbench for UAV surveillance flights.

A dozen functions for a notebook: `simulate`, `load_flight`, `save_flight`, `import_flight`, `check`,
`navigate`, `georeference`, `evaluate_points`, `track`, `consistency`, `plot`. Each gives a small result that
prints in a few lines and names no place. They are imported when they are asked for, and so are the rooms
(`wildlab.geometry`, `wildlab.tracking`, ...), in which everything else is.

Units are SI and radians, and where a name ends in a unit (``north_m``, ``yaw_deg``), that one. Frames: ``n``
north-east-down with a fixed origin, ``b`` body (forward, right, down), ``c`` camera (right and down in the
image, out of the lens); ``R_nb`` takes a vector from b to n. Errors of tracks and poses are truth minus
estimate, H (3.11).

H is the doctoral thesis of H. H. Helgesen (NTNU, 2019), F the master's thesis of A. Flodell and
C. Christensson (Linköping University, 2016); "H (7.35)" is an equation, "H 7.4" a section.
``docs/references.md`` has both in full, and every other text that is cited.
"""

import sys
from typing import TYPE_CHECKING

from wildlab.errors import WildlabError
from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.api.flights import check, evaluate_points, georeference, simulate
    from wildlab.api.plot import plot
    from wildlab.api.tracks import consistency, navigate, track
    from wildlab.flight.importing import import_flight
    from wildlab.flight.store import Flight, load_flight, save_flight
else:
    __getattr__, __dir__ = offer(
        __name__,
        folders=(
            *("geometry", "flight", "navigation", "tracking", "simulation", "evaluation", "analysis"),
            *("reporting", "studies"),
        ),
    )

# Notebooks are checked with jsonschema, which builds a grammar of internationalised addresses when it is
# imported: seconds in every process that reads or shows a notebook, whose schema has no such address.
# jsonschema does without the package where it is not installed.
sys.modules.setdefault("rfc3987_syntax", None)  # type: ignore[arg-type]

__version__ = "0.2.0"

__all__ = [
    "Flight",
    "WildlabError",
    "check",
    "consistency",
    "evaluate_points",
    "georeference",
    "import_flight",
    "load_flight",
    "navigate",
    "plot",
    "save_flight",
    "simulate",
    "track",
]
