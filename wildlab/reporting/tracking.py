"""What the report on a flight's tracks says: all of it follows from the numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.following.follow import TOGETHER
from wildlab.analysis.following.judged import (
    CAUTIOUS,
    CONSISTENT,
    FEW_INDEPENDENT,
    FEWEST,
    LEADING,
    OVERCONFIDENT,
    UNKNOWN,
    Apart,
    leading_filter,
    verdict,
)
from wildlab.analysis.following.noise_model import ROUGH, ToldValue
from wildlab.analysis.following.tuned import Tuned
from wildlab.analysis.overviews.verdict import Evidence, Verdict, verdict_of
from wildlab.reporting.report import Report
from wildlab.reporting.text import NOTHING
from wildlab.reporting.tracking_reinitialisation import summary_sentences

#: Errors nearer to what is stated than by this factor are "about as large".
ALIKE = 1.2
#: A mean outside of its band by less than this factor may be so by chance, where few values are independent.
NEAR_THE_BAND = 1.5
WORDS = {
    "ekf": "white noise (EKF)",
    "ukf": "white noise (UKF)",
    "imm": "two motions (IMM)",
    "coloured": "coloured noise",
    "schmidt": "considered errors (Schmidt)",
    "thinned": "thinned detections",
}


SHORT = {"ekf": "EKF", "ukf": "UKF", "imm": "IMM", "coloured": "coloured", "schmidt": "Schmidt",
         "thinned": "thinned"}  # fmt: skip


def short_words(name: str) -> str:
    """The same for titles."""
    base = name.removesuffix("-smoothed")
    return SHORT.get(base, base) + (" smoothed" if name != base else "")


def filter_words(name: str) -> str:
    """A filter's name in words; a smoothed one says so."""
    return WORDS.get(name.removesuffix("-smoothed"), name) + (
        ", smoothed" if name.endswith("-smoothed") else ""
    )


def length(metres: float) -> str:
    """Metres with sensible digits.

    Examples
    --------
    >>> length(0.234), length(12.3), length(3.46), length(6_070_000.0)
    ('0.23 m', '12 m', '3.5 m', '6070 km')
    """
    if metres >= 10_000:
        return f"{metres / 1000:.0f} km"
    return f"{metres:.2f} m" if metres < 1 else f"{metres:.1f} m" if metres < 10 else f"{metres:.0f} m"


def size_words(nees: float) -> str:
    """Errors beside what a filter states, of a mean NEES of two degrees of freedom.

    Examples
    --------
    >>> size_words(18.0), size_words(2.1), size_words(0.5)
    ('3.0 times as large as stated', 'about as large as stated', '0.50 of what is stated')
    """
    factor = float(np.sqrt(nees / 2))
    if factor > ALIKE:
        return f"{factor:.1f} times as large as stated"
    if factor < 1 / ALIKE:
        return f"{factor:.2f} of what is stated"
    return "about as large as stated"


#: Where no filter is consistent.
NONE_CONSISTENT = "No filter is consistent; that of the least error leads."
#: Detections may fall this many times as far from where they are expected as stated.
SURPRISED = 1.5
#: What is said of a verdict by a mean of few independent values.
FEW = "on few independent values"


def on_few(row: pd.Series, what: str = "nees") -> bool:
    """Whether a verdict stands on so few independent values that it may be by chance."""
    if not row[what] > 0:
        return False
    if row["verdict" if what == "nees" else "nis_verdict"] == CONSISTENT:
        return bool(row[f"{what}_worth"] < FEWEST)
    outside = max(row[what] / row[f"{what}_high"], row[f"{what}_low"] / row[what])
    # The band is too narrow where its width is a guess; what is far outside is outside all the same.
    return bool(row[f"{what}_worth"] < FEW_INDEPENDENT and 1 < outside < NEAR_THE_BAND)


