"""What the sender is told, and nobody else: what a copy lacks, and what no copy can hide."""

from __future__ import annotations

from collections.abc import Sequence

from wildlab.sharing.removed import Removed

#: What remains in a copy whatever is done to its numbers, for whoever knows where to look.
REMAINS = (
    "The path has its shape: rows look the same everywhere, but a path along a river, a road or a fence can "
    "be laid on a map of them. So can the tracks of animals.",
    "North is up, and lengths are true: both are what the report is about.",
    "Heights and their changes along a path that follows the ground are those of the ground. Terrain is not "
    "drawn, yet enough of such heights can be laid on an elevation map.",
    "Who has the flight's raw logs, or was there, knows it again by its numbers: a copy hides the place from "
    "strangers, not the flight from those who know it.",
    "Two flights that both name a cell, and are known to be of one place, tell where their cells meet.",
    "What you write around the file (subject, file name, the address it comes from) is not looked at.",
)


def removed_lines(removed: Sequence[Removed]) -> list[str]:
    """One line for each thing: what, what it was, and what stands in its place."""
    return [
        f"{one.what}: {one.was!r} -> {one.now}" if one.was else f"{one.what}: {one.now}" for one in removed
    ]


def sender_list(
    file: str, told: Sequence[tuple[str, Sequence[str]]], notes: Sequence[str], *, generalised: bool
) -> list[str]:
    """The whole list.

    Parameters
    ----------
    file
        Name of the copy.
    told
        Heading and lines for each flight and study.
    notes
        Sentences on the copy as a whole.
    generalised
        Whether there is a place to be hidden in it.

    Returns
    -------
    list of str
    """
    lines = [f"For the sender of {file} alone. Do not send this list: it says what the copy hides.", ""]
    for heading, ones in told:
        lines += [heading, *(f"  {line}" for line in ones), ""]
    if generalised:
        lines += ["What a copy cannot hide", *(f"  {line}" for line in REMAINS), ""]
    if notes:
        lines += ["Also", *(f"  {line}" for line in notes), ""]
    return lines[:-1]
