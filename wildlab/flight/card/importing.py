"""A card becomes a flight: what was found, its roles, the recipe beside the flight, and the flight itself.

The recipe is text that a user can read and change.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.card.proposal import Proposal, Wishes
from wildlab.flight.card.roles import OTHER, choose_roles, search, source_folder
from wildlab.flight.files import is_safe_name, printable
from wildlab.flight.manifest_parts import TerrainSays
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