def verdict_words(row: pd.Series, what: str = "nees") -> str:
    """The verdict with its band, and whether it stands on few independent values."""
    said = str(row["verdict" if what == "nees" else "nis_verdict"])
    return said + (f", {FEW}" if on_few(row, what) else "")


def summary(rows: pd.DataFrame, pairs: Sequence[Apart], tuned: Tuned | None) -> tuple[list[str], Verdict]:
    """The first sentences of the page, and its verdict."""
    if not (rows["detections"] > 0).any() and (rows["used"] > 0).any():
        return ["One detection started a track, and none followed: nothing can be judged."], Verdict.MEND
    if not (rows["detections"] > 0).any():
        return ["No track was started: no detection gives a place near a target."], Verdict.MEND
    known = rows[rows["compared"] > 0]
    said, word = _with_truth(known) if len(known) else _without_truth(rows[rows["detections"] > 0], pairs)
    pairs_of = [group for _, group in rows.groupby(["sensor", "target"], sort=False)]
    unseen = [group for group in pairs_of if not (group["detections"] > 0).any()]
    never = [f"{group['target'].iloc[0]} by {group['sensor'].iloc[0]}" for group in unseen]
    said += summary_sentences(rows)
    if never:
        said.append(f"Never followed: {', '.join(never)}.")
    if tuned is not None:
        how = "its truth" if tuned.against == "truth" else "the likelihood of its innovations"
        said.append(f"Tuned on the flight {tuned.flight} by {how}, judged on this one.")
    return said, word


def reason_of(rows: pd.DataFrame) -> str:
    """Why the verdict of `summary` is what it is: what the tracks of the leading filter were found to be.

    Parameters
    ----------
    rows
        As for `summary`.

    Returns
    -------
    str
    """
    followed = rows[rows["detections"] > 0]
    if not len(followed):
        return "No detection was followed by a second one."
    known = followed[followed["compared"] > 0]
    mine = known if len(known) else followed
    mine = mine[mine["filter"] == leading_filter(mine)]
    column, of = (
        ("verdict", "errors") if len(known) else ("nis_verdict", "distances from where it was expected")
    )
    what = "track" if len(mine) == 1 else "tracks"
    more = "; detections lie farther off than stated" if len(known) and len(_surprised(mine)) else ""
    return f"{len(mine)} {what}, by the size of their {of}: {_counts(mine, column)}{more}."


def _with_truth(rows: pd.DataFrame) -> tuple[list[str], Verdict]:
    alone = rows[rows["kind"] != TOGETHER]
    together, rows = rows[rows["kind"] == TOGETHER], alone if len(alone) else rows
    filters = list(dict.fromkeys(rows["filter"]))
    by_name = {name: rows[rows["filter"] == name] for name in filters}
    best = leading_filter(rows)
    mine, white = by_name[best], by_name.get("ekf")
    what = "The track" if len(mine) == 1 else f"The {len(mine)} tracks"
    are = "is" if len(mine) == 1 else "are"
    looks = int(mine["compared"].sum() + mine["without"].sum())
    size = float(mine["nees"].median())
    none = not mine["verdict"].isin([CONSISTENT, UNKNOWN]).any()
    said = [NONE_CONSISTENT] if none else []
    said.append(
        f"{what} of the filter with {filter_words(best)} {are} off by {_far(mine)} where the target is seen, "
        f"at {int(mine['compared'].sum())} of {looks} looks, and the errors there are "
        f"{size_words(size)}{_by_little(float(np.sqrt(size / 2)), mine['verdict'])}: {_counts(mine)}."
    )
    surprised = _surprised(mine)
    if len(surprised):
        times = float(np.sqrt((surprised["nis"] / surprised["dof"]).median()))
        of = "" if len(mine) == 1 else f" of {len(surprised)} of the {len(mine)} tracks"
        said.append(f"Detections{of} fall {times:.1f} times as far from where they are expected as stated.")
    unseen = mine[mine["without"] > 0]
    if len(unseen):
        wait = f"; the longest wait is {unseen['wait'].max():.1f} s" if unseen["wait"].notna().any() else ""
        said.append(
            f"Where it is not seen, {'it is' if len(mine) == 1 else 'they are'} off by "
            f"{_far(unseen, 'rmse_without')}{wait}."
        )
    worse = None
    if len(together) and len(alone):
        sentence, worse = _together(together[together["filter"] == best], mine)
        said += [sentence] if sentence else []
    if white is not None and best != "ekf":
        keys = ["sensor", "target"]
        pairs = mine.merge(white, on=keys, suffixes=("", "_white"))
        white = white[white.set_index(keys).index.isin(mine.set_index(keys).index)]
        ratio = float((pairs["rmse_white"] / pairs["rmse"]).median())
        said.append(
            f"With {filter_words('ekf')} the errors are {size_words(float(white['nees'].median()))}: "
            f"{_counts(white)}; {_error_change(ratio)}."
        )
    said += _smoothed(mine, by_name.get(f"{best}-smoothed"))
    in_all = len(rows.drop_duplicates(["sensor", "target"]))
    if len(mine) < in_all:
        said.append(f"These are {len(mine)} of {in_all} tracks: the others' detections cannot go through it.")
    few = mine.apply(on_few, axis=1)
    consistent = mine["verdict"] == CONSISTENT
    against = int((mine["verdict"].isin([OVERCONFIDENT, CAUTIOUS])).sum())
    troubled = against + len(surprised) + bool(worse)
    return said, verdict_of(Evidence(troubled=troubled, judged=int(consistent.any() and not few.any())))


