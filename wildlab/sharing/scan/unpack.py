"""What is inside of what: every part of a file, unpacked."""

from __future__ import annotations

from collections.abc import Iterator

from wildlab.sharing.scan.parts import Budget, Part


def unpacked(data: bytes, budget: Budget) -> Iterator[Part]:
    """The file itself, then everything that can be unpacked from it.

    Parameters
    ----------
    data
        The file.
    budget
        How much may be unpacked.
    """
    yield Part("", data)
