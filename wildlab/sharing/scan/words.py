"""Names: of flights, people, machines, files and folders, however they are written."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from functools import cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import wildlab
from wildlab.sharing.scan.hits import Hit

#: Shorter names are only found where they stand alone.
LONG = 4
#: At most so many of one word are listed.
MOST = 20
#: Up to so many words that cannot be looked for, for one reason, are told one by one; of more these.
MOST_TOLD, TOLD_OF_MANY = 12, 3
#: Shorter than this, or of digits only, they are everywhere.
SHORTEST = 3
#: Up to so many are looked for one by one.
FEW = 150
#: What has no letters of the Latin alphabet to stand for it when signs above letters are lost.
_PLAIN = {"ø": "o", "æ": "ae", "œ": "oe", "ß": "ss", "ł": "l", "đ": "d", "ð": "d", "þ": "th"}
_SIGNS = re.compile("[\u0300-\u036f]")

_PARTS = re.compile(r"[^\W_]+")


class Needles(NamedTuple):
    """What is looked for, and what is not.

    Attributes
    ----------
    phrases
        Words in lower case, in their parts: ``("nordre", "fjell")``.
    skipped
        Words that cannot be looked for, and why, as sentences: for each reason those that are few by
        themselves, and of many how many they are. What is rarest comes first.
    """

    phrases: tuple[tuple[str, ...], ...]
    skipped: tuple[str, ...]


def parts_of(word: str) -> tuple[str, ...]:
    """The parts of a word, in small letters: ``("nordre", "fjell")`` of ``"Nordre_Fjell"``."""
    return tuple(_PARTS.findall(unicodedata.normalize("NFKC", word).casefold()))


def plain(text: str) -> str:
    """Without the signs above letters: ``"bjornoya"``."""
    if text.isascii():
        return text
    for letter, letters in _PLAIN.items():
        text = text.replace(letter, letters)
    return _SIGNS.sub("", unicodedata.normalize("NFKD", text))


@cache
def own_text() -> str:
    """All words of wildlab's own sources, in order: that they stand in a report says nothing of a flight."""
    root = Path(wildlab.__file__).parent
    files = [*root.rglob("*.py"), *root.parent.glob("notebooks/*.ipynb")]
    texts = (path.read_text(encoding="utf-8", errors="replace").casefold() for path in sorted(files))
    return " ".join(("", *(word for text in texts for word in _PARTS.findall(text)), ""))


@cache
def own_words() -> frozenset[str]:
    """The different ones among them."""
    return frozenset(own_text().split())


def needles_of(words: Iterable[str]) -> Needles:
    """What can be looked for of some words.

    Parameters
    ----------
    words
        Names as they are: paths are taken apart, and so are names with blanks, - and _.
    """
    wanted: dict[tuple[str, ...], None] = {}
    skipped: dict[str, dict[str, None]] = {}
    for word in dict.fromkeys(words):
        for piece in dict.fromkeys(piece for piece in re.split(r"[/\\]", word) if piece.strip()):
            stem = piece.rpartition(".")[0] or piece
            for one in dict.fromkeys((piece, stem)):
                phrase = parts_of(one)
                reason = _useless(phrase)
                if not reason:
                    wanted[phrase] = None
                elif one == piece and phrase:
                    skipped.setdefault(reason, {})[one] = None
            known = own_words()
            telling = [part for part in parts_of(stem) if len(part) >= LONG and not part.isdigit()]
            wanted.update({(part,): None for part in telling if part not in known})
    rare = sorted(skipped.items(), key=lambda one: len(one[1]))
    return Needles(tuple(wanted), tuple(line for reason, ones in rare for line in _told(reason, list(ones))))


def _told(reason: str, words: list[str]) -> list[str]:
    """Which words are not looked for; of very many how many, with the first of them."""
    if len(words) <= MOST_TOLD:
        return [f"{one!r} is not looked for: {reason}" for one in words]
    some = ", ".join(repr(one) for one in words[:TOLD_OF_MANY])
    return [f"{len(words)} names are not looked for, {some} and so on; of each: {reason}"]


def _useless(phrase: tuple[str, ...]) -> str:
    """Why a phrase cannot be looked for; nothing where it can."""
    if not phrase:
        return "it has no letters"
    joined = "".join(phrase)
    if len(joined) < SHORTEST:
        return f"it has fewer than {SHORTEST} letters, and stands everywhere"
    if joined.isdigit() and len(joined) < 6:
        return "it is a short number, and stands everywhere"
    if phrase[0] in own_words() and f" {' '.join(phrase)} " in own_text():
        return "wildlab's own reports use it"
    return ""


class Words:
    """Looks for names in texts."""

    def __init__(self, words: Iterable[str]) -> None:
        self.needles = needles_of(words)
        spelt = {phrase: None for phrase in self.needles.phrases}
        spelt |= {tuple(plain(part) for part in phrase): None for phrase in spelt}
        self.phrases = list(spelt)

    def found_in_bytes(self, data: bytes) -> list[Hit]:
        """Where names with other letters than ASCII's stand among bytes that are no text.

        Parameters
        ----------
        data
            Any bytes.
        """
        hits = []
        for phrase in self.phrases:
            word = " ".join(phrase)
            if word.isascii() or len(word) < LONG:
                continue
            for spelt in {word, word.title(), word.upper(), word.capitalize()}:
                for encoding in ("utf-8", "latin-1", "utf-16-le", "utf-16-be"):
                    needle = spelt.encode(encoding, "ignore")
                    at = data.find(needle) if len(needle) >= LONG else -1
                    if at >= 0:
                        hits.append(Hit(at, at + len(needle), "name", "a name"))
        return hits

    def found_in(self, text: str) -> list[Hit]:
        """Where names stand in a text; the places are near enough where letters are not ASCII.

        Parameters
        ----------
        text
            As it is: letters large or small.
        """
        if not self.phrases:
            return []
        small = unicodedata.normalize("NFKC", text).casefold()
        hits = self._found(small)
        if not small.isascii():
            hits += self._found(plain(small))
        return hits

    def _found(self, small: str) -> list[Hit]:
        few = len(self.phrases) <= FEW
        distinct = set() if few else set(_PARTS.findall(small))
        # Of many words most are ruled out at once by the different words of the text.
        haystack = small if few else "\n".join(distinct)
        hits = []
        for phrase in self.phrases:
            if not all(part in haystack for part in phrase):
                continue
            body = r"[\W_]{0,3}".join(re.escape(part) for part in phrase)
            pattern = rf"(?<![^\W_]){body}(?![^\W_])" if len("".join(phrase)) < LONG else body
            matches = islice(re.finditer(pattern, small), MOST)
            hits += [Hit(match.start(), match.end(), "name", "a name") for match in matches]
        return hits
