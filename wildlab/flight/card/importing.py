"""A card becomes a flight: what was found, its roles, the recipe beside the flight, and the flight itself.

The recipe is text that a user can read and change.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.card.images import one_camera
from wildlab.flight.card.proposal import (
    Proposal,
    Sources,
    Wishes,
    add_frames,
    add_poses,
    add_satellites,
    add_seen,
    add_targets,
    add_vehicle,
    angles,
    uncertainty_of,
)
from wildlab.flight.card.roles import OTHER, CardItem, Choice, choose_roles, search, source_folder
from wildlab.flight.files import is_safe_name, printable
from wildlab.flight.manifest_parts import TerrainSays
from wildlab.flight.readers.log import Stream
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import Flight


@dataclass(frozen=True)
class Card:
    """What was found and chosen. ``source`` is the folder that all names are below."""

    source: Path
    choices: list[Choice]
    proposal: Proposal

    @property
    def recipe(self) -> str:
        """As TOML."""
        return self.proposal.text(self.choices)


def read_card(
    paths: Sequence[Path],
    wishes: Wishes,
    roles: Mapping[str, str],
    tell: Callable[[str], None] = lambda name: None,
) -> Card:
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
    Card

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
        return Card(source, choices, propose(choices, wishes))
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
    card: Card,
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
        fix = "choose another folder, or replace both (--overwrite)"
        raise WildlabError("there is a recipe beside this flight already", fix, file=beside)
    with tempfile.TemporaryDirectory(prefix="wildlab-") as folder:
        path = Path(folder) / beside.name
        path.write_text(card.recipe, encoding="utf-8")
        flight = import_flight(path, card.source, into, overwrite, calibration, terrain)
    write_atomic(beside, card.recipe.encode("utf-8"))
    return flight


# -- the recipe


def propose(choices: Sequence[Choice], wishes: Wishes) -> Proposal:
    """A recipe of a flight.

    Parameters
    ----------
    choices
        From `roles.choose_roles`.
    wishes
        What the user states.

    Returns
    -------
    Proposal

    Raises
    ------
    WildlabError
        Where nothing says where a camera was, no time is known, or heights cannot be brought together.
    """
    by_role: dict[str, list[Choice]] = {}
    for one in choices:
        by_role.setdefault(one.role, []).append(one)
    _refuse_without_zone(choices)
    own, camera, receiver = (_only(by_role, role) for role in ("own", "camera", "receiver"))
    triggers, clicks = _only(by_role, "triggers"), by_role.get("clicks", [])
    images = _most_images(by_role.get("images", []))
    proposal = Proposal({"name": wishes.name})
    for taken in (own, camera, receiver, triggers):
        for one in by_role.get(taken.role, ()) if taken is not None else ():
            if taken is not None and one is not taken:
                left = f"{one.item.shown} is left out: {taken.item.shown} has more rows, and a flight has one"
                proposal.notes.append(f"{left} of that role ({one.role}).")
    lens: str | None = None
    if images is not None:
        found, lens, said = one_camera(images.item, images.target, wishes.camera)
        images = replace(images, item=found)
        proposal.notes += [said] if said else []
    placed = _placed(images)
    if own is None and camera is None and receiver is None and not placed:
        raise WildlabError(
            "nothing here says where a camera was",
            "name the log of the flight (--role FILE=own), or write a recipe (data/recipes/README.md)",
        )
    streams = _streams(own, camera, receiver, images, by_role)
    aboard = {one.item.name for one in (own, camera, receiver, images) if one is not None}
    sources = Sources(wishes, streams, [key for key in streams if key[0] in aboard])
    proposal.notes += sources.heights.notes
    vehicle = own.item.log.vehicle if own is not None and own.item.log is not None else ""
    data = proposal.data
    data["description"] = f"Logged by {vehicle}." if vehicle else ""
    data["locations"] = {"sensitivity": "withheld"}
    data["platform"] = {"name": vehicle or "not stated"}
    data["vertical"] = {"reference": sources.heights.reference, "note": " ".join(sources.heights.notes)}
    data["time"] = {"kind": "utc"} | ({"epoch": wishes.start} if wishes.start is not None else {})
    if own is not None:
        add_vehicle(proposal, sources, own, "vehicle", receiver is None)
    if receiver is not None:
        add_satellites(proposal, sources, receiver, "receiver")
    if camera is not None:
        add_poses(proposal, sources, camera, "camera")
    if images is not None:
        add_frames(proposal, sources, images, lens, own, triggers, by_role, placed)
    _mount(proposal, camera is not None or "camera" in data.get("poses", {}))
    add_targets(proposal, sources, by_role)
    add_seen(proposal, sources, clicks, images, by_role)
    _uncertainty(proposal, streams)
    data["logs"] = sources.logs
    if "poses" not in data and "gnss" not in data:
        left_out = [one for one in proposal.notes if one.startswith("The images are left out")]
        because = f" ({left_out[0]})" if left_out else ""
        raise WildlabError(
            f"nothing here says where a camera was{because}",
            "add the log of the flight (--role FILE=own)",
        )
    order = (
        "name",
        "description",
        "locations",
        "platform",
        "camera",
        "mount",
        "time",
        "clocks",
        "vertical",
        "uncertainty",
        "logs",
    )
    proposal.data = {key: data[key] for key in order if key in data} | data
    return proposal


def _refuse_without_zone(choices: Sequence[Choice]) -> None:
    """A log whose clock states no zone may be the vehicle's own: none without an attitude takes its place."""
    if any(one.role == "own" and one.item.part("poses") is not None for one in choices):
        return
    for one in choices:
        if one.role == "nothing" and "without a zone" in one.why:
            raise WildlabError(
                f"the clock of {one.item.shown} is local time, and nothing says its zone",
                "state it, as --zone Europe/Oslo or --zone +02:00; or leave the file out, as "
                f"--role {one.item.name}=nothing",
                field="--zone",
            )


