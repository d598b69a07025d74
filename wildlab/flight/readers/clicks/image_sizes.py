"""Sizes of images that lie beside a file of labels: programs that give shares of an image want them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from pathlib import Path, PurePosixPath

from wildlab.flight.files import leaves_folder
from wildlab.flight.readers.frames.image import SUFFIXES
from wildlab.flight.readers.photos.tags import read_tags, size_of

#: Files of a folder that are looked through.
MOST_FILES = 200_000


def sizes_beside(folder: Path, names: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Width and height of images, px, out of their headers.

    Parameters
    ----------
    folder
        Of the labels. Images are looked for in it, in ``images`` in it and beside it, and where a folder
        ``labels`` above it has one ``images`` beside it, as programs that train detectors have them.
    names
        Of images, with or without their ending, perhaps with folders; none of them leads elsewhere.

    Returns
    -------
    dict
        By those names that an image was found for.
    """
    places = [one for one in dict.fromkeys(_places(folder)) if one.is_dir()]
    listed: dict[str, Path] = {}
    for place in reversed(places):
        try:
            for one in islice(place.iterdir(), MOST_FILES):
                if one.suffix.lower() in SUFFIXES:
                    listed |= {one.stem: one, one.name: one}
        except OSError:
            continue
    found = {}
    for name in dict.fromkeys(names):
        plain = PurePosixPath(name.replace("\\", "/"))
        deep = len(plain.parts) > 1 and not leaves_folder(name)
        own = next((place / plain for place in places if deep and _is_image(place / plain)), None)
        path = own or listed.get(plain.name) or listed.get(plain.stem)
        size = (0, 0) if path is None else size_of(read_tags(path))
        if all(size):
            found[name] = (float(size[0]), float(size[1]))
    return found


def _is_image(path: Path) -> bool:
    try:
        return path.suffix.lower() in SUFFIXES and path.is_file()
    except (OSError, ValueError):
        return False


def _places(folder: Path) -> Iterable[Path]:
    yield folder
    yield folder / "images"
    yield folder.parent / "images"
    parts = folder.parts
    for at in range(len(parts) - 1, max(len(parts) - 4, 0), -1):
        if parts[at] == "labels":
            yield Path(*parts[:at], "images", *parts[at + 1 :])
