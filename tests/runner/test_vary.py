"""`wildlab vary`: which verdicts turn when chosen parameters are moved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.runner import vary
from wildlab.runner.vary import AS_IT_IS, Moved, kept_table, turned_table, turned_words, vary_study
from wildlab.studies.protocol import VARIED, run_trial

BASE = Moved(AS_IT_IS, 1.0, {"a": "holds", "b": "undecided"})


def test_verdicts_that_are_others_than_as_it_is_have_turned() -> None:
    moved = [
        BASE,
        Moved("wind: speed", 0.5, {"a": "holds", "b": "holds"}),
        Moved("wind: speed", 2.0, dict(BASE.verdicts)),
        Moved("wind: speed", 9.0, {}, "this course cannot be flown"),
    ]
    table = turned_table(moved)
    assert table["turned"].tolist()[:2] == [1.0, 0.0] and np.isnan(table["turned"].iloc[2])
    assert table["which"].tolist() == ["b: undecided → holds", "", "this course cannot be flown"]
    words = turned_words((table, 20), "s")
    assert "1 of 2" in words and "wind: speed times 0.5" in words and "1 cannot" in words
    assert "0 of 1" in turned_words((table.iloc[1:2], 20), "s")


@pytest.mark.parametrize("factors", [(), (0.0,), (-1.0,), (float("nan"),), (1.0,)])
def test_factors_that_move_nothing_are_refused(factors: tuple[float, ...], tmp_path: Path) -> None:
    with pytest.raises(WildlabError, match="other than"):
        vary_study("coloured-noise-fast", factors=factors, reports=tmp_path)


def test_what_is_not_simulated_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WildlabError, match="nothing to move"):
        vary_study("sensitivity", reports=tmp_path)
    result = CliRunner().invoke(wildlab, ["vary", "coloured-noise-fast", "--by", "half"])
    assert result.exit_code == 2 and "numbers" in result.output


@pytest.mark.slow
def test_a_study_is_moved_kept_and_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wind = {"boresight: errors": ("boresight.roll_sd", "boresight.pitch_sd", "boresight.yaw_sd")}
    monkeypatch.setattr(vary, "groups_of", lambda twin: wind)
    lines: list[str] = []
    given: dict[str, Any] = {"factors": (4.0,), "seeds": 3, "reports": tmp_path, "tell": lines.append}
    table = vary_study("coloured-noise-fast", **given)
    assert "6 flights to compute, 0 are there" in lines[0]
    # Three flights decide no published number, so that none can turn.
    assert len(table) == 1 and table["turned"].iloc[0] == 0 < table["of"].iloc[0]
    kept = kept_table("coloured-noise-fast", str(tmp_path / "coloured-noise-fast"))
    assert kept is not None and kept[1] == 3
    pd.testing.assert_frame_equal(kept[0], table)
    assert vary_study("coloured-noise-fast", **given).equals(table)
    assert "0 flights to compute, 6 are there" in lines[-1]
    assert kept_table("coloured-noise-fast", str(tmp_path / "other" / "x")) is None


@pytest.mark.slow
def test_a_trial_is_moved_as_asked() -> None:
    plain = run_trial("coloured-noise", 1, {"twin": "fast-vessel"})
    wider = dict.fromkeys(("boresight.roll_sd", "boresight.pitch_sd", "boresight.yaw_sd"), 4.0)
    moved = run_trial("coloured-noise", 1, {"twin": "fast-vessel", VARIED: wider})
    assert moved["measurements/mae_georeferenced"] > 1.5 * plain["measurements/mae_georeferenced"]
    assert run_trial("coloured-noise", 1, {"twin": "fast-vessel", VARIED: {}}) == plain
