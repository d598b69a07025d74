"""A card becomes a flight: what was found, its roles, the recipe beside the flight, and the flight itself.

The recipe is text that a user can read and change.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.card.proposal import Proposal, Wishes
from wildlab.flight.card.roles import OTHER, ROLES, Choice, choose_roles, search, source_folder
from wildlab.flight.files import is_safe_name, printable
from wildlab.flight.manifest import TerrainSays
from wildlab.flight.readers.log import Stream
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import Flight


def read_card(
    paths: Sequence[Path],
    wishes: Wishes,
    roles: Mapping[str, str],
    tell: Callable[[str], None] = lambda name: None,
) -> Proposal:
    """Read files and folders, choose what each is for, and write down how a flight is made of them.

    Parameters
    ----------
    paths
        Files and folders: raw logs, folders of images, a whole memory card. Only read.
    wishes
        What the user states.
    roles
        Name of a file below the common folder -> role, see `roles.choose_roles`.
    tell
        Called with the name of each file before it is read.

    Returns
    -------
    Proposal

    Raises
    ------
    WildlabError
        Where nothing of it makes a flight, with the reason.
    """
    source = source_folder(paths)
    found = search(paths, source, wishes.zone, tell)
    if all(one.problem == OTHER for one in found):
        raise WildlabError("nothing in it is a log or an image", "name the folder of the logs", file=source)
    choices = choose_roles(found, roles)
    try:
        return Proposal(source, choices, wishes)
    except WildlabError as error:
        if error.file is not None:
            raise
        seen = "; ".join(f"{one.item.shown}: {one.role} ({printable(one.why)})" for one in choices[:20])
        raise WildlabError(
            f"{error.problem}. Found: {seen}", error.fix, file=source, field=error.field
        ) from None


def recipe_beside(flight: Path) -> Path:
    """Where the recipe of a flight lies: beside its folder."""
    return flight.with_name(f"{flight.name}.recipe.toml")


def import_card(
    card: Proposal,
    into: Path,
    overwrite: bool = False,
    calibration: Path | None = None,
    terrain: TerrainSays | None = None,
) -> Flight:
    """Write a card's flight, and its recipe beside it: both, or neither.

    Parameters
    ----------
    card
        From `read_card`.
    into
        Folder of the flight.
    overwrite
        Whether a flight and a recipe that are there may be replaced.
    calibration, terrain
        As for `import_flight`.

    Returns
    -------
    Flight

    Raises
    ------
    WildlabError
        As `import_flight`; and where there is a recipe already.
    """
    beside = recipe_beside(into)
    if beside.exists() and not overwrite:
        fix = "choose another, or --overwrite"
        raise WildlabError("there is a recipe already", fix, file=beside)
    with tempfile.TemporaryDirectory(prefix="wildlab-") as folder:
        path = Path(folder) / beside.name
        path.write_text(card.recipe, encoding="utf-8")
        flight = import_flight(path, card.source, into, overwrite, calibration, terrain)
    write_atomic(beside, card.recipe.encode("utf-8"))
    return flight


def safe_name(text: str) -> str:
    """A flight's name out of a folder's."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-_")[:100]
    return name if is_safe_name(name) else "flight"


#: Headings of `rows_of`.
HEADINGS = ("file", "format", "begins (UTC)", "lasts", "role")


def rows_of(choices: Sequence[Choice]) -> list[list[str]]:
    """A row for each thing that was found, under `HEADINGS`."""
    return [_row(one) for one in choices if one.item.problem != OTHER]


def _row(choice: Choice) -> list[str]:
    found, role = choice.item, choice.role + (f" {choice.target}" if choice.target else "")
    times = np.concatenate([np.empty(0), *map(_times, [] if found.log is None else found.log.parts.values())])
    begins = lasts = ""
    if len(times):
        begins = datetime.fromtimestamp(float(times.min()), UTC).strftime("%Y-%m-%d %H:%M:%S")
        lasts = f"{np.ptp(times):.0f} s"
    return [found.shown, found.called, begins, lasts, role]


def _times(stream: Stream) -> NDArray[np.float64]:
    values = stream.columns.get("time_s")
    if values is None:
        return np.empty(0)
    used = np.asarray(values[stream.used], float)
    return np.asarray(used[np.isfinite(used)])


def sentences_of(choices: Sequence[Choice]) -> list[str]:
    """What of each thing is not used and why, what was lost, and what its reader noted."""
    notes = []
    others = [one.item.shown for one in choices if one.item.problem == OTHER]
    if others:
        more = f" and {len(others) - 3} more" if len(others) > 3 else ""
        notes.append(f"No logs by their endings, and not looked at: {', '.join(others[:3])}{more}")
    for one in choices:
        log, name = one.item.log, one.item.shown
        own = [f"is not used: {printable(one.why)}"] if one.role == "nothing" or log is None else []
        if one.item.problem == OTHER:
            continue
        if log is not None:
            if not own:
                own = [f"is taken for {ROLES[one.role]}{one.target and f', {one.target}'}: {one.why}"]
            own = [log.vehicle and f"is of {log.vehicle}", *own]
            # An image without a place is one all the same, and its reader says what it lacks.
            own += [
                _unused(part, rows)
                for part, rows in log.parts.items()
                if part != "photos" and not rows.used.all()
            ]
            own += [*log.lost, *log.notes]
        notes += [f"{name}: {printable(text)}" for text in own if text]
    return notes


def _unused(part: str, stream: Stream) -> str:
    reasons = Counter(str(why) for why in stream.columns["why"] if why)
    told = ", ".join(f"{count} {why}" for why, count in reasons.most_common())
    return f"{int((~stream.used).sum())} of {len(stream)} rows of {part} are not used ({told})"
