"""The page of a run of a detector: what was found, what was missed and invented, and pictures of it."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wildlab.analysis.detecting.judged import ellipse_sentence, rate_words
from wildlab.detection.detections import PART
from wildlab.reporting.detectors_compared import compared_section
from wildlab.reporting.figures import BLUE, new_figure, png_bytes
from wildlab.reporting.glossary import with_glossary
from wildlab.reporting.html import examine
from wildlab.reporting.page import page
from wildlab.reporting.text import NOTHING, escape, inline

#: Bytes of pictures on a page at most: it is sent by mail. What has no room is left out, and that is said.
ROOM = 2_500_000
#: Problems of images that are listed one by one.
LISTED = 20
#: What each sheet shows, and how its picture is described.
SHEETS = {
    "missed": "Labelled, and not found",
    "invented": "Found, and not labelled",
    "found": "Found, and labelled",
    "detected": "Detected",
}
_COLOURS = {
    "found": "green",
    "invented": "red",
    "missed": "yellow",
    "not judged": "grey",
    "detected": "orange",
}


def detections_page(
    name: str,
    result: Mapping[str, Any],
    frames: pd.DataFrame,
    sheets: Mapping[str, bytes],
    overlays: Sequence[tuple[str, bytes]],
    thresholds: Mapping[str, Any],
    curves: pd.DataFrame | None = None,
) -> str:
    """The whole page, without anything that has to be fetched.

    Parameters
    ----------
    name
        What was looked at: the name of a folder, never its path.
    result
        From `wildlab.analysis.detecting.command.detect_images`.
    frames
        One row for each, with ``frame_id``, ``detections`` and ``problem``.
    sheets
        JPEG by a key of `SHEETS`.
    overlays
        Name of a frame and its JPEG, in order.
    thresholds
        By name, as plain values.
    curves
        Of detectors that are compared, as of `wildlab.analysis.detection_compared.curve_table`; None where
        there is only ours.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    WildlabError
        If the page would break a promise of `wildlab.reporting.html.examine`.
    """
    of = result["frames"]
    judged = result.get("judged")
    what = _plural(result["detections"], "detection")
    title = f"{what} in {_plural(of['usable'], 'image')}"
    parts = [
        f'<header><h1>{escape(title)}</h1><p class="sub">{escape(name)}, method '
        f"{escape(result['method'])}</p></header>",
        _summary(result),
        _tiles(result),
    ]
    parts.append(_rates_table(result))
    if curves is not None:
        parts.append(compared_section(result["compared"], curves))
    advice = advice_of(result)
    if advice:
        points = "".join(f"<li>{inline(one)}</li>" for one in advice)
        parts.append(f"<h2>What to do</h2><ul>{points}</ul>")
    left = ROOM
    for key, heading in SHEETS.items():
        if key not in sheets:
            continue
        number = int(result["pictures"].get(key, 0))
        total = int(judged[key]) if judged else int(result["detections"])
        left -= len(sheets[key])
        which = "the first" if key == "missed" else "the surest"
        which = "some of all scores" if key in ("found", "detected") else which
        more = f" {number} of {total}, {which}." if number < total else ""
        parts.append(f"<h2>{heading}: {total}</h2>")
        alt = f"{_plural(number, 'cutting')} of what was {key}, each with the name of its image."
        parts.append(_picture(sheets[key], alt, f"Each with the name of its image.{more}", wide=True))
    parts += _overlays(overlays, left, judged is not None)
    parts += _per_frame(frames, of)
    parts += _problems(result)
    if isinstance(thresholds.get("part"), float) and thresholds["part"] > 0:
        whose = "chosen on labelled people and deer" if thresholds["part"] == PART else "as it was given"
        parts.append(
            "<h2>What the covariances are of</h2><p>The middle of a whole animal. The warm part that is seen "
            f"shows where it lies to {100 * thresholds['part']:.0f} % of its length (the threshold part, "
            f"{whose}). What is evenly warm all over is better known than that: part 0 leaves what the shape "
            "and the noise of the image explain.</p>"
        )
    rows = "".join(
        f'<tr><th scope="row" class="text">{escape(key)}</th><td class="text">{escape(value)}</td></tr>'
        for key, value in thresholds.items()
        if not isinstance(value, dict | list) or len(str(value)) < 200
    )
    parts.append(
        "<details><summary>Thresholds of this run</summary>"
        f'<div class="scroll"><table><thead><tr><th scope="col" class="text">threshold</th>'
        f'<th scope="col" class="text">value</th></tr></thead><tbody>{rows}</tbody></table></div></details>'
    )
    whole = page(title=title, body=with_glossary("\n".join(parts)), kicker="wildlab › detections")
    examine(whole, name)
    return whole


def advice_of(result: Mapping[str, Any]) -> list[str]:
    """What to do next, from the numbers of the run.

    Parameters
    ----------
    result
        As for `detections_page`.

    Returns
    -------
    list of str
        Sentences; none where there is nothing to advise.
    """
    judged = result.get("judged")
    if result["frames"]["usable"] == 0:
        return ["No image could be used. The reasons are below."]
    if judged is None:
        return [
            "Nothing here says yet which of these detections are what you look for. Mark what is to be seen "
            "in some images, spread over the flight, and run the same command with `--labels FILE`."
        ]
    advice = []
    missed, invented = int(judged["missed"]), int(judged["invented"])
    if missed + invented and result.get("fit") is None:
        more = "More is missed: " if missed > invented else "More is invented: " if invented > missed else ""
        advice.append(
            f"{more}{missed} missed, {invented} invented. `--fit FILE` chooses thresholds from labelled "
            "images, and judges them on others."
        )
    if judged["f1"]["estimate"] is not None and judged["f1"]["low"] is None:
        advice.append(
            f"Labels of {_plural(judged['groups'], 'group')} of images are too few for an interval: these "
            "rates may be far off. Label more of the flight."
        )
    return advice


def _rates_shown(result: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Rates by where they come from, the one that counts first."""
    rows: dict[str, Mapping[str, Any]] = {}
    fit, judged = result.get("fit"), result.get("judged")
    if fit:
        rows["images that thresholds were not chosen from"] = fit["held_out"]
    if judged and not result.get("chosen_here"):
        rows["beside the labels"] = judged
    if fit:
        rows["where they were chosen (too good)"] = fit["where_chosen"]
        what = "without a classifier" if result["method"] == "shape" else "with the defaults"
        rows[what] = fit["defaults"]
    return rows


