"""What the report on many targets says, from its numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.following.judged import FEWEST
from wildlab.analysis.following.noise_model import ToldValue
from wildlab.analysis.many.follow import CUTOFF_M, ManyTracks
from wildlab.analysis.many.target_model import HERE
from wildlab.evaluation.identities import Identities
from wildlab.evaluation.sets import Gospa
from wildlab.reporting.quantities import length
from wildlab.reporting.report import Report
from wildlab.tracking.particles import Count, count_interval, count_probabilities

#: A target is followed well where it has a track at this share of the looks at which it can be seen.
FOLLOWED = 0.9
#: Of so many standard deviations hardly any honest error is larger.
WITHIN_SDS = 3.0
#: Mean NEES of a position, divided by two: between these a track is as far off as it says, to a factor of
#: about 1.4 in size.
SMALLEST, LARGEST = 0.5, 2.0
NOTHING = "–"


def counts_of(shown: ManyTracks) -> tuple[int, float]:
    """How many tracks there are in all, and at a look in the mean."""
    names = {int(one) for look in shown.shown for one in look.identity}
    return len(names), float(np.mean([len(look.identity) for look in shown.shown])) if shown.shown else 0.0


def most_at_once(followed: ManyTracks) -> Count:
    """How many targets there are at the look that has most, with a 90 % interval, as tracks may be false."""
    expected = [float(look.existence.sum()) for look in followed.shown]
    if not expected:
        return count_interval(count_probabilities([]))
    return count_interval(count_probabilities(followed.shown[int(np.argmax(expected))].existence))


def count_words(count: Count) -> str:
    """An interval of a number of targets.

    Examples
    --------
    >>> count_words(count_interval(count_probabilities([0.99, 0.5])))
    '1 to 2'
    """
    return f"{count.low}" if count.low == count.high else f"{count.low} to {count.high}"


def rms_error(lives: Identities) -> float:
    """Root mean square distance of tracks from the targets they are on, m; NaN where there are none."""
    squares = sum(one.localisation**2 for one in lives.gospa)
    return float(np.sqrt(squares / count)) if (count := on_target(lives)) else float("nan")


def on_target(lives: Identities) -> int:
    """How often a target that could be seen had a track, looks and targets counted together."""
    could = sum(life.visible for life in lives.targets.values())
    return could - sum(one.n_missed for one in lives.gospa)


def summary(followed: ManyTracks, lives: Identities | None) -> tuple[list[str], str]:
    """The first sentences of the page, and its level."""
    tracks, at_once = counts_of(followed)
    looks, minutes = len(followed.scans), followed.minutes
    many = f"{tracks} {'track' if tracks == 1 else 'tracks'} in {looks} looks over {minutes:.1f} min"
    if not tracks:
        return [f"No track was confirmed in {looks} looks over {minutes:.1f} min."], "bad"
    if lives is None:
        return [
            f"{many}, {at_once:.1f} at a time in the mean; when there are most, "
            f"{count_words(most_at_once(followed))} at once (90 % interval).",
            "Whose they are, and how many are false, cannot be said without the targets' true places.",
        ], "neutral"
    seen = {name: life for name, life in lives.targets.items() if life.visible}
    if not seen:
        return [f"{many}; no target with a known place was ever in reach."], "neutral"
    shares = {name: life.tracked for name, life in seen.items()}
    least = min(shares, key=lambda name: shares[name])
    if len(seen) > 1:
        first = f"Of {len(seen)} targets in reach, {plain(str(least))} has a track at the fewest looks, at "
    else:
        first = "The target in reach has a track at "
    off = f"; tracks are off by {length(rms_error(lives))} (RMS of those within {followed.cutoff_m:g} m)"
    said = [
        f"{first}{_share(shares[least])} of those at which it can be seen{off if on_target(lives) else ''}.",
        f"{_how_often(lives.swaps, 'track went over to another target', 'tracks went over to others')}, "
        f"{_how_often(lives.breaks, 'target got a new track', 'times a target got a new track').lower()}"
        # Where tracks on others are not judged, none is on nothing.
        + ("." if followed.others else f", and {_false_words(lives)}."),
    ]
    if len(lives.gospa) < looks:
        said.append(f"Judged are {len(lives.gospa)} of {looks} looks: a true place is known there.")
    if lives.incomplete:
        said.append(
            "As is stated, others are about whose true places nobody knows: tracks on none of the known ones "
            "are not judged."
            if followed.others
            else f"At {lives.incomplete} of the judged looks not every target's true place is known: tracks "
            "on none of the known ones are left out there."
        )
    said += [one for one in (_wide_words(followed), _long_words(followed)) if one]
    lost = [name for name, share in shares.items() if share == 0]
    if lost:
        said.append(f"Never followed: {', '.join(plain(str(name)) for name in lost)}.")
    return said, _level(lives, shares)


def _wide_words(followed: ManyTracks) -> str:
    """Where tracks may well be farther off than what counts as on a target; "" else."""
    covariances = [look.P[:, :2, :2] for look in followed.shown if len(look.P)]
    if not covariances:
        return ""
    widest = float(np.median(np.sqrt(np.linalg.eigvalsh(np.concatenate(covariances))[:, -1])))
    if WITHIN_SDS * widest <= followed.cutoff_m:
        return ""
    return (
        f"Tracks say that they may be {length(widest)} off (standard deviation of the worse axis, median), "
        f"and what is farther than {followed.cutoff_m:g} m counts as on nothing: honest tracks may be among "
        f"it. State `reach_m = {np.ceil(WITHIN_SDS * widest):.0f}` in [targets]."
    )


def _long_words(followed: ManyTracks) -> str:
    """Where a target is longer than what counts as on it; "" else."""
    longest = max((hull.length_m for hull in followed.targets.hulls), default=0.0)
    if longest <= followed.cutoff_m:
        return ""
    return (
        f"The longest kind of target has {length(longest)}, and a track farther than {followed.cutoff_m:g} m "
        "from where a target is said to be counts as on nothing, also where it is on its other end. State "
        f"`reach_m = {np.ceil(longest):.0f}` in [targets]."
    )


def false_share(lives: Identities) -> float:
    """Of how many looks a track is on nothing."""
    return float(np.mean([one.n_false > 0 for one in lives.gospa]))


def _false_words(lives: Identities) -> str:
    false = sum(track.false for track in lives.tracks.values())
    rate = lives.false_tracks_per_minute
    each = f" ({rate:.2f} a minute)" if np.isfinite(rate) else ""
    of = f"{false} of {len(lives.tracks)} tracks{each} {'is' if false == 1 else 'are'} mostly on nothing"
    return f"{of}; a track is on nothing at {_share(false_share(lives))} of the looks"


def judged_nees(lives: Identities) -> list[float]:
    """Mean NEES / 2 of the tracks that have enough of them to be judged."""
    return [one.anees / 2 for one in lives.tracks.values() if one.compared >= FEWEST]


def _level(lives: Identities, shares: dict[object, float]) -> str:
    if lives.swaps or min(shares.values()) < 0.5:
        return "bad"
    nees = judged_nees(lives)
    doubtful = not nees or any(not SMALLEST <= one <= LARGEST for one in nees)
    false = any(track.false for track in lives.tracks.values()) or false_share(lives) > 1 - FOLLOWED
    if lives.breaks or false or min(shares.values()) < FOLLOWED or doubtful:
        return "warn"
    return "good"


def verdict_of(followed: ManyTracks, lives: Identities | None, level: str) -> tuple[str, str]:
    """The word that goes with the level, and its reason."""
    tracks, _ = counts_of(followed)
    if not tracks:
        return "no track", "Nothing met all that the tracker was told a target is."
    if lives is None:
        return "not judged", "No target's true place is known at any look."
    seen = [life for life in lives.targets.values() if life.visible]
    if not seen:
        return "not judged", "No target whose true place is known is in reach."
    reasons = []
    if lives.swaps:
        reasons.append(f"tracks went over to other targets: {lives.swaps}")
    if lives.breaks:
        reasons.append(f"targets got new tracks: {lives.breaks}")
    if false := sum(track.false for track in lives.tracks.values()):
        reasons.append(f"tracks mostly on nothing: {false} of {len(lives.tracks)}")
    elif false_share(lives) > 1 - FOLLOWED:
        reasons.append(f"a track is on nothing at {_share(false_share(lives))} of the looks")
    if never := sum(life.tracked == 0 for life in seen):
        reasons.append(f"targets never followed: {never} of {len(seen)}")
    if short := sum(0 < life.tracked < FOLLOWED for life in seen):
        reasons.append(
            "targets without a track at more than a tenth of the looks, those before it is confirmed "
            f"counted too: {short} of {len(seen)}"
        )
    nees = judged_nees(lives)
    if not nees:
        reasons.append(f"no track was on a target at {FEWEST} looks: its covariance is not judged")
    if over := sum(value > LARGEST for value in nees):
        reasons.append(f"tracks farther off than they say: {over} of {len(nees)}")
    if under := sum(value < SMALLEST for value in nees):
        reasons.append(f"tracks nearer than they say: {under} of {len(nees)}")
    words = {"good": "sound", "warn": "look closer", "bad": "mixed up" if lives.swaps else "targets lost"}
    if not reasons:
        reasons = ["every target was followed by one track, and hardly ever was a track on nothing"]
    text = "; ".join(reasons)
    return words[level], f"{text[0].upper()}{text[1:]}."


def _share(value: float) -> str:
    return f"{100 * value:.0f} %"


def _how_often(count: int, once: str, more: str) -> str:
    return f"No {once}" if not count else f"1 {once}" if count == 1 else f"{count} {more}"


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


TARGETS = {
    "target": "target", "looks": "looks in reach", "tracked": "with a track (%)",
    "confirm": "first after (s)", "swaps": "tracks from others", "breaks": "new tracks",
}  # fmt: skip


def tracks_table(followed: ManyTracks, lives: Identities | None) -> pd.DataFrame:
    """A row for each track: when it was shown, of which kind it is, and whether it was on a true target."""
    rows = []
    hulls = [hull.name for hull in followed.targets.hulls]
    spans: dict[int, list[tuple[float, int]]] = {}
    for look in followed.shown:
        for i, identity in enumerate(look.identity):
            spans.setdefault(int(identity), []).append((look.time, int(np.argmax(look.kinds[i]))))
    start = followed.scans[0].time if followed.scans else 0.0
    for identity, span in spans.items():
        times = [time for time, _ in span]
        kinds = np.bincount([kind for _, kind in span], minlength=len(hulls))
        row: dict[str, object] = {
            "track": str(identity),
            "from": times[0] - start,
            "to": times[-1] - start,
            "looks": len(span),
        }
        if len(hulls) > 1:
            row["kind"] = plain(hulls[int(np.argmax(kinds))])
        if lives is not None:
            # One that was there only while a true place was not known is not judged.
            life = lives.tracks.get(identity)
            row["on"] = 100 * life.on_target / life.scans if life and life.scans else np.nan
            row["nees"] = life.anees / 2 if life else np.nan
            row["alone"] = life.anees_alone / 2 if life else np.nan
        rows.append(row)
    return pd.DataFrame(rows)


TRACKS = {
    "track": "track", "from": "from (s)", "to": "to (s)", "looks": "looks", "kind": "mostly a",
    "on": "on a target (%)", "nees": "mean NEES / 2", "alone": "truth exact",
}  # fmt: skip


def parts_table(found: Sequence[Gospa]) -> pd.DataFrame:
    """What GOSPA is made of, means over the looks."""
    total = np.mean([one.distance for one in found])
    squares = {
        "distance of tracks from their targets": np.mean([one.localisation**2 for one in found]),
        "targets without a track": np.mean([one.missed**2 for one in found]),
        "tracks on nothing": np.mean([one.false**2 for one in found]),
    }
    every = sum(squares.values())
    rows = [{"part": "GOSPA, mean over looks", "metres": total, "share": np.nan}]
    for name, square in squares.items():
        rows.append(
            {
                "part": f"from {name}, root of the mean square",
                "metres": np.sqrt(square),
                "share": 100 * square / every if every else np.nan,
            }
        )
    return pd.DataFrame(rows)


def told_table(said: Sequence[ToldValue]) -> pd.DataFrame:
    """Every value, subject by subject; a name in it is only text."""
    subjects = list(dict.fromkeys(one.subject for one in said))
    return pd.DataFrame(
        [
            {"of": plain(one.subject), "what": one.what, "value": plain(one.value), "source": one.source}
            for one in sorted(said, key=lambda one: subjects.index(one.subject))
        ]
    )


def plain(text: str) -> str:
    """A name without the signs by which a page sets words bold or as code."""
    return text.replace("*", "∗").replace("`", "ˋ")


def assumed_sentence(said: Sequence[ToldValue]) -> str:
    """How much of what the tracker was told is assumed or estimated from what it then followed."""
    assumed = sum(one.source.startswith("assumed") for one in said)
    here = sum(one.source.startswith(HERE) for one in said)
    if not assumed and not here:
        return "All that the tracker was told is stated."
    return (
        f"Of {len(said)} values that the tracker was told, {assumed} {'is' if assumed == 1 else 'are'} "
        f"assumed and {here} {'is' if here == 1 else 'are'} estimated from the detections themselves. State "
        "them in `flight.toml` or with `--settings`."
    )


def record(report: Report, followed: ManyTracks, lives: Identities | None) -> None:
    """The numbers, for ``metrics.json``."""
    tracks, at_once = counts_of(followed)
    report.metric("tracks", "all", tracks, "1", n=len(followed.scans))
    report.metric("tracks_at_a_look", "all", at_once, "1", n=len(followed.scans))
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


def caption_of_gospa(cutoff: float = CUTOFF_M) -> str:
    """What GOSPA counts, with a cut-off in m."""
    return (
        f"GOSPA adds the distances of tracks from their targets, and {cutoff / np.sqrt(2):.1f} m for every "
        f"target without a track and every track on nothing, as squares; beyond {cutoff:g} m a track is on "
        "no target."
    )
