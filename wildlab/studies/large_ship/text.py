"""What the report on the large ship says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import mean_share_interval
from wildlab.studies.large_ship.claims import scatter_left
from wildlab.studies.large_ship.trial import AT_REST_M_S, DETECTOR, SLIVER, START_S, WITH, WITHOUT

#: What the stated ellipses should hold.
ELLIPSE = 0.9
#: As with the claim: where less of the scatter is left than this, half of its variance is the poses'.
HALF_OF_VARIANCE = 0.7
#: As with the claim: a rate of detections is high where fewer are missed.
MISSED = 0.02
NAMES = {WITH: "adjusted", WITHOUT: "not adjusted"}

#: Means of H table 6.1, m, north and east, about an origin that is not printed.
POSITIONS = {"reference": (6.6, 16.4), WITH: (4.8, 12.2), WITHOUT: (3.6, 9.7)}

METHOD = r"""Images are rendered from the true poses of a simulated flight, blurred, counted by a camera with
noise, a fixed pattern, vignetting and dead pixels, and searched with the seven steps of H 4.3, as in the
study of vessel detection. Of the pieces that are found of the ship the largest counts; that they are the
ship's is known, as in H 6.4.1, here from the scene's labels. Where the border of the image cuts it, the
centre is moved along the major axis by H (4.7), for a ship as long as 70 m are from 100 m.

Both kinds of centres go to the sea by H (5.13), with the poses of an autopilot that was neither calibrated
nor synchronised, and through the extended Kalman filter of H 6.3, with segments joined as H 6.4.1 joins
them. Distances are from the ship's own single-frequency receiver, whose errors count, as in the thesis;
beside them stand those from the ship's middle, ahead of which the receiver is.

H 6.4.1 does not print the filter's parameters. They are those of H 6.4.2, flight 2, for a slow vessel:
$\sigma_v = 0.01$ m/s², $\mathbf{R} = (30\,\mathrm{px})^2$, $\mathbf{P}(0)$ of 10 m and 10 m/s. What else
they could be is in the table of readings."""

LIMITS = [
    "The ship is a hull with a deck, a house and an engine, of 70 m by 14 m, its bow to the south; what it "
    "looked like, how warm it was and how it lay is not printed. How the border cuts it follows from that.",
    "The course of the passes is chosen. Of a ship that enters at one border and leaves at the opposite one, "
    "what the one hides is made up for by the other, so the mean of all images may gain little.",
    "Waves stand still from image to image, and the sea has no foam, no rain, and no other ship.",
]


def shown_words(flights: int, images: int, every: int) -> str:
    """What was rendered of how many flights.

    Examples
    --------
    >>> shown_words(1, 441, 4)
    '1 simulated flight, one in 4 of its 441 images rendered'
    """
    whose = "its" if flights == 1 else "their"
    part = f"all of {whose}" if every == 1 else f"one in {every} of {whose}"
    return f"{flights} simulated flight{'s' * (flights != 1)}, {part} {images} images rendered"


def limits(images: int, every: int) -> list[str]:
    """`LIMITS`, and what it means that only every so many of the images are rendered."""
    if every == 1:
        return LIMITS
    return [
        *LIMITS,
        f"Of the {images} images one in {every} is rendered, and the filter has as many fewer measurements "
        "than that of the thesis: errors of its track and its time to rest are not those of all images.",
    ]


def _nearer(first: pd.Series, second: pd.Series) -> str:
    count, n = int((first < second).sum()), len(first)
    return f"nearer on {count} of {n} flight{'s' * (n != 1)}"


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what `trial.trial` gives, one row for each flight."""
    middle = spread.median()

    def of(name: str) -> tuple[float, float]:
        return float(middle[WITH, name]), float(middle[WITHOUT, name])

    (pixel, plain_pixel), (sd, plain_sd), (mae, plain_mae) = (
        of("pixel_error"), of("sd_both"), of("mae_after_start"),
    )  # fmt: skip
    (mean, plain_mean), (middle_mean, plain_middle) = of("error_of_mean"), of("centre_error_of_mean")
    in_image = (
        f"Moved along its axis, the centre of what shows of the ship is {pixel:.0f} px from the true one in "
        f"place of {plain_pixel:.0f} px"
    )
    nearer = _nearer(spread[WITH, "mae_after_start"], spread[WITHOUT, "mae_after_start"])
    scatter = "less" if sd < plain_sd else "no less"
    return [
        f"{in_image}, and on the sea positions scatter {scatter}: by {sd:.1f} m against {plain_sd:.1f} m.",
        f"After {START_S:.0f} seconds the track is {mae:.1f} m off with the adjustment and {plain_mae:.1f} m "
        f"without; with it, it is {nearer}.",
        f"The mean of all positions is {mean:.1f} m from the ship's receiver with it, and {plain_mean:.1f} m "
        f"without; from the ship's middle, {middle_mean:.1f} m and {plain_middle:.1f} m.",
    ]