def _surprised(rows: pd.DataFrame) -> pd.DataFrame:
    """Tracks whose errors are as stated, and whose detections are not where they expect them."""
    beyond = np.sqrt(rows["nis"] / rows["dof"]) > SURPRISED
    beyond &= (rows["verdict"] == CONSISTENT) & (rows["nis_verdict"] == OVERCONFIDENT)
    return rows[beyond & ~rows.apply(on_few, axis=1, what="nis")]


def _smoothed(mine: pd.DataFrame, smoothed: pd.DataFrame | None) -> list[str]:
    """What going back over the tracks made of their errors; nothing where nobody did."""
    if smoothed is None or not len(smoothed):
        return []
    both = mine.merge(smoothed, on=["sensor", "target"], suffixes=("", "_smoothed"))
    ratio = float((both["rmse_smoothed"] / both["rmse"]).median())
    return [
        f"Smoothed, with later detections too, the errors are {ratio:.2f} of these, and "
        f"{size_words(float(smoothed['nees'].median()))}: {_counts(smoothed)}."
    ]


def _together(together: pd.DataFrame, alone: pd.DataFrame) -> tuple[str, bool]:
    """All sensors beside the best one alone, of the target where that is worst; whether they are worse."""
    best = alone.loc[alone.groupby("target")["rmse"].idxmin().dropna()].set_index("target")
    both = together[together["target"].isin(best.index) & together["rmse"].notna()].set_index("target")
    if not len(both):
        return "", False
    own, least = both["rmse"].to_numpy(float), best["rmse"].reindex(both.index).to_numpy(float)
    worst = int(np.argmax(own / least))
    target, worse = str(both.index[worst]), bool(own[worst] > ALIKE * least[worst])
    said = (
        f"All sensors together are off by {length(float(own[worst]))} from {target}, "
        f"{best.loc[target, 'sensor']} alone by {length(float(least[worst]))}"
    )
    return said + ("; do not use them together as they are told of." if worse else "."), worse


def _far(rows: pd.DataFrame, column: str = "rmse") -> str:
    """Root mean square errors: of one track its own, of several the middle one's and their range."""
    values = rows[column]
    if len(rows) == 1:
        return f"{length(float(values.iloc[0]))} (root mean square)"
    low, high = length(float(values.min())), length(float(values.max()))
    return f"{length(float(values.median()))} in the middle (root mean squares from {low} to {high})"


