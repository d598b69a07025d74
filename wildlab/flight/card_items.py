"""What lies on a card, files known by their content and folders of images, the role of each in a flight, and
which camera took the images and how their stamps meet the vehicle's log.

Whoever imports it may say otherwise; nothing is written.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clock_fitting import Span
from wildlab.flight.files import did_you_mean, printable, read_regular
from wildlab.flight.manifest import CameraPart
from wildlab.flight.raw_files import RAW_LIMIT, match_images
from wildlab.flight.readers import FOLDERS, FORMATS, HEAD, read_folder, read_log, recognise
from wildlab.flight.readers.frames.image import SUFFIXES
from wildlab.flight.readers.log import RawLog, Stream
from wildlab.flight.readers.photos import of_camera
from wildlab.flight.readers.text import header_of
from wildlab.geometry.frames import Array, geodetic_to_ned
from wildlab.names import listed

#: Endings of images, in small letters.
IMAGES = frozenset(SUFFIXES)
#: What lies on cards and is no log: not worth a sentence each.
KNOWN_OTHERS = frozenset({".mp4", ".mov", ".lrv", ".thm", ".dng", ".lrf", ".toml", ".md", ".txt", ".parm"})
#: Why such a file is not read.
OTHER = "is no log by its ending"
#: How the problem of a table begins whose columns nobody explained.
TABLE = "a plain table"
#: More files than any card of a day's flights has.
MOST_FILES = 200_000
#: Of what could not be read, or is not there.
NO_LOG, NO_ROWS = RawLog({}), Stream({"use": np.empty(0)})


@dataclass(frozen=True)
class CardItem:
    """A file or a folder of images.

    Attributes
    ----------
    name
        Below the source folder, with ``/``.
    format
        As in `FORMATS` and `FOLDERS`; empty where none is known.
    log
        As read, empty where it could not be.
    problem
        Why not.
    """

    name: str
    format: str = ""
    log: RawLog = NO_LOG
    problem: str = ""

    @property
    def key(self) -> str:
        """What tells it from others: a folder may hold images, and pixels of things in them."""
        return self.name + self.format

    @property
    def shown(self) -> str:
        """The name as it is told."""
        return "the folder itself" if self.name == "." else printable(self.name)

    @property
    def called(self) -> str:
        """The format in words."""
        if self.format in FOLDERS:
            return FOLDERS[self.format].called
        return FORMATS[self.format].called if self.format else "not known"

    def part(self, name: str) -> Stream:
        """One part of the log, without rows where none can be used; images count without a place."""
        stream = self.log.parts.get(name, NO_ROWS)
        return stream if name == "photos" or stream.used.any() else NO_ROWS


def source_folder(paths: Sequence[Path]) -> Path:
    """The folder that all of some files and folders lie in, or the one folder that is named.

    Raises
    ------
    WildlabError
        Where one of them does not exist, or they share no folder.
    """
    for path in paths:
        if not path.exists():
            raise WildlabError("is not there", "check the name", file=path)
    if len(paths) == 1 and paths[0].is_dir():
        return paths[0]
    try:
        common = os.path.commonpath(
            [path.resolve() if path.is_dir() else path.resolve().parent for path in paths]
        )
    except ValueError:
        raise WildlabError(
            "the files lie on different drives", "copy them into one folder", file=paths[0]
        ) from None
    return Path(common)


def search(
    paths: Sequence[Path],
    source: Path,
    zone: str | None = None,
    tell: Callable[[str], None] = lambda name: None,
) -> list[CardItem]:
    """Everything in some files and folders that may belong to a flight.

    Parameters
    ----------
    paths
        Files and folders.
    source
        The folder that they lie in, see `source_folder`.
    zone
        Of wall clocks that carry none.
    tell
        Called with the name of each file before it is read.

    Returns
    -------
    list of CardItem
        In order of their names; also what no reader knows, or could not read.

    Raises
    ------
    WildlabError
        Where there are too many files to be a card.
    """
    found = []
    for path, folder in _items(paths):
        name = path.resolve().relative_to(source.resolve()).as_posix()
        if folder or path.suffix.lower() not in KNOWN_OTHERS:
            tell(name)
        found.append(_read(path, name, folder, zone))
    return sorted(found, key=lambda one: one.name)


def _items(paths: Sequence[Path]) -> Iterator[tuple[Path, str]]:
    """Files, and folders of one of `FOLDERS`, each once."""
    seen: set[Path] = set()
    for path in paths:
        if path.is_file() and path.suffix.lower() in IMAGES:
            raise WildlabError("is a single image", "name the folder of the images", file=path)
        for item, folder in _below(path) if path.is_dir() else [(path, "")]:
            key = item.resolve() / folder
            if key not in seen:
                seen.add(key)
                yield item, folder
            if len(seen) > MOST_FILES:
                raise WildlabError(
                    f"there are more than {MOST_FILES} files", "name the folder of one flight", file=path
                )


def _below(folder: Path) -> Iterator[tuple[Path, str]]:
    pictured: list[Path] = []
    for here, folders, files in os.walk(folder):
        folders[:] = sorted(one for one in folders if not one.startswith("."))
        names = sorted(one for one in files if not one.startswith("."))
        images = {one for one in names if Path(one).suffix.lower() in IMAGES}
        boxes = {one for one in names if one.lower().endswith(".txt") and _is_yolo(Path(here) / one)}
        pictured += [Path(here)] if images else []
        if boxes:
            yield Path(here), "clicks-yolo"
        for name in names:
            if name not in images | boxes:
                yield Path(here) / name, ""
    if pictured:  # 100MEDIA and 101MEDIA are one series of images
        yield Path(os.path.commonpath(pictured)), "photos"


def _is_yolo(path: Path) -> bool:
    """Whether the first line is a class and a box in shares of the image, as YOLO writes it."""
    try:
        with path.open("rb") as stored:
            words = stored.readline(HEAD).split()
        return len(words) in (5, 6) and words[0].isdigit() and all(0 <= float(one) <= 1 for one in words[1:])
    except (OSError, ValueError):
        return False


def _read(path: Path, name: str, folder: str, zone: str | None) -> CardItem:
    """A file, or a folder of one of `FOLDERS`, read where a reader knows it."""
    format_: str | None = folder
    if not folder:
        if path.is_symlink() and not path.resolve().is_file():
            return CardItem(name, problem="a link that leads nowhere")
        try:
            with path.open("rb") as stored:
                head = stored.read(HEAD)
        except OSError as error:
            return CardItem(name, problem=f"cannot be opened ({error.strerror})")
        format_ = recognise(head)
    if format_ is None:
        known = path.suffix.lower() in KNOWN_OTHERS
        return CardItem(name, problem=OTHER if known else _unknown(head))
    try:
        if folder:
            return CardItem(name, format_, read_folder(path, format_, zone)[0])
        return CardItem(name, format_, read_log(path, read_regular(path, RAW_LIMIT), format_, zone))
    except WildlabError as error:
        return CardItem(
            name, format_, problem=f"{error.problem}; {error.fix}" if error.fix else error.problem
        )


def _unknown(head: bytes) -> str:
    if len(header_of(head)) > 1:
        recipe = "a recipe says what its columns are (data/recipes/README.md, which `wildlab doctor` finds)"
        return f"{TABLE}: {recipe}; then wildlab import recipe.toml --source FOLDER"
    return "is empty" if not head else "no reader knows this format"


# -- roles

#: Role -> what is taken for that.
ROLES: dict[str, str] = {
    "own": "the vehicle's own log",
    "camera": "a log that rides on the camera",
    "receiver": "a receiver on board",
    "target": "the track of a target",
    "triggers": "records of the camera's triggers",
    "images": "the images",
    "marks": "surveyed points",
    "clicks": "pixels of things in the images",
    "nothing": "not used",
}
#: A receiver on board is within this of the vehicle's own log half of the time, m, level and in height: five
#: times the standard deviation of a single-frequency receiver. A target under the camera is below that.
ON_BOARD_M = 15.0
#: Parts of logs of which a copy is told, and the share of its rows that are in the other log.
COPIED, COPY = {"poses", "gnss", "marks", "clicks"}, 0.99
#: Two logs meet where they share this time, s.
SHARED_S = 1.0


@dataclass(frozen=True)
class Choice:
    """A thing on the card with its role. ``target`` is the target's name; ``why`` a clause."""

    item: CardItem
    role: str
    why: str
    target: str = ""


