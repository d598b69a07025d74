"""The arithmetic of printed numbers."""

import numpy as np
import pytest

from wildlab.studies.printed_numbers import planning_formulas
from wildlab.studies.printed_numbers.arithmetic import (
    images_in,
    off_nadir,
    pixels_on_ground,
    rescaled_nis,
    rest_of,
)
from wildlab.studies.printed_numbers.formulas import FORMULAS, formulas_table
from wildlab.studies.printed_numbers.item import MARGIN, Item, load_printed
from wildlab.studies.printed_numbers.items import all_items


@pytest.fixture(scope="module")
def items():
    return {item.key: item for item in all_items()}


def an_item(key="key", one=1.0, other=1.0, **more):
    given = {"topic": f"Topic {key}", "quotes": (("H 1.2", "“words”"),), "unit": "m", "arithmetic": "One.",
             "differs": "Two.", "reading": ("if apart", "if together")}  # fmt: skip
    return Item(key=key, one=one, other=other, **(given | more))


def test_lengths_and_images_are_rules_of_three():
    assert pixels_on_ground([1163.5, 0.0], 350.0, 1163.5) == pytest.approx([350.0, 0.0])
    assert images_in(np.array([60.0, 120.0]), 7.5) == pytest.approx([450.0, 900.0])


def test_nis_is_rescaled_as_a_filter_that_is_sure_of_its_state_does():
    """The filter's own update, with a covariance that hardly counts, against the rule."""
    x, H, z = np.zeros(2), np.eye(2), np.array([3.0, -4.0])
    nis = {}
    for sd in (7.0, 10.0):
        nu, S = z - H @ x, H @ (1e-9 * np.eye(2)) @ H.T + sd**2 * np.eye(2)
        nis[sd] = nu @ np.linalg.solve(S, nu)
    assert rescaled_nis(nis[7.0], 7.0, 10.0) == pytest.approx(nis[10.0], rel=1e-6)
    # With a covariance that counts NIS changes less: the rule is as far as it goes.
    wide = [25.0 / (30.0 + sd**2) for sd in (7.0, 10.0)]
    assert wide[1] / wide[0] > rescaled_nis(1.0, 7.0, 10.0)


def test_independent_errors_add_in_squares():
    rng = np.random.default_rng(1)
    one, other = rng.normal(0, 3.0, 100_000), rng.normal(0, 4.0, 100_000)
    assert rest_of(np.std(one + other), np.std(one)) == pytest.approx(4.0, rel=0.01)
    assert np.isnan(rest_of(3.0, 4.0))


def test_a_slanting_pixel_covers_as_much_more_as_the_ray_says():
    """By cutting two neighbouring rays with the ground."""
    height, step = 100.0, 1e-6
    angle = off_nadir(1.0, 1.7)
    ground = height * (np.tan(angle + step) - np.tan(angle)) / (height * np.tan(step))
    assert ground == pytest.approx(1.7, rel=1e-4)
    assert np.isnan(off_nadir(2.0, 1.0))


def test_every_ratio_is_that_of_the_printed_numbers(items):
    """Typed and computed a second time, from the thesis."""
    focal = (1159.2 + 1167.8) / 2
    expected = {
        "noise-by-altitude": 17.5 / 15.0,
        "mean-within-two-metres": np.sqrt(1.98**2 + 0.76**2) / 2,
        "images-in-view": 400 / (42 * 7.5),
        "frame-rate": 141 / 14 / 7.5,
        "images-of-the-first-case": 8000 / (25 * 60 * 7.5),
        "altitude": 1.25,
        "reference": np.sqrt(10.25**2 - (6.40 * 200 / 350) ** 2) / 5.08,
        "pixels-and-metres": 7.0 / (20 * 350 / focal),
        "nis-of-two-noises": 1.04 / (0.60 * (10 / (30 * 300 / focal)) ** 2),
        "nis-of-two-poses-fast": 0.42 / (0.50 * (20 / 30) ** 2),
        "nis-of-two-poses-slow": 1.84 / 1.04,
        "the-same-filter-twice": 1.0,
    }
    assert {key: item.ratio for key, item in items.items()} == pytest.approx(expected)


