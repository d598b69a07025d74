"""The frame of every page: its colours can be read by day and by night."""

from __future__ import annotations

import re

import pytest

from wildlab.reporting.page import STYLE

WORDS = ("ink", "dim", "link", "good", "warn", "bad")


def colours(rule: str) -> dict[str, str]:
    """The variables of the first ``:root`` after ``rule``, those that are a plain colour."""
    block = re.search(r":root \{(.*?)\}", STYLE[STYLE.index(rule) :], re.S)
    assert block is not None
    return dict(re.findall(r"--([a-z]+): (#[0-9a-f]{6})(?![0-9a-f])", block[1]))


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.2."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    red, green, blue = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    """The contrast ratio of WCAG 2.2."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_contrast_is_that_of_the_standard() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("scheme", [":root", "prefers-color-scheme: dark"])
def test_every_colour_of_words_can_be_read(scheme: str) -> None:
    found = colours(":root") | colours(scheme)
    for behind in ("bg", "soft"):
        for word in WORDS:
            assert contrast(found[word], found[behind]) >= 4.5, (scheme, word, behind)
    for status in ("dim", "good", "warn", "bad"):
        assert contrast(found["on"], found[status]) >= 4.5, (scheme, status)
    # What is drawn, not written.
    for mark in ("blue", "ink"):
        assert contrast(found[mark], found["bg"]) >= 3.0


def test_the_night_has_its_own_ground_and_leaves_paper_white() -> None:
    assert luminance(colours("prefers-color-scheme: dark")["bg"]) < 0.02
    assert "@media screen and (prefers-color-scheme: dark)" in STYLE
    # A colour written outside the variables would stay as it is by night.
    assert not re.findall(r"#[0-9a-fA-F]{3,8}\b", STYLE.split("* { box-sizing")[1])