class LoggedPath(NamedTuple):
    """Where a log says that it was: times (N,) s since 1970, latitude and longitude (N, 2) in radians, and by
    what they count from heights (N,) in m."""

    times: Array
    place: Array
    heights: dict[str, Array]


def choose_roles(found: Sequence[CardItem], stated: Mapping[str, str]) -> list[Choice]:
    """A role for everything that was found.

    Parameters
    ----------
    found
        From `search`.
    stated
        Name of a file or folder -> role, as `ROLES` names them; ``target:NAME`` names the target too. These
        are not argued with.

    Returns
    -------
    list of Choice
        In the order of `found`.

    Raises
    ------
    WildlabError
        Where a role or a name that is stated is not known, or two are stated to be the vehicle's own log.
    """
    given = _stated(found, stated)
    choices = {one.key: _first(one, given.get(one.name)) for one in found}
    for one, whole in _copies([one for one in found if one.name not in given]):
        choices[one.key] = Choice(one, "nothing", f"all that is in it is in {whole.shown} too")
    open_ = [one for one in found if one.name not in given and choices[one.key].role == ""]
    own = next((one.item for one in choices.values() if one.role == "own"), None)
    images = _images(found, choices)
    if own is None and open_:
        own, why = _own(open_, images, any(one.problem.startswith(TABLE) for one in found))
        if own is not None:
            choices[own.key] = Choice(own, "own", why)
    for one in open_:
        if one is not own:
            choices[one.key] = _other(one, own, images)
    return _named([choices[one.key] for one in found])