@pytest.mark.parametrize(
    ("ratio", "apart"),
    [(1.0, False), (MARGIN, False), (1 / MARGIN, False), (1.01 * MARGIN, True), (0.99 / MARGIN, True),
     (np.nan, True)],
)  # fmt: skip
def test_what_is_apart_is_beyond_the_margin_either_way(ratio, apart):
    item = an_item(one=ratio)
    assert item.apart is apart
    assert item.verdict == ("do not fit" if apart else "fit together")


def test_verdicts_turn_with_the_numbers():
    """All of the tables' numbers moved so that what did not fit fits, and the other way round."""
    opposed = load_printed()
    opposed["slow-vessel"]["observer", "mean_north"] = 1.85
    opposed["slow-vessel"]["observer", "mae"] = 6.25
    opposed["linear-vs-nonlinear-slow"]["ekf", "nis"] = 1.84
    opposed["schmidt-fast-vessel"]["ekf", "nis"] = 0.22
    opposed["coloured-noise-fast"]["cv", "mae"] = 20.0
    before, after = ({item.key: item for item in all_items(printed)} for printed in (None, opposed))
    turned = {key for key in before if before[key].apart != after[key].apart}
    assert turned == {
        "mean-within-two-metres",
        "reference",
        "nis-of-two-noises",
        "nis-of-two-poses-fast",
        "nis-of-two-poses-slow",
        "the-same-filter-twice",
    }


def test_formulas_are_judged_by_what_they_give():
    found = {make.__name__: make() for make in FORMULAS}
    assert found["occlusion_of_itself"].letter == 0.0 and 0.2 < found["occlusion_of_itself"].sense < 0.9
    behind = found["view_behind"]
    assert behind.letter == pytest.approx(2 * behind.sense, rel=0.1)
    added = found["metres_added"]
    # A thousandth of a degree is 111 m north, and 58 m east so far north.
    assert added.letter == pytest.approx(169.4, abs=0.5) and added.sense == pytest.approx(111.4, abs=0.5)
    assert found["longer_side"].sense == found["occlusion_of_itself"].sense
    assert all(one.differs for one in found.values())
    same = added._replace(letter=1.0, sense=1.0)
    assert not same.differs and formulas_table([same])["verdict"].tolist() == ["does the same"]
    assert not added._replace(letter=0.0, sense=0.0).differs


def test_formulas_of_planning_differ_from_what_they_should_follow_from():
    shown = planning_formulas.all_formulas()
    computed = [one for one in shown if one.defined]
    assert [one.verdict for one in computed] == ["differ"] * 5
    assert [one.verdict for one in shown if not one.defined] == ["not defined"] * 2
    assert [one.formula for one in shown] == ["F (A.1)"] * 4 + ["F (5.5)"] * 2 + ["F (5.2)"]
    table = planning_formulas.table_of_formulas(shown)
    assert list(table.columns) == list(planning_formulas.COLUMNS) and len(table) == 7
    # sin(theta) where cos(theta)^2 belongs, for 80 m above and 67.1 m beside.
    r2 = 80.0**2 + 60.0**2 + 30.0**2
    assert f"−{80 / r2**0.5:.2f}" in shown[0].shown
    assert f"{(60.0**2 + 30.0**2) / r2:.2f}" in shown[0].shown and "inf" in shown[-1].shown


def test_a_formula_that_follows_is_not_called_different(monkeypatch):
    """Were the print the derivative, they would agree."""
    sensor = planning_formulas.SearchSensor(1.0, 1.0, sd=1.0, reach=1.0, nearest=1e-9)

    def right(points, p_nc, sd):
        turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        return turn @ planning_formulas.bearing_information(points, p_nc, sensor) @ turn.T

    monkeypatch.setattr(planning_formulas, "as_printed", right)
    assert [one.verdict for one in planning_formulas.information_formulas()[:3]] == ["agree"] * 3
