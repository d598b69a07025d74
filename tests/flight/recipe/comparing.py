"""Columns of tables against what they are to be."""

from typing import Any

import numpy as np


def near(table: Any, expected: Any, *columns: str, atol: float = 1e-6) -> None:
    """A table, or some of its columns, is as expected to within so much."""
    found = table[list(columns)].to_numpy() if columns else np.asarray(table)
    np.testing.assert_allclose(found, expected, rtol=0, atol=atol)
