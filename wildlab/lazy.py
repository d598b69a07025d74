"""Names that a package offers and imports only when they are asked for (PEP 562).

``import wildlab.flight`` then costs nothing of what reads Parquet or checks recipes, and a room that is not
needed is not loaded. The package lists its names three times, for three readers: in ``__all__``, under
``TYPE_CHECKING`` (type checkers, editors), and here. A test holds them against each other.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any


def offer(
    package: str, names: Mapping[str, Sequence[str]], folders: Sequence[str] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """A package's ``__getattr__`` and ``__dir__``.

    Parameters
    ----------
    package
        Its ``__name__``.
    names
        What it offers, by the module below it that holds them: ``{"store": ["Flight"]}``.
    folders
        Packages below it that are there without being imported by name.

    Returns
    -------
    (__getattr__, __dir__)

    Examples
    --------
    >>> get, names = offer("wildlab", {"errors": ["WildlabError"]})
    >>> get("WildlabError").__name__
    'WildlabError'
    """
    home = {name: module for module, several in names.items() for name in several}

    def get(name: str) -> Any:
        if name in folders:
            return importlib.import_module(f"{package}.{name}")
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        found = getattr(importlib.import_module(f"{package}.{home[name]}"), name)
        setattr(sys.modules[package], name, found)  # the next time it is simply there
        return found

    def listed() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home, *folders})

    return get, listed