def cause_words(spread: pd.DataFrame) -> str:
    """Where errors come from: what true poses would leave of scatter and of the mean."""
    parts = []
    for subject in (WITH, WITHOUT):
        ratio = float((spread[subject, "sd_true_poses"] / spread[subject, "sd_both"]).median())
        left, whole, left_middle, whole_middle = (
            spread[subject, f"{origin}{name}"].median()
            for origin in ("", "centre_")
            for name in ("error_true_poses", "error_of_mean")
        )
        parts.append(
            f"{NAMES[subject]}, {100 * ratio:.0f} % of the scatter, and of what the mean is off "
            f"{left:.1f} m of {whole:.1f} m from the receiver, {left_middle:.1f} m of {whole_middle:.1f} m "
            "from the ship's middle"
        )
    share_left = scatter_left(spread)
    count, of = int((share_left < HALF_OF_VARIANCE).sum()), int(np.isfinite(share_left).sum())
    if not of:
        return ""
    if count == of:
        verdict = "So much of the scatter comes from the poses, as the thesis has it."
    elif count:
        verdict = (
            f"So on {count} of {of} flights much of the scatter comes from the poses, as the "
            "thesis has it, and on the others not."
        )
    else:
        verdict = (
            "So half of the variance or more, of one of them at least, is left with true poses; the thesis "
            "puts it down to the poses."
        )
    return f"With the true poses there would be left: {'; '.join(parts)}. {verdict}"


def origin_words(spread: pd.DataFrame, published: Mapping[tuple[str, str], float]) -> str:
    """What of the distances is the receiver's place and error: those from the ship's middle beside them."""
    off = float(spread[DETECTOR, "receiver_off"].median())
    parts = [
        f"{NAMES[who]} {spread[who, 'mae_after_start'].median():.1f} m from the receiver and "
        f"{spread[who, 'centre_mae_after_start'].median():.1f} m from the middle (published "
        f"{published['mae_after_start', who]:.2f} m, from the receiver)"
        for who in (WITH, WITHOUT)
    ]
    return (
        f"The receiver, by its own log, is {off:.1f} m from the ship's middle: how far ahead it is was "
        "chosen, the thesis says only that it was not exactly in the centre. What is compared with the "
        f"print depends on that. After {START_S:.0f} seconds the track is {'; '.join(parts)}."
    )


def detected_words(spread: pd.DataFrame) -> str:
    """How often the ship was found, and how often it was cut and moved."""
    rates, clear = (spread[DETECTOR, name] for name in ("detection_rate", "rate_beyond_sliver"))
    if not rates.notna().any():
        return ""
    high = [int((1 - one < MISSED).sum()) for one in (rates, clear)]
    largest = spread[DETECTOR, "largest_missed"].max()
    missed = (
        f"; what is missed shows {100 * largest:.1f} % of the ship at most" if np.isfinite(largest) else ""
    )
    cut, moved = (100 * spread[DETECTOR, name].median() for name in ("share_cut", "share_moved"))
    alarms = round(float((spread[DETECTOR, "images"] * spread[DETECTOR, "false_alarms_per_image"]).sum()))
    return (
        f"In {_over_flights(rates)} of the images that show any of it the ship is found, with {alarms} false "
        f"alarm{'s' * (alarms != 1)}, in {_over_flights(clear)} of those that show "
        f"{100 * SLIVER:g} % of it or more{missed}. "
        f"Fewer than {100 * MISSED:g} in a hundred are missed on {high[0]} of {len(spread)} flights by the "
        f"first count, on {high[1]} by the second. The border cuts it in {cut:.0f} % of the images, and of "
        f"the detections the centres of {moved:.0f} % are moved: those whose contour is closed, whose major "
        "axis is half as long again as the minor one, and meets the border that cuts them."
    )


