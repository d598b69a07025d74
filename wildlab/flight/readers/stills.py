"""Which image files a person names: one by one, or by their folder."""

from __future__ import annotations

from pathlib import Path

from wildlab.errors import WildlabError
from wildlab.flight.readers.frames.image import SUFFIXES


def still_files(paths: list[Path]) -> list[Path]:
    """Image files named one by one, and those in folders (by their ending, in the order of their names).

    Parameters
    ----------
    paths
        Of files and folders.

    Returns
    -------
    list of Path
        Each once.

    Raises
    ------
    WildlabError
        Where a path is not there, or a folder holds none.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(one for one in path.iterdir() if one.suffix.lower() in SUFFIXES and one.is_file())
            if not inside:
                endings = ", ".join(sorted(SUFFIXES))
                raise WildlabError(
                    "there are no images in this folder", f"name one with {endings} files", file=path
                )
            found += inside
        elif path.exists():
            found.append(path)
        else:
            raise WildlabError("there is no such file or folder", "check the path", file=path)
    return list(dict.fromkeys(found))
