"""The one kind of error a user of wildlab sees: a sentence with the fix in it."""

from __future__ import annotations

import errno
import os
from pathlib import Path


class WildlabError(Exception):
    """Unusable input or wrong use.

    Parameters
    ----------
    problem
        What was found, as a clause without a full stop: ``"column 'u_px' is missing"``.
    fix
        What to do about it, as a clause without a full stop: ``"add it or name another in [detections]"``.
    file
        The file concerned, if one is.
    field
        The field, column or option concerned, if one is.
    """

    #: What the command line exits with: 2 is wrong use or unusable input.
    exit_code = 2

    def __init__(
        self,
        problem: str,
        fix: str,
        *,
        file: str | os.PathLike[str] | None = None,
        field: str | None = None,
    ) -> None:
        self.problem = problem
        self.fix = fix
        self.file = os.fspath(file) if file is not None else None
        self.field = field
        where = ", ".join(part for part in (self.file, field) if part)
        sentence = f"{where}: {problem}" if where else f"{problem[:1].upper()}{problem[1:]}"
        super().__init__(f"{sentence}. {fix[:1].upper()}{fix[1:]}.")


def above_zero(**values: float) -> None:
    """Refuse numbers, by their names, that are not finite and above zero."""
    for name, value in values.items():
        if not 0 < value < float("inf"):
            raise WildlabError(f"{value} is not above zero", "give a number above zero", field=name)


class RunFailed(WildlabError):
    """The input was fine and the work was not: a notebook raised, a time limit passed."""

    exit_code = 1


def system_error(
    error: OSError,
    file: str | os.PathLike[str] | None = None,
    field: str | None = None,
    *,
    cannot: str = "be written or read",
) -> WildlabError:
    """What the system said of a file or folder, as a sentence with what to do.

    Parameters
    ----------
    error
        As it was raised.
    file
        What it is about; left out, the file that the error names.
    field
        Who asked for it, for the message.
    cannot
        What was tried.

    Returns
    -------
    WildlabError
        To be raised. A full disk is named by where it is mounted.

    Examples
    --------
    >>> print(system_error(OSError(errno.EROFS, "Read-only file system"), "reports/x.html"))
    reports/x.html: cannot be written or read (Read-only file system). Choose a place that can be written to.
    """
    about = file if file is not None else error.filename
    said = error.strerror or type(error).__name__
    fix = {
        errno.EACCES: "check its permissions, or choose another place",
        errno.EPERM: "check its permissions, or choose another place",
        errno.EROFS: "choose a place that can be written to",
        errno.ENOENT: "check the path: a folder above it is missing, or cannot be written to",
        errno.EEXIST: "a file is where a folder is wanted: move it away, or choose another name",
        errno.ENOTDIR: "a file is where a folder is wanted: move it away, or choose another name",
        errno.EISDIR: "a folder is where a file is wanted: choose another name",
        errno.ENAMETOOLONG: "give it a shorter name",
        errno.ELOOP: "its links go in a circle; give the file itself",
        errno.EIO: "the disk cannot give it back: copy what can be read, and restore the rest",
    }.get(error.errno or 0, "check the path, its permissions and its disk")
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        fix = f"free some space on the disk at {_disk(about)}"
    return WildlabError(f"cannot {cannot} ({said})", fix, file=about, field=field)


def _disk(file: str | bytes | os.PathLike[str] | int | None) -> str:
    """Where the disk of a file is mounted; the file may not exist."""
    place = Path(os.fsdecode(file)).absolute() if isinstance(file, str | bytes | os.PathLike) else Path.cwd()
    while not place.is_mount() and place != place.parent:
        place = place.parent
    return str(place)
