"""`wildlab vary`: which verdicts turn when chosen parameters are moved."""

import numpy as np
import pytest
from click.testing import CliRunner

from wildlab.cli import wildlab
from wildlab.errors import WildlabError
from wildlab.runner.vary import AS_IT_IS, Moved, turned_table, vary_study

BASE = Moved(AS_IT_IS, 1.0, {"a": "holds", "b": "undecided"})


def test_verdicts_that_are_others_than_as_it_is_have_turned():
    moved = [
        BASE,
        Moved("wind: speed", 0.5, {"a": "holds", "b": "holds"}),
        Moved("wind: speed", 2.0, dict(BASE.verdicts)),
        Moved("wind: speed", 9.0, {}, "this course cannot be flown"),
    ]
    table = turned_table(moved)
    assert table["turned"].tolist()[:2] == [1.0, 0.0] and np.isnan(table["turned"].iloc[2])
    assert table["which"].tolist() == ["b: undecided → holds", "", "this course cannot be flown"]


def test_what_is_not_simulated_is_refused(tmp_path):
    with pytest.raises(WildlabError, match="nothing to move"):
        vary_study("sensitivity", reports=tmp_path)
    result = CliRunner().invoke(wildlab, ["vary", "coloured-noise-fast", "--by", "half"])
    assert result.exit_code == 2 and "numbers" in result.output
