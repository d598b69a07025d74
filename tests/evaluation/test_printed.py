"""What a printed number beside ours comes to, on cases made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.evaluation import printed as p


def flight(
    kind: str, here: float, print_: float, low: float | None, high: float | None, **more: float
) -> str:
    return p.compare_flight(kind, here, print_, low, high, **more).verdict


@pytest.mark.parametrize(
    ("kind", "here", "print_", "low", "high", "verdict"),
    [
        # 8.2 beside 8, though the print lies outside of a narrow band.
        ("standard deviation", 0.082, 0.08, 0.0815, 0.0825, p.AGREES),
        ("error size", 7.7, 6.4, 5.1, 12.1, p.AGREES),
        ("error size", 9.0, 6.4, 5.1, 12.1, p.POSSIBLE),
        # 73 % more, and a middle that would hold nearly anything.
        ("error size", 13.8, 8.0, 4.0, 25.0, p.TOO_VAGUE),
        ("error size", 4.4, 10.25, 3.0, 6.4, p.DIFFERS),
        ("NEES or NIS", 0.15, 0.42, 0.1, 0.3, p.DIFFERS),
        ("NEES or NIS", 0.31, 0.42, 0.1, 0.3, p.AGREES),
        ("error size", 8.0, 6.0, None, None, p.NOT_JUDGED),
        ("error size", 7.0, 6.0, None, None, p.AGREES),
        ("error size", 0.0, 6.0, 0.0, 1.0, p.NOT_JUDGED),
        ("error size", 9.0, 6.0, 0.0, 12.0, p.TOO_VAGUE),
        ("rate", 0.882, 0.9664, 0.87, 0.89, p.DIFFERS),
        ("rate", 0.95, 0.9664, 0.94, 0.96, p.AGREES),
        ("rate", 0.93, 0.9664, 0.92, 0.98, p.POSSIBLE),
        ("rate", 0.93, 0.9664, 0.80, 0.98, p.TOO_VAGUE),
    ],
)
def test_verdicts_on_one_flight(
    kind: str, here: float, print_: float, low: float | None, high: float | None, verdict: str
) -> None:
    assert flight(kind, here, print_, low, high) == verdict


def test_a_signed_mean_is_held_against_the_size_of_the_errors() -> None:
    assert flight("signed mean", 1.5, 4.1, 0.1, 4.5, size=9.4) == p.AGREES
    assert flight("signed mean", 0.5, 4.1, 0.1, 4.5, size=9.4) == p.POSSIBLE
    assert flight("signed mean", 0.5, 4.1, 0.1, 2.0, size=9.4) == p.DIFFERS
    assert flight("signed mean", 0.5, 4.1, 0.1, 40.0, size=9.4) == p.TOO_VAGUE
    alone = p.compare_flight("signed mean", 1.5, 4.1, 0.1, 4.5)
    assert (alone.verdict, alone.reason) == (p.NOT_JUDGED, "no size of the errors is printed with it")


def test_where_the_deviation_is_printed_a_signed_mean_is_held_against_that() -> None:
    """Of a mean that is most of the error itself, the size of the errors would grant anything."""
    spread = {"low": -20.0, "high": 20.0, "size": 100.0, "deviation": 10.0}
    found = [p.compare_flight("signed mean", 90.0 + off, 90.0, **spread).verdict for off in (4.3, -4.3)]
    assert found == [p.AGREES] * 2
    far = p.compare_flight("signed mean", 94.5, 90.0, **spread)
    assert far.verdict == p.DIFFERS and far.ratio is None
    assert p.compare_flight("signed mean", 94.5, 90.0, **spread | {"deviation": None}).verdict == p.AGREES


def test_three_facts_go_with_a_verdict() -> None:
    found = p.compare_flight("error size", 9.0, 6.0, 5.0, 12.5)
    assert (found.ratio, found.difference, found.spread) == (1.5, 3.0, 2.5)


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(WildlabError, match="no margin for 'speed'"):
        p.compare_flight("speed", 1.0, 1.0, None, None)


@given(
    st.sampled_from(["error size", "standard deviation", "NEES or NIS"]),
    st.floats(0.01, 1e3),
    st.floats(0.01, 1e3),
    st.floats(1.0, 10.0),
    st.floats(1.0, 10.0),
    st.floats(1e-3, 1e3),
)
def test_verdicts_do_not_depend_on_the_unit(
    kind: str, here: float, print_: float, down: float, up: float, unit: float
) -> None:
    found = flight(kind, here, print_, here / down, here * up)
    assert flight(kind, here * unit, print_ * unit, here / down * unit, here * up * unit) == found
    # Nor on which of two is called larger: half as much is as far off as twice as much.
    assert flight(kind, 1 / here, 1 / print_, 1 / (here * up), down / here) == found


def test_a_vaguer_twin_is_never_rewarded() -> None:
    """Widening the flights' spread about a median that is off never ends in agreement."""
    worth = {p.DIFFERS: 0, p.POSSIBLE: 1, p.TOO_VAGUE: 0, p.AGREES: 2}
    verdicts = [flight("error size", 1.5, 1.0, 1.5 / w, 1.5 * w) for w in (1.01, 1.2, 1.6, 1.7, 1.8, 3, 30)]
    assert verdicts[0] == p.DIFFERS and verdicts[-1] == p.TOO_VAGUE
    assert max(worth[v] for v in verdicts) == 1


