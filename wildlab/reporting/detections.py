"""The page of a run of a detector: what was found, missed and invented, pictures, and other detectors beside.

What is said follows by rules from the run's numbers; the words lie in ``data/messages/en/detections.toml``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.detection_scores import ELLIPSE, rate_words
from wildlab.messages.catalogue import Message, load_texts, words
from wildlab.messages.quantities import NOTHING, percent_of
from wildlab.names import figure_name
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, PURPLE, VERMILLION, new_figure
from wildlab.reporting.notebook_pages import ADVICE, finished_page
from wildlab.reporting.report import Wording, open_report

#: Bytes of pictures on a page at most: it is sent by mail. What has no room is left out, and that is said.
ROOM = 2_500_000
#: Problems of images that are listed one by one.
LISTED = 20
#: What each sheet shows: keys of its texts.
SHEETS = ("missed", "invented", "found", "detected")
_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, INK)
_RATES = ("f1", "precision", "recall")


# -- what follows from the numbers


def rates_shown(result: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Rates by where they come from (keys of their words), the one that counts first."""
    rows: dict[str, Mapping[str, Any]] = {}
    fit, judged = result.get("fit"), result.get("judged")
    if fit:
        rows["held-out"] = fit["held_out"]
    if judged and not result.get("chosen_here"):
        rows["labels"] = judged
    if fit:
        rows["where-chosen"] = fit["where_chosen"]
        rows["no-classifier" if result["method"] == "shape" else "defaults"] = fit["defaults"]
    return rows


def answer(result: Mapping[str, Any]) -> list[Message]:
    """What was found, and whether the ellipses hold; two sentences at most."""
    if not result["frames"]["usable"]:
        return [Message("no-image")]
    rows, tracks = rates_shown(result), result.get("tracks")
    if not rows and tracks:
        return [Message("animals", tracks | {"animals": f"{tracks['animals']:.1f}"})]
    if not rows:
        return [Message("not-judged", {"detections": result["detections"]})]
    where, best = next(iter(rows.items()))
    values = {
        "found": best["found"],
        "labelled": best["found"] + best["missed"],
        "invented": best["invented"],
        "detections": best["found"] + best["invented"],
    }
    said = [Message("held-out" if where == "held-out" else "labels", values)]
    share = (result.get("judged") or {}).get("ellipse_coverage_90")
    # Of labels that thresholds were chosen from, it would be no test.
    if share and not result.get("fit"):
        kind = "small" if share["high"] < ELLIPSE else "large" if share["low"] > ELLIPSE else "open"
        ends = {end: percent_of(share[end]) for end in ("low", "high")}
        said.append(Message(f"ellipses-{kind}", {"share": percent_of(share["estimate"]), **ends}))
    return said


def reason(result: Mapping[str, Any]) -> tuple[str, str, Message]:
    """Level, key of the verdict's word, and why."""
    of, judged = result["frames"], result.get("judged")
    if lost := of["all"] - of["usable"]:
        return "warn", "lost", Message("reason-lost", {"lost": lost, "all": of["all"]})
    key = "judged" if judged else "not-judged"
    return "neutral", key, Message(f"reason-{key}")


def advice(result: Mapping[str, Any]) -> list[Message]:
    """What to do next; nothing where there is nothing to advise.

    Parameters
    ----------
    result
        As for `detections_page`.
    """
    judged = result.get("judged")
    if result["frames"]["usable"] == 0:
        return [Message("advice-images")]
    if judged is None:
        return [Message("advice-label")]
    said = []
    missed, invented = int(judged["missed"]), int(judged["invented"])
    if missed + invented and result.get("fit") is None:
        said.append(Message("advice-fit", {"missed": missed, "invented": invented}))
    if judged["f1"]["estimate"] is not None and judged["f1"]["low"] is None:
        said.append(Message("advice-few", {"groups": judged["groups"]}))
    return said


# -- tables and figures


def rates_table(result: Mapping[str, Any]) -> pd.DataFrame:
    """A row for each set of images that rates are of; empty without labels."""
    names = load_texts("detections").subjects
    return pd.DataFrame(
        [
            {
                "where": names[f"rates-{where}"],
                **{key: rate_words(of[key]) or NOTHING for key in _RATES},
                **{key: of[key] for key in ("found", "invented", "missed")},
            }
            for where, of in rates_shown(result).items()
        ]
    )


