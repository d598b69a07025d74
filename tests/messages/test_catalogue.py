"""Texts: every file whole, with the English placeholders; numbers and dates as the language has them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.messages.catalogue import (
    EDITIONS,
    Day,
    Message,
    Quantity,
    duration,
    languages,
    length,
    load_language,
    number,
    placeholders,
    say,
    share,
)

ENGLISH = EDITIONS / "en.toml"
SWEDISH = load_language("sv")
SPACE = "\u00a0"


def leaves(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value


def whole(path: Path) -> dict[str, Any]:
    return dict(leaves(tomllib.loads(path.read_text(encoding="utf-8"))))


def test_all_files_have_the_same_keys_and_placeholders():
    english = whole(ENGLISH)
    assert languages()[0] == "en" and {"nb", "sv"} <= set(languages())
    for code in languages():
        other = whole(EDITIONS / f"{code}.toml")
        assert set(other) == set(english), code
        for key, text in english.items():
            if isinstance(text, str):
                assert sorted(placeholders(other[key])) == sorted(placeholders(text)), f"{code}: {key}"
        assert load_language(code).missing == ()
        assert load_language(code).code == code


@pytest.mark.parametrize(
    ("code", "said", "shown"),
    [
        ("nb", length(6.42), "6,4 meter"),
        ("en", length(0.4), "40 cm"),
        ("sv", length(1234.0), "1,2 km"),
        ("nb", number(12345.0), "12\u00a0345"),
        ("nb", duration(9000.0), "2,5 timer"),
        ("en", share(0.9999), "99%"),
        ("en", Quantity("number", -12.0), "−12"),
        ("en", Day(date(2026, 3, 14), True), "14 March 2026 (UTC)"),
        ("sv", Day(date(2026, 3, 14), False), "mars 2026 (UTC)"),
    ],
)  # fmt: skip
def test_numbers_and_dates(code, said, shown):
    text = say(load_language(code), said)
    assert text.replace(SPACE, " ") == shown.replace(SPACE, " ")
    if isinstance(said, Quantity):
        assert " " not in text, "a number and its unit must not be parted at the end of a line"


@given(st.floats(-1e9, 1e9), st.sampled_from(["length", "number", "area", "duration"]))
def test_no_number_is_shown_with_a_minus_and_nothing(value, kind):
    text = say(SWEDISH, Quantity(kind, abs(value) if kind != "number" else value))
    assert text.strip() and not text.startswith("−0 ") and text != "−0"


def test_one_and_many():
    nb = load_language("nb")
    assert say(nb, Message("page.untranslated", {}, 1)).startswith("Én ")
    assert say(nb, Message("page.untranslated", {}, 4)).startswith("4 ")
    assert say(load_language(), (Message("cause.any"),) * 3).count("something") == 3


def test_a_value_is_no_template():
    """A name that looks like a placeholder stays a name."""
    shown = say(load_language(), Message("page.title", {"name": "{name} {n} **x**"}))
    assert "{name} {n} **x**" in shown


def partners(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "sw.toml"
    path.write_text(f'[language]\ncode = "sw"\nname = "Kiswahili"\n{text}', encoding="utf-8")
    return path


def test_a_partner_adds_a_language(tmp_path):
    path = partners(tmp_path, '[verdict]\nsound = "Hakuna kosa"\n')
    own = load_language(path)
    assert own.code == "sw" and own.name == "Kiswahili"
    assert say(own, Message("verdict.sound")) == "Hakuna kosa"
    assert say(own, Message("verdict.look")) == say(load_language(), Message("verdict.look"))
    assert "verdict.look" in own.missing and "verdict.sound" not in own.missing
    assert load_language(str(path)) == own


@pytest.mark.parametrize(
    ("text", "field", "problem"),
    [
        ('[tile]\nnobody = "x"', "tile.nobody", "no text"),
        ('[alarm]\nleans = "It leans."', "alarm.leans", "placeholders"),
        ('[alarm]\njumps = {one = "It jumps.", many = "{n} {size}"}', "alarm.jumps", "placeholders"),
        ('[page]\nmore = {one = "x", many = "y"}', "page.more", "placeholders"),
        ('[format]\nmonths = ["x"]', "format.months", "12"),
        ('[tile]\nseen = "' + "x" * 401 + '"', "tile.seen", "401"),
    ],
)
def test_a_text_that_cannot_be_used_is_named(tmp_path, text, field, problem):
    path = partners(tmp_path, text)
    with pytest.raises(WildlabError, match=problem) as raised:
        load_language(path)
    assert raised.value.field == field and raised.value.file == str(path)


def test_a_language_that_is_not_there():
    for code in ("xx", "../en/replay"):
        with pytest.raises(WildlabError, match="no language"):
            load_language(code)