def test_means_are_compared_by_their_standard_errors() -> None:
    # The flights' own spread (8 points) does not enter.
    assert p.compare_mean(88.2, 96.64, 0.08, 0.08, 0.5).verdict == p.DIFFERS
    assert p.compare_mean(96.40, 96.64, 0.08, 0.08, 0.0).verdict == p.DIFFERS
    assert p.compare_mean(96.40, 96.64, 0.08, 0.10, 0.0).verdict == p.AGREES  # 1.96 * 0.128 = 0.251
    assert p.compare_mean(96.40, 96.64, 0.01, 0.01, 0.25).verdict == p.AGREES
    for error, printed in ((None, 0.1), (0.1, None)):
        assert p.compare_mean(96.4, 96.6, error, printed, 0.5).verdict == p.NOT_JUDGED


def test_calculations_are_compared_by_what_rounding_leaves_open() -> None:
    assert p.compare_calculation(5.45, 5.3, 0.15).verdict == p.AGREES
    assert p.compare_calculation(5.46, 5.3, 0.15).verdict == p.DIFFERS
    assert p.compare_calculation(5.3, 5.3, None).verdict == p.NOT_JUDGED


def test_margins_are_what_twenty_independent_values_leave_open() -> None:
    """Half width of the 95 % band of each figure, by simulation of two independent coordinates."""
    rng = np.random.default_rng(2)
    errors = rng.standard_normal((40_000, p.INDEPENDENT, 2))
    distances = np.hypot(*np.moveaxis(errors, 2, 0))
    figures = {
        "error size": distances.mean(axis=1) / math.sqrt(math.pi / 2),
        "standard deviation": errors[..., 0].std(axis=1, ddof=1),
        "NEES or NIS": (distances**2).mean(axis=1) / 2,
    }
    for kind, values in figures.items():
        factor = p.MARGINS[kind].factor
        assert factor is not None
        assert np.quantile(np.abs(values - 1), 0.95) == pytest.approx(factor - 1, abs=0.025), kind
    mean = np.quantile(np.abs(errors[..., 0].mean(axis=1)), 0.95) / math.sqrt(math.pi / 2)
    assert mean == pytest.approx(p.MARGINS["signed mean"].difference, abs=0.01)
    by_deviation = np.quantile(np.abs(errors[..., 0].mean(axis=1)), 0.95)
    assert by_deviation == pytest.approx(p.BY_DEVIATION, abs=0.01)


@pytest.mark.parametrize(
    ("here", "print_", "low", "high", "verdict"),
    [
        (46 / 48, 1.0, 0.860, 0.988, p.TOO_VAGUE),
        (1.0, 0.993, 0.926, 1.0, p.TOO_VAGUE),
        (0.99, 0.993, 0.98, 0.995, p.AGREES),
        (0.96, 1.0, 0.95, 0.97, p.DIFFERS),
        (0.05, 0.0, 0.03, 0.08, p.DIFFERS),
        (0.0, 0.0, 0.0, 0.01, p.AGREES),
        (1.0, 1.0, None, None, p.NOT_JUDGED),
    ],
)
def test_a_share_of_images_is_judged_by_its_interval(
    here: float, print_: float, low: float | None, high: float | None, verdict: str
) -> None:
    assert p.compare_share(here, print_, low, high).verdict == verdict
