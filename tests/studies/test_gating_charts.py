"""Tables of the study of gating: what stands in their cells."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.studies.gating.charts import rates_chart
from wildlab.studies.gating.text import FED, rates_table, varied_table

PUBLISHED = {"position": 96.64, "pixels": 96.83, "angles": 95.99}


def test_rates_beside_published() -> None:
    runs = np.array([[90.0, 100.0], [80.0, 100.0], [70.0, 100.0]])
    table = rates_table({fed: runs - i for i, fed in enumerate(FED)}, PUBLISHED)
    assert len(table) == 9
    first = table.iloc[0]
    assert (first["form"], first["here"], first["published"]) == ("position", 95.0, 96.64)
    assert first["se"] == pytest.approx(5.0)  # half the distance of two values
    assert first["difference"] == pytest.approx(-1.64)
    assert table["here"].tolist() == [95, 90, 85, 94, 89, 84, 93, 88, 83]
    chart = rates_chart(dict.fromkeys(FED, runs), PUBLISHED, "Rates")
    hollow = [line for line in chart.axes[0].lines if line.get_markerfacecolor() == "white"]
    assert [list(np.asarray(line.get_ydata(), float)) for line in hollow] == [list(PUBLISHED.values())]


def test_changes_stand_in_brackets() -> None:
    rows = {"variation": ["as chosen", "lower"]}
    for form, change in {"position": -1.25, "pixels": 2.0, "angles": 0.0}.items():
        rows |= {form: [90.0, 90.0 + change], f"{form}_change": [0.0, change], f"{form}_se": [0.0, 0.3]}  # type: ignore[dict-item]
    table = varied_table(pd.DataFrame(rows))
    assert table.iloc[0].tolist() == ["as chosen", "90.0", "90.0", "90.0"]
    assert table.iloc[1].tolist() == ["lower", "88.8 (−1.2 ± 0.6)", "92.0 (+2.0 ± 0.6)", "90.0 (+0.0 ± 0.6)"]
