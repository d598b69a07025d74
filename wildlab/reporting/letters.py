"""Letters inside of PDF figures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fontTools.subset import Options

#: Tables of a font by which letters are chosen and set beside each other: kerning, ligatures and the like.
LAYOUT_TABLES = ("GSUB", "GPOS", "GDEF", "kern", "BASE", "JSTF", "MATH")


@contextmanager
def shapes_alone() -> Iterator[None]:
    """While this holds, fonts are embedded without `LAYOUT_TABLES`.

    In a PDF every letter has its place, so nobody reads them there, and taking them apart is two thirds of
    the time that a font takes.
    """
    usual = Options._drop_tables_default
    Options._drop_tables_default = [*usual, *LAYOUT_TABLES]
    try:
        yield
    finally:
        Options._drop_tables_default = usual
