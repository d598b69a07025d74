"""Photos, marks and clicks that are far out are named by what they share; a flight that is well has none."""

import numpy as np

from wildlab.evaluation.outliers import find_outliers

PHOTOS = np.repeat([f"P{i:02d}" for i in range(20)], 5)
MARKS = np.tile([f"M{i}" for i in range(10)], 10)


def residuals(seed):
    """Every photo has an error of its own that its points share, as poses give."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.normal(0, 1.0, (20, 2)), 5, axis=0) + rng.normal(0, 0.5, (100, 2))


def test_a_flight_that_is_well_has_no_outliers():
    for seed in range(20):
        z = residuals(seed)
        found, rest = find_outliers(z, z, PHOTOS, MARKS)
        assert found == () and rest.all()


def test_a_mark_a_photo_and_a_click_are_told_apart():
    z = residuals(0)
    z[MARKS == "M3"] += [12.0, 9.0]
    z[PHOTOS == "P07"] += [-30.0, 0.0]
    z[50] += [0.0, 40.0]
    found, rest = find_outliers(z, 2 * z, PHOTOS, MARKS)
    names = {one.kind: one for one in found}
    assert set(names) == {"mark", "photo", "click"} and len(found) == 3
    assert (names["mark"].mark, names["mark"].photo, names["mark"].points) == ("M3", "", 10)
    assert (names["photo"].photo, names["photo"].mark) == ("P07", "")
    assert (names["click"].photo, names["click"].mark) == ("P10", "M0")
    assert 25.0 < names["mark"].off_m < 35.0
    assert not rest[MARKS == "M3"].any() and not rest[PHOTOS == "P07"].any() and not rest[50]
    assert rest.sum() == 100 - 10 - 5 + ((MARKS == "M3") & (PHOTOS == "P07")).sum() - 1


def test_without_names_of_marks_photos_and_clicks_are_found():
    z = residuals(1)
    z[PHOTOS == "P03"] += 25.0
    (only,), _ = find_outliers(z, z, PHOTOS, np.full(100, ""))
    assert (only.kind, only.photo) == ("photo", "P03")


def test_what_all_share_is_no_outlier_of_anyone():
    z = residuals(2) * 30.0
    assert find_outliers(z, z, PHOTOS, MARKS)[0] == ()


def test_a_mark_seen_in_most_photos_is_still_the_mark():
    """It is off in every photo that shows it, and no photo is blamed."""
    marks = np.tile(["a", "b", "c", "d", "e"], 20)
    z = residuals(5)
    z[marks == "b"] += 15.0
    (only,), rest = find_outliers(z, z, PHOTOS, marks)
    assert (only.kind, only.mark, only.points) == ("mark", "b", 20) and rest.sum() == 80
