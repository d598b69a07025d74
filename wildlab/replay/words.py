"""What a replay shows in which colour, and says in words. Names are strangers' text.

Colours are those of the reports, so that a thing looks the same in both.
"""

from __future__ import annotations

import re
import unicodedata
from math import isfinite

from wildlab.replay.scene import ReplayScene
from wildlab.reporting.figures import BLUE, GREY, ORANGE, colour

FLOWN, VIEW, SIGHTING, TRUTH, GROUND = BLUE, "#1b7f79", ORANGE, "#111111", "#d8e6ee"
#: Letters of a name that are shown, at most.
MOST_LETTERS = 60


def rgba(colour: str, alpha: float = 1.0) -> tuple[int, int, int, int]:
    """``#rrggbb`` as four numbers to 255.

    Examples
    --------
    >>> rgba("#ff8000", 0.5)
    (255, 128, 0, 128)
    """
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue, round(255 * alpha)


def of_filter(name: str) -> str:
    """The colour that reports give a filter; grey where they know none."""
    found = colour(name)
    return found if found.startswith("#") and len(found) == 7 else GREY


def plain(name: str) -> str:
    """A name as text of one line: nothing that turns, breaks or hides it.

    Examples
    --------
    >>> plain("boat\\n\\u202egnp.exe")
    'boat gnp.exe'
    """
    kept = "".join(" " if one.isspace() else one for one in name if one.isspace() or _visible(one))
    short = " ".join(kept.split())
    return short if len(short) <= MOST_LETTERS else f"{short[: MOST_LETTERS - 1]}…"


def _visible(letter: str) -> bool:
    return not unicodedata.category(letter).startswith("C")


def in_markdown(name: str) -> str:
    """A name in a text that is Markdown: a link, a picture, a heading or HTML in it stays letters.

    Examples
    --------
    >>> in_markdown("![a](http://b)")
    '\\\\!\\\\[a\\\\]\\\\(http\\\\:\\\\/\\\\/b\\\\)'
    """
    return re.sub(r"([!-/:-@\[-`{-~])", r"\\\1", plain(name))


def path_part(name: str) -> str:
    """A name as one part of an entity's path.

    Examples
    --------
    >>> path_part("a/b c"), path_part("")
    ('a\\\\/b\\\\ c', 'no name')
    """
    import rerun_bindings

    return str(rerun_bindings.escape_entity_path_part(plain(name))) or "no name"


def minutes(seconds: float) -> str:
    """``"25 min 3 s"``."""
    whole = round(seconds)
    return f"{whole // 60} min {whole % 60} s" if whole >= 60 else f"{whole} s"


def about(scene: ReplayScene, pictures: int) -> str:
    """The panel of words beside the views, as Markdown."""
    shown = []
    if scene.path is not None:
        shown.append(f"**blue**: the aircraft and its way, poses of *{in_markdown(scene.path.source)}*")
    if scene.views is not None:
        posed = "**green-blue**: the camera and what it sees of the ground"
        shown.append(f"{posed}, {len(scene.views.times)} frames")
    if pictures:
        shown.append(f"{pictures} images, reduced")
    if scene.sightings is not None and len(scene.sightings.frame):
        shown.append(f"**orange**: {len(scene.sightings.frame)} detections in the images")
    if scene.points is not None:
        shown.append(f"**orange**: {len(scene.points.times)} detections on the ground, with 90 % ellipses")
    for name in dict.fromkeys(one.filter for one in scene.tracks):
        count = sum(one.filter == name for one in scene.tracks)
        of = "track" if count == 1 else "tracks"
        shown.append(f"{count} {of} by the filter *{in_markdown(name)}*, with 90 % ellipses")
    if scene.truth:
        count = len(scene.truth)
        shown.append(f"**black**: where {count} {'target' if count == 1 else 'targets'} really were")
    ground = "terrain" if scene.terrain is not None else "level ground" if isfinite(scene.ground) else ""
    shown += [ground] if ground else []
    flight = "a simulated flight" if scene.kind == "twin" else "a recorded flight"
    time = f"lasts {minutes(scene.length)}" if scene.timed else "its times number the images"
    lines = [
        f"# {in_markdown(scene.name)}",
        "",
        f"This is {flight}; it {time}." if scene.timed else f"This is {flight}; {time}.",
        "",
        "Shown:",
        "",
        *(f"- {one}" for one in shown),
    ]
    if scene.lacks:
        lines += ["", "Not shown:", "", *(f"- {_clause(one)}" for one in scene.lacks)]
    lines += ["", "Lengths are metres; x is east, y north, z up. Where on Earth this is it does not say."]
    return "\n".join(lines) + "\n"


def _clause(text: str) -> str:
    return re.sub(r"([!-&(-+/<-@\[-`{-~])", r"\\\1", "".join(c for c in text if c.isspace() or _visible(c)))
