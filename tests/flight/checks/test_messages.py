"""Texts of findings and mistakes: each is used, and each can be said."""

from collections import defaultdict
from pathlib import Path

import pytest

from wildlab.flight import checks
from wildlab.flight.checks.findings import messages, phrase, rows_of

SOURCES = "".join(path.read_text(encoding="utf-8") for path in Path(checks.__path__[0]).glob("*.py"))
#: Codes that are put together from a word and an end.
ENDS = ("-twice", "-off", "-gap", "-explained", "-unexplained")


class Fact(str):
    """Whatever a text takes it for: a number, a name, a list, a camera."""

    def __format__(self, spec: str) -> str:
        return "1"

    def __abs__(self) -> "Fact":
        return self

    def __gt__(self, other: object) -> bool:
        return True

    __lt__ = __gt__

    def __getitem__(self, key: object) -> "Fact":
        return self

    def __getattr__(self, name: str) -> "Fact":
        return self


FACTS: defaultdict[str, Fact] = defaultdict(lambda: Fact("1"))


@pytest.mark.parametrize("code", [code for code in messages("checks") if code != "use"])
def test_every_text_is_used_and_can_be_said(code):
    assert f'"{code}"' in SOURCES or code.endswith(ENDS)
    for text in messages("checks")[code].values():
        assert "{" not in phrase(text, FACTS) and "|" not in phrase(text, FACTS)


def test_every_mistake_is_used_and_can_be_said():
    for group in messages("mistakes"):
        assert f'"{group}"' in SOURCES
        for row in rows_of(group):
            for part in ("cause", "said", "fix"):
                said = phrase(row[part], FACTS)
                assert said and "{" not in said and "|" not in said


def test_uses_are_said():
    for use, text in messages("checks")["use"].items():
        assert f'"{use}"' in SOURCES and "{" not in phrase(text, FACTS)