def compared_table(compared: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """A row for each detector, ours first: rates with intervals, and F1 minus ours."""
    return pd.DataFrame(
        [
            {
                "detector": one["name"],
                **{key: rate_words(one[key]) or NOTHING for key in (*_RATES, "average_precision")},
                "beyond": "" if k == 0 else (rate_words(one["f1_beyond_ours"], "+") or NOTHING),
            }
            for k, one in enumerate(compared)
        ]
    )


def tracks_table(tracks: pd.DataFrame) -> pd.DataFrame:
    """A row for each track: from which frame to which, in how many it was detected, and how sure it is."""
    rows = tracks.assign(seen=tracks["detection_id"].fillna("") != "").groupby("track")
    found = rows.agg(
        first=("frame_id", "first"), last=("frame_id", "last"), frames=("seen", "size"), seen=("seen", "sum"),
        existence=("existence", "max"), sd=("sd_px", "median"),
    )  # fmt: skip
    return found.reset_index().astype({"track": str})


def precision_over_recall(names: Sequence[str], curves: pd.DataFrame) -> Figure:
    """Precision beside recall along the score, a line for each detector with a score; dots: all its boxes."""
    fig, ax = new_figure(5.6, 3.8)
    for number, name in enumerate(names):
        own = curves[curves["detector"] == name]
        if own.empty:
            continue
        colour = _COLOURS[number % len(_COLOURS)]
        ax.plot(own["recall"], own["precision"], "-", color=colour, label=figure_name(name))
        ax.plot(own["recall"].iloc[-1], own["precision"].iloc[-1], "o", color=colour, ms=7)
    ax.set(xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.03))
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def detections_by_image(counts: np.ndarray) -> Figure:
    """How many detections each image (N,) has, in order."""
    fig, ax = new_figure(6.4, 2.4)
    ax.stairs(counts, np.arange(len(counts) + 1) + 0.5, fill=True, color=BLUE)
    ax.set(xlabel="image, in order", ylabel="detections", xlim=(0.5, len(counts) + 0.5))
    ax.set_ylim(bottom=0)
    return fig


# -- the page


def detections_page(
    name: str,
    result: Mapping[str, Any],
    frames: pd.DataFrame,
    sheets: Mapping[str, bytes],
    overlays: Sequence[tuple[str, bytes]],
    thresholds: Mapping[str, Any],
    curves: pd.DataFrame | None = None,
    tracks: pd.DataFrame | None = None,
) -> str:
    """The whole page, without anything that has to be fetched.

    Parameters
    ----------
    name
        What was looked at: the name of a folder, never its path.
    result
        From `wildlab.analysis.detection_command.detect_images`.
    frames
        One row for each, with ``frame_id``, ``detections`` and ``problem``.
    sheets
        JPEG by a key of `SHEETS`.
    overlays
        Name of a frame and its JPEG, in order.
    thresholds
        By name, as plain values.
    curves
        Of detectors that are compared, as of `wildlab.analysis.detection_scores.curve_table`; None where
        there is only ours.
    tracks
        As of `wildlab.analysis.tracks.video.track_video`; None where they are not asked for.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    WildlabError
        If the page would break a promise of `wildlab.reporting.notebook_pages.examine`.
    """
    report = open_report(study="detections", kind="images")
    wording = Wording(report, load_texts("detections"))
    names, of = wording.texts.subjects, result["frames"]
    title = wording.say(names["title"], {"detections": result["detections"], "images": of["usable"]})
    report.head(title, f"{name}, method {result['method']}")
    level, key, why = reason(result)
    verdict = (names[f"verdict-{key}"], wording.messages([why])[0])
    report.summary(wording.messages(answer(result)), level=level, verdict=verdict)
    report.tiles(_tiles(result, names))
    if said := wording.messages(advice(result)):
        report.section(names["advice"], part=ADVICE)
        report.points(said)
    wording.table("rates", rates_table(result))
    if tracks is not None and len(tracks):
        wording.table("tracks", tracks_table(tracks))
    compared = result.get("compared", ())
    if curves is not None and len(compared) > 1:
        _show_compared(wording, compared, curves)
    left = _show_sheets(wording, result, sheets)
    _show_overlays(wording, overlays, left, judged=result.get("judged") is not None)
    counts = frames[frames["problem"].fillna("") == ""]["detections"].to_numpy(float)
    if len(counts) > 2:
        report.section(names["by-image"])
        wording.figure("by-image", detections_by_image(counts))
    _show_details(wording, result, thresholds)
    return finished_page(report.parts, title=title, name=name, kicker="wildlab › detections")


