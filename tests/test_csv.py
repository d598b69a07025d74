"""Tables for spreadsheets: names come from files of strangers."""

import pandas as pd

from wildlab.files import write_csv


def test_no_name_is_a_formula(tmp_path):
    names = ["=HYPERLINK(1)", "+1", "-2", "@x", "buoy", "a=b", ""]
    write_csv(tmp_path / "a.csv", pd.DataFrame({"name": names, "value": range(-3, 4)}), "%.1f")
    read = pd.read_csv(tmp_path / "a.csv", keep_default_na=False)
    assert read["name"].tolist() == ["'=HYPERLINK(1)", "'+1", "'-2", "'@x", "buoy", "a=b", ""]
    assert read["value"].tolist() == list(range(-3, 4))
