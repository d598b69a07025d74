"""The one kind of error a user of wildlab sees: a sentence with the fix in it."""

from __future__ import annotations

import os


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


class RunFailed(WildlabError):
    """The input was fine and the work was not: a notebook raised, a time limit passed."""

    exit_code = 1
