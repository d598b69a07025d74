"""The page on many targets at once: who has a track, whether it stays on its target, and what is on nothing.

What the page says follows by rules from what was tracked and how it compares with the truth; the words lie in
``data/messages/en/tracking-many.toml``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from wildlab.analysis.tracks.ground_positions import counts_twice, platform_errors
from wildlab.analysis.tracks.many import ManyTracks
from wildlab.evaluation.identities import Identities
from wildlab.messages.catalogue import Message, load_texts
from wildlab.messages.quantities import length, percent_of
from wildlab.names import listed
from wildlab.reporting.charts import tracks as charts
from wildlab.reporting.report import Report, Wording
from wildlab.reporting.tracking import count_assumed, parameters_table, plain
from wildlab.tracking.multitarget_tracks import Count, count_interval, count_probabilities

#: A target is tracked well where it has a track at this share of the scans at which it can be seen; below
#: half it is lost.
FOLLOWED, HALF = 0.9, 0.5
#: A track that was compared with its target at fewer scans is not judged.
FEWEST = 5
#: Of so many standard deviations hardly any honest error is larger.
WITHIN_SDS = 3.0
#: Mean NEES of a position, divided by two: between these a track is as far off as it predicts, to a factor of
#: about 1.4 in size.
SMALLEST, LARGEST = 0.5, 2.0


# -- numbers


def count_tracks(shown: ManyTracks) -> int:
    """How many tracks there are in all."""
    return len({int(one) for scan in shown.shown for one in scan.identity})


def most_at_once(followed: ManyTracks) -> Count:
    """How many targets there are at the scan that has most, with a 90 % interval, as tracks may be false."""
    expected = [float(scan.existence.sum()) for scan in followed.shown]
    if not expected:
        return count_interval(count_probabilities([]))
    return count_interval(count_probabilities(followed.shown[int(np.argmax(expected))].existence))


def rms_error(lives: Identities) -> float:
    """Root mean square distance of tracks from the targets they are on, m; NaN where there are none."""
    squares = sum(one.localisation**2 for one in lives.gospa)
    return float(np.sqrt(squares / count)) if (count := on_target(lives)) else float("nan")


def on_target(lives: Identities) -> int:
    """How often a target that could be seen had a track, scans and targets counted together."""
    could = sum(life.visible for life in lives.targets.values())
    return could - sum(one.n_missed for one in lives.gospa)


def false_share(lives: Identities) -> float:
    """Of how many scans a track is on nothing."""
    return float(np.mean([one.n_false > 0 for one in lives.gospa]))


def counted(count: Count) -> str:
    """An interval of a number of targets.

    Examples
    --------
    >>> counted(count_interval(count_probabilities([0.99, 0.5])))
    '1 to 2'
    """
    return f"{count.low}" if count.low == count.high else f"{count.low} to {count.high}"


def needed_reach(followed: ManyTracks) -> float:
    """How far from its target a track must count as on it, m, so that honest errors and the longest hull do.

    0 where what is taken suffices.
    """
    covariances = [scan.P[:, :2, :2] for scan in followed.shown if len(scan.P)]
    widest = 0.0
    if covariances:
        widest = float(np.median(np.sqrt(np.linalg.eigvalsh(np.concatenate(covariances))[:, -1])))
    longest = max((hull.length_m for hull in followed.targets.hulls), default=0.0)
    reach = max(WITHIN_SDS * widest, longest)
    return float(np.ceil(reach)) if reach > followed.cutoff_m else 0.0


# -- what follows from them

#: The colour of the page and the key of its verdict's word by what is most pressing; all else is looked at.
VERDICTS = {
    "none": ("bad", "none"),
    "swaps": ("bad", "swapped"),
    "never": ("bad", "lost"),
    "lost": ("bad", "lost"),
    "unjudged": ("neutral", "unjudged"),
    "sound": ("good", "sound"),
}


def answer(followed: ManyTracks, lives: Identities | None) -> list[Message]:
    """How well the targets are tracked, and what goes wrong: two sentences at most."""
    tracks = count_tracks(followed)
    values = {"tracks": tracks, "scans": len(followed.scans), "minutes": f"{followed.minutes:.1f}"}
    if not tracks:
        return [Message("no-track", values)]
    if lives is None:
        return [Message("no-truth", {**values, "most": counted(most_at_once(followed))})]
    seen = {name: life.tracked for name, life in lives.targets.items() if life.visible}
    if not seen:
        return [Message("none-in-reach", values)]
    never = sum(share == 0 for share in seen.values())
    least = min(seen, key=lambda name: seen[name])
    values = {
        "targets": len(seen),
        "share": percent_of(seen[least]),
        "target": plain(str(least)),
        "rmse": length(rms_error(lives)) if on_target(lives) else "–",
        "never": never,
    }
    key = "never-any" if never == len(seen) else "never" if never else "one" if len(seen) == 1 else "several"
    first = Message(key, values)
    if reach := needed_reach(followed):
        return [first, Message("reach", {"cutoff": f"{followed.cutoff_m:g}", "reach": f"{reach:.0f}"})]
    counts = {
        "swaps": lives.swaps,
        "breaks": lives.breaks,
        "false": sum(track.false for track in lives.tracks.values()),
        "tracks": len(lives.tracks),
    }
    return [first, Message("identities-others" if followed.others else "identities", counts)]


def verdict_of(message: Message) -> tuple[str, str]:
    """The colour of the page, ``good``, ``warn``, ``bad`` or ``neutral``, and the key of the verdict's word,
    which follow from the reason."""
    return VERDICTS.get(message.key.removeprefix("reason-"), ("warn", "look"))


def reason(followed: ManyTracks, lives: Identities | None) -> Message:
    """The most pressing of what keeps the tracks from being sound."""
    if not count_tracks(followed):
        return Message("reason-none")
    seen = [] if lives is None else [life for life in lives.targets.values() if life.visible]
    if lives is None or not seen:
        return Message("reason-unjudged")
    # Of the tracks that have enough of them to be judged.
    nees = [one.anees / 2 for one in lives.tracks.values() if one.compared >= FEWEST]
    false = sum(track.false for track in lives.tracks.values())
    counts = (
        ("swaps", lives.swaps, len(lives.tracks)),
        ("never", sum(life.tracked == 0 for life in seen), len(seen)),
        ("lost", sum(0 < life.tracked < HALF for life in seen), len(seen)),
        ("breaks", lives.breaks, len(seen)),
        ("false", false, len(lives.tracks)),
        ("nothing", int(false_share(lives) > 1 - FOLLOWED), 1),
        ("short", sum(life.tracked < FOLLOWED for life in seen), len(seen)),
        ("few", int(not nees), 1),
        ("overconfident", sum(value > LARGEST for value in nees), len(nees)),
        ("conservative", sum(value < SMALLEST for value in nees), len(nees)),
    )
    key, count, of = next((one for one in counts if one[1]), ("sound", 0, 0))
    return Message(f"reason-{key}", {"count": count, "of": of, "share": percent_of(false_share(lives))})


def limits(followed: ManyTracks) -> list[Message]:
    """What the page does not tell; five at most."""
    kinds = {one.kind for one in followed.places.values()}
    every = {name: one.errors for name, one in followed.places.items()}
    platform = {"heading", "platform_north", "platform_east"}
    # What lasts of each target's own errors holds those of the platform, too.
    own_last = {one.name for one in followed.sensors if one.correlation}
    bare = [
        name for name, errors in every.items() if not (platform & platform_errors(errors) or name in own_last)
    ]
    shared = [
        name for name, own in every.items() if any(counts_twice(own, errors) for errors in every.values())
    ]
    estimated = [followed.truth_sd[name] for name in followed.truth_estimated if name in followed.truth_sd]
    exact = len(followed.truth) - sum(sd > 0 for sd in followed.truth_sd.values())
    truth = bool(followed.truth)
    conditional: tuple[tuple[str, bool, dict[str, Any]], ...] = (
        ("others", truth and not followed.others, {}),
        ("beside", truth and followed.others, {}),
        ("truth-estimated", bool(estimated), {"sd": f"{max(estimated, default=0.0):.2g}"}),
        ("truth-exact", truth and exact > 0, {"count": exact}),
        ("shared", bool(shared), {"sensors": listed(shared)}),
        ("bare", bool(bare), {"sensors": listed(bare)}),
        (
            "smoothed",
            bool(followed.unknown_correlation),
            {"sensors": listed(list(followed.unknown_correlation))},
        ),
        ("bearing", "bearing" in kinds, {}),
        ("pixel", "pixel" in kinds, {}),
        ("returned", True, {}),
    )
    return [Message(f"limit-{key}", values) for key, applies, values in conditional if applies][:5]


# -- tables


def targets_table(lives: Identities) -> pd.DataFrame:
    """A row for each target."""
    return pd.DataFrame(
        [
            {
                "target": plain(str(name)),
                "looks": life.visible,
                "tracked": 100 * life.tracked,
                "confirm": life.time_to_confirm,
                "swaps": life.swaps,
                "breaks": life.breaks,
            }
            for name, life in lives.targets.items()
        ]
    )


def tracks_table(followed: ManyTracks, lives: Identities | None) -> pd.DataFrame:
    """A row for each track: when it was shown, of which kind it is, and whether it was on a true target."""
    start = followed.scans[0].time if followed.scans else 0.0
    hulls = [plain(hull.name) for hull in followed.targets.hulls]
    shown = pd.DataFrame(
        [
            (int(identity), scan.time - start, int(np.argmax(kinds)))
            for scan in followed.shown
            for identity, kinds in zip(scan.identity, scan.kinds, strict=True)
        ],
        columns=["track", "time", "kind"],
    )
    each = shown.groupby("track", sort=False)
    rows = each["time"].agg(["min", "max", "size"]).set_axis(["from", "to", "looks"], axis=1)
    if len(hulls) > 1:
        rows["kind"] = [hulls[one] for one in each["kind"].agg(lambda kinds: kinds.mode()[0])]
    if lives is not None:
        # One that was there only while a true place was not known is not judged.
        of = [lives.tracks.get(one) for one in rows.index]
        rows["on"] = [100 * one.on_target / one.scans if one and one.scans else np.nan for one in of]
        rows["nees"] = [one.anees / 2 if one else np.nan for one in of]
        rows["alone"] = [one.anees_alone / 2 if one else np.nan for one in of]
    return rows.reset_index().astype({"track": str})


# -- what is recorded, and the page


def record(report: Report, followed: ManyTracks, lives: Identities | None) -> None:
    """The numbers, for ``metrics.json``."""
    report.metric("tracks", "all", count_tracks(followed), "1", n=len(followed.scans))
    most = most_at_once(followed)
    report.metric("targets_at_once", "most", most.mean, "1", low=most.low, high=most.high)
    if lives is None:
        return
    gospa = lives.gospa
    report.metric("gospa", "all", float(np.mean([one.distance for one in gospa])), "m", n=len(gospa))
    report.metric("rmse", "all", rms_error(lives), "m", n=on_target(lives))
    report.metric("swaps", "all", lives.swaps, "1")
    report.metric("breaks", "all", lives.breaks, "1")
    report.metric("false_tracks_per_minute", "all", lives.false_tracks_per_minute, "1/min")
    for number, life in enumerate(lives.targets.values(), start=1):
        if life.visible:
            report.metric("tracked", f"target-{number}", life.tracked, "1", n=life.visible)
            report.metric("time_to_confirm", f"target-{number}", life.time_to_confirm, "s")


def show_many(report: Report, followed: ManyTracks, lives: Identities | None) -> None:
    """Write the page, and record its numbers.

    Parameters
    ----------
    report
        Is added to.
    followed, lives
        From `wildlab.analysis.tracks.many`: the tracks, and their lives beside the true targets'.
    """
    wording = Wording(report, load_texts("tracking-many"))
    names, why = wording.texts.subjects, reason(followed, lives)
    level, word = verdict_of(why)
    record(report, followed, lives)
    report.head(names["question"], ", ".join(followed.places))
    verdict = names[f"verdict-{word}"], wording.messages([why])[0]
    report.summary(wording.messages(answer(followed, lives)), level=level, verdict=verdict)
    if followed.notes:
        report.points(followed.notes)
    figure, name, alt, caption = charts.tracks_shown(followed, lives)
    report.figure(figure, name=name, alt=alt, caption=caption, main=True)
    if lives is not None and any(life.visible for life in lives.targets.values()):
        report.section(names["over-time"])
        shown = [charts.identities_shown(followed, lives)] if any(lives.followed) else []
        report.figures([*shown, charts.wrong_shown(followed, lives)])
    if lives is not None and lives.targets:
        wording.table("targets", targets_table(lives))
    report.limits(wording.messages(limits(followed)))
    report.section("Details")
    wording.table("tracks", tracks_table(followed, lives))
    wording.table("parameters", parameters_table(followed.given), count_assumed(followed.given))
    report.method(wording.texts.method)
