"""What the study of warm animals computes, and that its words turn with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.studies.animal_pictures import CAMERA, picture_of, rhino
from wildlab.detection.warm import Warm
from wildlab.evaluation.runs import Interval
from wildlab.reporting.published import load_claims
from wildlab.simulation.scene import (
    CameraResponse,
    sensor_of,
)
from wildlab.studies.wildlife_detection import STUDY, charts, claims, level_text, settings, text, trial
from wildlab.studies.wildlife_detection.trial import (
    ADAPTIVE,
    BY_EMPTY,
    BY_MEAN,
    BY_MEDIAN,
    CLOUDY,
    CONSTANT,
    COUNTS,
    ENHANCED,
    LARGE,
    METHODS,
    NIGHT,
    NOON,
    PRINTED,
    PROPOSED,
    READINGS,
    SMALL,
    SUBTRACTED,
    Operator,
)


@pytest.fixture(scope="module")
def numbers():
    """Of one seed, by a small camera."""
    response = CameraResponse()
    sensor = sensor_of(response, (120, 180), np.random.default_rng(1))
    operator = Operator(CAMERA, response, sensor, np.random.default_rng(2))
    return trial.numbers_of(operator, trial.take_pictures(operator, 4))


def test_a_seed_has_all_numbers(numbers):
    spread = pd.DataFrame([numbers] * 3)
    assert {claim["id"] for claim in load_claims("wildlife-detection")} == set(claims.check_claims(spread))
    for subject in (*METHODS, *PROPOSED):
        at = claims.places([CLOUDY])
        assert claims.counts_of(spread, subject, at).shape == (9, 3)
    assert not claims.counts_of(spread, SMALL, ["never"]).size
    assert STUDY.metric_of("herd", "mean_rise") is not None
    assert STUDY.metric_of(CONSTANT, "found_night_15") is None


def test_the_sun_makes_ground_as_warm_as_animals(numbers):
    at = {weather: [numbers["ground", f"as_warm_{one}"] for one in claims.places([weather])] for weather in
          (NIGHT, NOON)}  # fmt: skip
    assert np.nanmean(at[NIGHT]) < 0.1 < np.nanmean(at[NOON])
    assert numbers["herd", "mean_rise"] > 0
    assert numbers["ground", "level_after"] > numbers["ground", "level_before"]


def spread_of(numbers, **changes):
    """Twelve seeds alike; everything found and nothing invented, but for what is changed (``__`` for /)."""
    plain = dict(numbers)
    for (subject, name), value in plain.items():
        kind = name.split("_")[0]
        if kind in COUNTS:
            plain[subject, name] = {"found": 4.0, "invented": 0.0, "missed": 0.0}[kind]
        elif kind == "as" or name.startswith("pieces"):
            plain[subject, name] = {"as": 0.0}.get(kind, 1.0)
        else:
            plain[subject, name] = value
    plain["ground", "level_before"], plain["ground", "level_after"] = 60.0, 100.0
    plain["herd", "mean_rise"], plain["herd", "median_rise"] = 20.0, 2.0
    for key, value in changes.items():
        subject, name = key.split("__")
        for one in plain:
            if one[0] == subject.replace("_", "-") and one[1].startswith(name):
                plain[one] = value
    return pd.DataFrame([plain] * 12)


def test_claims_turn(numbers):
    thresholds = {c["id"]: c.get("threshold") for c in load_claims("wildlife-detection")}

    def true(spread):
        found = claims.check_claims(spread)
        return {key: bool(check.holds(thresholds[key]).all()) for key, check in found.items()}

    good = true(spread_of(numbers))
    assert not good["constant-fails"] and good["adaptive-copes"]
    assert not good["small-block-splits"] and good["large-block-whole"]
    assert not good["combinations-best"] and good["subtraction-and-constant-good"]
    assert good["herd-biases-mean"] and good["median-rises-less"] and not good["median-finds-more"]
    assert not good["sun-breaks"] and good["night-keeps"]
    assert not good["too-hot"] and not good["size-from-ground"] and not good["block-from-distance"]
    assert not good["enhancement-misses"]
    bad = true(
        spread_of(
            numbers, constant__invented=5.0, adaptive_offset__invented=5.0, constant__invented_before=0.0,
            adaptive_offset__invented_before=0.0, adaptive_51__pieces=2.0, adaptive_251__pieces=2.0,
            mean_constant__found=0.0, mean_constant__missed=4.0, herd__mean=1.0, herd__median=3.0,
            ground__as_warm=4.0, subtracted__invented=3.0, enhanced__missed=2.0, enhanced__background=9.0,
        )
    )  # fmt: skip
    assert bad["constant-fails"] and not bad["adaptive-copes"]
    assert bad["small-block-splits"] and not bad["large-block-whole"]
    assert bad["enhancement-misses"] and bad["enhancement-takes-background"]
    assert not bad["subtraction-and-constant-good"] and not bad["herd-biases-mean"]
    assert not bad["median-rises-less"] and bad["median-finds-more"]
    assert bad["sun-breaks"] and not bad["night-keeps"]
    assert bad["too-hot"] and bad["size-from-ground"] and bad["block-from-distance"]
    clear = true(spread_of(numbers, constant__invented=9.0, adaptive_offset__invented=9.0))
    assert clear["combinations-best"]
    # The constant threshold under another name neither copes nor competes.
    twin = true(spread_of(numbers, adaptive__invented_after=9.0, adaptive__found=0.0))
    assert twin["adaptive-copes"]
    beaten = spread_of(numbers, constant__invented=9.0, adaptive_offset__invented=9.0, adaptive__invented=0.0)
    assert true(beaten)["combinations-best"]


def check_of(claim, spread):
    threshold = next(c for c in load_claims("wildlife-detection") if c["id"] == claim).get("threshold")
    return claims.check_claims(spread)[claim].holds(threshold)


@pytest.mark.parametrize(("claim", "subject"), [("too-hot", "not_hot"), ("size-from-ground", "sized")])
def test_a_filter_has_to_be_worth_what_it_costs(numbers, claim, subject):
    gain = {"subtracted__invented": 3.0}
    assert check_of(claim, spread_of(numbers, **gain)).all()
    # Fewer false alarms, and as many animals lost: 8 / 11 becomes 8 / 12.
    loss = gain | {f"{subject}__missed": 4.0}
    assert not check_of(claim, spread_of(numbers, **loss)).any()
    assert not check_of(claim, spread_of(numbers, **gain, **{f"{subject}__invented": 3.0})).any()


def test_the_threshold_is_higher_than_needed_where_that_without_the_herd_finds_more(numbers):
    claim = "threshold-higher-than-needed"
    assert not check_of(claim, spread_of(numbers)).any()
    assert check_of(claim, spread_of(numbers, mean_constant__missed_herd=4.0)).all()
    # The rise alone does not make it so.
    assert check_of("herd-biases-mean", spread_of(numbers)).all()


def test_a_fall_is_a_part_of_what_was(numbers):
    assert claims.fall([1.0, 0.2], [0.8, 0.0]).tolist() == pytest.approx([0.2, 1.0])
    assert np.isnan(claims.fall([0.0], [0.0])).all()
    # From 0.2 to zero is by all of it, and by no more than the threshold of 0.2.
    low = {"adaptive_offset__found": 1.0, "adaptive_offset__missed": 8.0}
    gone = spread_of(numbers, **low, adaptive_offset__found_after=0.0)
    assert not check_of("adaptive-copes", gone).any()
    assert check_of("adaptive-copes", spread_of(numbers, **low)).all()


def test_thresholds_lie_where_their_measures_can_be(numbers):
    checks = claims.check_claims(spread_of(numbers))
    assert checks["subtraction-and-constant-good"].reaches(0.35)
    assert not checks["subtraction-and-constant-good"].reaches(1.4)
    assert not checks["constant-fails"].reaches(1.0)


def test_the_herd_is_also_searched_with_the_threshold_of_the_empty_place(numbers):
    rise = numbers["herd", "mean_rise"]
    assert rise > 0
    assert numbers[BY_EMPTY, "missed_herd"] <= numbers[BY_MEAN, "missed_herd"]


def test_false_alarms_are_not_fewer_than_none(numbers):
    spread = spread_of(numbers)
    spread.loc[0, [(CONSTANT, "invented_noon_15")]] = 9.0
    found = claims.false_alarms(spread, CONSTANT, claims.places([NOON]))
    assert found.estimate == pytest.approx(9 / 36)
    assert found.low == 0 and found.high > found.estimate


def test_a_premise_that_is_not_met_decides_nothing(numbers):
    still = spread_of(numbers, ground__level_after=62.0)
    assert not claims.check_claims(still)["constant-fails"].premise.any()
    none = spread_of(numbers, adaptive_51__pieces=np.nan)
    assert not claims.check_claims(none)["small-block-splits"].premise.any()


def test_the_summary_turns_with_the_numbers(numbers):
    good = " ".join(text.summary(spread_of(numbers)))
    assert f"the best of {len(METHODS)} settings has an F1 of 1.00 (" in good
    assert "at a sunny noon it is not told from 1.00 (" in good
    assert "rises by 40 grey levels" in good
    every = {f"{one.replace('-', '_')}__invented_noon": 20.0 for one in METHODS}
    bad = " ".join(text.summary(spread_of(numbers, **every)))
    assert "at a sunny noon the best comes only to 0.29 (" in bad
    every = {f"{one.replace('-', '_')}__invented_night": 20.0 for one in METHODS}
    assert "at a sunny noon it is more: 1.00 (" in text.summary(spread_of(numbers, **every))[0]


def test_all_settings_that_are_as_good_as_the_best_are_named(numbers):
    others = len(METHODS) - 1
    assert f"({others} more not told from it)" in text.summary(spread_of(numbers))[0]
    night = text.ties_words(spread_of(numbers)).split("; on a clear morning")[0]
    assert all(f"“{text.NAMES[one]}”" in night for one in METHODS)
    worse = {f"{one.replace('-', '_')}__invented_night": 20.0 for one in METHODS if one != BY_MEDIAN}
    alone = spread_of(numbers, **worse)
    first = text.summary(alone)[0].split("; at a sunny noon")[0]
    assert first.endswith(f" with “{text.NAMES[BY_MEDIAN]}”")
    night, morning = text.ties_words(alone).split("; on a clear morning")
    assert "not told from" not in night and "not told from" in morning
    worse.pop("constant__invented_night")
    two = text.summary(spread_of(numbers, **worse))[0]
    assert f"with “{text.NAMES[CONSTANT]}” (“{text.NAMES[BY_MEDIAN]}” not told from it);" in two


def test_who_is_told_from_the_best():
    every = {"a": Interval(0.8, 0.7, 0.9), "b": Interval(0.9, 0.78, 0.95), "c": Interval(0.5, 0.2, 0.99)}
    assert text.equals(every) == ["b", "a"]
    assert text.equals(every | {"b": Interval(0.9, 0.81, 0.95)}) == ["b"]
    blunt = {"a": Interval(0.999, np.nan, np.nan), "b": Interval(1.0, np.nan, np.nan)}
    assert text.equals(blunt) == ["b", "a"]
    assert text.equals(blunt | {"a": Interval(np.nan, np.nan, np.nan)}) == ["b"]


def test_words_on_the_sun_that_comes_out_turn(numbers):
    both = text.change_words(spread_of(numbers))
    copes = "the adaptive threshold copes and loses nothing (0 to 0 %)"
    assert both.endswith(f"{copes}, the constant one copes and loses nothing (0 to 0 %).")
    better = text.change_words(spread_of(numbers, constant__invented_after=9.0))
    assert better.endswith(f"{copes}, the constant one does not cope and loses 53 % of it (53 to 53 %).")
    name = text.NAMES[CONSTANT]
    assert f"{name} from 1.00 (" in better and ") to 0.47 (" in better
    neither = text.change_words(spread_of(numbers, adaptive_offset__invented_after=8.0))
    assert "the adaptive threshold does not cope and loses 50 % of it" in neither
    none = text.change_words(spread_of(numbers, constant__found_before=0.0, constant__missed_before=4.0))
    assert none.endswith("the constant one cannot be said to cope, as it found nothing before.")
    some = spread_of(numbers)
    some.loc[:3, [(CONSTANT, "missed_after")]] = 6.0
    assert "whether it copes is not told" in text.change_words(some)
    assert "too few flights to say whether it copes" in text.change_words(some.head(3))
    falls = text.change_words(spread_of(numbers, ground__level_after=20.0))
    assert "the ground falls by 40 grey levels" in falls


def test_copes_is_read_as_in_the_claims():
    of = {one["id"]: float(one.get("threshold", 0)) for one in load_claims("wildlife-detection")}
    assert of["constant-fails"] == of["adaptive-copes"] == text.FALL


def test_a_fall_has_the_interval_of_seeds_drawn_again():
    before = np.tile([4.0, 0.0, 0.0], (40, 1))
    after = np.where(np.arange(40)[:, None] % 2, before, [0.0, 0.0, 4.0])
    found = claims.fall_interval(before, after)
    # F1 from 1 to 2 k / (k + n), where k of n = 40 seeds are drawn that keep all.
    k = np.random.default_rng(3).binomial(40, 0.5, 100_000)
    assert found.estimate == pytest.approx(1 - 2 * 20 / 60)
    assert [found.low, found.high] == pytest.approx(
        np.percentile(1 - 2 * k / (k + 40), [2.5, 97.5]), abs=0.03
    )
    few = claims.fall_interval(before[:4], after[:4])
    assert np.isfinite(few.estimate) and np.isnan(few.low)
    assert np.isnan(claims.fall_interval(0 * before, after).estimate)


def test_a_threshold_under_two_names_is_said_to_be_one(numbers):
    same = text.masks_words(spread_of(numbers, masks__overlap=1.0))
    assert "in 168 of 168 images (98 to 100 %)" in same and "under another name" in same
    assert "100 % of what either makes white" in same
    apart = text.masks_words(spread_of(numbers, masks__overlap=0.5))
    assert "in 0 of 168 images (0 to 2 %); on average 50 %" in apart and "So the two differ" in apart


def test_tiles_have_intervals(numbers):
    spread = spread_of(numbers, subtracted__missed_noon=4.0, subtracted__invented_noon=2.0)
    night, noon, alarms = text.tiles(spread)
    assert night[0] == "100 %" and "(97 to 100 %)" in night[1]
    assert noon[0] == "50 %" and "(44 to 56 %)" in noon[1]
    assert alarms[0] == "2.0" and "(2.0 to 2.0)" in alarms[1]


def test_the_reading_is_that_with_the_largest_rates(numbers):
    spread = spread_of(numbers)
    for method in PRINTED:
        for one in READINGS:
            for height in trial.READ_AT:
                spread[f"{method}-{one}", f"missed_{height}"] = 0.0 if one == "offset" else 9.0
    names, found = text.best_of(spread, ADAPTIVE)
    assert names == ["offset"] and found.estimate == 1.0
    words = level_text.readings_words(spread)
    assert words.count("above the mean of its block by the level") == 3 and "not told from" not in words
    assert "held against the thesis's own pictures" in words
    last = text.summary(spread)[2]
    assert (
        "as “above the mean of its block by the level” with the numbers of figures 7.6, 7.10a, 7.10b." in last
    )
    for height in trial.READ_AT:
        spread[f"{ADAPTIVE}-offset", f"missed_{height}"] = 9.0
        spread[f"{ADAPTIVE}-floor", f"missed_{height}"] = 0.0
    last = text.summary(spread)[2]
    assert f"“{text.READ_AS['floor']}” with the numbers of figure 7.6" in last
    assert f"“{text.READ_AS['offset']}” with the numbers of figures 7.10a, 7.10b" in last
    for height in trial.READ_AT:
        spread[f"{ADAPTIVE}-white", f"missed_{height}"] = 0.0
    tied = f"not told from “{text.READ_AS['white']}”; for figure 7.10a"
    assert tied in level_text.readings_words(spread)
    assert f"“{text.READ_AS['floor']}” or “{text.READ_AS['white']}” with" in text.summary(spread)[2]
    assert len(level_text.readings_table(spread)) == 4


def test_words_on_pieces_herd_and_sun_turn(numbers):
    assert "With no reading of it" in level_text.pieces_words(spread_of(numbers))
    split = spread_of(numbers, adaptive_51__pieces_offset=2.5, adaptive_51__pieces_floor_0=np.nan)
    alone = level_text.pieces_words(split)
    assert "12 of 12 images (76 to 100 %) with “above the mean of the block by 65”, more often" in alone
    table = level_text.pieces_table(split).set_index("reading")
    assert table.loc["above the mean of the block by 65", "small"] == "2.50"
    assert table["seeds"].tolist() == [12, 12, 0]
    more = spread_of(numbers, adaptive_51__pieces=2.5)
    assert "not told from “above the mean of the block, and above 150”" in level_text.pieces_words(more)
    more.loc[:1, [(SMALL, "pieces_offset_65")]] = 1.0
    assert "12 of 12 images" in level_text.pieces_words(more) and "not told from" in level_text.pieces_words(
        more
    )
    words = text.herd_words(spread_of(numbers))
    assert "changes the mean by +20.0 (+20.0 to +20.0) grey levels and the median by +2.0 (" in words
    assert "the median finds as many (+0 to +0)" in words
    blind = spread_of(numbers, mean_constant__missed_herd=4.0)
    assert "the median finds 50 in a hundred more (+50 to +50)" in text.herd_words(blind)
    worse = text.herd_words(spread_of(numbers, median_constant__missed_herd=4.0, herd__mean=-3.0))
    assert "the median finds 50 in a hundred fewer (−50 to −50)" in worse and "the mean by −3.0 (" in worse
    one = spread_of(numbers)
    one.loc[0, [(BY_MEAN, "missed_herd")]] = 4.0
    assert "that the median finds 4 in a hundred more is not told from chance (−5 to +13)" in text.herd_words(
        one
    )
    assert "in a hundred more is not told from chance, with F1" in text.herd_words(one.head(1))
    assert "sunny noon 3" in text.sun_words(spread_of(numbers, ground__as_warm_noon=3.0))


def test_tables_have_a_row_for_each_method_and_weather(numbers):
    table = text.rates_table(spread_of(numbers), (CONSTANT, SMALL), text.by_weather())
    assert len(table) == 8
    assert set(table["images"]) == {36}
    assert len(text.rates_table(spread_of(numbers), (BY_MEDIAN, BY_MEAN), text.by_height())) == 6
    assert settings.chosen_table()["reason"].str.len().min() > 10


def test_charts_say_what_they_show(numbers):
    picture = picture_of(rhino(0, -4), rhino(0, 4))
    _, name, alt, _ = charts.methods_shown(picture, "methods-here", "clear night")
    assert name == "methods-here" and "constant 150: 2 of 2 found, 0 false" in alt
    assert (
        "sun out: 0 of 2 found"
        in charts.sequence_shown(picture, picture_of(rhino(0, -4), rhino(0, 4), window=(50.0, 90.0)))[2]
    )
    assert "detection" in charts.blocks_shown(picture, "floor", 150.0)[2]
    bad = spread_of(numbers, constant__missed_noon=12.0, constant__invented_morning=7.0)
    recall, false = charts.by_weather_shown(bad)
    assert "constant 150 100 %, 100 %, 25 %, 100 %" in recall[2]
    assert recall[0].axes[0].get_title(loc="left") == "Fewest animals are found at a sunny noon"
    assert false[0].axes[0].get_title(loc="left") == "Most false alarms come on a clear morning"
    # Where seeds differ as much as weathers do, none is named alone.
    alike = spread_of(numbers, constant__missed_noon=12.0, constant__missed_night=12.0)
    fewest = charts.by_weather_shown(alike)[0][0].axes[0].get_title(loc="left")
    assert fewest == "Fewest animals are found on a clear night or at a sunny noon"
    even, none = (one[0].axes[0].get_title(loc="left") for one in charts.by_weather_shown(spread_of(numbers)))
    assert even == "In no one weather clearly the fewest animals are found"
    assert none == "In no one weather clearly the most false alarms come"
    assert "15 m constant 150 1.00 (" in charts.heights_shown(spread_of(numbers))[2]


def test_the_worst_weather_is_told_seed_by_seed():
    rng = np.random.default_rng(1)
    base = rng.normal(0, 5, 12)
    values = {"a": base, "b": base + 1 + rng.normal(0, 0.2, 12), "c": base + rng.normal(0, 0.2, 12)}
    assert claims.extremes(values, 1.0) == ["b"]
    assert set(claims.extremes(values, -1.0)) == {"a", "c"}
    assert len(claims.extremes({name: one[:1] for name, one in values.items()}, 1.0)) == 3
    assert claims.extremes(values | {"d": np.full(12, np.nan)}, 1.0)[0] == "b"


def test_printed_settings_are_the_theses():
    assert (METHODS[CONSTANT].level, METHODS[ADAPTIVE].block_px, METHODS[ADAPTIVE].level) == (150, 451, 150)
    assert (METHODS[SMALL].block_px, METHODS[LARGE].block_px) == (51, 251)
    assert (METHODS[SUBTRACTED].background, METHODS[SUBTRACTED].block_px, METHODS[SUBTRACTED].level) == (
        "mean", 251, 65,
    )  # fmt: skip
    assert (METHODS[ENHANCED].background, METHODS[ENHANCED].block_px, METHODS[ENHANCED].level) == (
        "enhance", 251, 160,
    )  # fmt: skip
    assert all(isinstance(one, Warm) and one.smallest_px == trial.SMALLEST for one in METHODS.values())


def test_widths_are_told_apart(numbers):
    spread = spread_of(numbers)
    for height in trial.READ_AT:
        spread[trial.read_subject(SUBTRACTED, "offset", 3.0), f"missed_{height}"] = 8.0
    spread[trial.read_subject(ADAPTIVE, "floor", 1.0), "invented_after"] = 8.0
    table = claims.over_windows(spread).set_index(["width", "reading"])
    assert table.loc[(3.0, "offset"), SUBTRACTED] == 0.5 == table.loc[(1.0, "floor"), "after"]
    assert (table.drop(index=[(3.0, "offset")])[SUBTRACTED] == 1).all()
    assert (
        table["tied"].sum() == 6 and not table["tied"][(3.0, "offset")] and not table["tied"][(1.0, "floor")]
    )
    assert tuple(table.loc[(1.0, "floor"), ["fall", "fall_low", "fall_high"]]) == (0.5, 0.5, 0.5)
    assert table["mean"][(3.0, "offset")] == 0.9
    # One seed of twelve tells nothing apart.
    spread = spread_of(numbers)
    spread.loc[0, [(trial.read_subject(SUBTRACTED, "offset", 3.0), f"missed_{trial.READ_AT[0]}")]] = 4.0
    assert claims.over_windows(spread)["tied"].all()
    assert claims.over_windows(spread.head(2))["tied"].all()


def test_words_on_windows_turn():
    names = ["width", "reading", *PRINTED, "before", "after", "mean", "tied", "fall", "fall_low", "fall_high"]
    rows = [
        (1.0, "floor", 0.5, 0.5, 0.5, 0.9, 0.5, 0.58, False, 0.44, 0.4, 0.5),
        (2.0, "offset", 0.9, 0.9, 0.9, 0.9, 0.8, 0.88, True, 0.11, 0.05, 0.15),
    ]

    def said():
        return level_text.windows_words(pd.DataFrame(rows, columns=names))

    words = said()
    assert "the level” with 1 times (0.58)" in words and "by the level” with 2 times (0.88)" in words
    assert (
        "F1 goes from 0.90 to 0.80 when the sun comes out: it copes and loses 11 % of it (5 to 15 %)" in words
    )
    rows[1] = (*rows[1][:-3], 0.11, 0.05, 0.3)
    assert "it loses 11 % of it (5 to 30 %): whether it copes is not told" in said()
    rows[1] = (2.0, "offset", 0.9, 0.9, 0.9, 0.9, 0.5, 0.82, True, 0.44, 0.3, 0.5)
    rows.append((2.0, "floor", 0.1, 0.1, 0.1, 0.7, 0.2, 0.24, False, 0.7, 0.6, 0.8))
    worse = said()
    assert "does not cope" in worse and worse.endswith("read the other way, from 0.70 to 0.20.")
    rows.append((3.0, "floor", 0.9, 0.9, 0.9, 0.9, 0.5, 0.82, True, 0.44, 0.3, 0.5))
    tied = said()
    assert "With the best of 4," in tied and "1 more of which is not told from it" in tied
    assert "not told from it" not in worse
    assert "taken" not in level_text.windows_table(pd.DataFrame(rows, columns=names))["reading"][0]


def test_settings_say_where_they_are_printed():
    table = settings.settings_table().set_index("method")
    assert table.loc["constant, 150", "level"] == "150" and "by the level" in table.loc["adaptive 51", "read"]
    assert table["source"].str.startswith("F ").all()
