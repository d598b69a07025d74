"""What the page says, in no language yet: which texts, with which values. Each follows from the facts."""

from __future__ import annotations

import math
from typing import NamedTuple

from wildlab.analysis.overviews.verdict import MOST, WORTH, Verdict
from wildlab.messages.message import Message, Quantity, Value, duration, length, number, share
from wildlab.reporting.georeferencing import FEW
from wildlab.reporting.tracking import NEAR_THE_BAND
from wildlab.sharing.edition.facts import Alarm, Facts, Gain

#: A step of somebody who walks, m, and beyond how many nobody counts them.
STEP_M, MOST_STEPS = 0.75, 200
#: Of two normal errors of equal spread, the median distance from the middle over that spread.
MEDIAN_DISTANCE = math.sqrt(2 * math.log(2))
#: The verdicts by their texts.
VERDICTS: dict[str | None, str] = {
    Verdict.ALARM: "went_wrong",
    Verdict.MEND: "mend",
    Verdict.FIX: "fix",
    Verdict.LOOK: "look",
    Verdict.SOUND: "sound",
    Verdict.UNJUDGED: "unjudged",
    None: "unjudged",
}


#: Troubles by the gain that is had by doing the same.
_SAME_REMEDY = {
    "poses": "time_without_poses",
    "satellites": "time_without_satellites",
    "inertial": "time_without_inertial",
}


class Story(NamedTuple):
    """All that is said of a flight.

    Attributes
    ----------
    verdict, why, next
        In a word or two; what it follows from; what it means for the next flight.
    trusted
        Whether what was measured may be relied on as it is.
    tiles
        The numbers at the top, each with what it is.
    measured, wrong, advice, unknown
        The four lists; advice is ranked, most first. Where there are more than fit, the last text of a list
        says how many.
    """

    verdict: Message
    why: Message
    next: Message
    trusted: bool
    tiles: tuple[tuple[Value, Message], ...]
    measured: tuple[Message, ...]
    wrong: tuple[Message, ...]
    advice: tuple[Message, ...]
    unknown: tuple[Message, ...]


def tell(facts: Facts) -> Story:
    """What a flight's numbers come to.

    Parameters
    ----------
    facts
        From `wildlab.sharing.edition.facts.facts_of`.

    Returns
    -------
    Story
    """
    if not (math.isfinite(facts.error_median) and math.isfinite(facts.error_p90)):
        facts = facts._replace(compared=0)
    key = VERDICTS[facts.verdict]
    advice = _advice(facts)
    return Story(
        Message(f"verdict.{key}"),
        _why(facts),
        _next(facts, advice),
        facts.verdict in (Verdict.FIX, Verdict.SOUND),
        _tiles(facts)[:4],
        _measured(facts)[:MOST],
        _cut(_wrong(facts)),
        _cut(advice),
        _cut(_unknown(facts)),
    )


def _cut(items: tuple[Message, ...]) -> tuple[Message, ...]:
    """The first of them, and how many more there are: nothing is left out in silence."""
    rest = len(items) - MOST
    return items if rest <= 0 else (*items[:MOST], Message("page.more", {}, rest))


def steps_of(metres: float) -> Message | None:
    """A length in steps, roughly; None where nobody would count them.

    Parameters
    ----------
    metres
        The length.

    Returns
    -------
    Said or None
        From 20 steps on to the nearest five, from 100 on to the nearest ten.
    """
    steps = metres / STEP_M
    if not steps <= MOST_STEPS:
        return None
    if steps < 0.75:
        return Message("steps.none")
    to = 1 if steps < 20 else 5 if steps < 100 else 10
    return Message("steps.some", {}, to * max(1, round(steps / to)))


def _why(facts: Facts) -> Message:
    if facts.verdict == Verdict.ALARM or (facts.verdict == Verdict.LOOK and facts.alarms):
        return _alarm(facts.alarms[0]) if facts.alarms else Message("why.alarm")
    if facts.verdict == Verdict.MEND and not facts.problems and facts.doubted:
        return Message(f"why.doubt_{facts.doubted[0]}")
    if facts.verdict == Verdict.MEND:
        return Message("wrong.problems", {}, facts.problems)
    if facts.verdict == Verdict.FIX:
        worth = [gain for gain in facts.gains if gain.share >= WORTH]
        return Message("why.fix", {"first": _gained(worth[0])}, len(worth)) if worth else Message("why.alarm")
    if facts.verdict == Verdict.LOOK:
        for what, seconds in facts.troubles:
            lasting = facts.length_s > 0 and seconds >= WORTH * facts.length_s
            if lasting or what == "poses":
                return _trouble(facts, what, seconds)
        if facts.possible is not None:
            return Message(
                "why.possible", {"gain": length(facts.possible.value), "of": length(facts.possible.of)}
            )
        if _too_sure(facts):
            return Message("wrong.too_sure")
        return Message(f"why.doubt_{facts.doubted[0]}" if facts.doubted else "why.alarm")
    if facts.verdict == Verdict.SOUND:
        measured = facts.compared > 0 or facts.tracks > 0
        return Message("why.sound" if measured else "why.sound_unmeasured", {"share": share(WORTH)})
    return Message("why.failed" if "overview" in facts.failed else "why.unjudged")


