"""Images of a flight in the folders below one, as cameras put them: DCIM/100CANON, DCIM/101CANON."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from wildlab.errors import WildlabError
from wildlab.flight.files import printable
from wildlab.flight.readers.frames.image import SUFFIXES


def images_below(folder: Path, ids: Collection[str]) -> list[Path]:
    """Images in the folders below a folder that are frames of a flight, in the order of their paths.

    Parameters
    ----------
    folder
        As ``DCIM``; links and hidden folders in it are not followed.
    ids
        What the flight calls its frames: names of files, with or without their endings.

    Returns
    -------
    list of Path
        Empty where no image there is one of these.

    Raises
    ------
    WildlabError
        Where two files in different folders have one name: which of them is meant nobody says.
    """
    wanted = {str(one) for one in ids}
    stems = {Path(one).stem for one in wanted}
    found: dict[str, Path] = {}
    for here, folders, files in os.walk(folder):
        folders[:] = sorted(one for one in folders if not one.startswith("."))
        for name in sorted(files):
            path = Path(here) / name
            if path.suffix.lower() not in SUFFIXES or (name not in wanted and path.stem not in stems):
                continue
            if name in found:
                both = [printable(one.parent.relative_to(folder).as_posix()) for one in (found[name], path)]
                raise WildlabError(
                    f"{printable(name)}, a frame of the flight, is in {both[0]} and in {both[1]}",
                    f"name the folder that the flight has its images from: {both[0]} or {both[1]} in it",
                    file=folder,
                    field="--images",
                )
            found[name] = path
    return sorted(found.values())