def _error_change(ratio: float) -> str:
    """Errors of the white filter over the other's, in the middle of the tracks."""
    if ratio > 1.05 or ratio < 1 / 1.05:
        return f"it is {ratio:.2f} times as far off"
    return "both are about as far off"


def _counts(rows: pd.DataFrame, column: str = "verdict") -> str:
    order = (CONSISTENT, OVERCONFIDENT, CAUTIOUS, UNKNOWN)
    what = "nees" if column == "verdict" else "nis"
    counts = {name: rows[rows[column] == name] for name in order}
    if len(rows) == 1:
        return verdict_words(rows.iloc[0], what)
    said = []
    for name, some in counts.items():
        few = int(some.apply(on_few, axis=1, args=(what,)).sum()) if len(some) else 0
        caveat = "" if not few else f" ({FEW})" if few == len(some) else f" ({few} {FEW})"
        said += [f"{len(some)} {name}{caveat}"] if len(some) else []
    return ", ".join(said)


def _without_truth(rows: pd.DataFrame, pairs: Sequence[Apart]) -> tuple[list[str], Verdict]:
    name = leading_filter(rows)
    mine = rows[rows["filter"] == name]
    factor = float(np.sqrt((mine["nis"] / mine["dof"]).mean()))
    said = [
        f"Detections fall {_off(factor)} from where the filter with {filter_words(name)} expects them as it "
        f"states{_by_little(factor, mine['nis_verdict'])}: {_counts(mine, 'nis_verdict')}.",
        "How far off the tracks are cannot be said without the targets' true places.",
    ]
    used = [one for one in pairs if one.filter == name]
    for one in used[:2]:
        said.append(apart_sentence(one))
    agree = all(verdict(one.squares) == CONSISTENT for one in used)
    against = int(mine["nis_verdict"].isin([OVERCONFIDENT, CAUTIOUS]).sum())
    # Consistent innovations do not show an error that lasts: never sound.
    return said, verdict_of(Evidence(troubled=against + (not agree)))


def _off(factor: float) -> str:
    if factor > ALIKE:
        return f"{factor:.1f} times as far"
    if factor < 1 / ALIKE:
        return f"{factor:.2f} times as far"
    return "about as far"


def _by_little(factor: float, verdicts: pd.Series) -> str:
    """What reconciles "about as far" with a verdict that says otherwise: many values tell a small excess."""
    if 1 / ALIKE <= factor <= ALIKE and len(verdicts) == 1 and verdicts.isin([OVERCONFIDENT, CAUTIOUS]).all():
        return f" ({factor:.2f} times; more than by chance all the same)"
    return ""


def apart_sentence(one: Apart) -> str:
    """How far two sensors put one target apart, beside what their tracks state."""
    return (
        f"{one.one} and {one.other} put {one.target} {length(one.rms)} apart (root mean square), "
        f"{_off(float(np.sqrt(one.squares.mean / 2)))} as their tracks state."
    )