def _next(facts: Facts, advice: tuple[Message, ...]) -> Message:
    if facts.verdict in (Verdict.ALARM, Verdict.MEND, Verdict.LOOK):
        return Message(f"next.{VERDICTS[facts.verdict]}")
    if facts.verdict == Verdict.FIX and facts.gains:
        # The thing itself: the list stands far below.
        return _do(facts.gains[0])
    listed: dict[str, Value] = {"list": Message("heading.advice")}
    if facts.verdict == Verdict.SOUND:
        return Message("next.sound_more", listed) if advice else Message("next.sound")
    return Message("next.unjudged", listed) if advice else Message("next.nothing")


def _tiles(facts: Facts) -> tuple[tuple[Value, Message], ...]:
    found: list[tuple[Value, Message]] = []
    if facts.compared >= FEW:
        found.append((length(facts.error_median), Message("tile.error")))
    elif facts.tracked:
        worst: dict[str, Value] = {"worst": length(facts.track_worst)}
        label = Message("tile.tracks", worst) if _unlike(facts) else Message("tile.track")
        found.append((length(facts.track_error), label))
    if facts.seen > 0:
        pictured = not math.isfinite(facts.pictured) or facts.pictured == facts.seen
        found.append((number(facts.seen), Message("tile.seen" if pictured else "tile.detected")))
    if math.isfinite(facts.length_s):
        found.append((duration(facts.length_s), Message("tile.length")))
    if math.isfinite(facts.area_m2):
        found.append((Quantity("area", facts.area_m2), Message("tile.area")))
    return tuple(found)


def _measured(facts: Facts) -> tuple[Message, ...]:
    found: list[Message] = []
    if facts.compared >= FEW:
        values: dict[str, Value] = {
            "median": length(facts.error_median),
            "p90": length(facts.error_p90),
            "compared": number(facts.compared),
        }
        steps = steps_of(facts.error_median)
        found.append(Message("measured.error_steps", {**values, "steps": steps}) if steps else
                     Message("measured.error", values))  # fmt: skip
    elif math.isfinite(facts.scatter):
        apart = length(MEDIAN_DISTANCE * facts.scatter)
        found.append(Message("measured.scatter", {"apart": apart, "sightings": number(facts.sightings)}))
    if facts.tracked:
        off: dict[str, Value] = {"error": length(facts.track_error)}
        if _unlike(facts):
            off |= {"n": number(facts.tracks), "worst": length(facts.track_worst)}
            found.append(Message("measured.tracks", off))
        else:
            found.append(Message("measured.track", off, facts.tracks))
    if facts.other_sensors:
        if math.isfinite(facts.things):
            found.append(Message("measured.things_detected", {"seen": number(facts.seen)}, int(facts.things)))
        else:
            found.append(Message("measured.detected", {}, int(facts.seen)))
    elif facts.seen > 0 and math.isfinite(facts.placed):
        if math.isfinite(facts.things):
            seen: dict[str, Value] = {"seen": number(facts.seen), "placed": number(facts.placed)}
            found.append(Message("measured.things", seen, int(facts.things)))
        else:
            found.append(Message("measured.seen", {"placed": number(facts.placed)}, int(facts.seen)))
    if math.isfinite(facts.area_m2) and math.isfinite(facts.height_m):
        found.append(Message("measured.area", {"area": Quantity("area", facts.area_m2),
                                            "height": length(round(facts.height_m))}))  # fmt: skip
    return tuple(found) or (Message("measured.nothing"),)


def _unlike(facts: Facts) -> bool:
    """Whether some track was farther off than is typical: then the worst is said too."""
    return facts.tracks > 1 and facts.track_worst > facts.track_error


def _alarm(alarm: Alarm) -> Message:
    if alarm.what == "jumps":
        return Message("alarm.jumps", {"size": length(alarm.size)}, alarm.often)
    if alarm.what == "leans":
        return Message("alarm.leans", {"size": Quantity("angle", math.radians(alarm.size))})
    if alarm.what == "shakes":
        return Message("alarm.shakes", {"times": number(alarm.size / 9.81)})
    return Message("alarm.apart", {"size": length(alarm.size)})


def _trouble(facts: Facts, what: str, seconds: float) -> Message:
    values: dict[str, Value] = {"time": duration(seconds)}
    if facts.length_s > 0:
        values["share"] = share(min(1.0, seconds / facts.length_s))
        return Message(f"trouble.{what}", values)
    return Message(f"trouble_time.{what}", values)


def _too_sure(facts: Facts) -> bool:
    return facts.tracks > 0 and facts.track_sure > NEAR_THE_BAND


def _lasting(facts: Facts) -> list[tuple[str, float]]:
    """Troubles that are told: jumps are instants; an alarm has said them, and that it shakes."""
    told = {one.what for one in facts.alarms}
    return [
        (what, seconds)
        for what, seconds in facts.troubles
        if seconds >= 1 and not (what == "shaken" and "shakes" in told)
    ]


