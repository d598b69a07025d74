"""Names that strangers gave to things, made harmless where they are shown: the one door into figures, pages
and tables; several in a row; and which of them mean the same image."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import PurePosixPath

#: With what a spreadsheet takes the value of a cell for a formula.
FORMULA = ("=", "+", "-", "@", "\t", "\r")
#: Control characters, and marks that turn the direction of all that follows.
_UNSEEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def visible(text: object) -> str:
    """Text with a replacement character for each control character and mark of direction.

    Examples
    --------
    >>> visible("buoy" + chr(0x202E) + "1") == "buoy" + chr(0xFFFD) + "1"
    True
    """
    return _UNSEEN.sub("\N{REPLACEMENT CHARACTER}", str(text))


def figure_name(text: object) -> str:
    """A name as the label of a line, a tick or a title: matplotlib leaves labels out of a legend that begin
    with an underscore, so an invisible space comes before it.

    Examples
    --------
    >>> figure_name("buoy 1"), figure_name("_buoy").endswith("_buoy"), figure_name("_buoy")[0] == "_"
    ('buoy 1', True, False)
    """
    name = visible(text)
    return f"\N{ZERO WIDTH SPACE}{name}" if name.startswith("_") else name


def csv_cell(text: str) -> str:
    """A text as the value of a cell that no spreadsheet takes for a formula; `from_csv_cell` gives it back.

    Examples
    --------
    >>> csv_cell("=2+2"), csv_cell("A-1"), csv_cell("'=2")
    ("'=2+2", 'A-1', "''=2")
    """
    return f"'{text}" if text.lstrip("'").startswith(FORMULA) else text


def from_csv_cell(text: str) -> str:
    """What `csv_cell` was given.

    Examples
    --------
    >>> from_csv_cell("'=2+2"), from_csv_cell("'tis")
    ('=2+2', "'tis")
    """
    return text[1:] if text.startswith("'") and text.lstrip("'").startswith(FORMULA) else text


def listed(parts: Sequence[str], last: str = "and") -> str:
    """Several words in a row.

    Examples
    --------
    >>> listed(["roll", "pitch", "yaw"]), listed(["a", "b"], "or"), listed(["a"])
    ('roll, pitch and yaw', 'a or b', 'a')
    """
    return "".join(parts) if len(parts) < 2 else f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def plain_path(name: str) -> PurePosixPath:
    """A path as any system writes it."""
    return PurePosixPath(name.replace("\\", "/"))


def match_names(there: Iterable[str]) -> Callable[[str], str | None]:
    """What finds a name among those of images: as written, else the only one that is the same without folders
    and capitals, or without the ending too; other programs write names in all of these ways.

    Examples
    --------
    >>> match_names(["IMG_1.JPG", "IMG_2.JPG"])("set/images/img_2.png")
    'IMG_2.JPG'
    """
    names = dict.fromkeys(there)
    alike: dict[str, list[str]] = {}
    for name in names:
        place = plain_path(name.casefold())
        for key in {place.name, place.stem}:
            alike.setdefault(key, []).append(name)

    def match(name: str) -> str | None:
        place = plain_path(name.casefold())
        found = ([name] if name in names else alike.get(place.name) or alike.get(place.stem)) or []
        return found[0] if len(found) == 1 else None

    return match