def _copies(found: Sequence[CardItem]) -> Iterator[tuple[CardItem, CardItem]]:
    """Files whose every row is in another one of the same format, a copy or a part of it; and that other."""
    logs = [one for one in found if one.log.parts.keys() & COPIED]
    logs.sort(key=lambda one: sum(map(len, one.log.parts.values())), reverse=True)
    for number, one in enumerate(logs):
        whole = next((other for other in logs[:number] if _within(one, other)), None)
        if whole is not None:
            yield one, whole


def _within(one: CardItem, other: CardItem) -> bool:
    if one.format != other.format:
        return False
    for name, part in one.log.parts.items():
        whole = other.log.parts.get(name)
        if whole is None or set(whole.columns) != set(part.columns):
            return False
        # Stamps are fitted to a whole log, and differ where a part of it is fitted by itself.
        names = [key for key in part.columns if not key.startswith("time")]
        both = pd.concat([pd.DataFrame({key: log.columns[key] for key in names}) for log in (whole, part)])
        if not both.duplicated().to_numpy()[len(whole) :].mean() >= COPY:
            return False
    return True


def _stated(found: Sequence[CardItem], stated: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    names = {one.name for one in found}
    given: dict[str, tuple[str, str]] = {}
    for name, role in stated.items():
        kind, _, target = role.partition(":")
        if name not in names:
            raise WildlabError(
                f"nothing called {name!r} was found", did_you_mean(name, names), field="--role"
            )
        if kind not in ROLES or (target and kind not in ("target", "images")):
            raise WildlabError(f"{role!r} is no role", did_you_mean(kind, ROLES), field="--role")
        given[name] = (kind, target)
    if sum(kind == "own" for kind, _ in given.values()) > 1:
        raise WildlabError("two are stated to be the vehicle's own log", "name one", field="--role")
    return given


def _first(one: CardItem, stated: tuple[str, str] | None) -> Choice:
    """What needs no comparison; an empty role where it does."""
    if stated is not None:
        return Choice(one, stated[0], "as you said", stated[1])
    if one.problem:
        return Choice(one, "nothing", one.problem)
    for part, role in (("photos", "images"), ("marks", "marks"), ("clicks", "clicks")):
        if part in one.log.parts and not one.part(part):
            return Choice(one, "nothing", _useless(one))
        if part in one.log.parts:
            return Choice(one, role, f"it has {len(one.log.parts[part])} {PARTS_SHOWN[part]}")
    if not one.part("poses") and not one.part("gnss"):
        if one.part("triggers"):
            why = f"it has {len(one.log.parts['triggers'])} records of triggers alone"
            return Choice(one, "triggers", why)
        return Choice(one, "nothing", _useless(one))
    return Choice(one, "", "")


#: What a role needs, in words.
PARTS_SHOWN = {"photos": "images", "marks": "points", "clicks": "pixels"}


def _useless(one: CardItem) -> str:
    """Why a log without a usable place has no role."""
    if not one.log.parts:
        return "it holds nothing for a flight"
    reasons = [why for stream in one.log.parts.values() for why in stream.columns["why"] if why]
    common = max(set(reasons), key=reasons.count) if reasons else "it has no positions"
    return f"no row of it can be used: {common}"


def _images(found: Sequence[CardItem], choices: Mapping[str, Choice]) -> CardItem:
    """The folder with the most images, nothing where there is none."""
    folders = [one for one in found if choices[one.key].role == "images"]
    return max(folders, key=lambda one: len(one.part("photos")), default=CardItem(""))


def _own(open_: Sequence[CardItem], images: CardItem, unread: bool) -> tuple[CardItem | None, str]:
    """The vehicle's own log, with the reason: what turns, covers the images, triggers, flies and climbs, in
    this order, and of those that are alike the longest. Where the images have poses of their own and no log
    turns, the one that was where they say that the camera was, or None; None, too, where none turns or is
    known to fly beside an unread table."""
    turned = [one for one in open_ if any(one.part(part) for part in ("poses", "gimbal"))]
    if not turned and has_place(images):
        for one in open_:
            distance, above = _from_images(one, images)
            if _on_board(distance, above):
                return one, f"it is mostly within {distance:.1f} m of the images"
        return None, ""
    if unread and not turned and not any(map(_flies, open_)):
        return None, ""  # the table may be the vehicle's
    if len(open_) == 1:
        return open_[0], "it is the only log"
    taken = span_of(images, ["photos"])
    signs: dict[str, Callable[[CardItem], bool]] = {
        "has an attitude": lambda one: one in turned,
        "covers the images": lambda one: _overlap(span_of(one), taken) > SHARED_S,
        "has records of a camera's triggers": lambda one: bool(one.part("triggers")),
        "is of a vehicle that flies": _flies,
        "goes up and down by more than 15 m": lambda one: _climb(one) > ON_BOARD_M,
    }
    best = max(
        open_, key=lambda one: (*(holds(one) for holds in signs.values()), np.ptp(span_of(one) or (0.0, 0.0)))
    )
    said = [sign for sign, holds in signs.items() if holds(best)]
    return best, f"of {len(open_)} logs it {listed(said) or 'is the longest'} (--role says otherwise)"


#: Words of what flies, in what logs say of their vehicle.
_FLYING = re.compile(
    r"copter|plane|vtol|quad|hexa|octo|fixed.wing|heli|rotor|airship|balloon|kite|dji|mavic", re.I
)


def _flies(one: CardItem) -> bool:
    return bool(_FLYING.search(f"{one.format} {one.log.vehicle}"))


def _climb(one: CardItem) -> float:
    """From the lowest to the highest place of a log, m, without the outermost hundredths."""
    for part in ("poses", "gnss"):
        stream = one.part(part)
        for name in stream.columns:
            if name.startswith("height_"):
                heights = stream.columns[name][stream.used]
                heights = heights[np.isfinite(heights)]
                if len(heights):
                    return float(np.ptp(np.quantile(heights, [0.01, 0.99])))
    return 0.0


def has_place(images: CardItem) -> bool:
    """Whether some image says where it was taken."""
    photos = images.part("photos")
    return "latitude_deg" in photos.columns and bool(photos.used.any())


def _other(one: CardItem, own: CardItem | None, images: CardItem) -> Choice:
    """A log that is not the vehicle's own."""
    if own is None:
        # By UTC, or else by the wall clock of their camera.
        apart = -_overlap(span_of(one), span_of(images, ["photos"], ("time_s", "time_log_s")))
        if apart > ZONES_S:
            why = f"it is of another time: {_lasting(apart)} lie between it and the images"
            return Choice(one, "nothing", why)
        return Choice(one, "target", "it is another's track")
    mine, theirs = way_of(own), way_of(one)
    if theirs is None or not np.isfinite(theirs.times).any():
        return Choice(one, "nothing", "its positions have no times")
    if mine is None:
        return Choice(one, "nothing", "the vehicle's own log has no times")
    shared = _overlap((mine.times[0], mine.times[-1]), (theirs.times[0], theirs.times[-1]))
    if shared < SHARED_S:
        why = f"it is of another time: {_lasting(-shared)} lie between it and the flight"
        return Choice(one, "nothing", why)
    distance, above = _distance(mine, theirs)
    height = "" if math.isnan(above) else f" and {abs(above):.0f} m {'below' if above > 0 else 'above'}"
    if _on_board(distance, above):
        near = f"it is mostly within {distance:.1f} m of the vehicle's own log"
        return Choice(one, "camera" if one.part("poses") else "receiver", near)
    why = f"it is {distance:.0f} m beside{height} the vehicle (medians), for {_lasting(shared)} of its flight"
    return Choice(one, "target", why)


def _on_board(distance: float, above: float) -> bool:
    return distance < ON_BOARD_M and not abs(above) >= ON_BOARD_M


def _from_images(one: CardItem, images: CardItem) -> tuple[float, float]:
    """The distance of a log from where the images say that the camera was, see `_distance`."""
    theirs, mine = way_of(one), way_of(images, ("photos", "time_s"))
    if theirs is not None and mine is None and (wall := way_of(images, ("photos", "time_log_s"))):
        quarters = quarters_ahead(wall.times, (theirs.times[0], theirs.times[-1]))
        mine = None if quarters is None else wall._replace(times=wall.times - quarters * QUARTER_S)
    return (math.inf, math.nan) if mine is None or theirs is None else _distance(mine, theirs)


#: Time zones are whole quarters of an hour, s.
QUARTER_S = 900.0
#: The clock of a camera is set to within this of its zone's time, s.
SET_WITHIN_S = 300.0
#: Clocks on Earth differ by no more than this, s: wall clocks state no zone.
ZONES_S = 14 * 3600.0


def quarters_ahead(wall: Array, flown: Span) -> int | None:
    """How many quarters of an hour the wall clock is ahead of UTC, where one number alone fits the flight."""
    shares = {}
    for quarters in range(-14 * 4, 14 * 4 + 1):
        at = wall - quarters * QUARTER_S
        inside = (at >= flown[0] - SET_WITHIN_S) & (at <= flown[1] + SET_WITHIN_S)
        shares[quarters] = float(inside.mean())
    best = max(shares.values())
    those = [quarters for quarters, share in shares.items() if share > best - 0.01]
    whole = [quarters for quarters in those if quarters % 4 == 0]
    chosen = those if len(those) == 1 else whole
    return chosen[0] if best > 0.5 and len(chosen) == 1 else None


def way_of(one: CardItem, *stamped: tuple[str, str]) -> LoggedPath | None:
    """Where a log says that it was, rows that can be used; None where it does not say.

    ``stamped`` are the parts to look at in turn, each with its column of times.
    """
    for name, time in stamped or (("gnss", "time_s"), ("poses", "time_s")):
        stream = one.part(name)
        if not {"latitude_deg", time} <= stream.columns.keys():
            continue
        c = stream.columns
        place = np.radians(np.column_stack([c["latitude_deg"], c["longitude_deg"]]))
        good = stream.used & np.isfinite(place).all(axis=1) & np.isfinite(c[time])
        if good.any():
            # Above take-off, a boat and an aircraft have nothing in common.
            heights: dict[str, Array] = {
                key: c[key][good] for key in ("height_ellipsoid_m", "height_sea_m") if key in c
            }
            return LoggedPath(c[time][good], place[good], heights)
    return None


def _distance(mine: LoggedPath, theirs: LoggedPath) -> tuple[float, float]:
    """Median level distance at their times, and median height of mine above them, m; NaN: not comparable."""
    order = np.argsort(mine.times)
    both = (theirs.times >= mine.times[0]) & (theirs.times <= mine.times[-1])
    if not both.any():
        return math.inf, math.nan
    origin = (float(mine.place[0, 0]), float(mine.place[0, 1]), 0.0)
    a, b = (
        geodetic_to_ned(one.place[:, 0], one.place[:, 1], 0.0 * one.times, origin) for one in (mine, theirs)
    )
    at = np.column_stack(
        [np.interp(theirs.times[both], mine.times[order], a[order, axis]) for axis in (0, 1)]
    )
    level = float(np.median(np.hypot(*(b[both, :2] - at).T)))
    for kind in mine.heights.keys() & theirs.heights.keys():
        above = np.interp(theirs.times[both], mine.times[order], mine.heights[kind][order])
        gap = (above - theirs.heights[kind][both])[np.isfinite(above - theirs.heights[kind][both])]
        if len(gap):
            return level, float(np.median(gap))
    return level, math.nan


def span_of(
    one: CardItem, parts: Sequence[str] = ("poses", "gnss"), clocks: Sequence[str] = ("time_s",)
) -> Span | None:
    """First and last stamp of the first part, by the first clock, that has some, s; of images all count."""
    for part, clock in product(parts, clocks):
        stream = one.part(part)
        if clock in stream.columns:
            times = stream.columns[clock] if part == "photos" else stream.columns[clock][stream.used]
            times = times[np.isfinite(times)]
            if len(times):
                return float(times.min()), float(times.max())
    return None


def _overlap(a: Span | None, b: Span | None) -> float:
    """Seconds that two stretches of time share, below zero those between them; 0 where one is not known."""
    if a is None or b is None:
        return 0.0
    return min(a[1], b[1]) - max(a[0], b[0])


def _lasting(seconds: float) -> str:
    """``"12 s"``, ``"3 min"``, ``"5 h"``, ``"12 days"``."""
    for length, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s"


def _named(choices: list[Choice]) -> list[Choice]:
    """Targets with names of their own, from the files'."""
    taken: set[str] = {one.target for one in choices if one.target}
    named = []
    for one in choices:
        if one.role == "target" and not one.target:
            stem = re.sub(r"[^\w-]+", "-", one.item.name.rsplit("/", 1)[-1].rsplit(".", 1)[0])
            name = base = stem.strip("-_")[:60] or "target"
            number = 2
            while name in taken:
                name, number = f"{base}-{number}", number + 1
            taken.add(name)
            one = replace(one, target=name)
        named.append(one)
    return named


# -- images: which camera took them, and how their stamps meet the vehicle's log


class ImageClock(NamedTuple):
    """How the images' stamps become flight time.

    Attributes
    ----------
    kind
        ``"utc"``, or ``"sequence"`` for images without any time.
    offset_s
        What to add to the stamps.
    note
        A sentence on it.
    triggers
        Name of the recipe's table of triggers that they have their times from, where there is one.
    """

    kind: Literal["utc", "sequence"]
    offset_s: float
    note: str
    triggers: str = ""


def one_camera(
    images: CardItem, wanted: str = "", stated: CameraPart | None = None
) -> tuple[CardItem, str | None, str]:
    """The images of one camera: of that whose name has what is wanted, else whose images are as large as
    those of the stated one, else of the thermal one, else of that with the most.

    Parameters
    ----------
    images
        With the part ``photos``.
    wanted
        A part of the camera's name, as the user states it.
    stated
        The camera, where the user states it.

    Returns
    -------
    CardItem, the camera's name (None where all images are of one), and a sentence ("": there is no choice)

    Raises
    ------
    WildlabError
        Where no camera's name has what is wanted.
    """
    if "photos" not in images.log.parts:
        return images, None, ""
    named = Counter(str(one) for one in images.log.parts["photos"].columns.get("camera", ()))
    if len(named) < 2 and not wanted:
        return images, None, ""
    those = [name for name in named if wanted.lower() in name.lower()]
    if not those:
        known = ", ".join(repr(name) for name in named)
        raise WildlabError(f"no camera's name has {wanted!r}", f"there are {known}", field="--role")
    if stated is not None and not wanted:
        columns = images.log.parts["photos"].columns
        fits = (columns["width_px"] == stated.width_px) & (columns["height_px"] == stated.height_px)
        those = sorted({str(one) for one in columns["camera"][fits]}) or those
    thermal = [name for name in those if "thermal" in name.lower()]
    chosen = max(thermal or those, key=lambda name: named[name])
    others = ", ".join(f"{count} of {name or 'no name'}" for name, count in named.items() if name != chosen)
    note = (
        f"Of {images.shown} {named[chosen]} images of {chosen or 'no named camera'} are taken, not {others}"
    )
    note = f"{note} (--role {images.name}=images:NAME chooses)." if others else ""
    return replace(images, log=of_camera(images.log, chosen)), chosen, note


def clock_of_images(
    images: CardItem,
    own: CardItem | None,
    stated_offset_s: float | None,
    triggers: tuple[str, Stream] | None = None,
    others: Sequence[CardItem] = (),
) -> ImageClock:
    """How the images meet the vehicle's log.

    By records of their triggers (the recipe's table of them, by name, and its rows); by UTC where they have
    it; else by the only whole number of quarters of an hour that brings their camera's wall clock into the
    flight, which ``others``, tracks of targets, know where the vehicle has no log. What the user states to be
    added to the stamps counts for more.
    """
    photos = images.part("photos")
    utc, wall = (_known(photos.columns.get(name)) for name in ("time_s", "time_log_s"))
    if photos and triggers is not None and stated_offset_s is None:
        clock = _by_triggers(photos, *triggers)
        if clock is not None:
            return clock
    if not len(utc) + len(wall):
        return ImageClock("sequence", 0.0, "The images have no time.")
    offset = stated_offset_s or 0.0
    if len(utc):
        base = images.log.clock
        note = f"The images' stamps are {printable(base) if base.startswith('local') else 'in UTC'}."
        note += f" {offset:g} s are added to them, as you said." if offset else ""
        return ImageClock("utc", offset, note)
    if stated_offset_s is not None:
        return ImageClock("utc", offset, f"The camera's wall clock gets {offset:g} s, as you said.")
    flown = _flown(own, others)
    quarters = None if flown is None else quarters_ahead(wall, flown)
    if quarters is None:
        note = "The camera's clock is taken for UTC: --zone or --camera-offset."
        return ImageClock("utc", 0.0, note)
    note = (
        f"The camera's clock is taken to be {quarters / 4:+g} h from UTC, which alone brings the images into "
        "the flight; wildlab clock estimates seconds."
    )
    return ImageClock("utc", -quarters * QUARTER_S, note)


def _flown(own: CardItem | None, others: Sequence[CardItem]) -> Span | None:
    """When the flight was: by the vehicle's log, or where it has none by the tracks of targets."""
    spans = [span for one in others if (span := span_of(one)) is not None]
    if own is not None or not spans:
        return None if own is None else span_of(own)
    return min(span[0] for span in spans), max(span[1] for span in spans)


def _by_triggers(photos: Stream, name: str, triggers: Stream) -> ImageClock | None:
    """By the records of triggers; None where they do not fit for certain."""
    times = triggers.columns.get("time_s")
    match = None if times is None else match_images(photos, np.where(triggers.used, times, np.nan))
    if match is None:
        return None
    timed = len(_known(photos.columns.get("time_log_s", photos.columns.get("time_s"))))
    by = "the pattern of intervals" if timed else "their number and order"
    return ImageClock(
        "utc",
        0.0,
        f"{len(photos) - match.images_left} of {len(photos)} images have the time of a trigger, by {by} "
        f"({match.triggers_left} left over).",
        name,
    )


def _known(column: NDArray[Any] | None) -> Array:
    if column is None:
        return np.empty(0)
    values = np.asarray(column, float)
    return np.asarray(values[np.isfinite(values)])
