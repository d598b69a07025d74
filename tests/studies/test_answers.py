"""Which sentences answer a study's question: rules on numbers, tried on facts that say the opposite."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import pytest

from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, UNDECIDABLE, UNDECIDED
from wildlab.messages.catalogue import FOLDER, load_texts
from wildlab.paths import PACKAGE
from wildlab.studies.page import Facts
from wildlab.studies.protocol import case_names
from wildlab.studies.rules import load_rules
from wildlab.studies.static_point import COLUMNS as STATIC_COLUMNS

#: Recorded numbers by "subject/name" (a number, or an entry), and claims' verdicts by their id (alone, or
#: with the interval of their share) -> the keys of the sentences.
Case = tuple[Mapping[str, Any], tuple[str, ...]]


#: Undecided by flights of which some are so and some are not.
SPLIT = (UNDECIDED, 0.3, 0.7)


def found(ship: float, whole: float, alarms: float, near_perfect: str) -> dict[str, Any]:
    """Detection rates, false alarms an image on both flights, and the verdict on a near perfect rate."""
    return {
        "ship/detection_rate": ship,
        "boats-whole/detection_rate": whole,
        "ship/false_alarms_per_image": 0.0,
        "boats/false_alarms_per_image": alarms,
        "near-perfect": near_perfect,
    }


def navigated(rms: float, sd: float, nees: tuple[float, float | None, float | None]) -> dict[str, Any]:
    """Error and predicted deviation (degrees) of each axis, and NEES of position with its interval."""
    axes: dict[str, Any] = {f"mekf/rms_{axis}": known(rms, rms / 4) for axis in ("roll", "pitch", "yaw")}
    axes |= {f"mekf/mean_sd_{axis}": sd for axis in ("roll", "pitch", "yaw")}
    value, low, high = nees
    return {**axes, "mekf/nees_position": {"value": value, "centre_low": low, "centre_high": high}}


def moments(schmidt: float, ekf: float, n: int = 100) -> dict[str, Any]:
    """Mean NEES of one moment of each of ``n`` flights, with poses as calibrated."""
    return {
        "schmidt-estimated/mean_of_drawn_nees": {"value": schmidt, "n": n},
        "ekf/mean_of_drawn_nees": {"value": ekf, "n": n},
    }


def of_four(value: float, within: float = 0.01) -> dict[str, float | None]:
    """A number with the range of four flights, too few for an interval of the median."""
    ends = {"low": value - within, "high": value + within, "centre_low": None, "centre_high": None}
    return {"value": value, "flights": 4, **ends}


def known(value: float, within: float = 0.01) -> dict[str, float]:
    """A number with the interval of its median."""
    return {"value": value, "centre_low": value - within, "centre_high": value + within}


def two_tracks(kf: float, ekf: float, nees: float) -> dict[str, Any]:
    """Mean errors of both filters, and the median NEES of both within 1."""
    return {"kf/mae": kf, "ekf/mae": ekf} | dict.fromkeys(("kf/nees", "ekf/nees"), known(nees, 1.0))


def differenced(plain: float, coloured: float) -> dict[str, Any]:
    """Mean NEES without and with differenced measurements."""
    return {"cv/nees": plain, "coloured/nees": coloured}


COLUMNS_AT_REST = [f"{column}/mae" for column in STATIC_COLUMNS]
BOTH_KINDS = {"drawn-kf/mae": 8.0, "rendered-kf/mae": 8.1}


def image_and_track(track: float) -> dict[str, Any]:
    """Median errors of single images, 9 within 1, and of the track."""
    return {
        "reference/mae": 3.0,
        "observer/mae": known(9.0, 1.0),
        "filter/filter_error_mean": known(track, 1.0),
    }


def centres_moved(moved: float, found: float) -> dict[str, Any]:
    """Errors of the track, and of the centre in the image with the range of flights."""
    errors = {"with-adjustment": moved, "without-adjustment": found}
    return {f"{who}/mae_after_start": one for who, one in errors.items()} | {
        f"{who}/pixel_error": {"value": one, "low": one - 1, "high": one + 1} for who, one in errors.items()
    }


def shares_inside(honest: float, overconfident: float) -> dict[str, Any]:
    """Of all steps of both filters."""
    shares = {"honest": honest, "overconfident": overconfident}
    return {f"{who}/nees-1-run/share_inside": share for who, share in shares.items()}


def grown(**growth: float) -> dict[str, Any]:
    """Errors at both heights."""
    return {
        f"level/{name}/{height}/horizontal_error": error
        for name, times in growth.items()
        for height, error in (("100m", 10.0), ("400m", 10.0 * times))
    }


def searched(information: float, rows: float, swing: str, fixed: str) -> dict[str, Any]:
    """Times until all animals are found, and verdicts on the comparison with each kind of rows."""
    verdicts = {"lower-search-time-swing": swing, "lower-search-time-fixed": fixed}
    return {"information/all_found": information, "rows-swing/all_found": rows, **verdicts}


def hidden(above: Mapping[str, Any], flat: Mapping[str, Any]) -> dict[str, Any]:
    """Shares that trees hide, from above and at a flat angle; algorithms that agree as often."""
    alike = {f"{who}/agreement_60m": known(0.9) for who in ("ray-casting", "bresenham")}
    return alike | {"trees/hidden_0deg": above, "trees/hidden_75deg": flat}


def frames(empty: float, unset: float, after: float) -> dict[str, Any]:
    """Share of frames without an animal, and errors before and after the clock is set."""
    return {"none-in-view/share_of_frames": empty, "clock/error_unset": unset, "clock/error_set": after}


def by_weather(night: float, noon: float, other: float, within: float = 0.05) -> dict[str, Any]:
    """F1 of background subtraction, and at noon of another method."""
    rates = {"subtracted/f1_night": night, "subtracted/f1_noon": noon, "enhanced/f1_noon": other}
    return {k: {"value": v, "low": v - within, "high": v + within} for k, v in rates.items()}


def seen(within: float = 0.005, **shares: float) -> dict[str, Any]:
    """Shares of the enclosures seen from a multicopter on four flights."""
    plans = {"DOWN": "down-60m-25m", "YAW": "yaw-60m-25m", "LOW": "yaw-30m-25m", "CLOSE": "yaw-30m-10m"}
    return {f"{plans[plan]}/seen": of_four(share, within) for plan, share in shares.items()}


def seen_along_cable(down: float, roll: float, adaptive: float, within: float = 0.01) -> dict[str, Any]:
    """Shares of the enclosures seen from a gondola on four rides."""
    shares = {"down": down, "roll-60": roll, "adaptive-60": adaptive}
    return {f"{who}/seen": of_four(share, within) for who, share in shares.items()}


def tracked(anees: float, right: float) -> dict[str, Any]:
    """Numbers of the particle filter, the same from both platforms."""
    numbers = {"rmse": known(20.0), "anees": known(anees, 0.5), "right_share": known(right)}
    return {f"{one}-negative/{name}": value for one in ("gondola", "uav") for name, value in numbers.items()}


HARD = dict.fromkeys(("hard-to-associate", "same-problem-uav"), HOLDS)


def outcomes(gained: int, spoilt: int, **kept: int) -> dict[str, Any]:
    """Tracks that gained or were spoilt with a filter, and how many of eight each sensor kept."""
    found: dict[str, Any] = {
        "schmidt/all-sensors/tracks_gained": gained,
        "schmidt/all-sensors/tracks_spoilt": spoilt,
    }
    return found | {
        f"schmidt/{sensor}/tracks_kept_at_best": {"value": n, "n": 8} for sensor, n in kept.items()
    }


def many(tracked: float, changes: int) -> dict[str, Any]:
    """How much boats are tracked (%) where nothing was tuned, and how often their track changes."""
    return {"elsewhere/both/tracked_median": tracked, "elsewhere/both/track_changes": changes}


ANSWERS: dict[str, list[Case]] = {
    "schmidt": [
        (moments(2.0, 2.1), ("schmidt-consistent", "ekf-consistent")),
        (moments(2.9, 2.9), ("schmidt-nearly", "ekf-nearly")),
        (moments(0.5, 0.4), ("schmidt-conservative", "ekf-conservative")),
        (moments(2.9, 18.0, n=3), ("schmidt-few", "ekf-overconfident")),
        (moments(18.0, 2.9, n=3), ("schmidt-overconfident", "ekf-few")),
    ],
    "line-of-sight": [
        (
            {
                "ray-casting/agreement_60m": known(0.97),
                "bresenham/agreement_60m": known(0.93),
                "trees/hidden_0deg": known(0.2),
                "trees/hidden_75deg": known(0.5),
            },
            ("rays-more", "trees-more"),
        ),
        (
            {
                "ray-casting/agreement_60m": known(0.93),
                "bresenham/agreement_60m": known(0.97),
                "trees/hidden_0deg": known(0.5),
                "trees/hidden_75deg": known(0.2),
            },
            ("rays-less", "trees-less"),
        ),
        (
            {
                "ray-casting/agreement_60m": known(0.93, 0.05),
                "bresenham/agreement_60m": known(0.97, 0.05),
                "trees/hidden_0deg": known(0.2),
                "trees/hidden_75deg": known(0.2),
            },
            ("rays-unclear", "trees-unclear"),
        ),
        (hidden({"value": 0.17}, {"value": 0.39}), ("rays-unclear", "trees-few")),
        (
            {"ray-casting/agreement_60m": 0.9, "bresenham/agreement_60m": 0.5},
            ("rays-few", "trees-unknown"),
        ),
    ],
    "linear-vs-nonlinear": [
        (
            two_tracks(7.0, 8.0, 5.0) | {"kf-ekf-similar": MOSTLY},
            ("accuracy-alike", "consistency-overconfident"),
        ),
        (
            two_tracks(7.0, 9.0, 0.5) | {"kf-more-accurate": HOLDS},
            ("accuracy-ground", "consistency-conservative"),
        ),
        (
            two_tracks(9.0, 7.0, 2.0) | {"kf-more-accurate": FAILS},
            ("accuracy-image", "consistency-unclear"),
        ),
        (two_tracks(9.0, 7.0, 2.0), ("accuracy-unclear", "consistency-unclear")),
    ],
    "coloured-noise": [
        (
            differenced(9.0, 1.5) | {"differencing-consistent": HOLDS, "differencing-costs": MOSTLY},
            ("consistency-gained", "accuracy-lost"),
        ),
        (
            differenced(9.0, 4.0) | {"differencing-consistent": FAILS, "differencing-costs": FAILS},
            ("consistency-nearer", "accuracy-gained"),
        ),
        (
            differenced(3.0, 0.2) | {"differencing-consistent": FAILS},
            ("consistency-not-gained", "accuracy-unclear"),
        ),
        (
            differenced(3.0, 0.2) | {"differencing-consistent": UNDECIDED},
            ("consistency-unclear", "accuracy-unclear"),
        ),
    ],
    "static-point": [
        (
            dict.fromkeys(COLUMNS_AT_REST, 6.0) | {"misalignment-matters-most": HOLDS},
            ("located", "calibration-first"),
        ),
        (dict.fromkeys(COLUMNS_AT_REST, 6.0), ("located", "calibration-unclear")),
    ],
    "slow-vessel": [
        (image_and_track(6.0), ("located", "track-nearer")),
        (image_and_track(12.0), ("located", "track-farther")),
        (image_and_track(10.0), ("located", "track-unclear")),
    ],
    "large-ship": [
        (centres_moved(4.0, 9.0) | {"more-accurate-after-start": HOLDS}, ("track-helps", "image-nearer")),
        (centres_moved(9.0, 4.0) | {"more-accurate-after-start": FAILS}, ("track-harms", "image-unclear")),
        (centres_moved(9.0, 4.0), ("track-unclear", "image-unclear")),
    ],
    "end-to-end": [
        (BOTH_KINDS | {"tracks-alike": HOLDS}, ("tracks-alike", "claims")),
        (BOTH_KINDS | {"tracks-alike": FAILS}, ("tracks-differ", "claims")),
        (BOTH_KINDS, ("tracks-unclear", "claims")),
    ],
    "replay": [
        (frames(0.7, 2.0, 1.0) | {"manual-sync-increases-precision": HOLDS}, ("view-empty", "clock-better")),
        (
            frames(0.2, 2.0, 1.0) | {"manual-sync-increases-precision": FAILS},
            ("view-other", "clock-no-better"),
        ),
        (frames(0.7, 2.0, 1.0), ("view-empty", "clock-open")),
    ],
    "information-planning": [
        (
            searched(200.0, 300.0, swing=HOLDS, fixed=MOSTLY),
            ("free-sooner", "fixed-sooner"),
        ),
        (searched(300.0, 200.0, swing=FAILS, fixed=MOSTLY_NOT), ("free-later", "fixed-later")),
        (searched(300.0, 290.0, swing=UNDECIDED, fixed=UNDECIDED), ("free-open", "fixed-open")),
        (searched(200.0, 1200.0, swing=HOLDS, fixed=MOSTLY), ("free-sooner-at-limit", "fixed-sooner")),
        (searched(1200.0, 200.0, swing=FAILS, fixed=MOSTLY), ("free-later-at-limit", "fixed-sooner")),
        (searched(1200.0, 1200.0, swing=UNDECIDED, fixed=MOSTLY), ("free-open-at-limit", "fixed-sooner")),
    ],
    "wildlife-detection": [
        (by_weather(night=0.98, noon=0.2, other=0.3), ("sun-breaks", "noon-unusable")),
        (by_weather(night=0.9, noon=0.88, other=0.9), ("sun-harmless", "noon-usable")),
        (by_weather(night=0.9, noon=0.6, other=0.3), ("sun-costs", "noon-usable")),
        (by_weather(night=0.3, noon=0.05, other=0.05, within=0.2), ("sun-low", "noon-unusable")),
        (by_weather(night=0.9, noon=0.4, other=0.4, within=0.3), ("sun-open", "noon-open")),
    ],
    "vessel-detection": [
        (found(0.99, 1.0, 0.0, HOLDS), ("found-holds", "alarms-none")),
        (found(0.99, 0.8, 0.1, FAILS), ("found-fails", "alarms-some")),
        (found(0.99, 0.97, 0.0, UNDECIDED), ("found-few", "alarms-none")),
    ],
    "precision-drop": [
        ({"within-a-few-metres": HOLDS, "single-is-inaccurate": MOSTLY}, ("mean-holds", "single-holds")),
        ({"within-a-few-metres": FAILS, "single-is-inaccurate": FAILS}, ("mean-fails", "single-fails")),
        ({"within-a-few-metres": SPLIT, "single-is-inaccurate": SPLIT}, ("mean-split", "single-split")),
        (
            {"within-a-few-metres": (UNDECIDED, 0.4, 1.0), "single-is-inaccurate": (UNDECIDED, 0.0, 0.6)},
            ("mean-few", "single-few"),
        ),
    ],
    "wildlife-camera": [
        (
            {"tau2-data-sheet/best_video_off": 0.6, "inverse/largest_error": 0.1},
            ("video-fits", "inverse-unnoticed"),
        ),
        (
            {"tau2-data-sheet/best_video_off": 6.0, "inverse/largest_error": 3.0},
            ("video-open", "inverse-rim"),
        ),
    ],
    "printed-numbers": [
        ({"one/ratio": 1.0, "other/ratio": 1.2}, ("some-differ", "reasons")),
        ({"one/ratio": 1.0, "other/ratio": 0.96}, ("all-agree",)),
    ],
    "consistency-bounds": [
        (shares_inside(0.95, 0.5) | {"nees-1-run": HOLDS}, ("honest-inside", "overconfident-outside")),
        (shares_inside(0.95, 0.9), ("honest-otherwise", "overconfident-inside")),
    ],
    "sensitivity": [
        (grown(roll=4.0, north=1.0), ("tilt-grows", "position-alike")),
        (grown(roll=1.0, north=4.0), ("tilt-alike", "position-differs")),
        (grown(roll=0.2, north=0.2), ("tilt-shrinks", "position-differs")),
    ],
    "camera-calibration": [
        ({"tau2/sd_fx": 0.3, "mounting/error_at_350_m": 6.7}, ("camera-well", "mounting-large")),
        ({"tau2/sd_fx": 3.0, "mounting/error_at_350_m": 0.7}, ("camera-poorly", "mounting-small")),
    ],
    "uav-coverage": [
        (seen(DOWN=0.8, YAW=0.9, LOW=0.7, CLOSE=0.9), ("camera-yaw", "half-height-closer-rows")),
        (seen(DOWN=0.9, YAW=0.8, LOW=0.7, CLOSE=0.7), ("camera-down", "half-height-lost")),
        (
            seen(DOWN=0.98, YAW=0.99, LOW=0.98, CLOSE=0.99),
            ("camera-both-see-nearly-all", "half-height-open"),
        ),
        (seen(DOWN=0.8, YAW=0.81, LOW=0.9, CLOSE=0.9), ("camera-alike", "half-height-open")),
        (seen(0.2, DOWN=0.8, YAW=0.9, LOW=0.7, CLOSE=0.9), ("camera-open", "half-height-open")),
    ],
    "gondola-coverage": [
        (
            seen_along_cable(0.2, 0.5, 0.6) | {"adaptive-least-outside": HOLDS, "adaptive-sees-more": HOLDS},
            ("roll-more", "adaptive-sees-more"),
        ),
        (
            seen_along_cable(0.2, 0.5, 0.4) | {"adaptive-least-outside": HOLDS, "adaptive-sees-more": FAILS},
            ("roll-more", "adaptive-sees-no-more"),
        ),
        (
            seen_along_cable(0.2, 0.40, 0.45, within=0.2)
            | {"adaptive-least-outside": HOLDS, "adaptive-sees-more": UNDECIDED},
            ("roll-open", "adaptive-inside"),
        ),
        (seen_along_cable(0.6, 0.5, 0.4), ("roll-less", "adaptive-not-better")),
    ],
    "optical-flow-velocity": [
        (
            {"very-large-variance": HOLDS, "own-motion-dominates": HOLDS},
            ("scatter-holds", "own-motion-holds"),
        ),
        (
            {"very-large-variance": FAILS, "own-motion-dominates": FAILS},
            ("scatter-fails", "own-motion-fails"),
        ),
        (
            {"very-large-variance": SPLIT, "own-motion-dominates": SPLIT},
            ("scatter-split", "own-motion-split"),
        ),
        (
            {"very-large-variance": (UNDECIDED, 0.4, 1.0), "own-motion-dominates": UNDECIDED},
            ("scatter-few", "own-motion-few"),
        ),
    ],
    "gating": [
        ({"angles/success_rate": 96.0, "forms-agree": HOLDS}, ("rate-forms-agree",)),
        ({"angles/success_rate": 71.0, "forms-agree": FAILS}, ("rate-by-form",)),
        ({"angles/success_rate": 96.0, "forms-agree": UNDECIDABLE}, ("rate-by-form",)),
    ],
    "crossing-vessels": [
        (
            {"no-swap-with-features": HOLDS, "size-best": HOLDS, "looks/separation_size": 9.0},
            ("swap-holds", "today-unknown", "feature-size"),
        ),
        (
            {
                "no-swap-with-features": FAILS,
                "size-best": FAILS,
                "looks/separation_size": 1.0,
                "mht/swapped_shared": 0.0,
            },
            ("swap-fails", "today", "feature-open"),
        ),
        ({"no-swap-with-features": SPLIT}, ("swap-split", "today-unknown", "feature-unknown")),
        ({"no-swap-with-features": (UNDECIDED, 0.4, 1.0)}, ("swap-few", "today-unknown", "feature-unknown")),
    ],
    "wildlife-tracking": [
        (tracked(4.0, 0.4) | HARD, ("known-overconfident", "lap-hard")),
        (tracked(1.0, 0.95) | dict.fromkeys(HARD, FAILS), ("known-conservative", "lap-easy")),
        (tracked(2.0, 0.9) | dict.fromkeys(HARD, UNDECIDED), ("known-open", "lap-open")),
    ],
    "autoferry": [
        (outcomes(9, 1, lidar=8, radar=7, ir=7, eo=8), ("filter-helps", "sensors-all")),
        (outcomes(1, 9, lidar=8, radar=7, ir=1, eo=0), ("filter-harms", "sensors-ranging")),
        (outcomes(4, 3, lidar=8, radar=2, ir=1, eo=0), ("filter-neither", "sensors-some")),
    ],
    "navigation": [
        (navigated(1.0, 1.0, (5.0, 1.5, 12.0)), ("attitude-fits", "position-unclear")),
        *(
            (
                navigated(0.3, 0.3, (9.5, 8.5, 12.0)) | {f"mekf/mean_sd_{axis}": 0.08},
                (f"attitude-overconfident-{axis}", "position-overconfident"),
            )
            for axis in ("roll", "pitch", "yaw")
        ),
        (navigated(0.1, 1.0, (0.5, 0.4, 0.6)), ("attitude-fits", "position-conservative")),
        # Intervals decide: from 1.35 to 2.25 times, and without an interval.
        (navigated(1.8, 1.0, (3.5, 2.5, 4.5)), ("attitude-unclear", "position-near")),
        (
            navigated(1.0, 1.0, (9.5, None, None)) | {"mekf/rms_pitch": 2.24},
            ("attitude-few", "position-few"),
        ),
    ],
    "autoferry-many": [
        (many(98.0, 0), ("boats-tracked",)),
        (many(98.0, 200), ("boats-partly",)),
        (many(14.0, 0), ("boats-lost",)),
    ],
}
CASES = [name for name in case_names() if load_rules(name).answer]


def facts_of(given: Mapping[str, Any]) -> Facts:
    recorded, verdicts, shares = {}, {}, {}
    for key, value in given.items():
        if "/" in key:
            subject, name = key.rsplit("/", 1)
            recorded[name, subject] = value if isinstance(value, Mapping) else {"value": value}
        elif isinstance(value, tuple):
            verdicts[key], shares[key] = value[0], value[1:]
        else:
            verdicts[key] = value
    return Facts(recorded, verdicts, shares)


@pytest.mark.parametrize(
    ("case", "given", "keys"), [(c, *one) for c, many in ANSWERS.items() for one in many]
)
def test_the_facts_choose_the_sentences(case, given, keys):
    assert tuple(load_rules(case).answers(facts_of(given))) == keys


@pytest.mark.parametrize("case", CASES)
def test_every_sentence_can_be_chosen_and_every_chosen_one_is_there(case):
    """Where no fact is known it is one that needs none."""
    assert case in ANSWERS, "give ANSWERS its opposed facts"
    rules, texts = load_rules(case), load_texts(case).answers
    unknown = rules.answers(facts_of({}))
    assert unknown and all(key.endswith(("unknown", "missing")) and "{" not in texts[key] for key in unknown)
    assert {key for _, keys in ANSWERS[case] for key in keys}.union(unknown) == set(texts)


def test_every_file_of_texts_is_read_by_a_case_or_by_name():
    code = "".join(path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py"))
    read = {*case_names(), *re.findall(r'(?:load_texts|words)\("([a-z-]+)"', code)}
    assert {path.stem for path in FOLDER.glob("*.toml")} <= read