def tracks_table(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each track: errors, NEES, NIS, autocorrelation, each beside what it should be."""
    truth = bool((rows["compared"] > 0).any())

    def band(row: pd.Series, what: str) -> str:
        if not np.isfinite(row[what]):
            return NOTHING
        return f"{row[what]:.2f} ({row[f'{what}_low']:.2f} to {row[f'{what}_high']:.2f})"

    shown = []
    for _, row in rows.iterrows():
        one = {
            "track": f"{row['target']}, {row['sensor']}",
            "filter": filter_words(row["filter"]),
            "verdict": verdict_words(row, "nees" if truth else "nis"),
            "detections": NOTHING if row["filter"].endswith("-smoothed") else f"{row['detections']:.0f}",
        }
        if truth:
            inside = NOTHING
            if np.isfinite(row["inside"]):
                low, high = 100 * row["inside_low"], 100 * row["inside_high"]
                inside = f"{100 * row['inside']:.0f} ({low:.0f} to {high:.0f})"
            one |= {
                "compared": row["compared"],
                "rmse": row["rmse"],
                "rmse_without": row["rmse_without"],
                "nees": band(row, "nees"),
                "inside": inside,
            }
        one |= {"nis": band(row, "nis"), "lag1": row["lag1"]}
        shown.append(one)
    return pd.DataFrame(shown)


HEADINGS = {
    "track": "target, sensor",
    "filter": "filter",
    "verdict": "verdict",
    "compared": "looks compared",
    "rmse": "RMS error (m)",
    "rmse_without": "RMS unseen (m)",
    "nees": "mean NEES (band)",
    "inside": "inside (%)",
    "nis": "mean NIS (band)",
    "lag1": "lag 1",
    "detections": "used",
}


def columns_of(table: pd.DataFrame) -> dict[str, str]:
    """Headings of the columns that are there."""
    return {name: words for name, words in HEADINGS.items() if name in table}


def said_table(said: Sequence[ToldValue]) -> pd.DataFrame:
    """What filters were told, first what is assumed or estimated on this flight."""
    ordered = sorted(said, key=lambda one: not (one.source.startswith("assumed") or one.source == ROUGH))
    return pd.DataFrame(
        [{"of": one.subject, "what": one.what, "value": one.value, "source": one.source} for one in ordered]
    )


def assumed_sentence(said: Sequence[ToldValue]) -> str:
    """How much of what filters were told is assumed; nothing where none is."""
    assumed = sum(one.source.startswith("assumed") for one in said)
    here = sum(one.source == ROUGH for one in said)
    if not assumed and not here:
        return "All that the filters were told is stated or was tuned on another flight."
    parts = [
        f"{assumed} of {len(said)} values that the filters were told {_are(assumed)} assumed."
        if assumed
        else "",
        f"{here} of {len(said)} {_are(here)} estimated from the detections that are judged here, so that NIS "
        "is no proof of it."
        if here
        else "",
        "State them in `flight.toml` or with `--settings`, or tune them on another flight with `--tune`.",
    ]  # fmt: skip
    return " ".join(filter(None, parts))


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def band_name(name: str, end: str) -> str:
    """The metric of an end of the band in which the mean of a consistent filter lies.

    Examples
    --------
    >>> band_name("nees", "high")
    'nees_band_high'
    """
    return f"{name}_band_{end}"


def record(report: Report, rows: pd.DataFrame) -> None:
    """The numbers of every track, for ``metrics.json``, and which filter the page speaks of."""
    if len(rows):
        report.metric(LEADING, leading_filter(rows), 1, "1")
    for _, row in rows.iterrows():
        subject = f"{row['sensor']}/{row['target']}/{row['filter']}".replace(" ", "-")
        for name, unit, low, high, n in (
            ("rmse", "m", None, None, "compared"),
            ("rmse_without", "m", None, None, "without"),
            ("nees", "1", None, None, "compared"),
            ("nis", "1", None, None, "detections"),
            ("fraction_nees_inside", "1", "inside_low", "inside_high", "compared"),
            ("lag1_autocorrelation", "1", None, None, "detections"),
            ("share_followed", "1", None, None, None),
        ):
            column = {"fraction_nees_inside": "inside", "lag1_autocorrelation": "lag1",
                      "share_followed": "followed"}.get(name, name)  # fmt: skip
            if not np.isfinite(row[column]):
                continue
            if name in ("nees", "nis"):
                # Of a consistent filter; an interval of the value it is not.
                for end in ("low", "high"):
                    if np.isfinite(row[f"{name}_{end}"]):
                        report.metric(band_name(name, end), subject, float(row[f"{name}_{end}"]), "1")
            report.metric(
                name,
                subject,
                float(row[column]),
                unit,
                n=None if n is None else int(row[n]),
                low=None if low is None else float(row[low]),
                high=None if high is None else float(row[high]),
            )
