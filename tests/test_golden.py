"""Golden numbers: what moved, came or went is told, whatever it is."""

import numpy as np
import pandas as pd
import pytest

from tools import golden


def kept(folder, values):
    rows = [(key, row, value) for key, column in values.items() for row, value in enumerate(column)]
    folder.mkdir()
    pd.DataFrame(rows, columns=["key", "row", "value"]).to_parquet(folder / "numbers.parquet")
    return folder


@pytest.mark.parametrize(
    ("before", "after", "moved"),
    [
        ([1.0, np.nan], [1.0, np.nan], False),
        ([1.0], [1.0 + 1e-14], False),
        ([1.0], [1.0 + 1e-9], True),
        ([5.0], [np.inf], True),
        ([1.0], [1.0, 2.0], True),
    ],
)
def test_what_moved_is_told(tmp_path, capsys, before, after, moved):
    folders = [kept(tmp_path / name, {"a": values}) for name, values in (("b", before), ("a", after))]
    assert golden.compare(*folders, 5) == moved