def _only(by_role: Mapping[str, Sequence[Choice]], role: str) -> Choice | None:
    """The one thing of a role that only one can have; of several the one with the most rows."""
    several = by_role.get(role, ())
    return max(several, key=lambda one: _rows(one.item), default=None)


def _rows(found: CardItem) -> int:
    return sum(int(one.used.sum()) for one in found.log.parts.values()) if found.log is not None else 0


def _most_images(several: Sequence[Choice]) -> Choice | None:
    usable = [one for one in several if one.item.log is not None and "photos" in one.item.log.parts]
    return max(usable, key=lambda one: _rows(one.item), default=None)


def _placed(images: Choice | None) -> bool:
    """Whether the images say where the camera was and how it was turned."""
    photos = None if images is None else images.item.part("photos")
    if photos is None or "latitude_deg" not in photos.columns or not photos.used.any():
        return False
    return angles(photos) is not None


def _streams(
    own: Choice | None,
    camera: Choice | None,
    receiver: Choice | None,
    images: Choice | None,
    by_role: Mapping[str, Sequence[Choice]],
) -> dict[tuple[str, str], Stream]:
    """Every part with heights that the flight will use, by the name of its file and its own."""
    wanted = [(one, part) for one in (own, camera) if one is not None for part in ("poses", "gnss")]
    wanted += [(one, "gnss") for one in (receiver,) if one is not None]
    wanted += [(one, "photos") for one in (images,) if one is not None]
    wanted += [(one, part) for one in by_role.get("target", ()) for part in ("gnss", "poses")]
    wanted += [(one, "marks") for one in by_role.get("marks", ())]
    found = {}
    for one, part in wanted:
        stream = one.item.part(part)
        if stream is not None and "latitude_deg" in stream.columns and stream.used.any():
            found[one.item.name, part] = stream
    return found


def _uncertainty(proposal: Proposal, streams: Mapping[tuple[str, str], Stream]) -> None:
    """How good poses are, where not each of them says so itself."""
    poses = proposal.data.get("poses", {})
    if any("spreads" not in one for one in poses.values()):
        assumed, said = uncertainty_of(streams)
        proposal.data["uncertainty"] = assumed | proposal.data.get("uncertainty", {})
        proposal.notes.append(said)
    if "imu" in proposal.data:
        proposal.notes.append("[imu] assumes an inertial sensor typical of autopilots.")


def _mount(proposal: Proposal, camera: bool) -> None:
    """Which way the camera looks: along its own poses where there are any, else down."""
    if "frames" not in proposal.data:
        return
    if camera:
        poses = list(proposal.data.get("poses", {}))
        own = {"poses": "camera"} if "camera" in poses and len(poses) > 1 else {}
        proposal.data["mount"] = own | {"looks": "forward"}
        others = [name for name in poses if name != "camera"]
        proposal.notes.append(
            f"[mount] is that of the camera's own poses (--source camera); images are not used with "
            f"{', '.join(others)}."
            if own
            else "The poses are those of the camera itself: its lens points along them."
        )
    elif "gimbal" not in proposal.data:
        proposal.data["mount"] = {"looks": "down"}
        proposal.notes.append(
            "The camera is taken to look straight down, the top of its images forward: change [mount] where "
            "that is wrong."
        )


def safe_name(text: str) -> str:
    """A flight's name out of a folder's."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-_")[:100]
    return name if is_safe_name(name) else "flight"
