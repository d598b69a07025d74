"""Flights as plain values, for the tests of the page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from wildlab.analysis.verdict import Gain
from wildlab.reporting.front_page import OwnFlight, OwnReport
from wildlab.reporting.metrics import metric
from wildlab.sharing.edition import Facts

NAN = math.nan

#: A flight of which all is known, with two things worth fixing.
WHOLE = Facts(
    twin=False, verdict="worth fixing", problems=0, length_s=1510.0, height_m=118.3, area_m2=3.4e5,
    seen=1846.0, things=5.0, placed=1840.0, error_median=3.47, error_p90=9.57, compared=1846, scatter=NAN,
    sightings=0, tracks=5, track_error=4.1, track_sure=0.9, alarms=(), troubles=(("few_satellites", 62.0),),
    gains=(Gain("cause", ("boresight",), 1.9, 4.9, 0.39), Gain("images_without_pose", (), 120, 812, 0.15)),
    possible=None, failed=(),
)  # fmt: skip
#: A flight of which nothing is known.
EMPTY = WHOLE._replace(
    verdict=None, length_s=NAN, height_m=NAN, area_m2=NAN, seen=NAN, things=NAN, placed=NAN, error_median=NAN,
    error_p90=NAN, compared=0, tracks=0, track_error=NAN, track_sure=NAN, troubles=(), gains=(),
)  # fmt: skip

#: Of an overview: nothing is amiss, and one other report is there.
COUNTS = {"problems": 0, "worth_fixing": 0, "troubled": 0, "reports_beside": 1, "broken": 0, "alarmed": 0}


def report(
    about: str, entries: Mapping[tuple[str, str], Mapping[str, Any]] | None = None, state: str = "done"
) -> OwnReport:
    """A report with numbers, each as the keywords of `wildlab.reporting.metrics.metric`."""
    numbers = {key: metric(*key, **{"unit": "1", **values}) for key, values in (entries or {}).items()}
    return OwnReport(f"f-{about}", about, state, "2026-03-14T10:00:00+00:00", numbers, ())


def overview(counts: Mapping[str, int] | None = None, **more: Mapping[str, Any]) -> OwnReport:
    """An overview; ``more`` by ``name__subject``."""
    entries: dict[tuple[str, str], Mapping[str, Any]] = {
        (name, "flight"): {"value": value} for name, value in {**COUNTS, **(counts or {})}.items()
    }
    for key, values in more.items():
        name, _, subject = key.partition("__")
        entries[name, subject or "flight"] = values
    return report("overview", entries)


def flight(*reports: OwnReport, kind: str = "logged") -> OwnFlight:
    return OwnFlight("f", kind, reports)