def _summary(result: Mapping[str, Any]) -> str:
    of = result["frames"]
    lost = of["all"] - of["usable"]
    rows = _rates_shown(result)
    if rows:
        where, best = next(iter(rows.items()))
        where = "" if where == "beside the labels" else "On images that thresholds were not chosen from: "
        labelled, all_found = best["found"] + best["missed"], best["found"] + best["invented"]
        first = (
            f"{where}{best['found']} of {labelled} labelled {'is' if labelled == 1 else 'are'} found; "
            f"{best['invented']} of {_plural(all_found, 'detection')} "
            f"{'is' if best['invented'] == 1 else 'are'} not labelled."
        )
    else:
        first = f"{_plural(result['detections'], 'detection')}; without labels, none is judged."
    then = [str(one) for one in result.get("notes", ())]
    judged = result.get("judged")
    if judged and "ellipse_coverage_90" in judged:
        then.append(ellipse_sentence(judged["ellipse_coverage_90"]))
    if judged:
        aside = result["detections"] - judged["found"] - judged["invented"]
        if aside > 0:
            then.append(
                f"{_plural(aside, 'detection')} of {result['detections']} "
                f"{'is' if aside == 1 else 'are'} not judged: in images without labels, or in a place "
                "that is marked as not to be judged."
            )
    if lost:
        then.append(f"{_plural(lost, 'image')} of {of['all']} could not be used, for the reasons below.")
    level, pill = ("warn", "part") if lost else ("neutral", "")
    word = "images lost" if lost else "judged" if judged else "not judged"
    reason = "By the labels of the images." if judged else "There are no labels to judge the detections by."
    if lost:
        reason = f"{lost} of {of['all']} images could not be used."
    return (
        f'<section class="summary {level}" aria-label="Summary"><p><b>{escape(first[0].upper() + first[1:])}'
        f'</b> {escape(" ".join(then))}</p><p class="verdict"><span class="pill {pill}">{word}</span> '
        f"{reason}</p></section>"
    )


