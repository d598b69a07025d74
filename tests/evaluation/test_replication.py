"""What a published number and ours come to: by cases made by hand, closed forms and simulation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from wildlab.evaluation import intervals as order
from wildlab.evaluation import replication as r
from wildlab.evaluation.replication import operating_characteristics


@pytest.mark.parametrize(
    ("kind", "here", "published", "centre", "predicted", "words"),
    [
        ("standard deviation", 0.082, 0.08, (0.0818, 0.0822), (0.0795, 0.0825), "close, within"),
        # Near, and not of our flights: two facts.
        ("standard deviation", 0.082, 0.08, (0.0818, 0.0822), (0.0815, 0.0825), "close, outside"),
        ("error size", 9.0, 6.4, (8.4, 9.6), (5.1, 12.1), "not close, within"),
        ("error size", 7.7, 6.4, (7.0, 8.4), (5.1, 12.1), "cannot tell, within"),
        # 10.25 m, while nearly all of a hundred flights are below.
        ("error size", 8.6, 10.25, (8.4, 8.8), (7.5, 9.8), "close, outside"),
        ("NEES or NIS", 0.31, 0.42, (0.29, 0.33), (0.1, 0.5), "close, within"),
        ("error size", 8.0, 6.0, None, None, "cannot tell, too few flights"),
        ("rate", 0.96, 0.9664, (0.9597, 0.9603), (0.94, 0.98), "close, within"),
        ("rate", 0.93, 0.9664, (0.925, 0.935), (0.92, 0.98), "not close, within"),
    ],
)
def test_two_answers_on_one_flight(kind, here, published, centre, predicted, words):
    assert r.compare_flight(kind, here, published, centre=centre, predicted=predicted).words == words


def test_of_a_signed_mean_only_compatibility_is_asked_and_only_with_power():
    found = r.compare_flight("signed mean", 3.0, 4.1, predicted=(0.1, 8.0), power=0.1)
    assert found.words == "no power" and found.ratio is None and found.reason == "power 0.10"
    assert r.compare_flight("signed mean", 3.0, 9.1, predicted=(0.1, 8.0), power=0.1).words == "outside"
    assert r.compare_flight("signed mean", 38.0, 38.2, predicted=(35.0, 41.0), power=1.0).words == "within"


@given(
    st.sampled_from(r.SIZES),
    *(st.floats(0.01, 1e3) for _ in range(2)),
    *(st.floats(1.0, 10.0) for _ in range(2)),
    st.floats(1e-3, 1e3),
)
def test_answers_do_not_depend_on_the_unit_nor_on_which_is_called_larger(
    kind, here, published, down, up, unit
):
    bounds = here / down, here * up
    found = r.compare_flight(kind, here, published, centre=bounds, predicted=bounds).words
    scaled = (here / down * unit, here * up * unit)
    assert (
        r.compare_flight(kind, here * unit, published * unit, centre=scaled, predicted=scaled).words == found
    )
    turned = (1 / bounds[1], 1 / bounds[0])
    assert r.compare_flight(kind, 1 / here, 1 / published, centre=turned, predicted=turned).words == found


@pytest.mark.parametrize("n", [5, 6, 19, 20, 100])
def test_the_interval_of_the_median_holds_it_as_often_as_it_says(n):
    """Coverage by the binomial distribution: the median lies between two order statistics."""
    low, high = order.median_interval(np.arange(1, n + 1))
    assert low + high == n + 1
    inside = stats.binom.cdf(high - 1, n, 0.5) - stats.binom.cdf(low - 1, n, 0.5)
    wider = stats.binom.cdf(high - 2, n, 0.5) - stats.binom.cdf(low, n, 0.5)
    assert inside >= 0.9 > wider


@pytest.mark.parametrize("n", [19, 20, 100, 200])
def test_one_more_flight_lies_outside_as_often_as_the_closed_form_says(n):
    """Exact for any distribution: here one with a long tail."""
    flights = np.random.default_rng(n).lognormal(size=(4000, n + 1))
    ends = np.array([order.prediction_interval(one[1:]) for one in flights])
    outside = (flights[:, 0] < ends[:, 0]) | (flights[:, 0] > ends[:, 1])
    assert order.false_outside(n) <= 0.1
    assert outside.mean() == pytest.approx(order.false_outside(n), abs=3 * (0.09 / 4000) ** 0.5)


def test_power_is_that_of_the_closed_form():
    """Log-normal sizes: a flight with half the errors lies below the interval with a normal probability."""
    for sd in (0.2, 0.42, 0.8):
        values = np.exp(stats.norm.ppf(np.linspace(0.0005, 0.9995, 1000), scale=sd))
        expected = stats.norm.cdf(-1.645 + np.log(2) / sd) + stats.norm.sf(1.645 + np.log(2) / sd)
        assert r.power_of(values, "error size") == pytest.approx(expected, abs=0.01)
        assert r.power_of(values**2, "NEES or NIS") == pytest.approx(expected, abs=0.01)
    rates = stats.logistic.cdf(stats.norm.ppf(np.linspace(0.0005, 0.9995, 1000), scale=0.42))
    assert r.power_of(rates, "rate") == pytest.approx(0.5, abs=0.02)
    # The size of a mean about zero says nothing of a twin twice too wide.
    sizes = stats.halfnorm.ppf(np.linspace(0.0005, 0.9995, 1000))
    assert r.power_of(sizes, "signed mean") < 0.15


def test_operating_characteristics_are_those_of_closed_forms():
    found = operating_characteristics(trials=400).set_index(["kind", "factor"])
    close = found[["close", "not close", "cannot tell"]].sum(axis=1)
    assert np.allclose(close.drop("signed mean", level=0), 1) and (close["signed mean"] == 0).all()
    assert np.allclose(found[["within", "outside", "no power"]].sum(axis=1), 1)
    # "Outside" of a true twin, and of one whose squares are f^2 too large: chi-square with 40 degrees.
    for kind, worth in (("NEES or NIS", 40), ("standard deviation", 19)):
        law = stats.chi2(worth)
        for factor in (1.0, 1.5, 2.0):
            low, high = law.ppf([0.05, 0.95]) * factor**2
            expected = law.cdf(low) + law.sf(high)
            assert found.loc[(kind, factor), "outside"] == pytest.approx(expected, abs=0.07), (kind, factor)
    # "Close" is where the published draw lies within the margin of our well-known median.
    law = stats.chi2(40)
    margin = 1.25**2
    expected = law.cdf(law.median() * margin) - law.cdf(law.median() / margin)
    told = found.loc[("NEES or NIS", 1.0)]
    assert told["close"] < expected + 0.03 and told["not close"] < 1 - expected + 0.03
    assert (found.loc["signed mean", "within"] == 0).all() and found.loc[("error size", 2.0), "close"] == 0


def test_means_are_compared_by_their_standard_errors():
    # The flights' own spread does not enter; a small difference is close, and still more than chance.
    assert r.compare_mean(0.882, 0.9664, 5e-5, 0.0008, 0.0008).words == "not close, outside"
    assert r.compare_mean(0.960, 0.9664, 5e-5, 0.0008, 0.0008).words == "close, outside"
    assert r.compare_mean(0.9655, 0.9664, 5e-5, 0.0008, 0.0008).words == "close, within"
    assert r.compare_mean(0.960, 0.9664, 5e-5, 0.02, 0.02).words == "cannot tell, within"
    for error, published in ((None, 0.1), (0.1, None)):
        assert r.compare_mean(0.964, 0.966, 5e-5, error, published).words == "not judged"


def test_calculations_are_compared_by_what_rounding_leaves_open():
    assert r.compare_calculation(5.35, 5.3, 0.05).words == "close"
    off = r.compare_calculation(5.46, 5.3, 0.05)
    assert off.words == "not close" and off.reason.endswith("3.0 % off")
    # Bounds from rounded inputs that meet what the result is rounded from.
    assert r.compare_calculation(5.46, 5.3, 0.05, inputs=(5.34, 5.5)).words == "close"
    assert r.compare_calculation(5.46, 5.3, 0.05, inputs=(5.36, 5.5)).words == "not close"
    # By simulation: the interval of ours inside, across, beside.
    told = [r.compare_calculation(here, 5.3, 0.05, error=0.01).words for here in (5.31, 5.345, 5.38)]
    assert told == ["close", "cannot tell", "not close"]


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=2), st.floats(0, 0.2), st.floats(0, 0.2))
def test_rounded_inputs_are_propagated(inputs, a, b):
    """Of a sum exactly: the corners of the box."""
    low, high = r.propagate_rounding(lambda x: [x[0] ** 3 - 2 * x[1], x[1]], inputs, [a, b])
    x, y = inputs
    ends = [(x - a) ** 3 - 2 * (y + b), (x + a) ** 3 - 2 * (y - b)]
    assert (low[0], high[0]) == pytest.approx(tuple(ends), abs=1e-9)
    assert (low[1], high[1]) == pytest.approx((y - b, y + b))


def test_a_share_of_images_is_close_by_its_interval():
    """All of 4903 found stands for what a share of that many may be."""
    share = (0.99945, 1.0)
    for low, high, words in (
        (0.9475, 1.0, "cannot tell"),
        (0.99977, 1.0, "close"),
        (0.957, 0.963, "not close"),
    ):
        found = r.compare_flight("rate", high, 1.0, share=share, centre=(low, high))
        assert found.closeness == words


def test_rounding_adds_to_what_is_close_and_to_what_is_within():
    """0.08 stands for 0.075 to 0.085."""
    near = {"centre": (0.1055, 0.106), "predicted": (0.0845, 0.2)}
    assert r.compare_flight("error size", 0.1058, 0.08, **near).words == "not close, outside"
    assert r.compare_flight("error size", 0.1058, 0.08, 0.005, **near).words == "close, within"