def _over_flights(rates: pd.Series) -> str:
    """The mean of flights' rates with Student's interval: images of one pass are not independent."""
    if rates.notna().sum() < 2:
        return f"{100 * rates.mean():.1f} % (one flight)"
    if np.ptp(rates.dropna()) < 1e-12:  # flights that are all alike have no spread to make an interval of
        return f"{100 * rates.mean():.1f} % (on each of {int(rates.notna().sum())} flights)"
    mean, low, high = mean_share_interval(rates)
    return f"{100 * mean:.1f} % (95 % interval {100 * low:.1f} to {100 * high:.1f} %, over flights)"


def ellipse_words(spread: pd.DataFrame) -> str:
    """How often stated 90 % ellipses hold the truth, in the image and on the sea, over flights."""
    parts, words = [], {}
    for subject in (WITH, WITHOUT):
        shares = []
        for name, where in (("ellipse_coverage_90", "in the image"), ("ground_coverage_90", "on the sea")):
            values = spread[subject, name]
            shown = f"{100 * values.mean():.0f} % {where}"
            if values.notna().sum() > 1:
                _, low, high = mean_share_interval(values)
                shown += f" ({100 * low:.0f} to {100 * high:.0f}"
                if name == "ellipse_coverage_90":
                    words[subject] = (
                        "too small"
                        if high < ELLIPSE
                        else "too large"
                        if low > ELLIPSE
                        else f"{100 * ELLIPSE:g} % lies within"
                    )
                    shown += f": {words[subject]}"
                shown += ")"
            shares.append(shown)
        parts.append(f"{NAMES[subject]} {' and '.join(shares)}")
    if len(words) < 2:
        honest = "One flight cannot tell whether that is enough."
    elif "too small" in words.values():
        small = " and ".join(NAMES[who] for who, word in words.items() if word == "too small")
        honest = f"What the detector states of a ship that large is too small: {small}."
    else:
        honest = "So many flights do not show that what the detector states of it is too small."
    pieces = 100 * float(spread[DETECTOR, "share_in_pieces"].median())
    broken = (
        f" In {pieces:.0f} % of the detections the contour has gaps: pieces of it are found, not the ship."
        if pieces > 0
        else ""
    )
    return f"The stated 90 % ellipses hold the ship's centre: {'; '.join(parts)}. {honest}{broken}"


def rest_words(spread: pd.DataFrame) -> str:
    """When the estimated speed stays below the limit."""
    parts = []
    for subject in (WITH, WITHOUT):
        times = spread[subject, "time_to_rest"]
        never = int(times.isna().sum())
        shown = f"after {times.median():.0f} s" if times.notna().any() else "never"
        some = f", on {never} flight{'s' * (never != 1)} never" if never and shown != "never" else ""
        parts.append(f"{NAMES[subject]} {shown}{some}")
    return f"The estimated speed stays below {AT_REST_M_S:g} m/s: {'; '.join(parts)} (median)."


def readings_words(table: pd.DataFrame) -> str:
    """What the readings change in the comparison of both tracks."""
    moved, late = table[table["subject"] == WITH], table.set_index("reading")["mae_after_start"]
    better = moved[moved["mae_after_start"].to_numpy() < late[moved["beside"]].to_numpy()]
    ordered = moved.sort_values("mae_after_start")
    best, worst = ordered.iloc[0], ordered.iloc[-1]
    return (
        f"On the flight of the figures {len(better)} of {len(moved)} readings with the adjustment give a "
        "track nearer than the one without it of the same images and noise: from "
        f"{best['mae_after_start']:.1f} m with “{best['reading']}” to {worst['mae_after_start']:.1f} m with "
        f"“{worst['reading']}”."
    )


def printed_table(published: Mapping[tuple[str, str], float]) -> pd.DataFrame:
    """Table 6.1 as printed, with what can be compared of it."""
    rows = []
    for k, axis in enumerate(("north", "east")):
        reference = POSITIONS["reference"][k]
        values = [POSITIONS[subject][k] for subject in (WITH, WITHOUT)]
        rows.append(
            {
                "measure": f"mean {axis} position",
                "reference": f"{reference:.1f}",
                "adjusted": f"{values[0]:.1f}",
                "plain": f"{values[1]:.1f}",
                "compared": " and ".join(f"{reference - value:.1f}" for value in values),
            }
        )
    for axis in ("north", "east"):
        values = [published[f"sd_{axis}", subject] for subject in (WITH, WITHOUT)]
        rows.append(
            {
                "measure": f"SD {axis} position",
                "reference": "x",
                "adjusted": f"{values[0]:.1f}",
                "plain": f"{values[1]:.1f}",
                "compared": "as printed",
            }
        )
    return pd.DataFrame(rows)
