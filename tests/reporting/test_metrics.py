"""metrics.json: what is allowed in, and what comes back out."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wildlab.errors import WildlabError
from wildlab.reporting.metrics import claim, document, metric, read_metrics, write_metrics


def whole(**changes: Any) -> dict[str, Any]:
    given: dict[str, Any] = {"study": "s", "flight": "", "kind": "twin", "seed": 1, "seeds": None}
    given |= {"metrics": [metric("a", "b", 1.0, "m")], "claims": [claim("c", "It holds.", "holds")]}
    return document(**(given | changes))


def test_round_trip(tmp_path: Path) -> None:
    content = whole(metrics=[metric("a", "b/c", np.float64(0.5), "m", n=3, low=0.1, high=0.9, source="H 1")])
    write_metrics(tmp_path / "metrics.json", content)
    assert read_metrics(tmp_path / "metrics.json") == content
    assert [path.name for path in tmp_path.iterdir()] == ["metrics.json"]


def test_what_could_not_be_computed_is_null() -> None:
    assert metric("a", "b", math.nan, "m")["value"] is None
    assert metric("a", "b", None, "m")["value"] is None
    assert type(metric("a", "b", np.int64(3), "m")["value"]) in (int, float)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: metric("Error", "b", 1.0, "m"), "not made of a-z"),
        (lambda: metric("a", "two words", 1.0, "m"), "has a blank"),
        (lambda: metric("a", "", 1.0, "m"), "is empty"),
        (lambda: metric("a", "b", math.inf, "m"), "is infinite"),
        (lambda: metric("a", "b", "1.0", "m"), "'1.0'"),
        (lambda: metric("a", "b", 1.0, "m", low=2.0, high=1.0), "above the high one"),
        (lambda: claim("c", "x", "maybe"), "verdict 'maybe'"),
        (lambda: claim("c", "x", "holds", fraction=1.2), "share from 0 to 1"),
        (lambda: whole(kind="dream"), "kind 'dream'"),
        (lambda: whole(metrics=[metric("a", "b", 1.0, "m")] * 2), "given twice"),
        (lambda: whole(claims=[claim("c", "x", "holds")] * 2), "given twice"),
    ],
)
def test_refusals(make: Any, sentence: str) -> None:
    with pytest.raises(WildlabError, match=f"(?i){sentence}"):
        make()


@pytest.mark.parametrize("content", ["", "[]", '{"study": 1}', '{"metrics": NaN}', "\x00"])
def test_a_file_that_is_none_is_named(tmp_path: Path, content: str) -> None:
    path = tmp_path / "metrics.json"
    path.write_text(content)
    with pytest.raises(WildlabError, match=r"metrics\.json: this is not a metrics file"):
        read_metrics(path)
    path.write_text(json.dumps(whole() | {"metrics": [{"name": "a"}]}))
    with pytest.raises(WildlabError, match="not a metrics file"):
        read_metrics(path)