def _wrong(facts: Facts) -> tuple[Message, ...]:
    found = [_alarm(one) for one in facts.alarms]
    if facts.problems:
        found.append(Message("wrong.problems", {}, facts.problems))
    if "georeferencing" in facts.doubted:
        found.append(Message("why.doubt_georeferencing"))
    if _too_sure(facts):
        found.append(Message("wrong.too_sure"))
    elif "tracking" in facts.doubted:
        found.append(Message("why.doubt_tracking"))
    if "navigation" in facts.doubted:
        found.append(Message("why.doubt_navigation"))
    found += [_trouble(facts, what, seconds) for what, seconds in _lasting(facts)]
    # What the verdict says already is not said again, nor what the troubles say of time.
    gains = facts.gains[1 if facts.verdict == Verdict.FIX else 0 :]
    for gain in gains:
        counted = gain.key.startswith(("images", "detections"))
        if counted or (gain.key in ("cause", "far_out") and gain.share >= WORTH):
            found.append(_gained(gain))
    # Where no trouble says it of the time, the gain does.
    found = found or [_gained(gain) for gain in gains if gain.share >= WORTH]
    if found:
        return tuple(found)
    if facts.verdict is None:
        return (Message("wrong.unlooked"),)
    if facts.verdict in (Verdict.FIX, Verdict.LOOK, Verdict.ALARM, Verdict.MEND):
        return (Message("wrong.above"),)
    small = bool(facts.gains) or facts.possible is not None
    return (Message("wrong.small", {"share": share(WORTH)}),) if small else (Message("wrong.none"),)


def _gained(gain: Gain) -> Message:
    """What it is, in a sentence."""
    if gain.key == "cause":
        causes = tuple(
            Message(f"cause.{cause.replace(chr(39), '').replace(' ', '_')}") for cause in gain.causes
        )
        if not math.isfinite(gain.value):
            return Message("lost.cause_share", {"share": share(gain.share)})
        values: dict[str, Value] = {"gain": length(gain.value), "of": length(gain.of)}
        return Message("lost.cause", {**values, "causes": causes or Message("cause.any")})
    if not math.isfinite(gain.value):
        return Message(f"lost_share.{gain.key}", {"share": share(gain.share)})
    if gain.key == "far_out":
        return Message("lost.far_out", {"gain": length(gain.value), "of": length(gain.of)})
    if gain.key.startswith("time"):
        return Message(f"lost.{gain.key}", {"time": duration(gain.value), "of": duration(gain.of)})
    return Message(f"lost.{gain.key}", {"of": number(gain.of)}, int(gain.value))


def _advice(facts: Facts) -> tuple[Message, ...]:
    """What to do, what comes before all gains first."""
    found = [Message(f"do.{one.what}") for one in facts.alarms]
    if facts.problems:
        found.append(Message("do.problems", {}, facts.problems))
    found += [_do(gain) for gain in facts.gains]
    if facts.possible is not None:
        found.append(Message("do.possible", {"gain": length(facts.possible.value)}))
    if not facts.compared and "georeferencing" not in facts.failed:
        # Single sightings of other sensors never are.
        if not (facts.other_sensors and facts.tracked):
            found.append(Message("do.known_tracks" if facts.other_sensors else "do.known_places"))
    elif facts.compared < FEW and facts.compared:
        found.append(Message("do.more_places", {"few": number(FEW)}))
    if facts.failed:
        found.append(Message("do.failed", {}, len(facts.failed)))
    # What a gain asks for already is not asked for twice.
    asked = {one.key.removeprefix("do.") for one in found}
    for what, _ in _lasting(facts):
        if _SAME_REMEDY.get(what) not in asked and what not in asked:
            found.append(Message(f"do.trouble_{what}"))
    found += [Message("do.tracks")] if _too_sure(facts) or "tracking" in facts.doubted else []
    found += [Message("do.navigation")] if "navigation" in facts.doubted else []
    return tuple(found)


def _do(gain: Gain) -> Message:
    """What to do about one thing."""
    key = gain.key
    if key == "cause":
        one = gain.causes[0].replace("'", "").replace(" ", "_") if len(gain.causes) == 1 else ""
        key = f"cause_{one}" if one else "causes"
    return Message(f"do.{key}", {"share": share(gain.share)})


def _unknown(facts: Facts) -> tuple[Message, ...]:
    found = [Message(f"unknown.failed_{part}") for part in facts.failed]
    if not facts.compared and "georeferencing" not in facts.failed:
        found.append(Message("unknown.error_sightings" if facts.tracked else "unknown.error"))
    elif 0 < facts.compared < FEW:
        values: dict[str, Value] = {"median": length(facts.error_median)}
        found.append(Message("unknown.few", values, facts.compared))
    if not facts.seen > 0:
        found.append(Message("unknown.seen"))
    elif not math.isfinite(facts.things):
        found.append(Message("unknown.things"))
    if facts.seen > 0:
        found.append(Message("unknown.hidden_detected" if facts.other_sensors else "unknown.hidden"))
    found += [Message("unknown.another_day")] if facts.compared >= FEW else []
    return tuple(found)
