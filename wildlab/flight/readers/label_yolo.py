"""Boxes out of a folder of YOLO's text files: one an image, a line ``class cx cy w h [score]`` a thing."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, read_regular, unreadable
from wildlab.flight.readers.label_json import check_relative
from wildlab.flight.readers.marked import MOST_BYTES, Marked, Rows, number, shown

#: Text files of a folder at most, and bytes of one.
MOST_FILES, MOST_OF_FILE = 200_000, 2_000_000
#: Where names of the classes are looked for: beside the text files, and up to two folders above.
NAMES, DATA, ABOVE = "classes.txt", ("data.yaml", "data.yml", "dataset.yaml"), 2


def read_yolo_folder(path: Path) -> Marked:
    """Boxes out of a folder of text files that are called as the images are.

    Parameters
    ----------
    path
        Folder. An empty file is an image in which nothing is; an image without a file is not spoken of.

    Returns
    -------
    Marked
        Boxes in shares of the image, left, top, width, height; classes by the names in ``classes.txt`` or
        ``data.yaml`` where there is one, else their numbers.

    Raises
    ------
    WildlabError
        Where there is no such file, too many of them, or a line is wrong: with file and line.
    """
    files: list[Path] = []
    try:
        there = list(path.iterdir())
    except OSError as error:
        raise unreadable(error, path) from None
    for one in there:
        if one.suffix.lower() == ".txt" and one.name.lower() != NAMES:
            files.append(one)
        if len(files) > MOST_FILES:
            raise WildlabError(f"has more than {MOST_FILES:,} text files", "name a smaller folder", file=path)
    if not files:
        raise WildlabError(
            "has no text file of YOLO's", "name the folder with a .txt for each image", file=path
        )
    names = class_names(path)
    rows = Rows(path)
    left = MOST_BYTES
    for file in sorted(files):
        data = read_regular(file, min(MOST_OF_FILE, left))
        left -= len(data)
        for at, line in enumerate(data.decode("utf-8", errors="replace").splitlines(), start=1):
            if line.strip():
                _line(rows, file, at, line.split(), names)
    known = tuple(names.values()) if names else tuple(dict.fromkeys(rows.kinds))
    return rows.marked("YOLO", tuple(one.stem for one in sorted(files)), known, relative=True)


def _line(rows: Rows, file: Path, at: int, words: list[str], names: dict[int, str]) -> None:
    where = f"line {at}"
    given = " ".join(words)
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) not in (5, 6) or not words[0].isdecimal():
        raise WildlabError(
            f"is {shown(given)}, and class, centre, size and perhaps a score are wanted",
            "give 5 or 6 numbers, the first a whole one",
            file=file,
            field=where,
        )
    which = int(words[0])
    if names and which not in names:
        there = ", ".join(map(str, list(names)[:20]))
        raise WildlabError(
            f"has the class {which}, and names are given for {there}",
            f"add it to {NAMES} or data.yaml, or mend the line",
            file=file,
            field=where,
        )
    own = Rows(file)
    u, v, width, height = (number(one) for one in values[1:5])
    score = values[5] if len(values) == 6 else None
    own.add(where, file.stem, (u, v, width, height), names.get(which, str(which)), score)
    check_relative((u, v, width, height), given, where, file)
    box = (u - width / 2, v - height / 2, width, height)
    rows.add(where, file.stem, box, own.kinds[0], score)


def class_names(folder: Path) -> dict[int, str]:
    """Names of classes from ``classes.txt`` or the ``names`` of ``data.yaml``, whichever lies nearest.

    Parameters
    ----------
    folder
        Of the text files.

    Returns
    -------
    dict
        By the number of the class; empty where no file says it.

    Raises
    ------
    WildlabError
        Where such a file is there and its names cannot be read.
    """
    for place in [folder, *folder.resolve().parents][: 1 + ABOVE]:
        try:
            text = read_regular(place / NAMES, MOST_OF_FILE).decode("utf-8", errors="replace")
        except FileNotFoundError:
            pass
        else:
            return dict(enumerate(one.strip() for one in text.splitlines() if one.strip()))
        for name in DATA:
            try:
                text = read_regular(place / name, MOST_OF_FILE).decode("utf-8", errors="replace")
            except FileNotFoundError:
                continue
            return _yaml_names(text, place / name)
    return {}


def _yaml_names(text: str, path: Path) -> dict[int, str]:
    """The ``names`` of a data.yaml in any of the three ways it is written; no other YAML is understood."""
    found = re.search(
        r"^names\s*:[ \t]*(.*(?:\n(?:[ \t]+\S.*|-\s.*|[ \t]*#.*|[ \t]*|[\]}]\s*))*)", text, re.M
    )
    if found is None:
        return {}
    block = found[1].strip()
    names: dict[int, str] = {}
    if block.startswith("["):
        inside = block.strip("[] \n\t").split(",")
        names = dict(enumerate(_unquoted(one) for one in inside if one.strip()))
    elif block.startswith("{"):
        pairs = [one.partition(":") for one in block.strip("{} \n\t").split(",") if one.strip()]
        names = {int(a): _unquoted(b) for a, _, b in pairs if a.strip().isdecimal()}
    else:
        for line in (one.split(" #")[0].strip() for one in block.splitlines()):
            if line.startswith("- "):
                names[len(names)] = _unquoted(line[2:])
            elif (pair := line.partition(":"))[1] and pair[0].strip().isdecimal():
                names[int(pair[0])] = _unquoted(pair[2])
    if not names:
        raise WildlabError(
            f"the names are {shown(block)}, and a list of names is wanted",
            f"write them into a {NAMES}, one a line",
            file=path,
            field="names",
        )
    return names


def _unquoted(text: str) -> str:
    text = text.strip()
    try:
        value = ast.literal_eval(text) if text[:1] in "'\"" else text
    except (ValueError, SyntaxError):
        value = text
    return printable(str(value))
