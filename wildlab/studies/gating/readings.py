"""How H 6.4.3 can be read where it does not say what updates the track, and what in it speaks for each."""

from __future__ import annotations

from typing import NamedTuple

from wildlab.studies.gating.monte_carlo import Choices


class Reading(NamedTuple):
    """One way to read H 6.4.3: what it is called and does, and what in the text speaks for and against it.

    ``short`` stands in tables and legends; ``role`` says what it is here for.
    """

    short: str
    role: str
    choices: Choices
    speaks_for: str
    speaks_against: str


#: The reading that is compared with the print and that decides the claims.
DEFAULT = "own"
#: The one that shows what mistakes do to a tracker that believes them.
STRESS = "assigned"

READINGS = {
    "own": Reading(
        "its own measurement",
        "compared with the print",
        Choices(updated_with="own"),
        "H asks which of two measurements belongs to the main object and judges the answer, image by image, "
        "as right or wrong; nothing is said of what the answer does to the track. Mistakes are put down to "
        "outliers of single images.",
        "The measurement with the smaller distance is said to be assigned to the main target.",
    ),
    "assigned": Reading(
        "what was assigned",
        "stress test",
        Choices(updated_with="assigned"),
        "The measurement with the smaller distance is said to be assigned to the main target, and a tracker "
        "that knows no better is updated with it.",
        "Then a mistake leads to further ones, of which H says nothing.",
    ),
    "angles": Reading(
        "its own, angles where angles gate",
        "beside it",
        Choices(updated_with="own", angles_update="angles"),
        "Table 6.5 gives each association method a measurement noise, the angles too, as if each had a "
        "filter of its own. No sentence says so.",
        "H 6.3.2: pixels are used in the update, and angles can be used for gating.",
    ),
}  # fmt: skip


def subject(reading: str, gate: str) -> str:
    """Under what name a gate's numbers by a reading are recorded; by the default reading it is the gate's."""
    name = "pixels-and-angles" if gate == "both" else gate
    return name if reading == DEFAULT else f"{name}/updated-with-{reading}"