def _tiles(result: Mapping[str, Any], names: Mapping[str, str]) -> list[tuple[str, str]]:
    of = result["frames"]
    tiles = [(f"{of['usable']} of {of['all']}", names["tile-images"])]
    if tracks := result.get("tracks"):
        span = f" ({tracks['low']} to {tracks['high']}, 90 %)"
        tiles.append((f"{tracks['animals']:.1f}", names["tile-animals"] + span))
    rates: Mapping[str, Any] = next(iter(rates_shown(result).values()), {})
    for key in ("recall", "precision") if rates else ():
        one = rates[key]
        span = "" if one["low"] is None else f" ({one['low']:.2f} to {one['high']:.2f})"
        value = NOTHING if one["estimate"] is None else f"{one['estimate']:.2f}"
        tiles.append((value, names[f"tile-{key}"] + span))
    return tiles if rates else [*tiles, (str(result["detections"]), names["tile-detections"])]


def _show_compared(wording: Wording, compared: Sequence[Mapping[str, Any]], curves: pd.DataFrame) -> None:
    wording.table("compared", compared_table(compared))
    if len(curves):
        wording.figure("curves", precision_over_recall([one["name"] for one in compared], curves))
    if notes := [
        line
        for one in compared
        for line in words("terminal", [(key, values | {"name": one["name"]}) for key, values in one["told"]])
    ]:
        wording.report.points(notes)


def _show_sheets(wording: Wording, result: Mapping[str, Any], sheets: Mapping[str, bytes]) -> int:
    """Show the sheets; returns the room that is left."""
    names, judged, left = wording.texts.subjects, result.get("judged"), ROOM
    for key in SHEETS:
        if key not in sheets:
            continue
        number = int(result["pictures"].get(key, 0))
        total = int(judged[key]) if judged else int(result["detections"])
        left -= len(sheets[key])
        wording.report.section(f"{names[f'sheet-{key}']}: {total}")
        caption = wording.say(names[f"sheet-caption-{key}"], {"number": number, "total": total})
        wording.report.picture(sheets[key], alt=names[f"sheet-{key}"], caption=caption, wide=True)
    return left


def _show_overlays(
    wording: Wording, overlays: Sequence[tuple[str, bytes]], room: int, *, judged: bool
) -> None:
    names, report = wording.texts.subjects, wording.report
    shown: list[tuple[str, bytes]] = []
    for one in overlays:
        if len(one[1]) > room:
            break
        room -= len(one[1])
        shown.append(one)
    if not overlays:
        return
    key = names["colours-judged" if judged else "colours"]
    left_out = len(overlays) - len(shown)
    report.section(
        names["images"], key + (wording.say(names["more"], {"more": left_out}) if left_out else "")
    )
    for frame, data in shown:
        report.picture(data, alt=f"{frame}: {key}", caption=frame)


def _show_details(wording: Wording, result: Mapping[str, Any], thresholds: Mapping[str, Any]) -> None:
    names, report, judged = wording.texts.subjects, wording.report, result.get("judged")
    said = words("terminal", result.get("notes", ()))
    if judged and (aside := result["detections"] - judged["found"] - judged["invented"]) > 0:
        said += wording.messages([Message("aside", {"aside": aside, "of": result["detections"]})])
    part = thresholds.get("part")
    if isinstance(part, float) and part > 0:
        said += wording.messages([Message("part", {"part": f"{100 * part:.0f}"})])
    report.section(names["details"])
    report.points(said)
    if problems := result["problems"]:
        report.section(f"{names['problems']}: {len(problems)}")
        more = len(problems) - LISTED
        listed = [f"{image}: {why}" for image, why in problems[:LISTED]]
        report.points([*listed, *([wording.say(names["more-problems"], {"more": more})] if more > 0 else [])])
    rows = [
        {"threshold": key, "value": str(value)}
        for key, value in thresholds.items()
        if not isinstance(value, dict | list) or len(str(value)) < 200
    ]
    wording.table("thresholds", pd.DataFrame(rows, columns=["threshold", "value"]))
