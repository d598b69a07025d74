"""From numbers to one offline page: the report, its figures, metrics, and the ledger. It starts no process.

Figures are matplotlib's, apart from pyplot's state; their maps are in metres, east to the right and north up.
Metrics carry their unit beside them (``"m"``, ``"deg"``, ``"1"``), angles in degrees, since people read them.
What is shown is escaped, and a page that could ask the network for something is not written.
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.reporting.figures import (
        colour,
        ellipse,
        log_band,
        map_axes,
        new_figure,
        png_bytes,
        save_figure,
        with_alt,
    )
    from wildlab.reporting.metrics import claim, metric, read_metrics
    from wildlab.reporting.published import load_claims, load_published
    from wildlab.reporting.report import Report, open_report
else:
    __getattr__, __dir__ = offer(__name__, folders=("charts",))

__all__ = [
    "Report",
    "claim",
    "colour",
    "ellipse",
    "load_claims",
    "load_published",
    "log_band",
    "map_axes",
    "metric",
    "new_figure",
    "open_report",
    "png_bytes",
    "read_metrics",
    "save_figure",
    "with_alt",
]
