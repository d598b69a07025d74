"""Charts of many targets: what they show, whose colour it is, and letters that do not lie on each other."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.figure_text import overlapping
from wildlab.evaluation.identities import Scan, compare_identities
from wildlab.reporting import figures
from wildlab.reporting.charts import many as charts
from wildlab.reporting.figure_text import least_size
from wildlab.reporting.pictures import PHONE_WIDTH
from wildlab.tracking.many import POINT, Shown


def shown_at(time: int, names: Iterable[int], x: np.ndarray, P: np.ndarray) -> Shown:
    """What is shown at a time: the named tracks, with states (N, 4) of one covariance."""
    n = len(x)
    identity = np.array([*names], int)
    return Shown(
        float(time), 0, identity, x, np.tile(P, (n, 1, 1)), np.ones(n), np.ones((n, 1)), np.zeros((n, 4, 0))
    )


def made(
    seed: int, tracks: int = 9, targets: int = 3, looks: int = 80, name: str = "boat {}"
) -> tuple[Any, Any]:
    """Tracks that come and go beside targets that walk about; the first three are on them."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(1, 300)
    ways = rng.normal(0, size, (targets, 1, 2)) + rng.normal(0, size / 20, (targets, looks, 2)).cumsum(axis=1)
    begin = np.sort(rng.integers(0, looks // 2, tracks))
    names, flags = [name.format(i) for i in range(targets)], np.ones(targets, bool)
    shown, compared = [], []
    for t in range(looks):
        there = np.flatnonzero(begin <= t)
        x = np.pad(rng.normal(0, size, (len(there), 2)), ((0, 0), (0, 2)))
        on = there < targets
        x[on, :2] = ways[there[on], t]
        shown.append(shown_at(t, there, x, np.eye(4)))
        P = shown[-1].P[:, :2, :2]
        compared.append(Scan(float(t), x[:, :2], P, there.tolist(), ways[:, t], names, flags, ~flags))
    platform = rng.normal(0, size / 50, (looks, 2)).cumsum(axis=0)
    followed = SimpleNamespace(
        shown=shown,
        scans=[SimpleNamespace(time=float(t), platform=platform[t]) for t in range(looks)],
        truth=dict(zip(names, ways, strict=True)),
        targets=SimpleNamespace(hulls=(POINT,)),
        cutoff_m=20.0,
    )
    return followed, compare_identities(compared, 20.0)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ["map", "identities", "wrong"])
def test_letters_can_be_read_and_lie_on_no_others(name: str, seed: int) -> None:
    given = made(seed)
    figure = getattr(charts, f"{name}_shown")(*given[: 1 if name == "map" else 2])[0]
    figures.png_bytes(figure)
    assert overlapping(figure) == []
    assert figure.get_size_inches()[0] * least_size(figure) <= PHONE_WIDTH


def test_names_are_only_text_and_leave_room_for_the_picture() -> None:
    followed, lives = made(1, name="<b>a$b_{{$^</b>" + "L" * 60 + "{}")
    figure = charts.identities_shown(followed, lives)[0]
    figures.png_bytes(figure)
    shown = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert shown[0].startswith("<b>a$b_{$^") and all(len(one) <= charts.LONGEST_NAME for one in shown)


def test_a_line_is_parted_where_its_track_was_absent() -> None:
    way = np.array([[0.0, 1, 1], [0.0, 1, 2], [1.0, 2, 2], [4.0, 9, 9]])
    times = [0.0, 0.0, 1.0, 2.0, 3.0, 4.0]
    got = charts.parted(way, times)
    assert np.isnan(got[3]).all() and got[[0, 1, 2, 4]].tolist() == way.tolist()
    assert charts.parted(way[:3], times).tolist() == way[:3].tolist()