def _tiles(result: Mapping[str, Any]) -> str:
    tiles = [(f"{result['frames']['usable']} of {result['frames']['all']}", "images used")]
    rates: Mapping[str, Any] = next(iter(_rates_shown(result).values()), {})
    for key in ("recall", "precision") if rates else ():
        one = rates[key]
        if one["estimate"] is None:
            tiles.append((NOTHING, f"{key}, not defined here"))
            continue
        span = "no interval" if one["low"] is None else f"95 %: {one['low']:.2f} to {one['high']:.2f}"
        meaning = "of what is labelled is found" if key == "recall" else "of detections are labelled"
        tiles.append((f"{one['estimate']:.2f}", f"{meaning} ({key}); {span}"))
    if not rates:
        tiles.append((str(result["detections"]), "detections, not judged"))
    return (
        '<ul class="tiles">'
        + "".join(f"<li><b>{escape(big)}</b><span>{escape(small)}</span></li>" for big, small in tiles)
        + "</ul>"
    )


def _rates_table(result: Mapping[str, Any]) -> str:
    rows = _rates_shown(result)
    if not rows:
        return ""

    heads = ("where", "F1", "precision", "recall", "found", "invented", "missed")
    head = "".join(
        f'<th scope="col"{" class=" + chr(34) + "text" + chr(34) if one == "where" else ""}>{one}</th>'
        for one in heads
    )
    body = "".join(
        f'<tr><th scope="row" class="text">{escape(where)}</th>'
        + "".join(f"<td>{rate_words(of[key]) or NOTHING}</td>" for key in ("f1", "precision", "recall"))
        + "".join(f"<td>{of[key]}</td>" for key in ("found", "invented", "missed"))
        + "</tr>"
        for where, of in rows.items()
    )
    return (
        f'<h2>Rates</h2><div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody>'
        '</table></div><p class="note">In brackets 95 % intervals; they draw groups of images that belong '
        "together.</p>"
    )


def _overlays(overlays: Sequence[tuple[str, bytes]], room: int, judged: bool) -> list[str]:
    if not overlays:
        return []
    shown: list[tuple[str, bytes]] = []
    for one in overlays:
        if len(one[1]) > room:
            break
        room -= len(one[1])
        shown.append(one)
    if not shown:
        return ["<h2>Images</h2><p>The pictures in the folder overlays are too large for this page.</p>"]
    words = ("found", "invented", "missed") if judged else ("detected",)
    key = ", ".join(f"{_COLOURS[word]} {word}" for word in words)
    left_out = len(overlays) - len(shown)
    more = f" {_plural(left_out, 'more picture')} in the folder overlays." if left_out else ""
    pictures = "".join(_picture(data, f"The image {name} with boxes: {key}.", name) for name, data in shown)
    return [f"<h2>Images</h2><p>Boxes: {key}.{more}</p>", f'<div class="row">{pictures}</div>']


def _per_frame(frames: pd.DataFrame, of: Mapping[str, Any]) -> list[str]:
    good = frames[frames["problem"].fillna("") == ""]
    if len(good) < 3:
        return []
    counts = good["detections"].to_numpy(float)
    fig, ax = new_figure(6.4, 2.4)
    ax.stairs(counts, np.arange(len(counts) + 1) + 0.5, fill=True, color=BLUE)
    ax.set(xlabel="image, in order", ylabel="detections", xlim=(0.5, len(counts) + 0.5))
    ax.set_ylim(bottom=0)
    most = good.iloc[int(counts.argmax())]
    none = int((counts == 0).sum())
    said = (
        f"{none} of {len(counts)} images have none; the most has {most['frame_id']!s}, "
        f"with {int(most['detections'])}."
        if counts.max()
        else f"None of {len(counts)} images has any."
    )
    ax.set_title(f"{_plural(int(counts.max()), 'detection')} an image at most")
    data = png_bytes(fig)
    return ["<h2>Image by image</h2>", _picture(data, f"Detections in each image. {said}", said, "png")]


def _problems(result: Mapping[str, Any]) -> list[str]:
    problems = result["problems"]
    if not problems:
        return []
    points = "".join(f"<li>{escape(name)}: {escape(why)}</li>" for name, why in problems[:LISTED])
    more = len(problems) - LISTED
    rest = f"<p>{more} more are in frames.csv.</p>" if more > 0 else ""
    return [f"<h2>Images that could not be used: {len(problems)}</h2><ul>{points}</ul>{rest}"]


def _picture(data: bytes, alt: str, caption: str, kind: str = "jpeg", *, wide: bool = False) -> str:
    encoded = base64.b64encode(data).decode("ascii")
    # Many small things side by side cannot be seen on a phone unless they may be moved past.
    style = ' style="min-width:44rem"' if wide else ""
    image = f'<img alt="{escape(alt)}"{style} src="data:image/{kind};base64,{encoded}">'
    if wide:
        image = f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(alt)}">{image}</div>'
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def _plural(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"
